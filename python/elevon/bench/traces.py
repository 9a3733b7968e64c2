"""What the bench writes of one run: the drive's trace, the load cell's file, the command note."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.bench.procedure import BacklashStep, Procedure, TraceStep
from elevon.bench.rig import RATE, Hx711, Setup
from elevon.errors import FormatError, InputError, OutputExistsError
from elevon.files import check_output, write_text
from elevon.logs.command.fit import FREE
from elevon.logs.command.note import CommandNote
from elevon.logs.formats.drive import DriveFormat, write_drive_csv
from elevon.logs.formats.loadcell import write_loadcell
from elevon.logs.log import Log
from elevon.parameters.records import wirings
from elevon.recording import Recording
from elevon.recording import Recording as Built
from elevon.recording.csv import description_path
from elevon.units import format_quantity, parse_quantity
from elevon.worklog import Item, WorkLog


def claim_logs(path: Path, key: str, names: Iterable[str], *, force: bool) -> tuple[WorkLog, bool]:
    """Make a folder this work's own, or find the same work begun there.

    Returns
    -------
    WorkLog, bool
        ``bench-NAME.log``, a line for each finished log; whether the very same work was there.

    Raises
    ------
    InputError
        The folder is a file.
    OutputExistsError
        Without `force`: the folder holds logs of other work, or logs that nobody knows.
    """
    folder = path.parent
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is not a folder")
    if force:
        return WorkLog.begin(path, key), False
    try:
        old = WorkLog.read(path)
    except FormatError as error:
        raise OutputExistsError(f"{path}: cannot be read ({error})") from error
    if old is not None and old.key == key:
        return old, True
    if old is not None:
        raise OutputExistsError(f"{path}: belongs to other work")
    for name in names:
        traces = trace_files(folder, name, cell=True)
        for file in (*traces, description_path(traces[-1])):
            check_output(file)
    return WorkLog.begin(path, key), False


def finished_logs(path: Path) -> list[str]:
    """Return the names of the logs that a state file calls finished; none where there is none."""
    try:
        log = WorkLog.read(path)
    except FormatError:
        return []
    return [] if log is None else [name for name, item in log.items.items() if ending_of(item)]


def ending_of(item: Item) -> tuple[str, str] | None:
    """Return status (``ok`` or ``tripped``) and message of a finished log; None: it says none."""
    status, message = item.data.get("status"), item.data.get("message")
    if item.files and isinstance(status, str) and isinstance(message, str):
        return status, message
    return None


_LOGGED = {
    "encoder_position": "encoder_position",
    "resolver_position": "resolver_position",
    "resolver_speed": "motor_speed",
    "speed_ref": "speed_ref",
    "current_ref": "current_ref",
    "current_d_meas": "current_d_meas",
    "current_q_meas": "current_q_meas",
}
_CELL = ("motor_speed", "friction_torque", "output_position")
_VOLTAGES = ("voltage_q_ref", "voltage_q_meas")


def recorded(known: list[str]) -> str:
    """Return what must be recorded, of the signals that a model has."""
    wanted = [*_LOGGED, *_VOLTAGES, *_CELL]
    return f"{','.join(name for name in wanted if name in known)}@{RATE:g} Hz"


def trace_files(folder: Path, name: str, *, cell: bool) -> list[Path]:
    """Return the files of one log, the trace last: where it stands, the others do."""
    companions = [folder / f"{name}_command.json"]
    if cell:
        companions.append(folder / f"{name}_loadcell.csv")
    return [*companions, folder / f"{name}.csv"]


def write_traces(
    folder: Path, setup: Setup, recording: Recording, layout: DriveFormat, *, force: bool
) -> list[Path]:
    """Write the files of one log, each whole or not at all.

    Raises
    ------
    InputError
        A cable went slack.
    OutputExistsError, OutputError
        As `elevon.files.write_text`.
    """
    cell = cell_signals(setup, recording)
    files = trace_files(folder, setup.trace.name, cell=cell is not None)
    note = json.dumps(_note(setup, layout), indent=2) + "\n"
    write_text(files[0], note, force=force)
    if cell is not None:
        write_loadcell(files[1], *cell, force=force)
    write_drive_csv(files[-1], drive_signals(setup, recording), layout=layout, force=force)
    return files


def drive_signals(setup: Setup, recording: Recording) -> dict[str, Floats]:
    """The drive's own channels: its sensors, never the true motions."""
    time = np.asarray(recording["resolver_position"].time, dtype=np.float64)
    signals = {"time": time}
    for name, column in _LOGGED.items():
        if name in recording:
            signals[column] = np.asarray(recording[name].values, dtype=np.float64)
    pwm = setup.actuator.parameters["drive.kind"].value == "pwm"
    voltage = recording[_VOLTAGES[0] if pwm else _VOLTAGES[1]].values
    signals["voltage_q_ref"] = np.asarray(voltage, dtype=np.float64)
    signals["trigger"] = (time >= setup.conditions.trigger).astype(np.float64)
    return signals


