(() => {
  const bytes = text => Uint8Array.from(atob(text), c => c.charCodeAt(0)).buffer;
  const known = values => Array.from(values, v => Number.isFinite(v) ? v : null);
  const ink = () => getComputedStyle(document.body).color;
  const sync = uPlot.sync("elevon");
  function draw(host) {
    const spec = JSON.parse(host.querySelector("script").textContent);
    const plot = host.querySelector(".plot");
    const grid = { stroke: "rgba(128,128,128,.25)", width: 1 };
    const axis = (label, size) => ({ label, stroke: ink, grid, ticks: grid, labelSize: 22, size });
    const width = () => Math.max(200, plot.clientWidth);
    const number = (u, v) => v == null ? "--" : Number(v.toPrecision(7)).toString();
    const shade = u => spec.shaded.forEach(([start, end, text, alarming], k) => {
      const [from, to] = [start, end].map(t => u.valToPos(t, "x", true));
      const { left, top, width, height } = u.bbox;
      const [a, b] = [Math.max(from, left), Math.min(to, left + width)];
      if (b <= a) return;
      u.ctx.save();
      u.ctx.fillStyle = alarming ? "rgba(209,72,60,.12)" : `rgba(128,136,148,${k % 2 ? .05 : .14})`;
      u.ctx.fillRect(a, top, b - a, height);
      u.ctx.beginPath(); u.ctx.rect(a, top, b - a, height); u.ctx.clip();
      u.ctx.fillStyle = alarming ? "#c0392b" : ink();
      u.ctx.font = `${11 * devicePixelRatio}px system-ui, sans-serif`;
      u.ctx.fillText(text, a + 4, top + (13 + 13 * (k % 3)) * devicePixelRatio);
      u.ctx.restore();
    });
    const options = {
      width: width(), height: spec.height, cursor: { sync: { key: sync.key } },
      scales: { x: { time: false, distr: spec.log ? 3 : 1 }, y: { distr: spec.log ? 3 : 1 } },
      hooks: { drawClear: [shade] }, axes: [axis(spec.x, 34), axis(spec.y, 60)],
      series: [{ label: spec.x, value: number }, ...spec.series.map(s => ({
        label: s.name, stroke: s.colour, dash: s.dash, width: 1.4, value: number,
        points: { show: false } }))],
    };
    const data = [Array.from(new Float64Array(bytes(spec.time))),
      ...spec.series.map(s => known(new Float32Array(bytes(s.values))))];
    const drawn = new uPlot(options, data, plot);
    new ResizeObserver(() => drawn.setSize({ width: width(), height: spec.height })).observe(plot);
    host.dataset.ready = "1";
  }
  document.addEventListener("DOMContentLoaded",
    () => document.querySelectorAll(".elevon-chart").forEach(draw));
})();
