// Loads, faults and parameters as sliders in their unit.

import { element, put, toShown, toSi } from "./dom.js";

// A slider's way is the cube of its share: fine near zero, where severities that matter are.
class Slider {
  constructor(item, apply) {
    Object.assign(this, { item, apply });
    this.low = item.low ?? 0;
    this.high = item.high ?? Math.max(1, 4 * Math.abs(item.value ?? 1));
    const shown = toShown(item.value ?? 0, item);
    this.range = element("input", { type: "range", min: this.low < 0 ? -1 : 0, max: 1, step: 0.001, value: this.share(item.value ?? 0), "aria-label": `${item.label}, slider` });
    this.number = element("input", { type: "number", step: "any", value: Number(shown.toPrecision(5)), "aria-label": `${item.label} in ${item.shown || "1"}` });
    this.range.oninput = () => this.slid();
    this.number.onchange = () => this.typed();
    this.node = element("div", { class: "slider", "data-name": item.name, "data-set": "0" },
      element("span", { class: "name", title: item.title }, item.label), this.range, this.number, element("span", { class: "unit" }, item.shown));
    this.waiting = false;
  }

  span(sign) { return sign < 0 ? -this.low : this.high; }

  share(value) {
    if (this.item.linear) return (value - this.low) / (this.high - this.low);
    const span = this.span(Math.sign(value));
    return span > 0 ? Math.sign(value) * Math.cbrt(Math.min(1, Math.abs(value) / span)) : 0;
  }

  slid() {
    const share = Number(this.range.value);
    const value = this.item.linear ? this.low + share * (this.high - this.low) : Math.sign(share) * Math.abs(share) ** 3 * this.span(Math.sign(share));
    this.number.value = Number(toShown(value, this.item).toPrecision(4));
    this.later(value);
  }

  typed() {
    const value = toSi(Number(this.number.value), this.item);
    this.range.value = this.share(value);
    this.later(value);
  }

  // One message at a time; the last position is never lost.
  async later(value) {
    this.next = value;
    if (this.waiting) return;
    this.waiting = true;
    while (this.next !== undefined) {
      const sent = this.next;
      this.next = undefined;
      const answer = await this.apply(this.item, sent);
      this.node.dataset.set = !answer?.error && sent !== (this.item.value ?? 0) ? "1" : "0";
    }
    this.waiting = false;
  }

  show(value) {
    this.range.value = this.share(value);
    this.number.value = Number(toShown(value, this.item).toPrecision(4));
    this.node.dataset.set = value !== (this.item.value ?? 0) ? "1" : "0";
  }
}

const LOADS = { output: "load on the output", brake: "brake on the motor shaft", shaft: "torque on the motor shaft", supply: "supply", ambient: "air", weight_on_wheels: "weight on wheels" };
const START = { supply: "supply_voltage", ambient: "ambient_temperature" };

export class Loads {
  constructor(model, act, values) {
    this.node = element("div", {});
    for (const [name, input] of Object.entries(model.inputs)) {
      if (name === "command") continue;
      const value = values[START[name]] ?? (name === "ambient" ? 293.15 : 0);
      const linear = name === "supply" || name === "ambient" || name === "weight_on_wheels";
      const item = { ...input, name, label: LOADS[name] ?? name, value, linear };
      this.node.append(new Slider(item, (_, sent) => act({ set: { [name]: sent } })).node);
    }
  }
}

export class Parameters {
  constructor(model, act) {
    this.node = element("div", {}, element("p", { class: "label" }, "Values of the record that may change while it runs; any other by its path."));
    for (const parameter of model.parameters) {
      const size = Math.abs(parameter.value) || 1;
      const item = { ...parameter, name: parameter.path, label: `${parameter.path}: ${parameter.text}`, low: parameter.low != null && parameter.low >= 0 ? 0 : -4 * size, high: Math.min(parameter.high ?? Infinity, 4 * size) };
      this.node.append(new Slider(item, (_, sent) => act({ set: { [parameter.path]: sent } })).node);
    }
    const path = element("input", { placeholder: "path", "aria-label": "path of a parameter or input" }), value = element("input", { placeholder: "value with unit", "aria-label": "its value" });
    this.node.append(element("div", { class: "row" }, path, value, element("button", { onclick: () => act({ set: { [path.value.trim()]: value.value.trim() } }) }, "Set")));
  }
}

