// Scrolling plots with uPlot, the spectrum of a signal, the phasor of the phase currents.

import { by, digits, drawn, element } from "./dom.js";

const COLOURS = ["#2f7fd1", "#e0782f", "#2f9e6e", "#d1483c", "#8a6fd0", "#8a929d", "#b8860b", "#0f8b8d"];
const ink = () => getComputedStyle(document.body).color;
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
    this.sync = uPlot.sync("live");
    model.plots.forEach(plot => this.add(plot.title, plot.signals));
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.redraw());
  }

  get names() {
    return [...new Set(this.charts.flatMap(chart => chart.names))];
  }

  add(title, names) {
    const close = element("button", { "aria-label": `remove the plot ${title}` }, "×");
    const place = element("div", { class: "chart" });
    const host = element("section", { class: "chart", "aria-label": `plot: ${title}` },
      element("h3", {}, title, close), place);
    by("charts").append(host);
    const chart = { title, names, host, place, zoomed: false };
    close.onclick = () => this.remove(chart);
    chart.plot = this.made(chart);
    chart.watch = new ResizeObserver(() => chart.plot.setSize({ width: this.width(chart), height: 170 }));
    chart.watch.observe(place);
    this.charts.push(chart);
    this.changed();
  }

  remove(chart) {
    chart.watch.disconnect();
    chart.plot.destroy();
    chart.host.remove();
    this.charts = this.charts.filter(other => other !== chart);
    this.changed();
  }

  width(chart) { return Math.max(200, chart.place.clientWidth); }

  made(chart) {
    const units = chart.names.map(name => this.unit[name]);
    const series = chart.names.map((name, k) => ({ label: name, stroke: COLOURS[k % COLOURS.length], width: 1.4,
      points: { show: false }, value: (_, v) => v == null ? "–" : `${digits(v, 4)} ${units[k].shown}` }));
    const options = { width: this.width(chart), height: 170, series: [{ label: "t", value: (_, v) => v == null ? "–" : `${v.toFixed(3)} s` }, ...series],
      cursor: { sync: { key: this.sync.key, scales: ["x", null] } },
      scales: { x: { time: false } }, axes: [axis("", 26, 60), axis(units[0]?.shown ?? "", 54, 26)],
      hooks: { setSelect: [() => { chart.zoomed = true; }] } };
    const plot = new uPlot(options, [[], ...chart.names.map(() => [])], chart.place);
    plot.over.addEventListener("dblclick", () => { chart.zoomed = false; });
    return plot;
  }

  redraw() { this.charts.forEach(chart => chart.plot.redraw()); }

  hold(time) { this.frozen = time; }

  draw(now) {
    const end = this.frozen ?? now;
    for (const chart of this.charts) {
      if (chart.zoomed || !visible(chart.host)) continue;
      const units = chart.names.map(name => this.unit[name]);
      const data = this.store.window(chart.names, units, this.seconds, end, 400);
      chart.plot.setData(data, false);
      chart.plot.setScale("x", { min: end - this.seconds, max: end });
    }
  }
}

function visible(node) {
  const box = node.getBoundingClientRect();
  return box.bottom > 0 && box.top < innerHeight;
}

export class Spectrum {
  constructor(model, store) {
    this.store = store;
    this.unit = Object.fromEntries(model.signals.map(signal => [signal.name, signal]));
    const usual = ["current_q_meas", "current_line", "motor_speed"].find(name => this.unit[name]);
    by("spectrum-of").append(...model.signals.map(s => element("option", { selected: s.name === usual }, s.name)));
    const options = { width: 300, height: 120, legend: { show: false }, cursor: { show: false },
      scales: { x: { time: false }, y: { distr: 3 } }, axes: [axis("Hz", 24, 40), axis("", 44, 20)],
      series: [{}, { stroke: COLOURS[0], width: 1.2, points: { show: false } }] };
    this.plot = new uPlot(options, [[], []], by("spectrum"));
    new ResizeObserver(() => this.plot.setSize({ width: Math.max(150, by("spectrum").clientWidth), height: 120 })).observe(by("spectrum"));
  }

  get name() { return by("spectrum-of").value; }

  draw() {
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
  }

  draw(values) {
    const currents = ["a", "b", "c"].map(phase => values[`current_${phase}`]);
    if (!currents.every(Number.isFinite)) return;
    const [a, b, c] = currents, x = (2 * a - b - c) / 3, y = (b - c) / Math.sqrt(3);
    this.top = Math.max(this.top * 0.995, Math.hypot(x, y) * 1.15, 1e-3);
    const scale = 50 / this.top;
    this.phases.forEach((line, k) => {
      const angle = 2 * Math.PI * k / 3, size = currents[k] * scale * 2 / 3;
      line.setAttribute("x2", (size * Math.cos(angle)).toFixed(1));
      line.setAttribute("y2", (-size * Math.sin(angle)).toFixed(1));
    });
    this.sum.setAttribute("x2", (x * scale).toFixed(1));
    this.sum.setAttribute("y2", (-y * scale).toFixed(1));
    this.points = [...this.points.slice(-40), [x, y]];
    this.trail.setAttribute("points", this.points.map(([p, q]) => `${(p * scale).toFixed(1)},${(-q * scale).toFixed(1)}`).join(" "));
    this.label.textContent = `${digits(Math.hypot(x, y), 3)} A`;
  }
}
