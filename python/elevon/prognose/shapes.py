"""Ways in which one fault may grow: its law's own, and those of no physics, side by side."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.prognose.law import Law

NO_LAW = "no law"
"""Name of growth at an even rate that wanders, a Wiener or gamma process: of whatever it is."""

_BELOW, _WITHIN, _BEYOND = 16, 120, 40  # points of the tables: below the start, in life, beyond it
_SLOWEST = 1e-4  # of the mean rate of a life: no table stands still
_FORMS = (0.0, 0.5, 1.0, 1.7, 2.6)  # of the law's own deviation `form_spread`, one-sided
_COEFFICIENTS = (0.0, -1.2247, 1.2247)  # deviations of a coefficient, of Gauss and Hermite
_WEIGHTS = (2.0 / 3.0, 1.0 / 6.0, 1.0 / 6.0)

#: Prior share of each family, and its members: relative use of a life at relative damage, from a
#: seed of a share of the span.
#: ASSUMED: the law that a mission names is right more often than not; forms of either direction
#: are as likely.
_Form = Callable[[Floats, float], Floats]


def _power(b: float) -> _Form:
    return lambda s, _seed: np.asarray(s ** (1.0 / b))


def _exponential(a: float) -> _Form:
    """Return the use of s = (e^(au) - 1)/(e^a - 1); a below 0 is growth that saturates."""
    return lambda s, _seed: np.asarray(np.log1p(np.maximum(s * np.expm1(a), 1e-9 - 1.0)) / a)


def _paris(half: float) -> _Form:
    """Return the use of growth in proportion to length^half, from a seed [of the span]."""
    q = 1.0 - half
    return lambda s, seed: np.asarray((seed**q - (s + seed) ** q) / (seed**q - (1.0 + seed) ** q))


_SEED = 0.15  # of the span, where a new unit has no damage
_FAMILIES: Mapping[str, tuple[float, tuple[_Form, ...]]] = {
    "linear": (0.012, (lambda s, _seed: s,)),
    "power": (0.018, tuple(_power(b) for b in (0.5, 0.6, 0.75, 1.4, 1.8, 2.4))),
    "exponential": (0.018, tuple(_exponential(a) for a in (-2.0, -1.2, 1.5, 2.5, 4.0))),
    "paris": (0.014, tuple(_paris(m) for m in (1.25, 1.5, 1.75, 2.0))),
    NO_LAW: (0.014, (lambda s, _seed: s,)),
}
_NAMED, _HASTENED, _FREE = range(3)  # groups of rows: columns of a `_Kind`
_LONGEST_LIFE = 1e6
"""Repetitions of a life by growth of no physics, at most: a law that says nothing grows (a winding
that stays cold) does not hold it back. ASSUMED: more than any unit is used for."""


#: By how many e-folds a unit's rate hastens beyond its law until the end of life, with the prior.
#: ASSUMED: an exponent of Paris that is 1 too low is 0.9 of them over a crack's growth by five;
#: what a law leaves out (an edge, impacts, debris) hastens growth near its end.
_WRONG = ((0.6, 0.4), (1.2, 0.4), (2.0, 0.2))


@dataclass(frozen=True)
class _Kind:
    """How evenly rows grow: of the law, of the law with a wrong exponent, of no physics. ASSUMED.

    `share`: prior. `drift`: deviation of the logarithm of the rate over one life. `path`: variance
    of the path over a life, of the square of its damage. `bends`, `ahead`: changes of the rate each
    way, in one life so far and in one to come.
    """

    share: tuple[float, float, float]
    drift: tuple[float, float, float]
    path: tuple[float, float, float]
    bends: tuple[float, float, float]
    ahead: tuple[float, float, float]


_KINDS = (
    _Kind((0.78, 0, 0.72), (0.18, 0, 0.15), (0, 0, 5e-4), (0.03, 0, 0.3), (0.005, 0, 0.3)),
    _Kind((0, 0.2, 0.28), (0, 0.4, 0.4), (0, 0, 1e-4), (0, 0.03, 0.4), (0, 0.03, 0.4)),
    _Kind((0.02, 0, 0), (0.5, 0, 0.5), (0.01, 0, 0.01), (0.5, 0, 0.5), (0.5, 0, 0.5)),
)
#: Where a mission keeps its law alone, it is taken at its word.
_ALONE = (
    _Kind((0.96, 0, 0), (0.06, 0, 0), (0, 0, 0), (0.03, 0, 0), (0.005, 0, 0)),
    _Kind((0.04, 0, 0), (0.5, 0, 0), (0.01, 0, 0), (0.5, 0, 0), (0.5, 0, 0)),
)


@dataclass(frozen=True)
class Shapes:
    """Rows of growth of one fault; n rows, p points.

    Attributes
    ----------
    names : tuple of str
        Family of each row: the law's name, the same with "hastened", or one of no physics.
    prior : ndarray, shape (n,)
        Sum 1.
    damage, level : ndarray, shape (p,)
        Points, in damage and in *level*: the severity, continued below the least that a fault can
        have, so that growth before a fault shows is a number, too.
    clock : ndarray, shape (n, p)
        Use from the first point on, rising, at the growth factor 1.
    drift, grain : ndarray, shape (n,)
        Deviation of the logarithm of the rate over a life; scale of the gamma process [damage].
    start, limit : float
        Levels of a new unit and of the end of life that this fault alone brings.
    spread : ndarray, shape (n,)
        Deviation of the logarithm of the growth factor from unit to unit.
    bends : ndarray, shape (n,)
        Changes of the rate in one life so far, each way.
    ahead : ndarray, shape (n,)
        The same in the life to come.
    """

    names: tuple[str, ...]
    prior: Floats
    damage: Floats
    level: Floats
    clock: Floats
    drift: Floats
    grain: Floats
    start: float
    limit: float
    spread: Floats
    bends: Floats
    ahead: Floats

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


def shapes_of(law: Law, rate: Callable[[Floats, int], Floats], limit: float) -> Shapes:
    """Return the ways in which a law's fault may grow.

    Parameters
    ----------
    law : Law
        The first candidate.
    rate : callable
        Damages, shape (p,), and the number of a member of `members` to the law's growth a
        repetition, shape (p,).
    limit : float
        Severity at which this fault alone ends the life.
    """
    damage, level, start = _points(law, limit)
    member_clocks, members_prior = _members(law, damage, rate)
    life = np.diff(np.interp((start, limit), level, member_clocks[0]))[0]
    names, prior, clocks = [law.name] * len(member_clocks), list(members_prior), list(member_clocks)
    group = [_NAMED] * len(names)
    if not law.only:
        relative = np.maximum((level - start) / (limit - start), 0.0)
        below = level < start
        seed = start / (limit - start) if start > 0.0 else _SEED
        first = float(np.interp(start, level, member_clocks[0]))
        life = min(life, _LONGEST_LIFE)
        clocks += [_hastened(member_clocks[0], relative, folds) for folds, _ in _WRONG]
        names += [f"{law.name}, hastened"] * len(_WRONG)
        named_share = 1.0 - sum(share for share, _ in _FAMILIES.values())
        prior = [named_share * share for share in (*prior, *(share for _, share in _WRONG))]
        group += [_HASTENED] * len(_WRONG)
        for name, (share, forms) in _FAMILIES.items():
            for form in forms:
                use = first + life * form(relative, seed)
                clocks.append(_rising(np.where(below, member_clocks[0], use), life, relative))
                names.append(name)
                group.append(_FREE)
                prior.append(share / len(forms))
    rows = (tuple(names), np.array(group), np.array(prior), np.array(clocks))
    return _of_each_kind(law, rows, (damage, level), (start, limit))


def members(law: Law) -> list[tuple[float, tuple[float, ...], float]]:
    """Return form, deviations of the coefficients and prior of each member of a law's family.

    The first is the law as it stands.
    """
    forms = [c * law.form_spread for c in _FORMS] if law.form_spread > 0.0 else [0.0]
    of_form = np.exp(-0.5 * np.array(_FORMS[: len(forms)]) ** 2)
    of_form[0] *= 0.5  # half of the others' interval
    out = []
    for form, share in zip(forms, of_form / of_form.sum(), strict=True):
        for picks in product(range(3), repeat=len(law.spreading)):
            weight = float(np.prod([_WEIGHTS[i] for i in picks]))
            factors = tuple(
                _COEFFICIENTS[i] * law.coefficients[name].spread
                for i, name in zip(picks, law.spreading, strict=True)
            )
            out.append((form, factors, float(share) * weight))
    return out


def _members(
    law: Law, damage: Floats, rate: Callable[[Floats, int], Floats]
) -> tuple[list[Floats], list[float]]:
    """Return the clocks of a law's own members, and their prior."""
    clocks, prior = [], []
    middle = 0.5 * (damage[1:] + damage[:-1])
    for k, (_, _, share) in enumerate(members(law)):
        pace = rate(middle, k)
        pace = np.maximum(pace, _SLOWEST * max(float(pace.mean()), 1e-300))
        clocks.append(np.concatenate(([0.0], np.cumsum(np.diff(damage) / pace))))
        prior.append(share)
    return clocks, prior


