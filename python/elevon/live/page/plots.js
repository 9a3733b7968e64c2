// Scrolling plots with uPlot, the spectrum of a signal, the phasor of the phase currents.

import { Sight, by, digits, drawn, element, put } from "./dom.js";

const COLOURS = ["#2f7fd1", "#e0782f", "#2f9e6e", "#d1483c", "#8a6fd0", "#8a929d", "#b8860b", "#0f8b8d"];
const dark = matchMedia("(prefers-color-scheme: dark)");
let colour = null; // asked of the style once a theme: each question would lay the page out
const ink = () => colour ??= getComputedStyle(document.body).color;
dark.addEventListener("change", () => { colour = null; });
const GRID = { stroke: "rgba(128,128,128,.25)", width: 1 };
const axis = (label, size, space) => ({ label, labelSize: 18, size, stroke: ink, grid: GRID, ticks: GRID, space, font: "11px system-ui", labelFont: "11px system-ui" });

export class Plots {
  constructor(model, store, changed) {
    this.model = model;
    this.store = store;
    this.changed = changed;
    this.unit = Object.fromEntries(model.signals.map(signal => [signal.name, signal]));
    this.charts = [];
    this.frozen = null;
    this.seconds = 10;
    this.turn = 0;
    this.quota = 1;
    this.sync = uPlot.sync("live");
    model.plots.forEach(plot => this.add(plot.title, plot.signals));
    dark.addEventListener("change", () => this.redraw());
  }

  get names() {
    return [...new Set(this.charts.flatMap(chart => chart.names))];
  }

  add(title, names) {
    const close = element("button", { "aria-label": `remove the plot ${title}` }, "×");
    const place = element("div", { class: "chart" });
    const values = names.map(() => element("b", {}));
    const keys = names.map((name, k) => element("li", {}, drawn("svg", { viewBox: "0 0 10 10", "aria-hidden": "true" }, drawn("rect", { width: 10, height: 10, fill: COLOURS[k % COLOURS.length] })), name, values[k]));
    const host = element("section", { class: "chart", "aria-label": `plot: ${title}` },
      element("h3", {}, title, close), place, element("ul", { class: "keys" }, ...keys));
    by("charts").append(host);
    const chart = { title, names, host, place, values, zoomed: false, sight: new Sight(host) };
    close.onclick = () => this.remove(chart);
    chart.plot = this.made(chart);
    chart.watch = new ResizeObserver(() => chart.plot.setSize({ width: this.width(chart), height: 170 }));
    chart.watch.observe(place);
    this.charts.push(chart);
    this.changed();
  }

  remove(chart) {
    chart.watch.disconnect();
    chart.sight.watch.disconnect();
    chart.plot.destroy();
    chart.host.remove();
    this.charts = this.charts.filter(other => other !== chart);
    this.changed();
  }

  width(chart) { return Math.max(200, chart.place.clientWidth); }

  made(chart) {
    const unit = this.unit[chart.names[0]];
    const series = chart.names.map((name, k) => ({ label: name, stroke: COLOURS[k % COLOURS.length], width: 1.4, points: { show: false } }));
    const options = { width: this.width(chart), height: 170, series: [{ label: "t" }, ...series], legend: { show: false },
      cursor: { sync: { key: this.sync.key, scales: ["x", null] }, points: { show: false } },
      scales: { x: { time: false } }, axes: [axis("", 26, 60), axis(unit?.shown ?? "", 54, 26)],
      hooks: { setSelect: [() => { chart.zoomed = true; }], setCursor: [() => this.read(chart)] } };
    const plot = new uPlot(options, [[], ...chart.names.map(() => [])], chart.place);
    plot.over.addEventListener("dblclick", () => { chart.zoomed = false; });
    return plot;
  }

  // Values under the cursor, else the newest.
  read(chart) {
    const at = chart.plot?.cursor.idx;
    chart.names.forEach((name, k) => {
      const unit = this.unit[name], latest = this.store.latest[name];
      const value = at != null ? chart.plot.data[k + 1][at] : latest == null ? null : latest * unit.scale + unit.offset;
      put(chart.values[k], "text", `${digits(value, 4)} ${unit.shown}`);
    });
  }

  readAll() { this.charts.forEach(chart => { if (chart.sight.seen) this.read(chart); }); }

  redraw() { this.charts.forEach(chart => chart.plot.redraw()); }

  hold(time) { this.frozen = time; }

  // The charts in turn, as many a picture as leave it in time: `lag` [ms] is how long it has waited.
  draw(now, lag) {
    const charts = this.charts.filter(chart => !chart.zoomed && chart.sight.seen);
    this.quota = Math.max(1, Math.min(charts.length, this.quota + (lag < 22 ? 0.1 : -0.5)));
    for (let k = 0; k < Math.min(Math.floor(this.quota), charts.length); k++)
      this.drawOne(charts[this.turn++ % charts.length], this.frozen ?? now);
  }

