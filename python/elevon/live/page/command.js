// The command page of the real bench: its blocks, its switches, its watch table; the gear lever.

import { digits, element, put } from "./dom.js";

// Names as on the bench's page; each block is enabled by its own switch and the blocks add up.
function blocks(unit) {
  const [q, s] = [unit, `${unit}/s`];
  const angle = unit === "deg";
  return [
    { kind: "step", flag: "IStep", title: "step", fields: [["StepIni", "initial", q, 0], ["StepFin", "final", q, angle ? 10 : 10], ["StepTime", "time", "s", 0]] },
    { kind: "ramp", flag: "IRamp", title: "ramp", fields: [["RampIC", "initial", q, 0], ["RampSlope", "slope", s, 1], ["RampTime", "start", "s", 1], ["RampEnd", "end", "s", 11]] },
    { kind: "sine", flag: "ISin", title: "sine", on: true, fields: [["SinAmp", "amplitude", q, 6], ["SinBias", "bias", q, angle ? 10 : 0], ["SinFrq", "frequency", "Hz", 0.5]] },
    { kind: "chirp", flag: "IChirp", title: "chirp", fields: [["ChirpAmp", "amplitude", q, 3], ["ChirpF0", "start_frequency", "Hz", 0.1], ["ChirpF1", "end_frequency", "Hz", 2], ["ChirpTg", "sweep_time", "s", 20]] },
  ];
}

const UNITS = { position: null, speed: "rpm", torque: "N m" };

export class CommandPage {
  constructor(model, act) {
    this.model = model;
    this.act = act;
    this.node = element("div", {});
    if (model.actions.length) this.gear();
    else this.waves();
  }

  waves() {
    const unit = this.model.inputs.command?.given ?? "deg";
    this.mode = element("select", { "aria-label": "mode" }, ...this.model.modes.map(mode => element("option", { selected: mode === this.model.mode }, mode)));
    this.mode.onchange = () => this.fields(UNITS[this.mode.value] ?? unit);
    this.form = element("div", {});
    this.watch = element("table", { "aria-label": "watch table" });
    const button = (label, message, kind) => element("button", { class: kind, "data-panel": label.toLowerCase(), onclick: () => this.act(message()) }, label);
    const panel = action => () => ({ panel: action });
    this.node.append(
      element("div", { class: "row" }, element("label", {}, "mode ", this.mode),
        element("button", { class: "main", id: "run", onclick: () => this.run() }, "Run"),
        element("button", { id: "stop", onclick: () => this.act({ panel: "stop" }) }, "Stop")),
      this.form,
      element("h3", {}, "switches, in their order"),
      element("div", { class: "row" }, button("Submit", () => ({ block: this.command() })), button("Reset", panel("reset")), button("Enable", panel("enable")), button("Home", panel("home")), button("Move", panel("move")), button("Disable", panel("disable"))),
      this.watch);
    this.fields(unit);
  }

  fields(unit) {
    this.unit = unit;
    this.blocks = blocks(unit).map(block => {
      const flag = element("input", { type: "checkbox", checked: block.on, name: block.flag, "aria-label": `${block.flag}: enable the ${block.title}` });
      const inputs = block.fields.map(([name, key, fieldUnit, value]) => ({ key, unit: fieldUnit, node: element("input", { type: "number", step: "any", value, name, inputmode: "decimal" }), name }));
      const host = element("fieldset", {}, element("legend", {}, flag, ` ${block.title} `),
        element("div", { class: "grid" }, ...inputs.map(item => element("label", {}, `${item.name} [${item.unit}]`, item.node))));
      return { ...block, flag, inputs, host };
    });
    this.own = element("textarea", { "aria-label": "own waveform: time in s and value, a point a line", placeholder: `0 0\n1 5\n2 0   (s, ${unit})` });
    this.ownFlag = element("input", { type: "checkbox", name: "ICom", "aria-label": "ICom: enable the own waveform" });
    this.repeat = element("input", { type: "checkbox", checked: true });
    this.form.replaceChildren(...this.blocks.map(block => block.host),
      element("fieldset", {}, element("legend", {}, this.ownFlag, " own waveform (com) "), this.own, element("label", {}, this.repeat, " again and again")));
  }

  command() {
    const terms = this.blocks.filter(block => block.flag.checked).map(block => {
      const term = { kind: block.kind };
      for (const item of block.inputs) term[item.key] = `${Number(item.node.value)} ${item.unit}`;
      return term;
    });
    if (this.ownFlag.checked) {
      const rows = this.own.value.trim().split("\n").map(line => line.trim().split(/[\s,;]+/).map(Number));
      terms.push({ kind: "table", unit: this.unit, times: rows.map(row => row[0]), values: rows.map(row => row[1]), repeat: this.repeat.checked });
    }
    return { mode: this.mode?.value ?? "position", terms };
  }

  run() { return this.act({ command: this.command() }); }

  toggle(moving) {
    if (this.model.actions.length) return;
    return moving ? this.act({ panel: "stop" }) : this.run();
  }

  gear() {
    const lever = action => ({ command: { mode: "gear", steps: [{ time: 0, action }] } });
    const button = (label, action, kind) => element("button", { class: kind, "data-action": action, onclick: () => this.act(lever(action)) }, label);
    const wheels = element("input", { type: "checkbox", onchange: event => this.act({ set: { weight_on_wheels: event.target.checked ? 1 : 0 } }) });
    this.watch = element("table", { "aria-label": "watch table" });
    this.node.append(
      element("fieldset", {}, element("legend", {}, "gear lever"), element("div", { class: "row" }, button("▲ UP: retract", "retract", "main"), button("▼ DOWN: extend", "extend", "main"), button("Stop", "stop"))),
      element("fieldset", {}, element("legend", {}, "free fall"), element("div", { class: "row" }, button("Free fall", "free_fall"))),
      element("label", { class: "row" }, wheels, " weight on wheels"), this.watch);
  }

  show(state) {
    const values = state.values, panel = state.panel ?? {};
    const rows = this.model.actions.length
      ? [["state", digits(values.state, 2)], ["fault_code", digits(values.fault_code, 2)], ["warning_code", digits(values.warning_code, 2)], ["command_refused", digits(values.command_refused, 1)], ["locked", values.locked > 0.5 ? "TRUE" : "FALSE"], ["brake_released", values.brake_released > 0.5 ? "TRUE" : "FALSE"]]
      : [["abilita (enabled)", panel.enabled], ["home", panel.homing ? "homing" : panel.homed], ["move_pos_abs", panel.moving], ["ActVelocity", `${digits((values.motor_speed ?? 0) * 30 / Math.PI, 4)} rpm`], ["SpeedSp", `${digits((values.speed_ref ?? 0) * 30 / Math.PI, 4)} rpm`], ["ErrorSinaSpeed", state.status !== "ok"], ["Status", state.status]];
    const cell = value => value === true ? "TRUE" : value === false ? "FALSE" : value ?? "–";
    if (this.watch.rows.length !== rows.length)
      this.watch.replaceChildren(...rows.map(([name]) => element("tr", {}, element("th", { scope: "row" }, name), element("td", {}))));
    rows.forEach(([, value], k) => put(this.watch.rows[k].cells[1], "text", String(cell(value))));
  }
}