def cell_signals(setup: Setup, recording: Recording) -> tuple[Floats, Floats] | None:
    """Time and force of the load cell on its own clock, None where it hangs idle."""
    conditions, rig = setup.conditions, setup.rig
    converter, stretch = Hx711(), 1.0 + conditions.cell.clock_drift
    clock = np.asarray(recording["motor_speed"].time, dtype=np.float64)
    if setup.brake is not None:
        run = setup.brake
        at = conditions.trigger + run.time * stretch
        share = _reaction(setup, recording, np.searchsorted(clock, at).clip(0, len(clock) - 1))
        force = run.torque * share * rig.equipment.chain_ratio / rig.equipment.arm
        return run.time, converter.convert(force + run.noise)
    if rig.springs is None and rig.weights is None:
        return None
    count = int((clock[-1] - conditions.trigger) / stretch * converter.rate) + 1
    time = np.arange(count, dtype=np.float64) / converter.rate
    output = np.asarray(recording["output_position"].values, dtype=np.float64)
    force = np.zeros_like(time)
    if rig.springs is not None:
        all_forces = rig.springs.forces(output)
        force += np.interp(conditions.trigger + time * stretch, clock, all_forces)
    if rig.weights is not None:
        force += rig.weights.at(np.asarray(time * stretch, dtype=np.float64))
    rng, cell = np.random.default_rng([conditions.seed, 1]), conditions.cell
    noise = cell.offset + cell.drift * time + cell.noise * rng.standard_normal(len(time))
    return time, converter.convert(force + noise)


def _reaction(setup: Setup, recording: Recording, index: npt.NDArray[np.intp]) -> Floats:
    """Torque on the disk over what it could oppose, signed with the motion.

    Sliding: all of it. At rest the brake and the gear's own dry friction share what holds the
    shaft; how, statics cannot tell: ASSUMED in the ratio of what each could oppose.
    """
    speed = np.asarray(recording["motor_speed"].values, dtype=np.float64)[index]
    friction = np.asarray(recording["friction_torque"].values, dtype=np.float64)[index]
    assert setup.brake is not None
    able = setup.brake.torque + setup.actuator.parameters.value("friction.static")
    share = np.clip(friction / np.maximum(able, 1e-12), -1.0, 1.0)
    return np.where(speed == 0.0, share, np.sign(speed))


def _note(setup: Setup, layout: DriveFormat) -> dict[str, Any]:
    """Return what the operator knows: degrees, Hz, s; not when anything began."""
    note: dict[str, Any] = {}
    terms = [term for term in setup.trace.command.terms if term.enabled]
    mode = setup.trace.command.mode
    if mode == "position" and len(terms) == 1 and terms[0].kind in FREE:
        note |= _waveform(terms[0])
    elif terms:
        default_unit = wirings()[setup.actuator.wiring]["mode_units"][mode]
        note["command"] = setup.trace.command.model_dump(exclude_unset=True, mode="json")
        note["command"]["terms"] = [
            _stated(term, default_unit) for term in note["command"]["terms"]
        ]
    note["brake"] = "on" if setup.brake is not None else "off"
    rig = setup.rig
    if setup.brake is not None:
        note["load_cell_arm"] = rig.equipment.arm
        note["chain_ratio"] = rig.equipment.chain_ratio
    elif rig.springs is not None or rig.weights is not None:
        note["load_cell_arm"] = (rig.springs or rig.weights).radius  # type: ignore[union-attr]
    note["current"] = layout.current_convention
    if layout.gear_ratio != DriveFormat().gear_ratio:
        note["gear_ratio"] = layout.gear_ratio
    return note


