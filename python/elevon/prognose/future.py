"""Monte Carlo of what is to come: when each possible unit fails, and which requirement first."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.plain import Plain
from elevon.prognose.mission import Usage
from elevon.prognose.observation import governing
from elevon.prognose.process import Process, UnitPopulation
from elevon.prognose.requirement import SEVERITY

MODEL_ERROR = 0.008
"""Deviation of what the calibrated model says of a requirement, over its threshold. Measured on
units of other values, calibrated to about 1 %, against the switching model at the true end of
life: 0.8 % (23 histories). A limit on a severity itself has none."""
LASTING = 0.5
"""Share of the square of `MODEL_ERROR` that a unit keeps as its faults grow, so that what is
measured early says it of the end. ASSUMED; in three lives of the histories the error changed by
0.5 % along the life, about a mean of as much and more."""
_STEP = 0.02  # of the way to the greatest severity, for the fastest tenth of the units alive
_FIRST = 0.5  # of a step is the first one: of a new unit, dormant faults may begin behind it
_MOST_STEPS = 1500
_COURSE = 3  # steps from one point of the severities' course to the next
_FARTHEST = 1e7  # repetitions: beyond, no end of life is in sight
_FAR = 20.0  # times the median of the ends: the same
_QUANTILES = (0.05, 0.5, 0.95)


@dataclass(frozen=True)
class Future(Plain):
    """Ends of life.

    Attributes
    ----------
    usage : float
        Use at which the prediction was made.
    end : ndarray, shape (n,)
        Use at the end of life; infinite where none is in sight.
    first : ndarray of int, shape (n,)
        Requirement that failed first; -1 where none did.
    at : ndarray, shape (s,)
        Uses at which the severities' course is kept.
    course : ndarray, shape (s, k, 3)
        5, 50, 95 % of the severities, of units that failed as they were then.
    """

    usage: float
    end: Floats
    first: npt.NDArray[np.intp]
    at: Floats
    course: Floats

    @property
    def remaining(self) -> Floats:
        """Remaining useful life of each sample, 0 or more."""
        return np.maximum(self.end - self.usage, 0.0)


def look_ahead(
    process: Process,
    units: UnitPopulation,
    usage: Usage,
    rng: np.random.Generator,
    *,
    model_error: float = 0.0,
    course: bool = True,
) -> Future:
    """Let units be used until they fail.

    Parameters
    ----------
    process : Process
        How they grow.
    units : UnitPopulation
        Now.
    usage : Usage
        Of the future: the factor on the loads is drawn once a unit.
    rng : Generator
        Of chance.
    model_error : float
        See `MODEL_ERROR`; one of each unit and requirement.
    course : bool
        Whether the severities' course is kept, which takes a sixth of the time; else it is where
        they stand now.
    """
    off = _model_errors(process, units, model_error, rng)
    load = usage.load * np.exp(usage.load_spread * rng.standard_normal(len(units)))
    fleet = _Fleet(process, units, load, off)
    at, courses = [units.usage], [_quantiles(process, fleet.damage)]
    for number in range(_MOST_STEPS):
        if fleet.done(units.usage):
            break
        fleet.use(1.0 if number else _FIRST, rng)
        if course and number % _COURSE == 0:
            at.append(fleet.usage)
            courses.append(_quantiles(process, fleet.damage))
    if course and at[-1] < fleet.usage:
        at.append(fleet.usage)
        courses.append(_quantiles(process, fleet.damage))
    return Future(units.usage, fleet.end, fleet.first, np.array(at), np.array(courses))


class _Fleet:
    """Units in use, and the ends of those that have failed.

    Parameters
    ----------
    process, units
        As in `look_ahead`.
    load : ndarray, shape (n,)
        Factor on the loads of each unit.
    off : ndarray, shape (m, n)
        Of `_model_errors`.
    """

    def __init__(self, process: Process, units: UnitPopulation, load: Floats, off: Floats) -> None:
        count = len(units)
        self.process, self.now, self._load, self._off = process, units, load, off
        self.end, self.first = np.full(count, np.inf), np.full(count, -1, dtype=np.intp)
        self.damage = units.damage.copy()
        self._alive = np.arange(count)
        reserve, self._drivers = self._state(units.damage)
        failed = reserve.min(axis=0) < 0.0
        self.end[failed], self.first[failed] = units.usage, reserve[:, failed].argmin(axis=0)
        self._leave(failed, reserve)

    @property
    def usage(self) -> float:
        """Of those that are still in use."""
        return self.now.usage

    def done(self, since: float) -> bool:
        """Whether all have failed, or the rest has no end in sight."""
        return not len(self._alive) or _out_of_sight(self.usage - since, self.end - since)

    def use(self, share: float, rng: np.random.Generator) -> None:
        """Go on by a share of the step that the growth of the fastest asks for."""
        load, now = self._load[self._alive], self.now
        rate = self.process.rate(now, now.damage, load, self._drivers)
        step = _step(self.process, rate) * share
        self.now = self.process.advance(now, step, rng, load, rate)
        after, self._drivers = self._state(self.now.damage)
        failed = after.min(axis=0) < 0.0
        if failed.any():
            part, which = crossing(self._reserve[:, failed], after[:, failed])
            gone = self._alive[failed]
            self.end[gone], self.first[gone] = now.usage + part * step, which
        self.damage[self._alive] = self.now.damage
        self._leave(failed, after)

    def _state(self, damage: Floats) -> tuple[Floats, dict[str, Floats]]:
        """Return reserves, shape (m, a), and exposure of those that are still in use."""
        severity = self.process.severity(damage)
        reserve, drivers = self.process.response.state(severity, self._load[self._alive])
        return reserve + self._off[:, self._alive], drivers

    def _leave(self, failed: npt.NDArray[np.bool_], reserve: Floats) -> None:
        """Take units that have failed out of use."""
        self._alive, self._reserve = self._alive[~failed], reserve[:, ~failed]
        if failed.any():
            self.now = self.now.picked(np.flatnonzero(~failed))
            self._drivers = {name: x[~failed] for name, x in self._drivers.items()}


def _model_errors(
    process: Process, units: UnitPopulation, deviation: float, rng: np.random.Generator
) -> Floats:
    """Return the model's error of each unit's requirements, shape (m, n), in thresholds.

    Drawn, or what the units carry where requirements have been measured.
    """
    count, requirements = len(units), process.response.requirements
    measured = [r.measure != SEVERITY for r in requirements]
    if deviation == 0.0:
        return np.zeros((len(measured), count))
    off = rng.standard_normal((len(measured), count))
    if units.off.shape[2]:
        for item in (r for r in requirements if r.measure != SEVERITY):
            r, k = governing(process.response, item.name)
            off[r] = np.sqrt(LASTING) * units.off[:, k, r] + np.sqrt(1.0 - LASTING) * off[r]
    return np.asarray(deviation * np.array(measured, dtype=np.float64)[:, None] * off)


def _out_of_sight(more: float, ends: Floats) -> bool:
    """Whether most have failed long ago, so that the rest has no end in sight."""
    median = float(np.median(ends))
    long_ago = np.isfinite(median) and more > _FAR * max(median, 1e-12)
    return bool(long_ago) or more > _FARTHEST


def _step(process: Process, rate: Floats) -> float:
    """Repetitions in which the fastest units go a fiftieth of the way to the greatest severity."""
    fast = np.quantile(rate, 0.9, axis=0)
    with np.errstate(divide="ignore"):
        return float(min(np.min(_STEP * process.range / fast), 0.1 * _FARTHEST))


def crossing(before: Floats, after: Floats) -> tuple[Floats, npt.NDArray[np.intp]]:
    """Return the share of a step at which the first reserve is gone, and which it is.

    Parameters
    ----------
    before, after : ndarray, shape (m, n)
        Reserves of m requirements before and after the step, of units that failed in it.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(after < 0.0, before / (before - after), np.inf)
    which = share.argmin(axis=0)
    return np.clip(share.min(axis=0), 0.0, 1.0), which


