"""Requirements: what the actuator must do, measured on the model with the faults of the moment."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import numpy.typing as npt
from pydantic import BaseModel, ConfigDict, StrictFloat, StrictInt, StrictStr, model_validator

from elevon.arrays import Floats
from elevon.errors import InputError, UnitError, did_you_mean
from elevon.scenario import Scenario
from elevon.units import parse_quantity

Quantity = StrictInt | StrictFloat | StrictStr
SEVERITY = "severity"
FAR = 2.0
"""Largest distance from a limit that is distinguished, in limits."""


@dataclass(frozen=True)
class RunSignals:
    """What a run recorded: `time` and roles, shape (n,) each; ``complete`` unless it tripped."""

    time: Floats
    signals: Mapping[str, Floats]
    complete: bool = True

    def __getitem__(self, role: str) -> Floats:
        return self.signals[role]


@dataclass(frozen=True)
class Measure:
    """How a requirement is measured.

    Attributes
    ----------
    text : str
        What it is.
    unit : str
        SI unit; ``output`` and ``load`` stand for those of the actuator's position and output load.
    roles : tuple of str
        Signals it needs.
    value : callable
        Runs and requirement to the number.
    scenarios : callable or None
        Requirement and mission to the runs it needs; None: the mission itself.
    at_least : bool
        Whether the limit is a least value.
    needs : tuple of str
        Keys that a requirement of this measure must give.
    """

    text: str
    unit: str
    roles: tuple[str, ...]
    value: Callable[[Sequence[RunSignals], Requirement], float]
    scenarios: Callable[[Requirement, Scenario], list[Scenario]] | None = None
    at_least: bool = False
    needs: tuple[str, ...] = ()


class Requirement(BaseModel):
    """One requirement.

    Attributes
    ----------
    name : str
        As it is called in results.
    measure : str
        Key of `MEASURES`, or ``severity``: a bare limit on a fault.
    limit : quantity
        Where it fails.
    margin : float
        Share of the limit that is left unused: life ends that much before it.
    after : float
        s left out at the start of a run.
    amplitude, step, slope, load_slope : quantity, optional
        Of the measure's own runs.
    frequencies : tuple of float
        Hz, of ``bandwidth``.
    fault : str
        ``KIND@PLACE`` of a ``severity``.
    scenario : dict, optional
        Run instead of the mission.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: StrictStr
    measure: StrictStr
    limit: Quantity
    margin: StrictFloat | StrictInt = 0.0
    after: StrictFloat | StrictInt = 0.0
    amplitude: Quantity | None = None
    step: Quantity | None = None
    slope: Quantity | None = None
    load_slope: Quantity | None = None
    frequencies: tuple[StrictFloat | StrictInt, ...] = (0.5, 1.0, 2.0, 4.0, 8.0)
    fault: StrictStr | None = None
    scenario: dict[str, Any] | None = None

    @model_validator(mode="after")
    def _known(self) -> Self:
        if self.measure != SEVERITY and self.measure not in MEASURES:
            names = [*MEASURES, SEVERITY]
            raise ValueError(f"unknown measure {self.measure!r}{did_you_mean(self.measure, names)}")
        if not 0.0 <= self.margin < 1.0:
            raise ValueError(f"margin = {self.margin} is outside 0 to 1")
        needs = ("fault",) if self.measure == SEVERITY else MEASURES[self.measure].needs
        for key in needs:
            if getattr(self, key) is None:
                raise ValueError(f"a requirement of {self.measure} needs {key!r}")
        rising = all(a < b for a, b in zip(self.frequencies, self.frequencies[1:], strict=False))
        if not rising or not self.frequencies or self.frequencies[0] <= 0.0:
            raise ValueError("frequencies must rise from above 0")
        return self

    @property
    def at_least(self) -> bool:
        """Whether the limit is a least value."""
        return self.measure != SEVERITY and MEASURES[self.measure].at_least

    def unit(self, output: str, load: str, faults: Mapping[str, str]) -> str:
        """Return the SI unit of its value on an actuator of these units."""
        if self.measure == SEVERITY:
            if self.fault is None or self.fault not in faults:
                known = ", ".join(faults)
                raise InputError(f"requirement {self.name}: no law drives {self.fault}: {known}")
            return faults[self.fault]
        return {"output": output, "load": load, "output/s": f"{output}/s"}.get(
            MEASURES[self.measure].unit, MEASURES[self.measure].unit
        )

    def threshold(self, unit: str) -> float:
        """Return where life ends: the limit with its margin, in SI."""
        place = f"requirement {self.name}: limit"
        limit = parse_quantity(self.limit, unit, place)
        if not limit > 0.0:
            raise InputError(f"{place} = {self.limit} must be above 0")
        return limit * (1.0 + self.margin if self.at_least else 1.0 - self.margin)

    def reserve(self, value: Floats, threshold: float) -> Floats:
        """Return how far values are from the threshold, in thresholds; negative where it fails."""
        ratio = np.asarray(value) / threshold
        reserve = ratio - 1.0 if self.at_least else 1.0 - ratio
        return np.clip(np.nan_to_num(reserve, nan=-FAR, posinf=FAR, neginf=-FAR), -FAR, FAR)

    def value(self, runs: Sequence[RunSignals]) -> float:
        """Return the number; infinitely bad where a run did not end well."""
        if not all(run.complete for run in runs):
            return -math.inf if self.at_least else math.inf
        return MEASURES[self.measure].value(runs, self)


