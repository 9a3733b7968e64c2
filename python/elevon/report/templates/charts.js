(() => {
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
  const doubles = text => Array.from(new Float64Array(bytes(text)));
  const known = values => Array.from(values, v => Number.isFinite(v) ? v : null);
  const dark = matchMedia("(prefers-color-scheme: dark)");
  const ink = () => getComputedStyle(document.body).color;
  const number = (u, v) => v == null ? "--" : Number(v.toPrecision(5)).toString();
  const rule = { stroke: "rgba(128,128,128,.22)", width: 1 };
  const font = "12px system-ui, sans-serif";
  const pen = document.createElement("canvas").getContext("2d");
  const wide = text => { pen.font = font; return pen.measureText(text).width; };
  const all = [];

  // One place in pixels of the canvas; a side that is null is that edge of the plot.
  const px = (u, v) => v == null ? null : u.valToPos(v, "x", true);
  const py = (u, v) => v == null ? null : u.valToPos(v, "y", true);

  function mark(ctx, kind, x, y, r, hollow) {
    const cross = { x: [[-1, -1, 1, 1], [-1, 1, 1, -1]], "+": [[-1, 0, 1, 0], [0, -1, 0, 1]], "|": [[0, -1, 0, 1]], "_": [[-1, 0, 1, 0]] }[kind];
    ctx.beginPath();
    if (cross) for (const [a, b, c, d] of cross) { ctx.moveTo(x + a * r, y + b * r); ctx.lineTo(x + c * r, y + d * r); }
    else if (kind === "s") ctx.rect(x - r, y - r, 2 * r, 2 * r);
    else if (kind === "D") { ctx.moveTo(x, y - r); ctx.lineTo(x + r, y); ctx.lineTo(x, y + r); ctx.lineTo(x - r, y); ctx.closePath(); }
    else ctx.arc(x, y, kind === "." ? r / 2 : r, 0, 7);
    if (cross || hollow) ctx.stroke(); else ctx.fill();
  }

  function traced(u, s, xs, ys) {
    const { ctx } = u, dot = devicePixelRatio;
    if (s.width) {
      ctx.lineWidth = s.width * dot;
      ctx.setLineDash((s.dash || []).map(d => d * dot));
      ctx.beginPath();
      xs.forEach((x, k) => ctx[k ? "lineTo" : "moveTo"](px(u, x), py(u, ys[k])));
      if (s.kind === "area") ctx.fill(); else ctx.stroke();
      ctx.setLineDash([]);
    } else if (s.kind === "area") {
      ctx.beginPath();
      xs.forEach((x, k) => ctx[k ? "lineTo" : "moveTo"](px(u, x), py(u, ys[k])));
      ctx.fill();
    }
    ctx.lineWidth = 1.5 * dot;
    if (s.marker) xs.forEach((x, k) => ys[k] == null || mark(ctx, s.marker, px(u, x), py(u, ys[k]), s.size / 2 * dot, s.hollow));
  }

  function shape(u, s) {
    const { ctx } = u, { left, top, width, height } = u.bbox, dot = devicePixelRatio;
    if (s.kind === "key") return;
    const colour = s.colour || ink();
    ctx.globalAlpha = s.alpha ?? 1;
    ctx.strokeStyle = ctx.fillStyle = colour;
    if (s.kind === "box") {
      const [a, b] = s.x ? s.x.map(v => px(u, v)) : [left, left + width];
      const [c, d] = s.y ? s.y.map(v => py(u, v)) : [top, top + height];
      ctx.fillRect(Math.min(a, b), Math.min(c, d), Math.abs(b - a), Math.abs(d - c));
      if (s.text) {
        ctx.fillStyle = s.ink || ink();
        ctx.font = `${11 * dot}px system-ui, sans-serif`;
        ctx.fillText(s.text, Math.max(a, left) + 4, top + (13 + 13 * (s.row % 3)) * dot);
      }
    } else if (s.kind === "text") {
      ctx.font = `${12 * dot}px system-ui, sans-serif`;
      ctx.textAlign = s.align;
      ctx.fillText(s.text, px(u, s.x), py(u, s.y));
      ctx.textAlign = "left";
    } else if (s.kind === "upright" || s.kind === "level") {
      const at = s.kind === "upright" ? px(u, s.at) : py(u, s.at);
      ctx.lineWidth = s.width * dot;
      ctx.setLineDash((s.dash || []).map(d => d * dot));
      ctx.beginPath();
      if (s.kind === "upright") { ctx.moveTo(at, top); ctx.lineTo(at, top + height); } else { ctx.moveTo(left, at); ctx.lineTo(left + width, at); }
      ctx.stroke();
      ctx.setLineDash([]);
    } else traced(u, s, s.xs, s.ys);
    ctx.globalAlpha = 1;
  }

  // Areas lie below the grid and the lines; marks, bars of errors and words above them.
  const layer = (panel, low) => u => {
    const { ctx } = u, { left, top, width, height } = u.bbox;
    ctx.save();
    ctx.beginPath(); ctx.rect(left, top, width, height); ctx.clip();
    panel.shapes.filter(s => low === ["area", "box"].includes(s.kind)).forEach(s => shape(u, s));
    if (!low) panel.series.forEach((s, k) => {
      if (!s.marker || !u.series[k + 1].show) return;
      ctx.strokeStyle = ctx.fillStyle = s.colour || ink();
      traced(u, { ...s, width: 0 }, s.xs, s.ys);
    });
    ctx.restore();
  };

  // Limits as drawn until a stretch is chosen; then those of what is in sight.
  function scales(panel, first) {
    const [lx, ly] = panel.limits || [null, null];
    const [logx, logy] = panel.log;
    const sorted = pair => pair && [...pair].sort((a, b) => a - b);
    const [sx, sy] = [sorted(lx), sorted(ly)];
    const whole = (u, lo, hi) => lo === first[0] && hi === first[1];
    const x = { time: false, distr: logx ? 3 : 1, dir: lx && lx[0] > lx[1] ? -1 : 1 };
    const y = { distr: logy ? 3 : 1, dir: ly && ly[0] > ly[1] ? -1 : 1 };
    if (sx) x.range = (u, lo, hi) => lo == null || whole(u, lo, hi) ? sx : [lo, hi];
    if (sy) y.range = (u, lo, hi) => {
      const { min, max } = u.scales.x;
      if (panel.ticks[1] || lo == null || min == null || (min === sx[0] && max === sx[1])) return sy;
      return logy ? uPlot.rangeLog(lo, hi, 10, false) : uPlot.rangeNum(lo, hi, .08, true);
    };
    return { x, y };
  }

  // A line for each decade, with two between where there are few.
  function decades(u, axis, low, high) {
    const [a, b] = [Math.floor(Math.log10(low)), Math.ceil(Math.log10(high))];
    if (!Number.isFinite(a + b)) return [];
    const stride = Math.ceil((b - a) / 8), steps = b - a > 2 ? [1] : [1, 2, 5], out = [];
    for (let e = a; e <= b; e += stride) for (const s of steps) out.push(s * 10 ** e);
    return out.filter(v => v >= low * (1 - 1e-9) && v <= high * (1 + 1e-9));
  }

  function axes(panel, room) {
    const [tx, ty] = panel.ticks, [lx, ly] = panel.label;
    const common = k => ({ stroke: ink, font, labelFont: font, labelSize: 20, label: panel.label[k], grid: rule, ticks: { ...rule, size: 5 }, ...(panel.log[k] ? { splits: decades, filter: (u, splits) => splits, values: (u, splits) => splits.map(v => Number(v.toPrecision(3)).toString()) } : {}) });
    const x = { ...common(0), size: 32 }, y = { ...common(1), size: (u, labels) => 14 + Math.max(22, ...(labels || []).map(wide)) };
    if (!lx) x.labelSize = 0;
    if (!ly) y.labelSize = 0;
    if (tx) {
      const longest = Math.max(...tx.map(t => wide(t[1]))), turned = longest > room / (tx.length + 1);
      Object.assign(x, { splits: tx.map(t => t[0]), values: tx.map(t => t[1]), grid: { show: false } });
      if (turned) Object.assign(x, { rotate: -40, size: 20 + Math.min(90, .7 * longest) });
    }
    if (ty) {
      const most = .42 * room, cut = text => { while (wide(text) > most) text = `${text.slice(0, -2)}…`; return text; };
      const words = ty.map(t => cut(t[1]));
      Object.assign(y, { splits: ty.map(t => t[0]), values: words, space: 1, grid: { show: false }, size: 14 + Math.max(...words.map(wide)) });
    }
    return [x, y];
  }

  const paths = s => s.width === 0 ? () => null : s.step ? uPlot.paths.stepped({ align: s.step }) : undefined;
  const faded = s => s.colour && s.alpha < 1 ? s.colour + Math.round(255 * s.alpha).toString(16).padStart(2, "0") : s.colour || ink;

  function joined(panel) {
    const tables = panel.series.map(s => [s.xs, s.ys]);
    if (tables.length) return tables.every(t => t[0] === tables[0][0])
      ? [tables[0][0], ...tables.map(t => t[1])] : uPlot.join(tables);
    return [[...panel.limits[0]].sort((a, b) => a - b)];
  }

  function draw(place, panel) {
    let last = [];
    for (const s of panel.series) { s.xs = last = s.time ? doubles(s.time) : last; s.ys = known(new Float32Array(bytes(s.values))); }
    for (const s of panel.shapes) if (s.x && typeof s.x === "string") { s.xs = doubles(s.x); s.ys = doubles(s.y); }
    const data = joined(panel);
    const width = () => Math.max(200, place.clientWidth);
    const named = panel.shapes.filter(s => s.name);
    named.forEach(() => data.push(data[0].map(() => null)));
    const first = [data[0][0], data[0][data[0].length - 1]];
    const back = document.createElement("button");
    let home = null;
    const options = {
      width: width(), height: panel.height, scales: scales(panel, first), axes: axes(panel, width()),
      cursor: { sync: { key: panel.label[0] || "elevon", scales: ["x", null] }, focus: { prox: 30 } }, focus: { alpha: .35 },
      legend: { show: panel.legend !== false },
      hooks: { drawClear: [layer(panel, true)], draw: [layer(panel, false)], setScale: [u => { back.hidden = home == null || (u.scales.x.min === home[0] && u.scales.x.max === home[1]); }], ready: [u => { home = [u.scales.x.min, u.scales.x.max]; }] },
      series: [{ label: panel.label[0] || "x", value: number },
        ...panel.series.map(s => ({ label: s.name, stroke: faded(s), dash: s.dash || undefined, width: s.width, paths: paths(s), value: number, points: { show: false }, class: s.own === false ? "quiet" : undefined })),
        ...named.map(s => ({ label: s.name, stroke: s.colour || ink, width: 2, dash: s.dash || undefined, value: () => "", points: { show: false } }))],
    };
    const drawn = new uPlot(options, data, place);
    Object.assign(back, { type: "button", hidden: true, textContent: "whole", title: "show the whole again (double click)" });
    back.onclick = () => drawn.setData(data, true);
    place.append(back);
    new ResizeObserver(() => drawn.setSize({ width: width(), height: panel.height })).observe(place);
    all.push(drawn);
  }

  function fill(host) {
    const spec = JSON.parse(host.querySelector("script").textContent);
    const grid = host.querySelector(".panels");
    grid.style.setProperty("--columns", spec.columns);
    host.classList.add("live");
    for (const panel of spec.panels) {
      const place = document.createElement("div");
      place.className = "panel";
      place.title = "drag: zoom; double click: the whole";
      if (panel.title) { const name = document.createElement("h4"); name.textContent = panel.title; place.append(name); }
      grid.append(place);
      draw(place, panel);
    }
    host.dataset.ready = "1";
  }
  document.addEventListener("DOMContentLoaded", () => {
    // Hundreds of charts would hold a page up: one is made where it is about to be seen.
    const sight = new IntersectionObserver(entries => entries.filter(e => e.isIntersecting).forEach(e => {
      sight.unobserve(e.target);
      fill(e.target);
    }), { rootMargin: "800px 0px" });
    document.querySelectorAll(".elevon-chart").forEach(host => sight.observe(host));
    dark.addEventListener("change", () => all.forEach(u => u.redraw(false, true)));
  });
})();
