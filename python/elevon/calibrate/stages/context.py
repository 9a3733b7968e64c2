"""What the stages of a calibration share: logs, the actuator before, what is determined so far.

Balances need a log on the clock of what they balance, with the motor's speed, all channels smoothed
alike, and the samples that count.
"""

from __future__ import annotations

import math
import time as clock
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import Any, Generic, TypeVar

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.named import named
from elevon.calibrate.outcome import Calibration, LogFacts, log_facts
from elevon.calibrate.validation import Validation
from elevon.data import packaged_toml
from elevon.errors import InputError, Interrupted
from elevon.estimate import Estimate
from elevon.estimate.signals import local_polynomial
from elevon.logs.log import Log, per_log
from elevon.parameters.records import record_of, records
from elevon.progress import Progress, part
from elevon.recording import Recording

_FEWEST = 100  # samples
#: Friction per torque of the motor, where the law of friction knows of it; the laws that do not.
LOAD_SHARE, LAWS_WITHOUT_LOAD = "friction.load_motor", ("borello", "stribeck")
#: Share of the highest speed over which friction falls from rest to motion. ASSUMED: no log at
#: 100 Hz settles it; half and twice as much are part of the intervals of a fit in closed loop.
FALL = 0.02
#: What shows the motor's speed, the best first.
MOTION = ("motor_speed", "motor_position", "output_speed", "output_position")


def role_log(recording: Recording, name: str, actuator: Actuator) -> Log:
    """Return what the calibration needs of a recording, by the roles it states.

    The clock is that of the output's position for an actuator with a control unit of its own, of
    the torque current for a servo. A log without the motor's speed has it from what else it shows
    of the motion.

    Raises
    ------
    InputError
        A role that is needed is missing, nothing of the motion was recorded, or the log is too
        short.
    """
    servo = "control.position_gain" in actuator.parameters
    log = Log.of(recording, name, clock="torque_current" if servo else "output_position")
    if len(log.time) < _FEWEST:
        raise InputError(f"{name}: {len(log.time)} samples; at least {_FEWEST}")
    if log.has("motor_speed"):
        return log
    return log.with_channels(motor_speed=_speed(log, motor_ratio(actuator)))


def motor_ratio(actuator: Actuator) -> float:
    """Return the motor's angle over the output's coordinate, rad/rad or rad/m."""
    known, value = actuator.parameters, actuator.parameters.value
    stages = ("gear.ratio",) if "gear.ratio" in known else ("gear.ratio_first", "gear.ratio_second")
    lead = value("screw.lead") if "screw.lead" in known else 1.0
    return math.prod(value(path) for path in stages) / lead


def grows_with_torque(top_speed: float) -> dict[str, str | float]:
    """Return the choices with which friction grows with the motor's torque alone.

    Parameters
    ----------
    top_speed : float
        Highest of the logs [rad/s].
    """
    return {
        "friction.law": "load_dependent", "friction.stribeck_speed": FALL * top_speed,
        "friction.load_external": 0.0, "friction.load_motor_stribeck": 0.0,
        "friction.load_external_stribeck": 0.0,
    }  # fmt: skip


def geared(actuator: Actuator) -> bool:
    """Return whether the motor's torque passes a gear or a screw, which may lose a share of it."""
    return motor_ratio(actuator) != 1.0


def _speed(log: Log, ratio: float) -> Floats:
    """Motor's speed from what else was recorded of the motion, the best first."""
    motion = next((role for role in MOTION[1:] if log.has(role)), None)
    if motion is None:
        one = ", ".join(MOTION)
        raise InputError(f"{log.name}: nothing of the motion was recorded; one of {one}")
    values = np.gradient(log[motion], log.time) if motion.endswith("position") else log[motion]
    return np.asarray((1.0 if motion == "motor_position" else ratio) * values)


LOAD = ("load", "load_cell")
_WIDTH = 0.05  # s of the polynomials that smooth all channels alike
#: Eighth order, in the order in which a convolution takes it.
_STENCIL = np.array([-3, 32, -168, 672, 0, -672, 168, -32, 3]) / 840.0
_SLOPES = {"acceleration": "motor_speed", "current_slope": "torque_current"}
_SLOWEST = 0.01  # s between samples, from which a log shows temperatures only
_MOVES = 0.05  # of the largest speed: below it the friction's sign is open
CORNERS = (
    0.06,
    0.1,
)  # s about a reversal or a limit that do not count; the second is a choice as good
_LIMIT = 0.98  # of the largest set point of the current: the drive is limited


def quick(log: Log) -> bool:
    """Whether the motion is sampled quickly enough for balances."""
    return log.period < _SLOWEST