def _stated(term: dict[str, Any], default_unit: str) -> dict[str, Any]:
    """Return a term with the units of its numbers, which a note must not leave open."""
    from elevon.waveforms import TABLE, unit_of, wave_records

    record = wave_records()[term["kind"]]
    stated = dict(term)
    for parameter in record.parameters:
        value = term.get(parameter.name)
        unit = unit_of(parameter, default_unit)
        if isinstance(value, (int, float)) and not isinstance(value, bool) and unit != "1":
            stated[parameter.name] = f"{value!r} {unit}"
    if record.kind == TABLE and not term.get("unit"):
        stated["unit"] = default_unit
    return stated


def _waveform(term: Any) -> dict[str, Any]:
    from elevon.waveforms import unit_of, wave_records

    shape: dict[str, Any] = {"waveform": term.kind}
    for parameter in wave_records()[term.kind].parameters:
        name = parameter.name
        given = term.arguments.get(name)
        if given is None or name in {"start", "end", "time", "phase", "repeat", "hold"}:
            continue
        unit = unit_of(parameter, "rad")
        label = unit.replace("rad", "deg")
        value = parse_quantity(given, unit, name)
        shape[name] = format_quantity(value, label, 12)
    return shape


def first_trace(procedure: Procedure) -> Procedure:
    """Return a procedure up to its first trace, with the unit's own backlash."""
    steps = []
    for step in procedure.step:
        if not isinstance(step, BacklashStep):
            steps.append(step)
        if isinstance(step, TraceStep):
            break
    return procedure.model_copy(update={"step": tuple(steps)})


def traced(
    setup: Setup,
    recording: Recording,
    *,
    cell: float = 1.0,
    noise: Mapping[str, float] | None = None,
) -> Log:
    """Return the log that the bench writes of a run.

    Parameters
    ----------
    setup : Setup
        From `elevon.bench.rig.setups`.
    recording : Recording
        Its run, with what `elevon.bench.traces.recorded` says.
    cell : float
        Brake torque measured over the true one.
    noise : mapping of str to float, optional
        Deviation of white noise on channels of the log, SI.
    """
    from elevon.logs.brake import brake_of

    signals = drive_signals(setup, recording)
    rng = np.random.default_rng([setup.conditions.seed, 7])
    for name, deviation in (noise or {}).items():
        signals[name] = signals[name] + deviation * rng.standard_normal(len(signals[name]))
    time, note = signals["time"], _noted(setup)
    cell_log = _cell(setup, recording, cell)
    channels = {
        "speed_ref": signals["speed_ref"],
        "motor_speed": signals["motor_speed"],
        "torque_current": signals["current_q_meas"],
        "current_ref": signals["current_ref"],
        "motor_position": signals["resolver_position"],
        "output_position": signals["encoder_position"],
        "torque_voltage": signals["voltage_q_ref"],
    }
    if "current_d_meas" in signals:
        channels["direct_current"] = signals["current_d_meas"]
    brake = brake_of(cell_log, note, time, 0.0, channels["motor_speed"])
    return Log(setup.trace.name, time, channels, note=note, brake=brake)


def _noted(setup: Setup) -> CommandNote:
    """What the operator notes of the command: a single waveform."""
    from elevon.units import parse_quantity
    from elevon.waveforms import unit_of, wave_records

    term = setup.trace.command.terms[0]
    parameters = {
        p.name: parse_quantity(term.arguments[p.name], unit_of(p, "rad"), p.name)
        for p in wave_records()[term.kind].parameters
        if p.name in term.arguments and p.name not in {"start", "end", "time", "phase"}
    }
    return CommandNote("", term.kind, parameters, brake=setup.brake is not None)


def _cell(setup: Setup, recording: Recording, factor: float) -> Recording:
    """Return a recording of the brake's torque by the load cell, on the drive's clock."""
    signals = cell_signals(setup, recording)
    if signals is None:
        return recording
    time, force = signals
    equipment = setup.rig.equipment
    torque = factor * force * equipment.arm / equipment.chain_ratio
    clock = setup.conditions.trigger + time * (1.0 + setup.conditions.cell.clock_drift)
    return Built.build(clock, {"load_cell_torque": torque}, {"load_cell_torque": "N m"})