def _quantiles(process: Process, damage: Floats) -> Floats:
    severity = process.severity(damage)
    return np.asarray(np.quantile(severity, _QUANTILES, axis=0)).T


_STEPS = 400  # a life, about
_MOST = 4000


@dataclass(frozen=True)
class Life:
    """One unit's life.

    Attributes
    ----------
    usage : ndarray, shape (s,)
        From 0 to the end of life.
    severity : ndarray, shape (s, k)
        Of each law's fault.
    end : float
        Use at the end of life.
    first : int
        Requirement that failed.
    """

    usage: Floats
    severity: Floats
    end: float
    first: int

    def at(self, usage: float) -> Floats:
        """Return the severities at a use, shape (k,)."""
        return np.array([np.interp(usage, self.usage, column) for column in self.severity.T])


def run_to_failure(process: Process, unit: UnitPopulation, rng: np.random.Generator) -> Life:
    """Use one unit until it fails.

    Parameters
    ----------
    process : Process
        How it grows, and what it must hold.
    unit : UnitPopulation
        One unit.
    rng : Generator
        Of chance.

    Raises
    ------
    InputError
        It does not fail within ten times its expected life.
    """
    if len(unit) != 1:
        raise InputError("a life is that of one unit")
    usage, severity = [unit.usage], [process.severity(unit.damage)[0]]
    before = process.response.reserve(process.severity(unit.damage))
    one = np.ones(1)
    for _ in range(_MOST):
        rate = process.rate(unit, unit.damage, one)[0]
        with np.errstate(divide="ignore"):
            step = float(np.min(process.range / (_STEPS * rate)))
        if not np.isfinite(step):
            break
        unit = process.advance(unit, step, rng)
        severities = process.severity(unit.damage)
        after = process.response.reserve(severities)
        usage.append(unit.usage)
        severity.append(severities[0])
        if after.min() < 0.0:
            return _ended(usage, severity, before, after)
        before = after
    raise InputError("the unit does not fail: no law brings it to a requirement's limit")


def _ended(usage: list[float], severity: list[Floats], before: Floats, after: Floats) -> Life:
    """Cut the last step where the first requirement fails."""
    share, first = crossing(before, after)
    end = usage[-2] + float(share[0]) * (usage[-1] - usage[-2])
    last = severity[-2] + share[0] * (severity[-1] - severity[-2])
    return Life(np.array([*usage[:-1], end]), np.array([*severity[:-1], last]), end, int(first[0]))
