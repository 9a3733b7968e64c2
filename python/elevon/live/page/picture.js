// The mechanism, drawn from the signals: motor, gear with its backlash, screw and nut, lever, lock.

import { Sight, digits, drawn, put } from "./dom.js";

// Numbers change five times a second: faster ones nobody reads, and each is laid out anew.
let readable = true;
const say = (node, words) => { if (readable) put(node, "text", words); };
const turn = (angle, x, y) => `rotate(${(angle * 180 / Math.PI).toFixed(2)} ${x} ${y})`;
const text = (x, y, words, kind = "label", anchor = "start") => drawn("text", { x, y, class: kind, "text-anchor": anchor }, words);

function wheel(x, y, radius, teeth) {
  const points = [];
  for (let i = 0; i < teeth * 4; i++) {
    const angle = 2 * Math.PI * i / (teeth * 4), r = radius * (i % 4 < 2 ? 1 : 0.86);
    points.push(`${(x + r * Math.cos(angle)).toFixed(1)},${(y + r * Math.sin(angle)).toFixed(1)}`);
  }
  const spokes = [0, 60, 120].map(a => drawn("line", { x1: x - radius * 0.7, x2: x + radius * 0.7, y1: y, y2: y, class: "thin", transform: `rotate(${a} ${x} ${y})` }));
  return drawn("g", {}, drawn("polygon", { points: points.join(" "), class: "metal" }), ...spokes, drawn("circle", { cx: x, cy: y, r: radius * 0.16, class: "frame" }));
}

class Motor {
  constructor(x, y, radius) {
    Object.assign(this, { x, y });
    this.rotor = drawn("g", {}, drawn("circle", { cx: x, cy: y, r: radius * 0.62, class: "metal" }),
      ...[0, 90, 180, 270].map((a, k) => drawn("rect", { x: x + radius * 0.42, y: y - 5, width: radius * 0.2, height: 10, class: k % 2 ? "force-head" : "mark", transform: `rotate(${a} ${x} ${y})` })));
    this.flux = drawn("line", { x1: x, y1: y, x2: x, y2: y, class: "flux" });
    const slots = Array.from({ length: 12 }, (_, k) => drawn("line", { x1: x + radius * 0.76, x2: x + radius * 0.94, y1: y, y2: y, class: "frame", transform: `rotate(${30 * k} ${x} ${y})` }));
    this.speed = text(x, y + radius + 17, "", "value", "middle");
    this.radius = radius;
    this.top = 1e-3;
    this.node = drawn("g", {}, drawn("circle", { cx: x, cy: y, r: radius, class: "frame" }), ...slots, this.rotor, this.flux, text(x, y - radius - 7, "motor", "label", "middle"), this.speed);
  }

  draw(v) {
    put(this.rotor, "transform", turn(v.motor_position ?? 0, this.x, this.y));
    const [a, b, c] = [v.current_a, v.current_b, v.current_c];
    if ([a, b, c].every(Number.isFinite)) {
      const p = (2 * a - b - c) / 3, q = (b - c) / Math.sqrt(3);
      this.top = Math.max(this.top * 0.995, Math.hypot(p, q));
      const scale = this.radius * 0.72 / this.top;
      put(this.flux, "x2", (this.x + p * scale).toFixed(1));
      put(this.flux, "y2", (this.y - q * scale).toFixed(1));
    }
    say(this.speed, `${digits((v.motor_speed ?? 0) * 30 / Math.PI, 3)} rpm`);
  }
}

// The gap between drive and output as the signals show it: the widest difference of late is its width.
class Gap {
  constructor(x, y, label, unit, scale) {
    Object.assign(this, { x, y, unit, scale, low: Infinity, high: -Infinity });
    this.left = drawn("path", { class: "flank" });
    this.right = drawn("path", { class: "flank" });
    this.tooth = drawn("path", { class: "drive" });
    this.words = text(x, y + 55, "", "value", "middle");
    this.node = drawn("g", {}, text(x, y - 45, label, "label", "middle"), this.left, this.right, this.tooth, this.words);
  }