export class Faults {
  constructor(model, act) {
    this.search = element("input", { type: "search", placeholder: `search ${model.faults.length} faults`, "aria-label": "search the faults", id: "fault-search" });
    this.list = element("div", { id: "fault-list" });
    this.sliders = new Map(model.faults.map(fault => {
      const item = { ...fault, value: 0, label: fault.name, title: fault.effect };
      return [fault.name, new Slider(item, (_, sent) => act({ fault: { [fault.name]: sent } }))];
    }));
    const order = ["backlash", "friction", "friction_growth", "short", "open_phase", "eccentricity_static", "demagnetisation", "jam", "efficiency_loss"];
    const rank = name => { const k = order.indexOf(name.split("@")[0]); return k < 0 ? 99 : k; };
    const names = [...this.sliders.keys()].sort((a, b) => rank(a) - rank(b));
    this.list.append(...names.map(name => this.sliders.get(name).node));
    this.search.oninput = () => {
      const words = this.search.value.toLowerCase().split(/\s+/).filter(Boolean);
      for (const fault of model.faults) {
        const text = `${fault.name} ${fault.effect}`.toLowerCase();
        this.sliders.get(fault.name).node.hidden = !words.every(word => text.includes(word));
      }
    };
    this.clear = element("button", { onclick: () => this.cleared(act) }, "Clear all");
    this.guess = element("select", { "aria-label": "your guess" }, element("option", { value: "" }, "no fault"), ...[...new Set(model.faults.map(fault => fault.kind))].sort().map(kind => element("option", {}, kind)));
    this.verdict = element("p", { role: "status" });
    this.hidden = element("input", { type: "checkbox", id: "hide-truth", onchange: () => this.hide() });
    this.truth = element("div", {}, element("div", { class: "row" }, this.search, this.clear), this.list);
    this.game = element("div", { hidden: true }, element("div", { class: "row" }, element("label", {}, "your guess ", this.guess), element("button", { onclick: () => this.compare() }, "Compare")), this.verdict);
    this.node = element("div", {}, element("label", { class: "row" }, this.hidden, " hide the truth: another viewer injects, you guess against the machine"), this.game, this.truth);
  }

  hide() {
    this.truth.hidden = this.hidden.checked;
    this.game.hidden = !this.hidden.checked;
    this.verdict.textContent = "";
  }

  compare() {
    const state = this.state ?? {}, machine = state.health?.faults?.[0]?.kind ?? state.health?.status ?? "–";
    const truth = state.injected == null ? "the server keeps it" : Object.keys(state.injected).join(", ") || "no fault";
    this.verdict.textContent = `You: ${this.guess.value || "no fault"}. The machine: ${machine}. The truth: ${truth}.`;
  }

  cleared(act) {
    const names = [...this.sliders].filter(([, slider]) => slider.node.dataset.set === "1").map(([name]) => name);
    if (names.length) act({ fault: Object.fromEntries(names.map(name => [name, 0])) });
    names.forEach(name => this.sliders.get(name).show(0));
  }

  show(state) {
    this.state = state;
    const set = state.injected;
    if (!set) return;
    const told = JSON.stringify(set);
    if (told === this.told) return;
    this.told = told;
    for (const [name, slider] of this.sliders)
      if (!slider.waiting && !slider.node.contains(document.activeElement)) slider.node.dataset.set = name in set ? "1" : "0";
  }
}

export class Records {
  constructor(model, source, act) {
    this.source = source;
    this.act = act;
    const start = kind => () => act({ record: kind });
    this.status = element("p", { role: "status" }, "no recording");
    this.files = element("ul", { id: "files" });
    this.node = element("div", {},
      element("fieldset", {}, element("legend", {}, "record"), element("div", { class: "row" },
        element("button", { class: "main", id: "record", onclick: start("drive") }, "As a drive logs"),
        element("button", { onclick: start("full") }, "All signals"),
        element("button", { id: "record-stop", onclick: () => act({ record: false }) }, "Stop and write")), this.status, this.files),
      element("fieldset", {}, element("legend", {}, "what was done"), element("div", { class: "row" },
        element("button", { id: "save", onclick: () => this.save() }, "Save as scenario"),
        element("button", { id: "link", onclick: () => this.link() }, "Copy a link")),
        this.again = element("div", { class: "row" }), this.repeating = element("p", { role: "status" })));
    this.linked();
  }

  async save() {
    const answer = await this.act({ save: true });
    if (!answer.scenario) return;
    const address = URL.createObjectURL(new Blob([answer.scenario], { type: "application/toml" }));
    const anchor = element("a", { href: address, download: "live-scenario.toml" });
    anchor.click();
    setTimeout(() => URL.revokeObjectURL(address), 10_000);
  }

  async link() {
    const answer = await this.act({ save: true });
    if (!answer.steps) return;
    const text = encodeURIComponent(JSON.stringify(answer.steps));
    history.replaceState(null, "", `#do=${text}`);
    await navigator.clipboard?.writeText(location.href).catch(() => null);
    this.linked();
  }

  linked() {
    if (!location.hash.startsWith("#do=")) return;
    let steps;
    try { steps = JSON.parse(decodeURIComponent(location.hash.slice(4))); } catch { return; }
    if (!Array.isArray(steps)) return;
    this.again.replaceChildren(element("button", { id: "linked", onclick: () => this.act({ repeat: steps }) }, `Do the link's ${steps.length} steps`));
  }

  show(state) {
    const running = state.recording;
    const { left, error } = state.repeating ?? {};
    put(this.repeating, "text", error ? `the link stopped: ${error}` : left ? `${left} steps of the link to go` : "");
    put(this.status, "text", running ? `recording (${running.kind}): ${running.seconds.toFixed(1)} s` : "no recording");
    const names = state.files ?? [];
    if (names.length === this.files.childElementCount) return;
    this.files.replaceChildren(...names.map(name => element("li", {}, element("a", { href: this.source.fileAddress(name), download: name }, name))));
  }
}

