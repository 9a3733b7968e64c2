"""Lives drawn at random: no list of forms, but splines, changes of rate, faults, maintenance.

Everything of a life comes from one generator of random numbers that is seeded with the study's
seed and the life's number, so that a life is the same whatever else is drawn. Written before the
filter that it judges, and not changed since.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from elevon.arrays import Floats

Rng = np.random.Generator
POINTS = 4001
_STREAM = 61  # of the random numbers of lives
_LIFE = 0.6  # deviation of the logarithm of a life over the expected one
_LONGEST = 3.0  # lives over which a course is drawn before it is cut at its end
_SLOWEST = 1e-3  # of the mean rate


@dataclass(frozen=True)
class Look:
    """One inspection of a drawn life.

    Attributes
    ----------
    usage : float
        In expected lives.
    severity : float or None
        What was reported, over the limit; None where nothing was.
    deviation : float
        That the report states of it; of nothing reported, a third of `detectable`.
    probability : float
        That the fault is there, as reported.
    renewed : bool
        Whether the part was made new after it, and the record says so.
    """

    usage: float
    severity: float | None
    deviation: float
    probability: float
    renewed: bool = False


@dataclass(frozen=True)
class DrawnLife:
    """A life, and what inspections said of it until the prediction.

    Attributes
    ----------
    number : int
        Of the life.
    usage, severity : ndarray, shape (s,)
        Course of the last part of the unit, from new to its end; in expected lives and limits.
    looks : tuple of Look
        Until the prediction, which is made at the last of them.
    detectable : float
        Least severity that inspections see as a rule, over the limit.
    bias : float
        Deviation of a common error of all inspections, relative, as stated to the predictor.
    end : float
        Use at the end of life.
    curvature : float
        Logarithm of the mean rate in the last third of the use, over that in the first.
    changes : int
        Changes of the rate.
    """

    number: int
    usage: Floats
    severity: Floats
    looks: tuple[Look, ...]
    detectable: float
    bias: float
    end: float
    curvature: float
    changes: int

    @property
    def at(self) -> float:
        """Use at the prediction."""
        return self.looks[-1].usage

    @property
    def remaining(self) -> float:
        """Remaining life at the prediction."""
        return self.end - self.at


def drawn_life(number: int, seed: int, *, looks: int | None = None) -> DrawnLife:
    """Draw one life and its inspections.

    Parameters
    ----------
    number, seed : int
        Of the life and of the study.
    looks : int, optional
        Inspections until the prediction; default: drawn, 2 to 40.
    """
    rng = np.random.default_rng([_STREAM, seed, number])
    usage, severity, changes = _course(rng)
    count = round(float(np.exp(rng.uniform(np.log(2.0), np.log(40.0)))))
    return _inspected(number, rng, (usage, severity, changes), looks or count)


def _course(rng: Rng) -> tuple[Floats, Floats, int]:
    """Draw a course from new to the limit: use, severity, changes of rate."""
    share = np.linspace(0.0, _LONGEST, POINTS)
    first = _rate(share, share[1], rng)
    changes = int(rng.poisson(0.6))
    for _ in range(changes):
        first = first * np.where(share > rng.uniform(0.1, 1.0), np.exp(rng.normal(0.0, 0.9)), 1.0)
    if rng.random() < 0.12:  # stop and go
        for begin in rng.uniform(0.0, 1.0, rng.integers(1, 4)):
            first = np.where(
                (share > begin) & (share < begin + rng.uniform(0.05, 0.2)), 0.02 * first, first
            )
            changes += 1
    if rng.random() < 0.12:  # a second fault whose growth adds to what is seen
        begin = rng.uniform(0.2, 0.9)
        second = _rate(np.maximum(share - begin, 0.0), share[1], rng) * np.exp(rng.normal(0.0, 0.5))
        first = first + np.where(share > begin, second, 0.0)
        changes += 1
    step = share[1]
    wander = float(rng.choice([0.0, np.exp(rng.uniform(np.log(0.1), np.log(0.8)))]))
    first = first * np.exp(wander * np.sqrt(step) * np.cumsum(rng.standard_normal(POINTS)))
    grown = 0.5 * (first[1:] + first[:-1]) * step
    grain = float(rng.choice([0.0, np.exp(rng.uniform(np.log(1e-4), np.log(1e-2)))]))
    if grain > 0.0:
        grown = grain * rng.standard_gamma(np.maximum(grown, 1e-12) / grain)
    if rng.random() < 0.12:  # overloads
        for at in rng.integers(1, POINTS // 3, rng.integers(1, 4)):
            grown[at] += rng.uniform(0.03, 0.2)
    severity = np.concatenate(([0.0], np.cumsum(grown)))
    life = float(np.exp(_LIFE * rng.standard_normal()))
    last = int(np.argmax(severity >= 1.0)) if severity[-1] >= 1.0 else POINTS - 1
    severity = severity[: last + 1] / severity[last]
    return life * share[: last + 1], severity, changes


def _rate(share: Floats, step: float, rng: Rng) -> Floats:
    """Draw a rate over the share of life: the slope of a random monotone spline, and of a power."""
    from scipy.interpolate import PchipInterpolator

    knots = int(rng.integers(2, 7))
    at = np.concatenate(([0.0], np.sort(rng.uniform(0.05, 0.95, knots - 1)), [1.0, _LONGEST]))
    gained = rng.dirichlet(np.full(knots, np.exp(rng.uniform(np.log(1.0), np.log(20.0)))))
    beyond = gained[-1] / (at[-2] - at[-3]) * (_LONGEST - 1.0)
    course = PchipInterpolator(at, np.concatenate(([0.0], np.cumsum(gained), [1.0 + beyond])))
    power = float(np.exp(rng.normal(0.1, 0.5)))
    grown = np.asarray(course(share)) ** power
    return np.maximum(np.gradient(grown, step), _SLOWEST)


def _renewal(rng: Rng, life: float) -> tuple[float, bool]:
    """Draw the use of an earlier part of the unit, at whose end it was renewed; 0: none was."""
    if rng.random() >= 0.12:
        return 0.0, False
    return float(rng.uniform(0.2, 1.0) * life), bool(rng.random() < 0.8)


@dataclass(frozen=True)
class _Inspector:
    """How the inspections of one life err, all relative to the limit or to the severity."""

    relative: float
    absolute: float
    stated: float  # what is stated of the scatter, over it
    detectable: float
    bias: float  # common to all, relative
    missed: float  # share of well visible faults that are not seen

    @classmethod
    def drawn(cls, rng: Rng, stated_bias: float) -> _Inspector:
        """Draw an inspector."""
        absolute = float(np.exp(rng.uniform(np.log(0.002), np.log(0.03))))
        missed = (rng.uniform(0.0, 0.02), rng.uniform(0.05, 0.3))
        return cls(
            relative=float(np.exp(rng.uniform(np.log(0.005), np.log(0.08)))),
            absolute=absolute,
            stated=float(np.exp(rng.normal(0.0, 0.35))),
            detectable=float(rng.uniform(2.0, 4.0)) * absolute,
            bias=stated_bias * float(rng.standard_normal()),
            missed=float(rng.choice(missed, p=[0.8, 0.2])),
        )

    def look(self, rng: Rng, usage: float, severity: float) -> Look:
        """Draw what one inspection reports of a severity."""
        severity *= 1.0 + self.bias
        value = severity + self._deviation(severity) * float(rng.standard_normal())
        if rng.random() < _STRAY:
            value = severity + 0.3 * float(rng.standard_normal())
        if value < self.detectable:
            if rng.random() >= _FALSE:
                return Look(usage, None, self.detectable / 3.0, 0.0)
            seen = self.detectable * float(rng.uniform(1.0, 3.0))  # and not sure of itself
            return Look(usage, seen, self._stated(seen), float(rng.uniform(0.25, 0.75)))
        if rng.random() < self.missed:
            return Look(usage, None, self.detectable / 3.0, 0.0)
        certain = rng.random() < _CERTAIN
        probability = 1.0 - rng.beta(1.0, 12.0) if certain else rng.uniform(0.4, 0.9)
        return Look(usage, value, self._stated(value), float(probability))

    def _deviation(self, severity: float) -> float:
        return float(np.hypot(self.relative * severity, self.absolute))

    def _stated(self, severity: float) -> float:
        return self.stated * self._deviation(severity)


_STRAY = 0.015  # share of the diagnoses that err far
_FALSE = 0.03  # share of the inspections of a fault that cannot be seen that report one
_CERTAIN = 0.85  # share of the sightings with a high probability


def _inspected(number: int, rng: Rng, course: tuple[Floats, Floats, int], count: int) -> DrawnLife:
    """Inspect a life at irregular uses, with errors, misses, false sightings, maintenance."""
    usage, severity, changes = course
    life = float(usage[-1])
    renewed_at, recorded = _renewal(rng, life)
    until = renewed_at + rng.uniform(0.3, 0.95) * life
    gaps = rng.gamma(float(np.exp(rng.uniform(np.log(0.6), np.log(20.0)))), size=count)
    uses = until * np.cumsum(gaps) / gaps.sum()
    stated_bias = float(rng.choice([0.01, rng.uniform(0.02, 0.08)], p=[0.7, 0.3]))
    inspector = _Inspector.drawn(rng, stated_bias)
    earlier = float(np.exp(rng.normal(0.0, 0.3)))  # pace of the part before the renewal
    if renewed_at > 0.0:  # at the first inspection, where none was made before it
        renewed_at = max(renewed_at, float(uses[0]))
    last = max((float(at) for at in uses if at <= renewed_at), default=0.0)
    begin = last if recorded else renewed_at  # a recorded renewal is done at an inspection
    looks = []
    for at in uses.tolist():
        if at <= renewed_at:
            true = min(float(np.interp(earlier * at, usage, severity)), 0.97)
        elif at - begin < 0.97 * life:
            true = float(np.interp(at - begin, usage, severity))
        else:
            break
        item = inspector.look(rng, at, true)
        looks.append(replace(item, renewed=recorded and at == last > 0.0))
    early = float(np.interp(life / 3.0, usage, severity))
    late = 1.0 - float(np.interp(2.0 * life / 3.0, usage, severity))
    curvature = float(np.log(max(late, 1e-3) / max(early, 1e-3)))
    return DrawnLife(
        number, usage, severity, tuple(looks), inspector.detectable, stated_bias, begin + life,
        curvature, changes,
    )  # fmt: skip
