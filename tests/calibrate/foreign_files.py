"""The files of the foreign bench: drive trace, load cell and what its operator noted."""

import json
import math
from dataclasses import dataclass

import numpy as np

from tests.calibrate.foreign import CAMPAIGN, COUNT, RPM, run, truth

HEADERS = {
    "time": "Xms",
    "encoder": "C0Drive_axis_1r4821",
    "motor": "C1Drive_axis_1r4820",
    "speed_ref": "Drive_axis_1.r62",
    "speed": "Drive_axis_1.r63",
    "current_ref": "Drive_axis_1.r77",
    "field": "Drive_axis_1.r76",
    "voltage": "Drive_axis_1.r1733",
    "trigger": "Drive_control.r722",
    "current": "Drive_axis_1.r78",
}


@dataclass(frozen=True)
class Style:
    """How the files are written."""

    delimiter: str = ","
    decimal_comma: bool = False
    encoding: str = "utf-8"
    bom: bool = False
    line_end: str = "\n"
    encoder_shaft: str = "fast"
    current: str = "rms"
    missing: tuple = ()
    extra: str = ""
    cell_header: str = "time,value"
    noted_arm: bool = True
    note_keys: str = "plain"  # plain, units (amplitude_deg...), nested


def drive_columns(done, sensors, style, rng):
    """Return the columns of a drive trace as its file holds them: degrees, rpm, A, V, ms."""
    rows, n = done.rows, len(done.time)
    scale = math.sqrt(0.5) if style.current == "rms" else 1.0
    counts = 2**24 / (2 * math.pi)
    motor = np.degrees(np.round((rows["motor"] + sensors.motor_zero) * counts) / counts)
    if sensors.motor_rounding:
        motor = np.round(motor / sensors.motor_rounding) * sensors.motor_rounding
    speed = rows["speed"] + sensors.speed_offset + rng.normal(0, sensors.speed_noise, n)
    current = rows["current"] + sensors.current_offset + rng.normal(0, sensors.current_noise, n)
    if sensors.current_step:
        current = np.round(current / sensors.current_step) * sensors.current_step
    shaft = 124.0 if style.encoder_shaft == "fast" else 1.0
    return {
        "time": 1e3 * done.time,
        "encoder": np.degrees(rows["output"]) * shaft,
        "motor": motor,
        "speed_ref": rows["speed_ref"] / RPM,
        "speed": speed / RPM,
        "current_ref": scale * rows["current_ref"],
        "field": scale * rng.normal(0, sensors.current_noise, n),
        "voltage": scale * (rows["voltage"] + rng.normal(0, sensors.voltage_noise, n)),
        "trigger": (done.time >= done.trigger).astype(float),
        "current": scale * current,
    }


def load_cell(done, sensors, rng):
    """Return time on the cell's own clock, zero at the trigger, and force [N]."""
    last = (done.time[-1] - done.trigger) / (1 + sensors.cell_clock)
    cell_time = np.arange(0.0, last, 1.0 / sensors.cell_rate)
    at = done.trigger + (1 + sensors.cell_clock) * cell_time
    force = np.interp(at, done.time, done.rows["reaction"]) * sensors.chain / sensors.arm
    if sensors.cell == "positive":
        force = np.abs(force)
    force = force + sensors.cell_offset + rng.normal(0, sensors.cell_noise, len(cell_time))
    return cell_time, force


def note(trial, sensors, style, cell):
    """Return what the operator knows."""
    waveform = {"waveform": trial.waveform}
    unit = {"amplitude": "deg", "bias": "deg", "sweep_time": "s"}
    for key, value in trial.values.items():
        tail = f"_{unit.get(key, 'Hz')}".lower() if style.note_keys == "units" else ""
        in_text = key in {"amplitude", "bias"} and not tail
        waveform[key + tail] = f"{value!r} deg" if in_text else value
    if style.note_keys == "nested":
        waveform["kind"] = waveform.pop("waveform")
        waveform = {"command": waveform}
    known = {**waveform, "brake": "on" if trial.brake else "off", "current": style.current}
    if cell and style.noted_arm:
        arm = "load_cell_arm_m" if style.note_keys == "units" else "load_cell_arm"
        known |= {arm: sensors.arm, "chain_ratio": sensors.chain}
    return known


def write_table(path, header, columns, style, formats):
    """Write columns of numbers."""
    cells = [[f % v for v in c.tolist()] for f, c in zip(formats, columns, strict=True)]
    lines = [header, *map(style.delimiter.join, zip(*cells, strict=True))]
    text = style.line_end.join(lines) + style.line_end
    if style.decimal_comma:
        body = text[len(header) :].replace(".", ",")
        text = header + body
    data = text.encode(style.encoding)
    path.write_bytes(b"\xef\xbb\xbf" + data if style.bom else data)


def write_trial(path, done, sensors, style, seed=0):
    """Write one trial's trace and the files beside it; return the trace's path."""
    rng = np.random.default_rng([seed, 3])
    columns = drive_columns(done, sensors, style, rng)
    columns = {k: v for k, v in columns.items() if k not in style.missing}
    names = [HEADERS[key] for key in columns]
    values, formats = list(columns.values()), ["%.9g"] * len(columns)
    if style.extra:
        names.append(style.extra)
        values.append(35.0 + 0.1 * done.time)
        formats.append("%.2f")
    write_table(path, style.delimiter.join(names), values, style, formats)
    cell = bool(done.trial.brake) and sensors.cell != "none"
    if cell:
        cell_time, force = load_cell(done, sensors, rng)
        header = style.cell_header.replace(",", style.delimiter)
        cell_file = path.with_name(f"{path.stem}_loadcell.csv")
        write_table(cell_file, header, [cell_time, force], style, ["%.5f", "%.4f"])
    known = note(done.trial, sensors, style, cell)
    path.with_name(f"{path.stem}_command.json").write_text(json.dumps(known, indent=1))
    return path


def write_campaign(folder, bench, sensors, style=None, trials=None, seed=0):
    """Carry trials out and write them; return the traces' paths and the truth."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = []
    for k, (name, trial) in enumerate((trials or CAMPAIGN).items()):
        done = run(bench, sensors, trial, seed=100 * seed + k)
        paths.append(
            write_trial(folder / f"{name}.csv", done, sensors, style or Style(), 100 * seed + k)
        )
    return paths, truth(bench, sensors)


__all__ = ["COUNT", "HEADERS", "Style", "write_campaign", "write_trial"]