def loaded(log: Log) -> bool:
    """Whether the force on the ram was measured."""
    return any(log.has(role) for role in LOAD)


@per_log
def smooth(log: Log) -> dict[str, Floats]:
    """All channels, and slopes of speed, position and current, through one smoother."""
    slopes = {name: slope(log[role], log.period) for name, role in _SLOPES.items() if log.has(role)}
    every = {**log.channels, **slopes}
    return {role: smoothed(values, log.period) for role, values in every.items()}


def apart(log: Log, corner: float = CORNERS[0]) -> Bools:
    """Return the samples in motion, so long apart from reversals and limits."""
    speed = smooth(log)["motor_speed"]
    away = np.abs(speed) < _MOVES * float(np.max(np.abs(speed)))
    if log.has("current_ref"):
        size = np.abs(log["current_ref"])
        top = float(np.max(size))
        away |= (size > _LIMIT * top) & (np.median(size) < 0.5 * top)
    width = 2 * round(corner / log.period) + 1
    near = np.convolve(away.astype(float), np.ones(width), mode="same") > 0.5
    edge = (log.time < _WIDTH) | (log.time > log.time[-1] - _WIDTH)
    return np.asarray(~near & ~edge)


def smoothed(values: Floats, period: float) -> Floats:
    """Values through the polynomials that smooth all channels alike."""
    return local_polynomial(values, period, _WIDTH, order=3)


def slope(values: Floats, period: float) -> Floats:
    """Slope by central differences of eighth order: in a balance it is smoothed like the rest.

    The slope of a polynomial through the smoother's window is smoothed more than the values are:
    at the corners of a trapezoid that made masses 10 % too large.
    """
    padded = np.pad(values, 4, mode="edge")
    return np.asarray(np.convolve(padded, _STENCIL / period, mode="valid"), dtype=np.float64)


C = TypeVar("C", bound="Context")
_WIDE = 0.2  # of a value: a deviation above which it is not determined
_NOISE = "the logs' noise is larger than its effect"
_IMPOSSIBLE = "the value that the logs say is none that the model can have"


