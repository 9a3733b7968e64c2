"""A fault's law of growth as tables: use against severity, and the free rate beside it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.prognose.law import Law

FREE = "free"
"""Name of growth at a rate that follows no law: it is only as smooth as growth is."""

_BELOW, _WITHIN, _BEYOND = 16, 120, 40  # points of the tables: below the start, in life, beyond it
_SLOWEST = 1e-4  # of the mean rate of a life: no table stands still
_COEFFICIENTS = (0.0, -1.2247, 1.2247)  # deviations of a coefficient, of Gauss and Hermite
_WEIGHTS = (2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0)
_LONGEST_LIFE = 1e6
"""Repetitions of a life at a free rate, at most: a law that says nothing grows (a winding that
stays cold) does not hold it back. ASSUMED: more than any unit is used for."""
_KNEE = 0.03
"""Relative severity below which a free rate no longer follows the severity. ASSUMED."""
_LAW_KNEE = 0.25
"""The same of a law's error, over the greatest severity (`Law.form_spread`)."""


@dataclass(frozen=True)
class Shapes:
    """Tables of one fault's growth; n rows (members of the law, then the free rate), p points.

    Attributes
    ----------
    law : str
        Name of the law.
    prior : ndarray, shape (n,)
        Probability of each row; sum 1.
    free : ndarray of bool, shape (n,)
        Rows that follow no law.
    damage, level : ndarray, shape (p,)
        Points, in damage and in *level*: the severity, continued below the least that a fault can
        have, so that growth before a fault shows is a number, too.
    clock : ndarray, shape (n, p)
        Use from the first point on, rising, where the law has no error.
    start, limit : float
        Levels of a new unit and of the end of life that this fault alone brings.
    knee : ndarray, shape (n,)
        Level below which the error of a row no longer follows the level.
    """

    law: str
    prior: Floats
    free: npt.NDArray[np.bool_]
    damage: Floats
    level: Floats
    clock: Floats
    start: float
    limit: float
    knee: Floats

    @property
    def span(self) -> float:
        """Level from new to the end of life."""
        return self.limit - self.start

    @property
    def span_of_damage(self) -> float:
        """Damage from new to the end of life."""
        first, last = np.interp((self.start, self.limit), self.level, self.damage)
        return float(last - first)

    def life(self) -> Floats:
        """Return the use from new to the end of life of each row, shape (n,)."""
        at = [np.interp((self.start, self.limit), self.level, row) for row in self.clock]
        return np.array([end - begin for begin, end in at])

    def rates(self) -> Floats:
        """Return the growth of damage in one repetition between the points, shape (n, p - 1)."""
        return np.asarray(np.diff(self.damage) / np.diff(self.clock, axis=1))

    def logarithm(self, level: Floats, row: npt.NDArray[np.intp]) -> Floats:
        """Return the coordinate that the error of a rate has a slope over, shape of `level`."""
        knee = self.knee[row]
        return np.asarray(np.log1p(np.maximum(level - self.start, 0.0) / knee))


def shapes_of(law: Law, rate: Callable[[Floats, int], Floats], limit: float) -> Shapes:
    """Return the tables of a law's fault.

    Parameters
    ----------
    law : Law
        Its coefficients that differ from unit to unit make one row for each of their points.
    rate : callable
        Damages, shape (p,), and the number of a member of `members` to the law's growth a
        repetition, shape (p,).
    limit : float
        Severity at which this fault alone ends the life.
    """
    damage, level, start = _points(law, limit)
    clocks, prior = _members(law, damage, rate)
    count = len(clocks)
    knee = [_LAW_KNEE * law.highest] * count
    if not law.only:
        life = float(np.diff(np.interp((start, limit), level, clocks[0]))[0])
        first = float(np.interp(start, level, clocks[0]))
        relative = (level - start) / (limit - start)
        even = first + (law.life or min(life, _LONGEST_LIFE)) * _formed(relative, law.form)
        clocks.append(np.where(level < start, clocks[0], even))
        prior = [*(law.trust * p for p in prior), 1.0 - law.trust]
        knee.append(_KNEE * (limit - start))
    return Shapes(
        law.name, np.array(prior), np.arange(len(clocks)) >= count, damage, level,
        np.array(clocks), start, limit, np.array(knee),
    )  # fmt: skip


def _formed(relative: Floats, form: tuple[tuple[float, float], ...]) -> Floats:
    """Return shares of a life at relative severities; beyond those known on as at the last."""
    if not form:
        return relative
    severity, use = np.array(form).T
    pace = (use[-1] - use[-2]) / (severity[-1] - severity[-2])
    beyond = np.maximum(relative - severity[-1], 0.0) * pace
    return np.asarray(np.interp(relative, severity, use) + beyond)


def members(law: Law) -> list[tuple[tuple[float, ...], float]]:
    """Return deviations of the coefficients and prior of each member; the first is the law."""
    out = []
    for picks in product(range(3), repeat=len(law.spreading)):
        factors = tuple(
            _COEFFICIENTS[i] * law.coefficients[name].spread
            for i, name in zip(picks, law.spreading, strict=True)
        )
        out.append((factors, float(np.prod([_WEIGHTS[i] for i in picks]))))
    return out


def _members(
    law: Law, damage: Floats, rate: Callable[[Floats, int], Floats]
) -> tuple[list[Floats], list[float]]:
    """Return the clocks of a law's own members, and their prior."""
    clocks, prior = [], []
    middle = 0.5 * (damage[1:] + damage[:-1])
    for k, (_, share) in enumerate(members(law)):
        pace = rate(middle, k)
        pace = np.maximum(pace, _SLOWEST * max(float(pace.mean()), 1e-300))
        clocks.append(np.concatenate(([0.0], np.cumsum(np.diff(damage) / pace))))
        prior.append(share)
    return clocks, prior


def _points(law: Law, limit: float) -> tuple[Floats, Floats, float]:
    """Return damages, levels, and the level of a new unit."""
    end, first = float(law.damage(np.array([limit]))[0]), law.start
    most = 2.0 * law.highest_damage
    below = np.linspace(0.0, first, _BELOW, endpoint=False) if first > 0.0 else np.zeros(0)
    within = first + (end - first) * np.linspace(0.0, 1.0, _WITHIN) ** 2
    beyond = np.geomspace(end, max(most, 2.0 * end), _BEYOND + 1)[1:]
    damage = np.unique(np.concatenate((below, within, beyond)))
    level = np.array(law.severity(damage))
    visible = int(np.argmax(level > 0.0))
    if visible > 1:  # nothing shows yet: on as at the first point that does
        slope = (level[visible + 1] - level[visible]) / (damage[visible + 1] - damage[visible])
        level[:visible] = level[visible] - slope * (damage[visible] - damage[:visible])
    rising = np.concatenate(([True], np.diff(level) > 0.0))
    damage, level = damage[rising], level[rising]
    return damage, level, float(np.interp(first, damage, level))