def _counted(run: RunSignals, requirement: Requirement) -> npt.NDArray[np.bool_]:
    return run.time >= requirement.after


def _tracking(runs: Sequence[RunSignals], requirement: Requirement) -> float:
    run = runs[0]
    error = np.abs(run["command"] - run["output_position"])
    return float(error[_counted(run, requirement)].max())


def _tracking_rms(runs: Sequence[RunSignals], requirement: Requirement) -> float:
    run = runs[0]
    error = (run["command"] - run["output_position"])[_counted(run, requirement)]
    return float(np.sqrt(np.mean(error**2)))


def _current(runs: Sequence[RunSignals], requirement: Requirement) -> float:
    current = runs[0]["torque_current"][_counted(runs[0], requirement)]
    return float(np.sqrt(np.mean(current**2)))


def _current_peak(runs: Sequence[RunSignals], requirement: Requirement) -> float:
    return float(np.abs(runs[0]["torque_current"][_counted(runs[0], requirement)]).max())


def _temperature(runs: Sequence[RunSignals], requirement: Requirement) -> float:
    return float(runs[0]["temperature"][_counted(runs[0], requirement)].max())


def _step_runs(requirement: Requirement, mission: Scenario) -> list[Scenario]:
    terms = [{"kind": "constant", "value": requirement.step}]
    return [_bare_run(mission, 2.0, terms)]


def _overshoot(runs: Sequence[RunSignals], _requirement: Requirement) -> float:
    commanded = float(runs[0]["command"][-1])
    return float(np.max(runs[0]["output_position"] / commanded) - 1.0)


def _rise_time(runs: Sequence[RunSignals], _requirement: Requirement) -> float:
    done = runs[0]["output_position"] / float(runs[0]["command"][-1]) >= 0.9
    return float(runs[0].time[np.argmax(done)]) if done.any() else math.inf


_WINDOW = 0.05  # s over which a speed must hold to count: longer than the sensors' steps


def _no_load_speed(runs: Sequence[RunSignals], _requirement: Requirement) -> float:
    """Greatest speed towards a step without load that holds over a short window."""
    run = runs[0]
    ends = np.interp(run.time + _WINDOW, run.time, run["output_position"])
    whole = run.time + _WINDOW <= run.time[-1]
    travel = np.sign(run["command"][-1]) * (ends - run["output_position"])
    return float(travel[whole].max() / _WINDOW)


_CYCLES = 6.0


def _sine_runs(requirement: Requirement, mission: Scenario) -> list[Scenario]:
    return [
        _bare_run(
            mission,
            max(_CYCLES / f, 1.0),
            [{"kind": "sine", "amplitude": requirement.amplitude, "frequency": f"{f!r} Hz"}],
        )
        for f in map(float, requirement.frequencies)
    ]