@dataclass(eq=False)
class Context:
    """What a calibration knows as its stages go on.

    Parameters
    ----------
    logs : sequence of Log
        The data.
    actuator : Actuator
        Values before.
    fidelity : str or None
        Of runs that correct what balances misread: ``auto``, ``low``, ``high``, or none.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Attributes
    ----------
    levels : dict of str to Estimate
        What is determined, by path.
    reasons : dict of str to str
        Why others are not.
    given : dict of str to tuple of str
        What a value stands on.
    facts : dict of str to object
        What else is known, plain types.
    begin : float
        Of the work, by the clock of this process [s].
    """

    logs: Sequence[Log]
    actuator: Actuator
    _: KW_ONLY
    fidelity: str | None = "auto"
    progress: Progress | None = None
    levels: dict[str, Estimate] = field(default_factory=dict, init=False)
    reasons: dict[str, str] = field(default_factory=dict, init=False)
    given: dict[str, tuple[str, ...]] = field(default_factory=dict, init=False)
    facts: dict[str, Any] = field(default_factory=dict, init=False)
    begin: float = field(default_factory=clock.perf_counter, init=False)

    def go(self, fraction: float) -> None:
        """Report progress; stop where it says so."""
        if self.progress is not None and self.progress(fraction) is False:
            raise Interrupted("calibration stopped")

    def add(self, levels: Mapping[str, Estimate], reasons: Mapping[str, str] | None = None) -> None:
        """Take over what a stage determined, and why it did not the rest.

        What the model cannot hold (a resistance below zero) is noise, and says so.
        """
        possible = {path: item for path, item in levels.items() if self._holds(path, item)}
        self.levels |= possible
        self.reasons |= dict.fromkeys(levels.keys() - possible.keys(), _IMPOSSIBLE)
        self.reasons |= {p: why for p, why in (reasons or {}).items() if p not in self.levels}
        for path in possible:
            self.reasons.pop(path, None)

    def _holds(self, path: str, item: Estimate) -> bool:
        record = record_of(self.actuator.wiring, path)
        low = item.value > record.minimum if record.minimum_open else item.value >= record.minimum
        high = item.value < record.maximum if record.maximum_open else item.value <= record.maximum
        return low and high

    def stands_on(self, paths: Sequence[str], given: tuple[str, ...]) -> None:
        """Note what values of some paths stand on, beside what they do already."""
        for path in paths:
            self.given[path] = (*self.given.get(path, ()), *given)

    def given_value(self, path: str) -> float:
        """Return the value before."""
        return self.actuator.parameters.value(path)

    def value(self, path: str) -> float:
        """Return what is determined by now, else what is given."""
        item = self.levels.get(path)
        return self.given_value(path) if item is None else item.value

    @property
    def progress_of_runs(self) -> Progress | None:
        """Of model runs in the middle of a stage."""
        return part(self.progress, 0.5, 0.9)

    @cached_property
    def ratio(self) -> float:
        """Motor angle over a servo's travel, rad/m."""
        return motor_ratio(self.actuator)

    def settled(self) -> Actuator:
        """Return the actuator as the stages so far have it, for what is only read from it."""
        values: dict[str, str | float] = {p: item.value for p, item in self.levels.items()}
        return self.actuator.with_values(values, source="calibration")

    def calibration(
        self,
        fitted: Actuator,
        estimates: Iterable[Estimate],
        undetermined: Mapping[str, str],
        *,
        logs: tuple[LogFacts, ...] | None = None,
        facts: Mapping[str, object] | None = None,
        findings: tuple[str, ...] = (),
        promise: Validation | None = None,
        validation: Validation | None = None,
    ) -> Calibration:
        """Return the answer, with the actuator before and the time it took.

        Parameters
        ----------
        fitted : Actuator
            With the estimates.
        estimates : iterable of Estimate
            What is determined.
        undetermined : mapping of str to str
            What is not, and why.
        logs, facts, findings, promise, validation
            As in `Calibration`; by default the logs' names and rates, and what the stages noted.
        """
        self.go(1.0)
        return Calibration(
            actuator=fitted, before=self.actuator, findings=findings, promise=promise,
            logs=log_facts(self.logs) if logs is None else logs, validation=validation,
            parameters={item.path: item for item in estimates}, undetermined=undetermined,
            facts=self.facts if facts is None else facts,
            wall_s=clock.perf_counter() - self.begin,
        )  # fmt: skip

    def answer(self, free: Sequence[str] | None) -> tuple[list[Estimate], dict[str, str]]:
        """Return the estimates, those requested only, and the rest with its reasons.

        Raises
        ------
        InputError
            Nothing is determined, or not what was requested.
        """
        estimates = []
        for path, level in self.levels.items():
            if not level.std < _WIDE * abs(level.value):
                self.reasons[path] = _NOISE
            elif free is None or path in free:
                given = self.given.get(path, ())
                estimates.append(named(level, path, self.actuator, given=given))
        present = {item.path for item in estimates}
        for path in free or ():
            if path not in present:
                why = self.reasons.get(path, "nothing in the logs speaks of it")
                raise InputError(f"--free {path}: {why}")
        if not estimates:
            text = "; ".join(list(dict.fromkeys(self.reasons.values()))[:3])
            raise InputError(f"the logs determine no parameter: {text}")
        order = {path: k for k, path in enumerate(self.actuator.parameters)}
        estimates.sort(key=lambda item: order[item.path])
        missing = {p: self.reasons[p] for p in sorted(self.reasons, key=lambda p: order[p])}
        return estimates, {} if free is not None else missing


@dataclass(frozen=True)
class Balance:
    """What a balance of torques determines, why it does not the rest, and its residual [SI]."""

    levels: dict[str, Estimate]
    reasons: dict[str, str]
    residual: float


@dataclass(frozen=True)
class Stage(Generic[C]):
    """A part of a calibration; it says itself why the logs do not show what it gives.

    Attributes
    ----------
    name : str
        Of the stage.
    of : str
        A parameter that an actuator has which the stage can serve.
    needs : str
        Roles and excitation that it needs, in words.
    gives : str
        What it determines, in words.
    run : callable
        Reads the context and adds to it.
    """

    name: str
    of: str
    needs: str
    gives: str
    run: Callable[[C], None]


def stages_of(flow: str, runs: Mapping[str, Callable[[C], None]]) -> tuple[Stage[C], ...]:
    """Return the stages of a flow; what each needs and gives stands in ``stages.toml``."""
    rows = packaged_toml("elevon.calibrate.stages", "stages.toml")[flow]
    return tuple(Stage(name, run=run, **rows[name]) for name, run in runs.items())


def run_stages(stages: Sequence[Stage[C]], context: C, first: float, last: float) -> None:
    """Run the stages that serve an actuator, between two fractions of the work."""
    known = records(context.actuator.wiring)
    serving = [stage for stage in stages if stage.of in known]
    for number, stage in enumerate(serving):
        context.go(first + (last - first) * number / len(serving))
        stage.run(context)
