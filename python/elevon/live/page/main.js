// The page: a source of snapshots, what is drawn of them, what is sent back.

import { CommandPage } from "./command.js";
import { by, digits, element, put, toShown } from "./dom.js";
import { Picture } from "./picture.js";
import { Phasor, Plots, Spectrum } from "./plots.js";
import { Faults, Loads, Parameters, Records } from "./sliders.js";
import { LiveSource, RecordedSource } from "./source.js";
import { Store } from "./store.js";

const FACTORS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100], WINDOWS = [2, 5, 10, 30, 60];

class Page {
  constructor(source, model) {
    Object.assign(this, { source, model, store: new Store(), state: null, time: 0, frames: 0, pictures: 0, latency: null });
    this.unit = Object.fromEntries(model.signals.map(signal => [signal.name, signal]));
    this.send = message => this.act(message);
  }

  build(state) {
    by("title").textContent = this.model.title;
    document.title = `${this.model.actuator} · Elevon live bench`;
    by("fidelity").textContent = this.model.fidelity === "replay" ? "replay" : `${this.model.fidelity} fidelity`;
    by("factor").append(...FACTORS.map(value => element("option", { value, selected: value === state.factor_asked }, `×${value}`)));
    by("window").append(...WINDOWS.map(value => element("option", { value, selected: value === 10 }, `${value} s`)));
    by("signal-names").append(...this.model.signals.map(signal => element("option", { value: signal.name }, signal.text)));
    this.picture = this.model.fidelity === "replay" && !this.unit.motor_position ? null : new Picture(this.model, by("picture"));
    this.phasor = new Phasor();
    this.spectrum = new Spectrum(this.model, this.store);
    this.plots = new Plots(this.model, this.store, () => this.choose());
    this.tabs(state);
    this.wire();
    this.choose();
  }

  choose() {
    if (!this.plots) return;
    const names = new Set([...this.plots.names, ...(this.picture?.names ?? []), "current_a", "current_b", "current_c", this.spectrum.name]);
    this.source.watch([...names].filter(name => this.unit[name]));
  }

  tabs(state) {
    const command = this.command = new CommandPage(this.model, this.send);
    this.faults = new Faults(this.model, this.send);
    this.records = new Records(this.model, this.source, this.send);
    const parts = this.model.fidelity === "replay" ? [] : [["Command", command], ["Loads", new Loads(this.model, this.send, state.values)], ["Faults", this.faults], ["Parameters", new Parameters(this.model, this.send)], ["Record", this.records]];
    by("controls").hidden = parts.length === 0;
    this.tab = parts.map(([name, part], k) => {
      const panel = element("div", { role: "tabpanel", id: `panel-${k}`, "aria-labelledby": `tab-${k}`, hidden: k > 0 }, part.node);
      const tab = element("button", { role: "tab", id: `tab-${k}`, "aria-controls": `panel-${k}`, "aria-selected": k === 0, onclick: () => this.select(k) }, name);
      by("tabs").append(tab);
      by("panels").append(panel);
      return { tab, panel };
    });
    by("tabs").addEventListener("keydown", event => {
      const way = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
      if (way) this.select((this.selected + way + this.tab.length) % this.tab.length, true);
    });
    this.selected = 0;
  }

  select(number, focus = false) {
    if (!this.tab[number]) return;
    this.selected = number;
    this.tab.forEach(({ tab, panel }, k) => {
      tab.setAttribute("aria-selected", k === number);
      tab.tabIndex = k === number ? 0 : -1;
      panel.hidden = k !== number;
    });
    if (focus) this.tab[number].tab.focus();
  }

  wire() {
    by("factor").onchange = event => this.act({ factor: Number(event.target.value) });
    by("pause").onclick = () => this.act({ pause: !this.state?.paused });
    by("restart").onclick = () => this.act({ restart: true });
    by("window").onchange = event => { this.plots.seconds = Number(event.target.value); };
    by("freeze").onclick = () => this.freeze();
    by("spectrum-of").onchange = () => this.choose();
    by("help").onclick = () => by("about").showModal();
    by("add-signal").onchange = event => {
      if (!this.unit[event.target.value]) return;
      this.plots.add(event.target.value, [event.target.value]);
      event.target.value = "";
    };
    document.addEventListener("keydown", event => this.key(event));
  }

