"""What a drive, or the stand's recorder, writes of a stretch of a live run: its log and its note.

Nothing here knows a fault or a parameter that was changed: the files hold sensors, set points and
the operator's command, as those of the virtual bench do.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.bench.acquisition import acquire, acquired_signals
from elevon.bench.brake_rig import BrakeRig
from elevon.bench.converter import Hx711
from elevon.bench.stand import Stand, stand_of
from elevon.errors import InputError
from elevon.files import write_text
from elevon.logs.formats.drive import DriveFormat, write_drive_csv
from elevon.logs.formats.loadcell import write_loadcell
from elevon.recording import Recording
from elevon.scenario.compile import signal_records

if TYPE_CHECKING:
    from elevon.actuator import Actuator


#: Column's channel of a drive's trace to the model's signals that give it, the best first.
_DRIVE = {
    "encoder_position": ("encoder_position",),
    "resolver_position": ("resolver_position",),
    "motor_speed": ("resolver_speed",),
    "speed_ref": ("speed_ref",),
    "current_ref": ("current_ref",),
    "current_d_meas": ("current_d_meas",),
    "current_q_meas": ("current_q_meas",),
}
_TRIGGER = 0.1  # s from a trace's start to its trigger
_NOISE = 0.05  # N of the load cell. ASSUMED, as on the virtual bench


@dataclass(frozen=True)
class LiveMotion:
    """What a stretch is a part of.

    Attributes
    ----------
    begin : float
        The stretch's first sample [s].
    since : float
        Since when command, loads and parameters have been the same [s].
    window : float or None
        Whole periods of the command [s]; None where it does not repeat.
    """

    begin: float
    since: float
    window: float | None


@dataclass(frozen=True)
class Stretch:
    """A stretch of a live run.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s.
    signals : mapping of str to ndarray, shape (n,)
        SI, by the model's names.
    command : mapping
        The command that was given, as in a scenario file; its instants count from the stretch's
        first sample.
    load : ndarray, shape (n,)
        What the stand puts on the output.
    brake : bool
        Whether the brake was closed.
    seed : int
        Of the recorder's noise.
    initial : mapping of str to float
        Where the motion began, as far as the operator knows.
    since : float
        Since when command, loads and parameters have been the same [s].
    """

    time: Floats
    signals: Mapping[str, Floats]
    command: Mapping[str, Any] | None
    load: Floats
    brake: bool = False
    seed: int = 0
    initial: Mapping[str, float] = field(default_factory=dict)
    since: float = 0.0

    @property
    def motion(self) -> LiveMotion:
        """What it is a part of."""
        from elevon.live.watching import window_of

        return LiveMotion(float(self.time[0]), self.since, window_of(self.command))


def trace_signals(actuator: Actuator, fidelity: str) -> list[str]:
    """Return the model's signals from which a log is written."""
    stand = stand_of(actuator.wiring)
    if stand.equipment != "rotary":
        return list(acquired_signals(actuator, fidelity, stand).values())
    known = signal_records(actuator.wiring, fidelity)
    wanted = [name for names in _DRIVE.values() for name in names]
    wanted += [_voltage(actuator), "brake_torque", "motor_speed"]
    return [name for name in wanted if name in known]


def write_stretch(
    path: Path, stretch: Stretch, actuator: Actuator, fidelity: str, *, force: bool = False
) -> list[Path]:
    """Write the log of a stretch and what stands beside it; return the files, the log first.

    Raises
    ------
    InputError
        No sample.
    OutputError
        A file that cannot be written.
    """
    if len(stretch.time) < 2:
        raise InputError("nothing was recorded yet")
    stand = stand_of(actuator.wiring)
    if stand.equipment != "rotary":
        return _recorder(path, stretch, actuator, fidelity, stand, force=force)
    return _drive(path, stretch, actuator, force=force)


def _voltage(actuator: Actuator) -> str:
    pwm = actuator.parameters["drive.kind"].value == "pwm"
    return "voltage_q_ref" if pwm else "voltage_q_meas"


def _drive(path: Path, stretch: Stretch, actuator: Actuator, *, force: bool) -> list[Path]:
    layout = DriveFormat(gear_ratio=actuator.parameters.value("gear.ratio"))
    time = stretch.time - stretch.time[0]
    columns: dict[str, Floats] = {"time": time}
    for channel, names in _DRIVE.items():
        present = [name for name in names if name in stretch.signals]
        if present:
            columns[channel] = stretch.signals[present[0]]
    if _voltage(actuator) in stretch.signals:
        columns["voltage_q_ref"] = stretch.signals[_voltage(actuator)]
    columns["trigger"] = (time >= _TRIGGER).astype(np.float64)
    note: dict[str, Any] = {"brake": "on" if stretch.brake else "off"}
    if stretch.command is not None:
        note["command"] = dict(stretch.command)
    note["current"] = layout.current_convention
    files = [path]
    if stretch.brake:
        rig = BrakeRig()
        note |= {"load_cell_arm": rig.arm, "chain_ratio": rig.chain_ratio}
        cell = path.with_name(f"{path.stem}_loadcell.csv")
        files.append(write_loadcell(cell, *_cell(stretch, rig), force=force))
    note_file = path.with_name(f"{path.stem}_command.json")
    files.append(write_text(note_file, json.dumps(note, indent=2) + "\n", force=force))
    write_drive_csv(path, columns, layout=layout, force=force)
    return files


def _cell(stretch: Stretch, rig: BrakeRig) -> tuple[Floats, Floats]:
    """Time from the trigger and force of the brake's load cell."""
    converter, clock = Hx711(), stretch.time - stretch.time[0]
    count = max(2, int((clock[-1] - _TRIGGER) * converter.rate) + 1)
    time = np.arange(count, dtype=np.float64) / converter.rate
    way = np.sign(stretch.signals["motor_speed"])
    torque = np.interp(time + _TRIGGER, clock, stretch.signals["brake_torque"] * way)
    noise = _NOISE * np.random.default_rng([stretch.seed, 1]).standard_normal(count)
    return time, converter.convert(torque * rig.chain_ratio / rig.arm + noise)


def _recorder(
    path: Path, stretch: Stretch, actuator: Actuator, fidelity: str, stand: Stand, *, force: bool
) -> list[Path]:
    roles = acquired_signals(actuator, fidelity, stand)
    units = signal_records(actuator.wiring, fidelity)
    present = {role: name for role, name in roles.items() if name in stretch.signals}
    time = stretch.time - stretch.time[0]
    rate = 1.0 / float(np.median(np.diff(time)))
    run = Recording.build(
        time,
        {name: stretch.signals[name] for name in present.values()},
        {name: str(units[name]["unit"] or "1") for name in present.values()},
        clock="live",
        rate=rate,
    )
    log = acquire(run, present, (time, stretch.load), stand, rate=rate, seed=stretch.seed)
    stated = {
        "name": stand.name, "text": stand.text, "parameters": {},
        "initial": dict(stretch.initial), "rig_moves": False,
    }  # fmt: skip
    log = log.with_meta(status="measured", ended="ok", log=path.stem, stand=stated)
    log.save(path, force=force)
    from elevon.recording.formats import files_of

    return [Path(file) for file in files_of(path)]
