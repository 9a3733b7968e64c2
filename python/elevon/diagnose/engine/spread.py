"""Spread from day to day and mismatch of model and machine: what is known of them.

Each is a factor of a variance that the package states: scaled inverse chi-square, worth so many
runs. A threshold by draws includes what is not known of it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np

from elevon.arrays import Floats

_REMEMBERED = 8  # arrays; one of a servo's features takes 3 MB


@lru_cache(maxsize=_REMEMBERED)
def normal(count: int, width: int, seed: tuple[int, ...]) -> Floats:
    """Draw of the standard normal distribution, shape (count, width)."""
    out = np.random.default_rng(seed).standard_normal((count, width))
    out.flags.writeable = False
    return out


@lru_cache(maxsize=_REMEMBERED)
def chi_square(count: int, degrees: tuple[float, ...], seed: tuple[int, ...]) -> Floats:
    """Draw of chi-square, a column for each number of degrees, shape (count, k)."""
    out = np.random.default_rng(seed).chisquare(degrees, (count, len(degrees)))
    out.flags.writeable = False
    return out


@lru_cache(maxsize=_REMEMBERED)
def uniform(count: int, seed: tuple[int, ...]) -> Floats:
    """Draw between nought and one, shape (count,)."""
    out = np.random.default_rng(seed).random(count)
    out.flags.writeable = False
    return out


DEGREES = 10.0  # ASSUMED: worth of the stated spread, and of the stated mismatch, in runs
#: ASSUMED: the same of a feature by itself, beside the factor that all features have in common.
STATED = 20.0
#: Of the factor that all features' variances have in common, each as likely. ASSUMED: so wide that
#: one baseline decides; a factor below one is none, as the stated deviations are least ones.
_FACTORS = np.geomspace(1.0, 100.0, 61)
_FAR = 3.0  # ASSUMED: as `STATED`, of an offset: one feature that is far off is no matter of all
_ENDS = (0.05, 0.95)
_INTERVAL_DRAWS = 4000  # draws of an interval that is printed


class VarianceFactor(NamedTuple):
    """A mean square over the stated variance, and how many runs it was taken over."""

    value: float = 1.0
    runs: float = 0.0


class FeatureSpread(NamedTuple):
    """What healthy logs showed of one feature: its steps from day to day, the model's mismatch.

    Attributes
    ----------
    days, mismatch : VarianceFactor
        Mean squares; of no runs where nothing was seen.
    worth : float
        Runs that the stated spread is worth beside them: fewer where units differ.
    """

    days: VarianceFactor = VarianceFactor()
    mismatch: VarianceFactor = VarianceFactor()
    worth: float = STATED


class KnownSpread(NamedTuple):
    """What is known of features before baselines, shape (k,) each, as `StepVariance` has it.

    Attributes
    ----------
    worth, scatter, free : ndarray, shape (k,)
        Of the steps from day to day.
    mismatch_scatter, mismatch_free : ndarray, shape (k,)
        Of the units' offsets.
    learnt : bool
        Whether it was learnt: then the offsets' size is apart from the steps'.
    """

    worth: Floats
    scatter: Floats
    free: Floats
    mismatch_scatter: Floats
    mismatch_free: Floats
    learnt: bool = False


@dataclass(frozen=True)
class StepVariance:
    """Variances of a unit's steps from day to day over the stated ones: what is known of them.

    Each feature's is a factor that all features have in common, times one of its own (scaled
    inverse chi-square about one). Healthy days tell both: few of them the common one well, as
    every feature counts for it. Offsets of units from the model are known in the same form.

    Attributes
    ----------
    worth : ndarray, shape (k,)
        Runs that the prior of a feature's own factor is worth.
    scatter : ndarray, shape (k,)
        Sum of squares of days about their mean, over the stated variance.
    free : ndarray, shape (k,), or float
        Its degrees of freedom.
    common : ndarray, shape (m,)
        Probability of each of `_FACTORS`; none: there is no common factor.
    """

    worth: Floats
    scatter: Floats
    free: Floats | float = 0.0
    common: Floats = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(
        cls,
        worth: Floats,
        scatter: Floats,
        free: Floats | float,
        alone: Floats | None = None,
        alone_free: Floats | float = 1.0,
    ) -> StepVariance:
        """Weigh a common factor by healthy days.

        Parameters
        ----------
        worth, scatter, free
            As above.
        alone : ndarray, shape (k,), optional
            Sum of squares of units' means less the model's, over its stated variance.
        alone_free : ndarray, shape (k,), or float
            Its degrees of freedom.
        """
        log = _log_likelihood(scatter, free, worth)
        if alone is not None:
            log = log + _log_likelihood(alone, alone_free, np.minimum(worth, _FAR))
        weight = np.exp(log - log.max())
        return cls(worth, scatter, free, weight / weight.sum())

    @property
    def value(self) -> Floats:
        """The factors, shape (k,)."""
        middle = 1.0 / float(np.sum(self.common / _FACTORS)) if len(self.common) else 1.0
        return np.asarray((self.worth * middle + self.scatter) / (self.worth + self.free))

    def drawn(self, count: int, seed: int) -> tuple[Floats, Floats]:
        """Draw factors, shape (count, k), and the common one of each draw, shape (count, 1)."""
        common = np.ones((count, 1))
        if len(self.common):
            at = np.searchsorted(np.cumsum(self.common), uniform(count, (seed, 0)))
            common = _FACTORS[np.minimum(at, len(_FACTORS) - 1)][:, None]
        square = chi_square(count, tuple((self.worth + self.free).tolist()), (seed, 1))
        return (self.worth * common + self.scatter) / square, common

    def roots(self) -> Floats:
        """Return the deviations over the stated ones: middle and 90 % interval, shape (3, k)."""
        factors, _ = self.drawn(_INTERVAL_DRAWS, 5)
        return np.asarray(np.sqrt(np.quantile(factors, (0.5, *_ENDS), axis=0)), dtype=np.float64)


def _log_likelihood(scatter: Floats, free: Floats | float, tail: Floats) -> Floats:
    """Log likelihood of each common factor by sums of squares, which follow Fisher's law."""
    from scipy.stats import f as fisher

    degrees = np.broadcast_to(np.asarray(free, dtype=np.float64), scatter.shape)
    seen = degrees > 0.0
    ratio = np.maximum(scatter[seen] / degrees[seen], 1e-9) / _FACTORS[:, None]
    each = fisher.logpdf(ratio, degrees[seen], tail[seen]) - np.log(_FACTORS)[:, None]
    return np.asarray(each.sum(axis=1), dtype=np.float64)


