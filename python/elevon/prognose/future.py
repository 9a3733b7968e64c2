"""Monte Carlo of what is to come: when each possible unit fails, and which requirement first."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.plain import Plain
from elevon.prognose.mission import Usage
from elevon.prognose.observation import governing
from elevon.prognose.process import ONSET, Process, UnitPopulation
from elevon.prognose.requirement import SEVERITY

MODEL_ERROR = 0.008
"""Deviation of what the calibrated model says of a requirement, over its threshold. Measured on
units of other values, calibrated to about 1 %, against the switching model at the true end of
life: 0.8 % (23 histories). A limit on a severity itself has none."""
LASTING = 0.5
"""Share of the square of `MODEL_ERROR` that a unit keeps as its faults grow, so that what is
measured early says it of the end. ASSUMED; in three lives of the histories the error changed by
0.5 % along the life, about a mean of as much and more."""
HORIZON = 1e7
"""Repetitions beyond which no end of life is in sight."""
_STEP = 0.02  # of the way from new to the end of life, that each unit goes in one step
_LIFE, _LATER = 0.1, 0.15  # of a life, and of the use since the prediction: longest step
_MOST_STEPS = 600
_POINTS = 40  # of the severities' course
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
        Whether the severities' course is kept; else it is where they stand now.
    """
    off = _model_errors(process, units, model_error, rng)
    load = usage.load * np.exp(usage.load_spread * rng.standard_normal(len(units)))
    fleet = _Fleet(process, units, load, off, rng)
    uses, damages = [fleet.usage.copy()], [fleet.damage.copy()]
    for _ in range(_MOST_STEPS):
        if not fleet.alive:
            break
        fleet.use(rng)
        if course:
            uses.append(fleet.usage.copy())
            damages.append(fleet.damage.copy())
    at = _times(fleet.end - units.usage, units.usage) if course else np.array([units.usage])
    courses = _courses(process, np.array(uses), np.array(damages), at)
    return Future(units.usage, fleet.end, fleet.first, at, courses)


class _Fleet:
    """Units in use, each on a clock of its own, and the ends of those that have failed.

    Parameters
    ----------
    process, units
        As in `look_ahead`.
    load : ndarray, shape (n,)
        Factor on the loads of each unit.
    off : ndarray, shape (m, n)
        Of `_model_errors`.
    rng : Generator
        Of chance: when faults begin that are not there yet.
    """

    def __init__(
        self, process: Process, units: UnitPopulation, load: Floats, off: Floats,
        rng: np.random.Generator,
    ) -> None:  # fmt: skip
        count = len(units)
        self.process, self.now, self._load, self._off = process, units, load, off
        self.end, self.first = np.full(count, np.inf), np.full(count, -1, dtype=np.intp)
        self.damage, self.usage = units.damage.copy(), np.full(count, units.usage)
        self._new = np.array([law.start for law in process.laws])
        # A fault that is not there begins at a rate for each e-fold of use; in a new unit, never.
        folds = rng.standard_exponential(units.active.shape) / ONSET
        self._onset = np.where(units.active, 0.0, units.usage * np.exp(np.minimum(folds, 600.0)))
        self._onset[~units.active & (units.usage <= 0.0)] = np.inf
        self._since, self._last = units.usage, units.usage + HORIZON
        self._shortest = _LIFE * min(float(life[0]) for life in process.lives)
        self._alive = np.arange(count)
        reserve, self._drivers = self._state(units.damage)
        failed = reserve.min(axis=0) < 0.0
        self.end[failed], self.first[failed] = units.usage, reserve[:, failed].argmin(axis=0)
        self._leave(failed, reserve)

    @property
    def alive(self) -> bool:
        """Whether any unit has neither failed nor been used beyond the horizon."""
        return len(self._alive) > 0

    def use(self, rng: np.random.Generator) -> None:
        """Let each unit go on by a step of its own life."""
        load, now = self._load[self._alive], self.now
        rate = self.process.rate(now, now.damage, load, self._drivers)
        with np.errstate(divide="ignore"):
            step = np.min(_STEP * self.process.range / rate, axis=1)
        before = self.usage[self._alive]
        # Rates that wander do so with use, however slowly the fault grows.
        step = np.minimum(step, np.maximum(self._shortest, _LATER * (before - self._since)))
        if not now.active.all():
            waiting = np.where(now.active, np.inf, self._onset[self._alive] - before[:, None])
            step = np.minimum(step, waiting.min(axis=1))
        step = np.minimum(step, self._last - before)
        self.now = self.process.advance(now, step, rng, load, rate)
        self.usage[self._alive] = before + step
        if not now.active.all():
            self._begin()
        after, self._drivers = self._state(self.now.damage)
        failed = after.min(axis=0) < 0.0
        if failed.any():
            part, which = crossing(self._reserve[:, failed], after[:, failed])
            gone = self._alive[failed]
            self.end[gone], self.first[gone] = before[failed] + part * step[failed], which
            self.usage[gone] = self.end[gone]
        self.damage[self._alive] = self.now.damage
        self._leave(failed | (self.usage[self._alive] >= self._last), after)

    def _begin(self) -> None:
        """Let faults begin whose time has come."""
        begun = ~self.now.active & (self._onset[self._alive] <= self.usage[self._alive, None])
        damage = np.where(begun & (self.now.damage <= 0.0), self._new, self.now.damage)
        self.now = replace(self.now, active=self.now.active | begun, damage=damage)

    def _state(self, damage: Floats) -> tuple[Floats, dict[str, Floats]]:
        """Return reserves, shape (m, a), and exposure of those that are still in use."""
        severity = self.process.severity(damage)
        reserve, drivers = self.process.response.state(severity, self._load[self._alive])
        return reserve + self._off[:, self._alive], drivers

    def _leave(self, gone: npt.NDArray[np.bool_], reserve: Floats) -> None:
        """Take units out of use that have failed or reached the horizon."""
        self._alive, self._reserve = self._alive[~gone], reserve[:, ~gone]
        if gone.any():
            self.now = self.now.picked(np.flatnonzero(~gone))
            self._drivers = {name: x[~gone] for name, x in self._drivers.items()}


def _times(remaining: Floats, since: float) -> Floats:
    """Return uses at which the severities' course is kept: as densely as lives end."""
    finite = remaining[np.isfinite(remaining)]
    if not len(finite):
        return since + np.linspace(0.0, HORIZON, _POINTS)
    ends = np.quantile(finite, np.linspace(0.0, 0.99, _POINTS // 2))
    even = np.linspace(0.0, max(float(ends[-2]), 1e-9), _POINTS // 2 + 1)
    return np.asarray(since + np.unique(np.concatenate((even, ends))))


def _courses(process: Process, uses: Floats, damages: Floats, at: Floats) -> Floats:
    """Return quantiles of the severities at some uses, shape (s, k, 3).

    Parameters
    ----------
    uses : ndarray, shape (t, n)
        Use of each unit after each step.
    damages : ndarray, shape (t, n, k)
        Damages there.
    at : ndarray, shape (s,)
        Uses.
    """
    units, out = np.arange(uses.shape[1]), []
    for use in at:
        low = np.clip((uses <= use).sum(axis=0) - 1, 0, max(len(uses) - 2, 0))
        high = np.minimum(low + 1, len(uses) - 1)
        gap = uses[high, units] - uses[low, units]
        share = np.clip((use - uses[low, units]) / np.maximum(gap, 1e-300), 0.0, 1.0)[:, None]
        damage = (1.0 - share) * damages[low, units] + share * damages[high, units]
        out.append(_quantiles(process, damage))
    return np.array(out)


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