  draw(difference) {
    if (!Number.isFinite(difference)) return;
    const middle = Number.isFinite(this.low) ? (this.low + this.high) / 2 : difference, half = Number.isFinite(this.low) ? (this.high - this.low) / 2 : 0;
    this.low = Math.min(difference, middle - half * 0.9995);
    this.high = Math.max(difference, middle + half * 0.9995);
    const width = (this.high - this.low) * this.scale, at = ((difference - this.low) / Math.max(this.high - this.low, 1e-12) - 0.5);
    const open = 8 + 42 * (1 - Math.exp(-width / this.unit.typical));
    const { x, y } = this, shape = (cx, way) => `M${cx.toFixed(1)} ${y - 36} h${way * 26} v72 h${-way * 26} l${way * 6} -36 z`;
    put(this.left, "d", shape(x - 18 - open / 2, -1));
    put(this.right, "d", shape(x + 18 + open / 2, 1));
    const t = Number((x + at * open).toFixed(1));
    put(this.tooth, "d", `M${t - 14} ${y + 30} L${t - 20} ${y - 8} L${t - 8} ${y - 30} h16 L${t + 20} ${y - 8} L${t + 14} ${y + 30} z`);
    say(this.words, `${digits(width, 2)} ${this.unit.shown}`);
  }
}

class Arrow {
  constructor(x, y, label) {
    Object.assign(this, { x, y });
    this.line = drawn("line", { x1: x, x2: x, y1: y, y2: y, class: "force" });
    this.head = drawn("path", { class: "force-head" });
    this.words = text(x, y + 18, "", "value", "middle");
    this.label = label;
    this.node = drawn("g", {}, this.line, this.head, this.words);
  }

  draw(value, top, unit) {
    const present = Number.isFinite(value) && Math.abs(value) > 1e-9;
    put(this.node, "hidden", present ? null : "");
    if (!present) return;
    const length = -55 * Math.max(-1, Math.min(1, value / top)), way = Math.sign(length);
    const end = this.x + length;
    put(this.line, "x2", end.toFixed(1));
    put(this.head, "d", `M${end + way * 8} ${this.y} l${-way * 10} -6 v12 z`);
    say(this.words, `${this.label} ${digits(value, 3)} ${unit}`);
  }
}

function rotary(model) {
  const ratio = model.geometry["gear.ratio"] ?? 1;
  const motor = new Motor(75, 110, 52), gear = wheel(182, 110, 30, 10), big = wheel(270, 110, 56, 22);
  const gap = new Gap(475, 105, "backlash at the output", { typical: 0.6, shown: "°" }, 180 / Math.PI);
  const arm = drawn("line", { x1: 270, y1: 110, x2: 360, y2: 110, class: "arm" });
  const ghost = drawn("line", { x1: 270, y1: 110, x2: 388, y2: 110, class: "ghost" });
  const load = new Arrow(270, 200, "load");
  const angle = text(270, 40, "", "value", "middle");
  const nodes = [drawn("line", { x1: 127, x2: 182, y1: 110, y2: 110, class: "frame" }), motor.node, gear, big, ghost, arm, gap.node, load.node, angle, text(182, 66, `1 : ${digits(ratio, 3)}`, "label", "middle")];
  const draw = v => {
    motor.draw(v);
    put(gear, "transform", turn(v.motor_position ?? 0, 182, 110));
    put(big, "transform", turn(-(v.output_position ?? 0) * 4, 270, 110));
    put(arm, "transform", turn(-(v.output_position ?? 0), 270, 110));
    put(ghost, "transform", turn(-(v.command ?? 0), 270, 110));
    put(ghost, "hidden", model.mode !== "position" ? "" : null);
    gap.draw((v.resolver_position ?? v.motor_position) / ratio - (v.encoder_position ?? v.output_position));
    load.draw(v.output_torque, 60, "N m");
    say(angle, `output ${digits((v.output_position ?? 0) * 180 / Math.PI, 3)}°`);
    return `Motor at ${motor.speed.textContent}, ${angle.textContent}, gap ${gap.words.textContent}`;
  };
  return { box: "0 0 560 225", nodes, draw };
}

function screwPattern(x, y, length) {
  const rod = drawn("rect", { x, y: y - 7, width: length, height: 14, class: "metal" });
  const lines = Array.from({ length: Math.ceil(length / 12) + 2 }, (_, k) => drawn("line", { x1: x + 12 * k, x2: x + 12 * k + 8, y1: y - 7, y2: y + 7, class: "thin" }));
  const clip = drawn("svg", { x, y: y - 8, width: length, height: 16, viewBox: `${x} ${y - 8} ${length} 16` }, drawn("g", {}, ...lines));
  return { node: drawn("g", {}, rod, clip), draw: phase => put(clip.firstChild, "transform", `translate(${((((phase % 1) + 1) % 1) * 12 - 12).toFixed(2)} 0)`) };
}