  drawOne(chart, end) {
    const units = chart.names.map(name => this.unit[name]);
    const data = this.store.window(chart.names, units, this.seconds, end, Math.max(100, chart.plot.width >> 1));
    chart.plot.batch(() => {
      chart.plot.setData(data, false);
      chart.plot.setScale("x", { min: end - this.seconds, max: end });
    });
  }
}

export class Spectrum {
  constructor(model, store) {
    this.store = store;
    this.unit = Object.fromEntries(model.signals.map(signal => [signal.name, signal]));
    const usual = ["current_q_meas", "current_mean", "motor_speed"].find(name => this.unit[name]);
    by("spectrum-of").append(...model.signals.map(s => element("option", { selected: s.name === usual }, s.name)));
    const options = { width: 300, height: 120, legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false }, y: { distr: 3 } }, axes: [axis("", 24, 40), { ...axis("", 50, 20), values: (_, ticks) => ticks.map(v => v == null ? "" : String(v)) }],
      series: [{}, { stroke: COLOURS[0], width: 1.2, points: { show: false } }] };
    this.plot = new uPlot(options, [[], []], by("spectrum"));
    this.sight = new Sight(by("spectrum"));
    new ResizeObserver(() => this.plot.setSize({ width: Math.max(150, by("spectrum").clientWidth), height: 120 })).observe(by("spectrum"));
  }

  get name() { return by("spectrum-of").value; }

  draw() {
    if (!this.sight.seen) return;
    const size = 1024, store = this.store, column = store.columns.get(this.name);
    if (!column || store.count < size) return;
    const first = store.count - size, last = store.count - 1;
    const rate = (size - 1) / (store.time[last] - store.time[first]);
    const part = Array.from(column.subarray(first, first + size));
    if (!Number.isFinite(rate) || !part.every(Number.isFinite)) return;
    const mean = part.reduce((a, b) => a + b, 0) / size;
    const real = part.map((v, i) => (v - mean) * (0.5 - 0.5 * Math.cos(2 * Math.PI * i / size)) * this.unit[this.name].scale);
    const lines = magnitudes(real);
    this.plot.setData([lines.map((_, k) => k * rate / size), lines.map(v => Math.max(v, 1e-9))]);
  }
}

// Amplitudes of a real signal under a Hann window, by a transform of radix two.
function magnitudes(real) {
  const n = real.length, re = Float64Array.from(real), im = new Float64Array(n);
  for (let i = 1, j = 0; i < n; i++) {
    let bit = n >> 1;
    for (; j & bit; bit >>= 1) j ^= bit;
    j ^= bit;
    if (i < j) [re[i], re[j]] = [re[j], re[i]];
  }
  for (let size = 2; size <= n; size *= 2) {
    for (let k = 0; k < size / 2; k++) {
      const c = Math.cos(-2 * Math.PI * k / size), s = Math.sin(-2 * Math.PI * k / size);
      for (let i = k; i < n; i += size) {
        const j = i + size / 2, a = re[j] * c - im[j] * s, b = re[j] * s + im[j] * c;
        re[j] = re[i] - a; im[j] = im[i] - b; re[i] += a; im[i] += b;
      }
    }
  }
  return Array.from({ length: n / 2 }, (_, k) => 4 / n * Math.hypot(re[k], im[k]));
}

export class Phasor {
  constructor() {
    const host = by("phasor");
    const way = angle => [50 * Math.cos(angle), -50 * Math.sin(angle)];
    this.phases = ["a", "b", "c"].map((phase, k) => {
      const [x, y] = way(2 * Math.PI * k / 3);
      host.append(drawn("line", { x2: x, y2: y, class: "axis" }));
      return drawn("line", { class: `phasor phase-${phase}` });
    });
    this.trail = drawn("polyline", { class: "trail" });
    this.sum = drawn("line", { class: "sum" });
    this.label = drawn("text", { x: -58, y: 57, class: "label" });
    host.append(this.trail, ...this.phases, this.sum, this.label);
    this.points = [];
    this.top = 1e-3;
    this.sight = new Sight(host);
  }

  draw(values, readable) {
    const currents = ["a", "b", "c"].map(phase => values[`current_${phase}`]);
    if (!this.sight.seen || !currents.every(Number.isFinite)) return;
    const [a, b, c] = currents, x = (2 * a - b - c) / 3, y = (b - c) / Math.sqrt(3);
    this.top = Math.max(this.top * 0.995, Math.hypot(x, y) * 1.15, 1e-3);
    const scale = 50 / this.top;
    this.phases.forEach((line, k) => {
      const angle = 2 * Math.PI * k / 3, size = currents[k] * scale * 2 / 3;
      put(line, "x2", (size * Math.cos(angle)).toFixed(1));
      put(line, "y2", (-size * Math.sin(angle)).toFixed(1));
    });
    put(this.sum, "x2", (x * scale).toFixed(1));
    put(this.sum, "y2", (-y * scale).toFixed(1));
    this.points = [...this.points.slice(-40), [x, y]];
    put(this.trail, "points", this.points.map(([p, q]) => `${(p * scale).toFixed(1)},${(-q * scale).toFixed(1)}`).join(" "));
    if (readable) put(this.label, "text", `${digits(Math.hypot(x, y), 3)} A`);
  }
}
