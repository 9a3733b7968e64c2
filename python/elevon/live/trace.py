"""What a drive, or the stand's recorder, writes of a stretch of a live run: its log and its note.

Nothing here knows a fault or a parameter that was changed: the files hold sensors, set points and
the operator's command, as those of the virtual bench do.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.bench.acquisition import acquire, acquired_signals
from elevon.bench.rig import BrakeRig, Hx711
from elevon.bench.stand import Stand, stand_of
from elevon.errors import ElevonError, InputError
from elevon.files import write_text
from elevon.logs.formats.drive import DriveFormat, write_drive_csv
from elevon.logs.formats.loadcell import write_loadcell
from elevon.plain import Plain
from elevon.recording import Recording
from elevon.scenario.compile import signal_records
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.monitor import Monitor
    from elevon.logs.log import Log


_NARROWEST = 1.0  # s: a window has some hundred samples both ways
_STREAM = 600.0  # s for which thresholds are simulated
_STANDING = ("constant", "step")


@dataclass(frozen=True)
class Watch(Plain):
    """The result of the monitor.

    Attributes
    ----------
    statistic : float
        Of the latest window, in units of its threshold: an alarm above one.
    windows : int
        How many were used.
    alarm : bool
        Whether it has been above one since the motion's last healthy stretch.
    since : float or None
        Where the change most likely began [s].
    """

    statistic: float
    windows: int
    alarm: bool = False
    since: float | None = None


def window_of(command: Mapping[str, Any] | None) -> float | None:
    """Return a window's width [s]: whole periods of a command that has one; None where it has none.

    Parameters
    ----------
    command : mapping or None
        As in a scenario file.
    """
    terms = [] if command is None else command.get("terms", [])
    moving = [term for term in terms if term["kind"] not in _STANDING]
    if not moving or any(term["kind"] not in ("sine", "triangle") for term in moving):
        return None
    rates = {parse_quantity(term["frequency"], "Hz", "frequency") for term in moving}
    rate = rates.pop()
    if rates or not rate > 0.0:
        return None
    return math.ceil(_NARROWEST * rate) / rate


class StreamWatch:
    """Monitors the successive stretches of one motion.

    Parameters
    ----------
    actuator : Actuator
        The healthy unit.
    """

    def __init__(self, actuator: Actuator) -> None:
        self._actuator = actuator
        self._motion: LiveMotion | None = None
        self._monitor: Monitor | None = None
        self._refused = False
        self._fed = -math.inf
        self._statistic = 0.0

    def take(self, log: Log, motion: LiveMotion, *, healthy: bool) -> Watch | None:
        """Feed the new samples of a stretch; None where no baseline exists yet.

        Parameters
        ----------
        log : Log
            The stretch, from the instant ``motion.begin`` on.
        motion : LiveMotion
            What it belongs to.
        healthy : bool
            Whether the diagnosis calls it so; where it began after the alarm, watching begins anew.
        """
        self._of(motion)
        if self._monitor is None:
            return None
        alarm = self._monitor.alarm
        if healthy and alarm is not None and motion.begin > self._origin + alarm.time:
            self._monitor, self._statistic = self._monitor.fresh(), 0.0
        self._feed(log, motion.begin)
        return self._watch()

    def learn(self, log: Log, motion: LiveMotion) -> None:
        """Take a healthy stretch as the baseline of its motion, if it has none yet.

        Seconds of processor time: what every fault does to a window is simulated.
        """
        from elevon.diagnose.monitor import Monitor

        self._of(motion)
        if self._monitor is not None or self._refused or motion.window is None:
            return
        try:
            self._monitor = Monitor(self._actuator, [log], window=motion.window, longest=_STREAM)
        except ElevonError:  # too few windows, or no command: the diagnosis is alone
            self._refused = True
        self._fed = motion.begin + float(log.time[-1])

    def _of(self, motion: LiveMotion) -> None:
        """Begin anew where the motion is another one."""
        if self._motion is None or self._motion.since != motion.since:
            self._monitor, self._refused, self._statistic = None, False, 0.0
        self._motion = replace(motion)

    @property
    def _origin(self) -> float:
        origin = None if self._monitor is None else self._monitor.origin
        return 0.0 if origin is None else origin

    def _feed(self, log: Log, begin: float) -> None:
        assert self._monitor is not None
        time = log.time + begin
        new = time > self._fed
        if not new.any():
            return
        channels = {role: log[role][new] for role in self._monitor.roles if log.has(role)}
        for step in self._monitor.feed({"time": time[new], **channels}):
            if not step.skipped:
                self._statistic = step.statistic
        self._fed = float(time[-1])

    def _watch(self) -> Watch:
        assert self._monitor is not None
        alarm = self._monitor.alarm
        since = None if alarm is None else self._origin + alarm.since
        return Watch(self._statistic, self._monitor.windows, alarm is not None, since)


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
    """The motion that a stretch is part of.

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