function ballscrew(model) {
  const lead = model.geometry["screw.lead"] / (model.geometry["gear.ratio"] ?? 1), top = model.geometry["stop.upper"] ?? 0.1;
  const motor = new Motor(65, 105, 45), screw = screwPattern(112, 105, 230), scale = 85 / top;
  const nut = drawn("g", {}, drawn("rect", { x: -18, y: -26, width: 36, height: 52, rx: 4, class: "metal" }), ...[-9, 0, 9].flatMap(x => [drawn("circle", { cx: x, cy: -13, r: 4, class: "mark" }), drawn("circle", { cx: x, cy: 13, r: 4, class: "mark" })]));
  const ram = drawn("g", {}, drawn("path", { d: "M0 -18 h150 v36 h-150 z", class: "metal" }), drawn("circle", { cx: 158, cy: 0, r: 10, class: "frame" }));
  const mark = drawn("path", { d: "M0 -44 l-5 -9 h10 z", class: "force-head" });
  const gap = new Gap(420, 180, "backlash, nut to ram", { typical: 0.15, shown: "mm" }, 1000);
  const load = new Arrow(210, 180, "load"), words = text(235, 30, "", "value", "middle");
  const nodes = [motor.node, screw.node, ram, nut, mark, gap.node, load.node, words, text(235, 47, "▼ command", "label", "middle")];
  const draw = v => {
    motor.draw(v);
    const at = 225 + (v.motor_position ?? 0) * lead * scale, out = 225 + (v.output_position ?? 0) * scale;
    screw.draw((v.motor_position ?? 0) / (2 * Math.PI));
    put(nut, "transform", `translate(${at.toFixed(2)} 105)`);
    put(ram, "transform", `translate(${(out + 24).toFixed(2)} 105)`);
    put(mark, "transform", `translate(${(225 + (v.command ?? 0) * scale).toFixed(2)} 125)`);
    put(mark, "hidden", model.mode !== "position" ? "" : null);
    gap.draw((v.motor_position ?? 0) * lead - (v.output_position ?? 0));
    load.draw(v.load_force, 5000, "N");
    say(words, `ram ${digits((v.output_position ?? 0) * 1000, 3)} mm`);
    return `Motor at ${motor.speed.textContent}, ${words.textContent}, gap ${gap.words.textContent}`;
  };
  return { box: "0 0 500 245", nodes, draw };
}

const lamp = (x, y, label) => {
  const dot = drawn("circle", { cx: x, cy: y, r: 6, class: "off" });
  return { node: drawn("g", {}, dot, text(x, y + 18, label, "label", "middle")), set: on => put(dot, "class", on > 0.5 ? "on" : "off") };
};