class HeldOutLog(NamedTuple):
    """A learnt log's chance by what the others say.

    Attributes
    ----------
    test, group : int
        Its test; its unit, or its day where all logs are of one unit.
    alone, based : float
        Chance that draws give it without a baseline, and with one of another day; of none: one.
    """

    test: int
    group: int
    alone: float
    based: float


@dataclass(frozen=True)
class LearnedSpread:
    """Spread of healthy units, learnt from their logs.

    Attributes
    ----------
    actuator : str
        Name of the actuator file that the logs were held against.
    logs, units, days : int
        Learnt from; a unit's days are counted apart from another's.
    features : mapping of str to FeatureSpread
        By name; the stated ones hold where a feature is missing.
    held_out : tuple of HeldOutLog
        Every learnt log.
    """

    actuator: str = ""
    logs: int = 0
    units: int = 0
    days: int = 0
    features: Mapping[str, FeatureSpread] = field(default_factory=dict)
    held_out: tuple[HeldOutLog, ...] = ()

    def of(self, names: Sequence[str]) -> KnownSpread:
        """Return what is known of features."""
        rows = [self.features.get(name, FeatureSpread()) for name in names]
        table = np.array([[r.worth, *r.days, *r.mismatch] for r in rows], dtype=np.float64)
        worth, days, runs, mismatch, units = table.reshape(-1, 5).T
        return KnownSpread(worth, days * runs, runs, mismatch * units, units, learnt=True)

    def deviations(self) -> dict[str, Floats]:
        """Return deviations over the stated ones by name, shape (6,).

        From day to day, and of the mismatch: middle, ends of its 90 % interval.
        """
        known = self.of(tuple(self.features))
        days, offsets = variances(known)
        return dict(zip(self.features, np.vstack([days.roots(), offsets.roots()]).T, strict=True))

    @property
    def groups(self) -> int:
        """Units of the test that fewest were learnt of, or days where all are of one unit."""
        tests = {row.test for row in self.held_out}
        return min((len({r.group for r in self.held_out if r.test == t}) for t in tests), default=0)

    def enough(self, rate: float) -> bool:
        """Whether a conformal threshold reaches a rate of false alarms."""
        return self.groups >= needed(rate)

    def rank(self, chance: float, baselines: int, rate: float) -> float:
        """Return how often a healthy log has such a chance, by its rank among held-out ones.

        It holds for a unit, or for a day of the one unit, that is exchangeable with theirs,
        whatever the features' distribution (Vovk, Gammerman and Shafer, 2005, chapter 2). A
        group's logs share one weight. Which of the tests a log is of nobody says: the largest
        holds for each. Where it does not reach the rate it is nought.
        """
        if not self.enough(rate):
            return 0.0
        below: dict[tuple[int, int], list[bool]] = {}
        for row in self.held_out:
            seen = (row.based if baselines else row.alone) <= chance
            below.setdefault((row.test, row.group), []).append(seen)
        tests = {test for test, _ in below}
        shares = [[float(np.mean(x)) for (t, _), x in below.items() if t == k] for k in tests]
        return max((1.0 + sum(each)) / (len(each) + 1.0) for each in shares)

    def threshold_text(self, rate: float, logs: int = 1) -> str:
        """Say what a threshold stands on; several logs at once have no rank."""
        of = "units" if self.units > 1 else "days"
        how = "by draws of what is not known of the spread"
        if logs == 1 and self.enough(rate):
            how += ", and conformal: an alarm passes both"
        return (
            f"threshold {how}; {self.groups} healthy {of} of each test were learnt, a conformal "
            f"one at {100.0 * rate:g} % needs {needed(rate)}{' and one log' * (logs > 1)}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        rows = {
            name: [row.days.value, row.days.runs, row.mismatch.value, row.mismatch.runs, row.worth]
            for name, row in self.features.items()
        }
        return {
            "actuator": self.actuator, "logs": self.logs, "units": self.units, "days": self.days,
            "held_out": [list(row) for row in self.held_out], "features": rows,
        }  # fmt: skip

    @classmethod
    def from_dict(cls, data: Mapping[str, Any]) -> LearnedSpread:
        """Read what `to_dict` gave.

        Raises
        ------
        ValueError, TypeError, KeyError
            A key is missing, or a value is none of a spread.
        """
        held_out = tuple(
            HeldOutLog(int(test), int(group), float(alone), float(based))
            for test, group, alone, based in data["held_out"]
        )
        return cls(
            str(data["actuator"]), int(data["logs"]), int(data["units"]), int(data["days"]),
            {str(name): _row(name, row) for name, row in data["features"].items()}, held_out,
        )  # fmt: skip