  freeze() {
    const frozen = this.plots.frozen == null;
    this.plots.hold(frozen ? this.time : null);
    by("freeze").setAttribute("aria-pressed", frozen);
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.closest?.("input, textarea, select, dialog")) return;
    const number = Number(event.key) - 1;
    if (this.tab[number]) this.select(number, true);
    else if (event.key === " " && !event.target.closest("button")) { event.preventDefault(); this.freeze(); }
    else if (event.key === "p") by("pause").click();
    else if (event.key === "r") this.command.toggle(this.state?.panel?.moving);
    else if (event.key === "?") by("about").showModal();
    else if (event.key === "/") { event.preventDefault(); this.select(2); by("fault-search").focus(); }
  }

  async act(message) {
    const begun = performance.now();
    const answer = await this.source.act(message).catch(() => ({ error: "the bench does not answer" }));
    if (answer.time != null) this.acted = { begun, time: answer.time };
    const files = answer.files?.map(path => path.split("/").at(-1)).join(", ");
    put(by("message"), "text", answer.error ?? (files ? `written: ${files}` : ""));
    put(by("message"), "data-good", answer.error ? "0" : "1");
    return answer;
  }

  frame(frame, names) {
    if (this.store.count && frame.rows && frame.times[0] < this.store.time[this.store.count - 1]) this.store.clear();
    this.store.add(frame, names);
    this.frames += 1;
    this.time = frame.time;
    this.factor = frame.factor;
    if (this.waiting) return;
    this.waiting = true;
    this.arrived = performance.now();
    requestAnimationFrame(now => this.draw(now));
  }

  draw(now) {
    this.waiting = false;
    const begin = performance.now(), newest = this.store.count ? this.store.time[this.store.count - 1] : this.time;
    const legible = now - (this.numbered ?? 0) > 200;
    if (legible) this.numbers(now);
    this.picture?.draw(this.store.latest, now, legible);
    this.phasor.draw(this.store.latest, legible);
    this.plots.draw(newest, begin - this.arrived);
    if (now - (this.spectrumDrawn ?? 0) > 500) { this.spectrum.draw(); this.spectrumDrawn = now; }
    this.pictures += 1;
    if (this.acted && newest > this.acted.time) {
      this.latency = performance.now() - this.acted.begun;
      this.acted = null;
    }
  }

  numbers(now) {
    const past = now - (this.numbered ?? now);
    this.rate = past > 0 ? (this.pictures - this.counted) * 1000 / past : 0;
    Object.assign(this, { numbered: now, counted: this.pictures });
    put(by("time"), "text", `${this.time.toFixed(1)} s`);
    put(by("reached"), "text", `×${this.factor.toFixed(2)}`);
    this.plots.readAll();
  }

  show(state) {
    this.state = state;
    put(by("status"), "text", state.message ? `${state.status}: ${state.message}` : state.status);
    put(by("status"), "data-bad", ["ok", "ended"].includes(state.status) ? "0" : "1");
    put(by("pause"), "text", state.paused ? "Go on" : "Pause");
    put(by("pause"), "aria-pressed", String(state.paused));
    if (document.activeElement !== by("factor")) by("factor").value = state.factor_asked;
    const control = state.control;
    put(by("control"), "text", !control ? "recorded" : state.mine ? "you have control" : control.held ? "another viewer has control" : `control is free, ${control.viewers} viewer${control.viewers === 1 ? "" : "s"}`);
    if (by("about").open) put(by("rates"), "text", `${digits(this.rate, 2)} pictures a second; the last act was seen after ${this.latency == null ? "–" : this.latency.toFixed(0)} ms.`);
    this.health(state.health);
    this.command.show(state);
    this.faults.show(state);
    this.records.show(state);
  }

  health(health) {
    const words = { faulty: "FAULTY", healthy: "HEALTHY", waiting: "WAITING", unknown_fault: "UNKNOWN FAULT", model_does_not_fit: "MODEL DOES NOT FIT", undecided: "UNDECIDED" };
    put(by("health"), "data-status", health.status);
    put(by("verdict"), "text", words[health.status] ?? health.status);
    put(by("sentence"), "text", health.text);
    put(by("since"), "text", health.since == null ? "" : `${health.onset ? "began" : "seen"} ${Math.max(0, this.time - health.since).toFixed(0)} s ago`);
    const chance = health.p_fault ?? 0;
    put(by("fill"), "width", (100 * chance).toFixed(1));
    put(by("meter"), "aria-valuenow", chance.toFixed(3));
    put(by("remaining"), "text", health.remaining ?? "");
    const told = JSON.stringify([health.p_fault, health.watch, health.faults]);
    if (told === this.told) return;
    this.told = told;
    const p = health.p_fault == null ? [] : [element("li", {}, "p(fault) ", element("b", {}, digits(chance, 3)))];
    by("causes").replaceChildren(...p, ...this.watched(health.watch), ...health.faults.filter(fault => fault.probability >= 0.1).map(fault => this.cause(fault)));
  }

  // What the monitor says: its statistic in units of its threshold.
  watched(watch) {
    return watch?.statistic == null ? [] : [element("li", {}, "monitor ", element("b", {}, watch.alarm ? "ALARM" : "quiet"), `, statistic ${digits(watch.statistic, 2)} of its threshold`)];
  }

  cause(fault) {
    const unit = this.model.faults.find(item => item.name === `${fault.kind}@${fault.place}`) ?? { scale: 1, shown: "", offset: 0 };
    const read = value => digits(toShown(value, unit), 3), [low, high] = fault.interval;
    const also = fault.ambiguous_with?.length ? `, or ${fault.ambiguous_with.join(", ")}` : "";
    return element("li", {}, element("b", {}, `${fault.kind}@${fault.place}`), ` ${read(fault.severity)} (${read(low)} to ${read(high)}) ${unit.shown}, p ${digits(fault.probability, 2)}${also}`);
  }
}

async function begin() {
  const recorded = document.querySelector("meta[name=session]");
  const source = recorded ? new RecordedSource(window.elevonSession) : new LiveSource();
  const page = new Page(source, await source.model());
  let built = false;
  source.begin({
    frame: (frame, names) => { if (built) page.frame(frame, names); },
    state: state => { if (!built) { built = true; page.build(state); } page.show(state); },
    lost: () => { by("status").textContent = "connection lost; trying again"; by("status").dataset.bad = "1"; },
  });
  window.elevonPage = page;
}

begin().catch(error => { by("message").textContent = String(error); });