function landingGear(model) {
  const g = model.geometry, stroke = g["lever.stroke"] ?? 0.264;
  const motor = new Motor(58, 92, 38), first = wheel(122, 92, 20, 10), second = wheel(160, 92, 24, 12), screw = screwPattern(184, 92, 130);
  const nut = drawn("rect", { x: -9, y: 76, width: 18, height: 32, rx: 3, class: "metal" });
  const ram = drawn("rect", { x: 0, y: 84, width: 110, height: 16, class: "metal" });
  const hinge = [392, 60], strut = drawn("line", { x1: 0, y1: 92, x2: 0, y2: 0, class: "frame" });
  const leg = drawn("g", {}, drawn("line", { x1: hinge[0], y1: hinge[1], x2: hinge[0], y2: 170, class: "arm" }), drawn("line", { x1: hinge[0], y1: hinge[1], x2: hinge[0] - 36, y2: hinge[1] + 16, class: "arm" }), drawn("circle", { cx: hinge[0], cy: 186, r: 20, class: "metal" }), drawn("circle", { cx: hinge[0], cy: 186, r: 7, class: "frame" }));
  const lock = drawn("path", { d: "M-7 0 v-12 a7 7 0 0 1 14 0 v12 z", class: "frame" }), body = drawn("rect", { x: 238, y: 132, width: 24, height: 18, rx: 3, class: "off" });
  const lockWords = text(250, 168, "", "value", "middle"), words = text(205, 30, "", "value", "middle"), load = new Arrow(330, 150, "load");
  const lamps = [["proximity_0", "0 %"], ["proximity_25", "25 %"], ["proximity_75", "75 %"], ["proximity_100", "100 %"], ["proximity_wheels", "wheels"], ["brake_released", "brake free"]].map(([name, label], k) => ({ name, ...lamp(22 + 54 * k, 190, label) }));
  const ground = drawn("line", { x1: 330, x2: 495, y1: 208, y2: 208, class: "axis" });
  const nodes = [motor.node, first, second, screw.node, ram, nut, strut, leg, lock, body, lockWords, words, load.node, ground, ...lamps.map(item => item.node), drawn("circle", { cx: hinge[0], cy: hinge[1], r: 5, class: "frame" })];
  let least = Infinity, most = -Infinity;
  const draw = v => {
    motor.draw(v);
    const share = Math.max(-0.05, Math.min(1.05, (v.output_position ?? 0) / stroke)), nutAt = 190 + 95 * (v.nut_position ?? v.output_position ?? 0) / stroke, ramAt = 196 + 95 * share;
    put(first, "transform", turn(-(v.motor_position ?? 0) / (g["gear.ratio_first"] ?? 4), 122, 92));
    put(second, "transform", turn((v.motor_position ?? 0) / 18, 160, 92));
    screw.draw((v.motor_position ?? 0) / (2 * Math.PI) / 18);
    put(nut, "transform", `translate(${nutAt.toFixed(2)} 0)`);
    put(ram, "x", ramAt.toFixed(2));
    if (Number.isFinite(v.lever_angle)) { least = Math.min(least, v.lever_angle); most = Math.max(most, v.lever_angle); }
    const angle = 85 * (1 - share) * Math.PI / 180;
    put(leg, "transform", turn(-angle, ...hinge));
    const tip = [hinge[0] - 36 * Math.cos(angle) + 16 * Math.sin(angle) * 1, hinge[1] + 16 * Math.cos(angle) + 36 * Math.sin(angle)];
    put(strut, "x1", (ramAt + 110).toFixed(1)); put(strut, "x2", tip[0].toFixed(1)); put(strut, "y2", tip[1].toFixed(1));
    const locked = (v.locked ?? 0) > 0.5;
    put(lock, "transform", `translate(${locked ? 250 : 257} ${locked ? 134 : 128})`);
    put(body, "class", locked ? "on" : "off");
    say(lockWords, locked ? "locked" : "unlocked");
    lamps.forEach(item => item.set(v[item.name] ?? 0));
    load.draw(v.load_force, 8000, "N");
    say(words, `ram ${digits((v.output_position ?? 0) * 1000, 3)} mm`);
    return `Motor at ${motor.speed.textContent}, ${words.textContent}, gear ${lockWords.textContent}`;
  };
  return { box: "0 0 500 225", nodes, draw };
}

const KINDS = { rotary, ballscrew, landing_gear: landingGear };
const NEEDED = {
  rotary: ["motor_position", "motor_speed", "output_position", "resolver_position", "encoder_position", "command", "output_torque", "current_a", "current_b", "current_c"],
  ballscrew: ["motor_position", "motor_speed", "output_position", "command", "load_force", "current_a", "current_b", "current_c"],
  landing_gear: ["motor_position", "motor_speed", "output_position", "nut_position", "lever_angle", "locked", "proximity_0", "proximity_25", "proximity_75", "proximity_100", "proximity_wheels", "brake_released", "load_force", "current_a", "current_b", "current_c"],
};

export class Picture {
  constructor(model, host) {
    this.names = (NEEDED[model.wiring] ?? []).filter(name => model.signals.some(signal => signal.name === name));
    const { box, nodes, draw } = (KINDS[model.wiring] ?? rotary)(model);
    this.drawParts = draw;
    this.svg = drawn("svg", { viewBox: box, role: "img", "aria-label": "mechanism" }, ...nodes);
    host.replaceChildren(this.svg);
    this.named = 0;
    this.sight = new Sight(host);
  }

  draw(values, now, legible) {
    if (!this.sight.seen) return;
    readable = legible;
    const words = this.drawParts(values);
    if (now - this.named > 2000) { put(this.svg, "aria-label", words); this.named = now; }
  }
}