def variances(
    known: KnownSpread,
    scatter: Floats | float = 0.0,
    free: float = 0.0,
    alone: Floats | None = None,
) -> tuple[StepVariance, StepVariance]:
    """Return what is known of steps from day to day and of offsets, with baselines' scatter.

    Of the stated spread baselines tell one common factor of both; without a baseline there is
    none. Of a learnt one each has its own, which the learnt logs tell as well.

    Parameters
    ----------
    known : KnownSpread
        Before baselines.
    scatter, free, alone
        As in `StepVariance.of`, of the baselines.
    """
    total, degrees = known.scatter + scatter, known.free + free
    stated_worth = np.full(len(known.worth), STATED)
    if not known.learnt:
        steps = StepVariance(known.worth, total, degrees)
        if alone is not None or free > 0.0:
            steps = StepVariance.of(known.worth, total, degrees, alone)
        return steps, StepVariance(stated_worth, known.mismatch_scatter, known.mismatch_free)
    off, units = known.mismatch_scatter, known.mismatch_free
    if alone is not None:
        off, units = off + alone, units + 1.0
    none = np.zeros(len(off))
    common = StepVariance.of(stated_worth, none, 0.0, off, units).common
    offsets = StepVariance(stated_worth, known.mismatch_scatter, known.mismatch_free, common)
    return StepVariance.of(known.worth, total, degrees), offsets


def stated(count: int) -> KnownSpread:
    """Return what is known of features whose spread was not learnt."""
    none = np.zeros(count)
    return KnownSpread(np.full(count, STATED), none, none, none, none)


def needed(rate: float) -> int:
    """Return how many healthy days or units a conformal threshold needs.

    The least n of 1/(n + 1) <= rate.

    >>> needed(0.05), needed(0.01)
    (19, 99)
    """
    return max(math.ceil(1.0 / rate - 1e-9) - 1, 1)


def _row(name: str, row: Sequence[float]) -> FeatureSpread:
    days, runs, mismatch, units, worth = map(float, row)
    known = all(math.isfinite(v) and v >= 0.0 for v in (days, runs, mismatch, units))
    if not known or not (math.isfinite(worth) and worth > 0.0):
        raise ValueError(
            f"{name}: mean squares and runs must be nought or more, worth above it, not {row}"
        )
    return FeatureSpread(VarianceFactor(days, runs), VarianceFactor(mismatch, units), worth)