def _bandwidth(runs: Sequence[RunSignals], requirement: Requirement) -> float:
    """Frequency at which the amplitude falls to -3 dB, on logarithmic scales between the runs."""
    gains = []
    for run in runs:
        late = run.time >= 0.5 * run.time[-1]
        gains.append(np.ptp(run["output_position"][late]) / np.ptp(run["command"][late]))
    level = np.log(np.maximum(gains, 1e-6) * math.sqrt(2.0))
    octave = np.log(np.asarray(requirement.frequencies, dtype=np.float64))
    below = np.flatnonzero(level < 0.0)
    if not len(below):
        return float(np.exp(octave[-1]))
    k = int(below[0])
    if k == 0:
        return float(np.exp(octave[0]))
    share = level[k - 1] / (level[k - 1] - level[k])
    return float(np.exp(octave[k - 1] + share * (octave[k] - octave[k - 1])))


_STALL_TIME = 12.0


def _stall_runs(requirement: Requirement, mission: Scenario) -> list[Scenario]:
    terms = [{"kind": "ramp", "slope": requirement.slope}]
    load = {"output": {"terms": [{"kind": "ramp", "slope": requirement.load_slope}]}}
    return [_bare_run(mission, _STALL_TIME, terms).replaced(load=load)]


def _stall_load(runs: Sequence[RunSignals], requirement: Requirement) -> float:
    """Load at which the output last moved at a quarter of the commanded speed."""
    run = runs[0]
    speed = np.gradient(run["output_position"], run.time)
    commanded = float(run["command"][-1] / run.time[-1])
    moving = np.flatnonzero(speed > 0.25 * commanded)
    seconds = float(run.time[moving[-1]]) if len(moving) else 0.0
    assert requirement.load_slope is not None
    text = requirement.load_slope
    number = text if not isinstance(text, str) else _slope(text, requirement.name)
    return seconds * float(number)


def _slope(text: str, name: str) -> float:
    place = f"requirement {name}: load_slope"
    try:
        return parse_quantity(text, "N m/s", place)
    except UnitError:
        return parse_quantity(text, "N/s", place)


def _lock_time(runs: Sequence[RunSignals], requirement: Requirement) -> float:
    locked = (runs[0]["locked"] > 0.5) & _counted(runs[0], requirement)
    return float(runs[0].time[np.argmax(locked)]) if locked.any() else math.inf


def _bare_run(mission: Scenario, seconds: float, terms: list[dict[str, Any]]) -> Scenario:
    """Return a run of its own with the mission's parameters, supply and air, without its loads."""
    of_mission = mission.to_dict()
    data: dict[str, Any] = {
        key: of_mission[key] for key in ("parameters", "supply", "ambient") if key in of_mission
    }
    return Scenario.from_dict({**data, "duration": seconds, "command": {"terms": terms}})


_BOTH = ("command", "output_position")
MEASURES: dict[str, Measure] = {
    "tracking_error": Measure("largest tracking error", "output", _BOTH, _tracking),
    "tracking_error_rms": Measure("RMS of the tracking error", "output", _BOTH, _tracking_rms),
    "current": Measure("RMS of the torque current", "A", ("torque_current",), _current),
    "current_peak": Measure("peak of the torque current", "A", ("torque_current",), _current_peak),
    "temperature": Measure(
        "highest winding temperature", "K", ("temperature",), _temperature
    ),
    "overshoot": Measure(
        "overshoot of a step over the step", "1", _BOTH, _overshoot, _step_runs, needs=("step",)
    ),
    "rise_time": Measure(
        "time to nine tenths of a step", "s", _BOTH, _rise_time, _step_runs, needs=("step",)
    ),
    "no_load_speed": Measure(
        "greatest speed of a step without load", "output/s", _BOTH, _no_load_speed, _step_runs,
        at_least=True, needs=("step",),
    ),
    "bandwidth": Measure(
        "frequency at which a sine's amplitude falls to -3 dB", "Hz", _BOTH, _bandwidth, _sine_runs,
        at_least=True, needs=("amplitude",),
    ),
    "stall_load": Measure(
        "output load at which a motion against a rising load stops", "load", _BOTH, _stall_load,
        _stall_runs, at_least=True, needs=("slope", "load_slope"),
    ),
    "lock_time": Measure("time until the down-lock is engaged", "s", ("locked",), _lock_time),
}  # fmt: skip
"""Name to measure."""