def _hastened(clock: Floats, relative: Floats, folds: float) -> Floats:
    """Return a clock of the same life whose rate hastens by e-folds until its end."""
    middle = np.minimum(0.5 * (relative[1:] + relative[:-1]), 1.0)
    steps, factor = np.diff(clock), np.exp(-folds * middle)
    within = (middle > 0.0) & (middle < 1.0)
    factor *= float(steps[within].sum() / (steps * factor)[within].sum())
    return np.concatenate(([0.0], np.cumsum(steps * factor)))


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


def _rising(clock: Floats, life: float, relative: Floats) -> Floats:
    """Return a clock that rises at each point: what saturates goes on slowly."""
    least = 1e-3 * life * np.diff(relative)
    most = life / _SLOWEST * np.maximum(np.diff(relative), 1e-9)
    steps = np.diff(np.nan_to_num(clock, posinf=1e300))
    floor = np.where(np.diff(relative) > 0.0, least, 1e-9 * life)
    return np.concatenate(([0.0], np.cumsum(np.clip(steps, floor, np.maximum(most, floor)))))


def _of_each_kind(
    law: Law,
    rows: tuple[tuple[str, ...], npt.NDArray[np.intp], Floats, Floats],
    points: tuple[Floats, Floats],
    ends: tuple[float, float],
) -> Shapes:
    """Return each row once a kind; growth without a law is of the last kind alone."""
    (damage, level), (start, limit) = points, ends
    names, group, prior, clocks = rows
    end, kinds = float(np.interp(limit, level, damage)) - law.start, _ALONE if law.only else _KINDS
    count = len(kinds)
    none, last = np.array(names) == NO_LAW, np.arange(count)[:, None] == count - 1

    def column(field: str) -> Floats:
        return np.array([np.array(getattr(kind, field))[group] for kind in kinds])

    return Shapes(
        names * count,
        (prior * np.where(none, last, column("share"))).ravel(),
        damage,
        level,
        np.vstack([clocks] * count),
        column("drift").ravel(),
        np.maximum(law.grain, end * column("path")).ravel(),
        start,
        limit,
        np.tile(np.where(group == _FREE, max(law.spread, 1.0), law.spread), count),
        column("bends").ravel(),
        column("ahead").ravel(),
    )
