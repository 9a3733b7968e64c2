"""One fault's state, known through particles that each carry a small Gaussian.

A particle holds parameters (`Manner`: drift, changes of rate, path, scatter, misses) and a Gaussian
over what they leave open: progress on the law's clock, logarithm of the rate over the law's, the
slope of that over the severity, the part of it that fades, the diagnoses' common error
(Rao-Blackwellised particle filter: Doucet, de Freitas, Murphy, Russell 2000). Changes of rate,
jumps and stray diagnoses are drawn.
"""

from __future__ import annotations

from collections.abc import Callable
from math import erfc, sqrt

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.prognose.law import Law
from elevon.prognose.manner import GrowthPrior, Manner, draw_manner, draw_rates
from elevon.prognose.observation import Seen
from elevon.prognose.shapes import Shapes

PROGRESS, RATE, SLOPE, WANDER, COMMON = range(5)
_STATES = 5
_FIRST, _LATER = 3000, 700  # particles until three sightings, and from then on
_TOGETHER = 3
_POWER, _ALIKE = 0.5, 0.3  # of the weights that particles are drawn again by; share that counts
_STEPS = 6  # of growth between two inspections
CHANGE = 0.9  # deviation of a sudden change of the logarithm of the rate; ASSUMED
JUMPS = 0.25  # sudden growth or unrecorded renewals in one life, where growth is free; ASSUMED
JUMP, _WORN = 0.25, 0.4  # deviation of a jump, and of a unit that enters worn, of a life's progress
_ENTERS_WORN = 0.05  # share of units whose history does not say that they began new; ASSUMED
_PROPOSED = 0.15  # share of the particles in which each event is tried, however rare it is
_STRAY = 0.02  # share of the diagnoses that err far; ASSUMED
_LIKELY = 0.5  # probability from which a sighting counts as one, where sightings are counted
_LARGEST = 0.3  # of a life: a longer step counts as that for what may happen in it
_NARROW = 0.25  # deviation of a particle's own Gaussian of the slope
GROWTHS, SLOPES = 12.0, 4.0  # bounds of the logarithm of the rate, and of its slope
_FAR_OFF = 4.0  # deviations at which a measured value is taken as stray
_NORMAL = sqrt(2.0 * np.pi)


class FaultFilter:
    """What is known of one fault.

    Parameters
    ----------
    shapes : Shapes
        Tables of its growth.
    law : Law
        Its law.
    priors : (GrowthPrior, GrowthPrior)
        Of units beside the law, and without it.
    rng : Generator
        Of chance.

    Attributes
    ----------
    weight : ndarray, shape (n,)
        Of the particles; with `dormant` their sum is 1.
    mean, cov : ndarray, shape (n, d) and (n, d, d)
        Of each particle: progress (1: the end of life), logarithm of the rate, its slope over the
        logarithm of the severity, its part that fades with use, common error of the diagnoses, and
        the model's errors of requirements that have been measured.
    manner : Manner
        Of each particle.
    dormant : float
        Probability that the fault is not there.
    seen : int
        Sightings since the part was new.
    evidence : float
        Logarithm of the probability of all diagnoses since then, by the priors.
    """

    def __init__(
        self,
        shapes: Shapes,
        law: Law,
        priors: tuple[GrowthPrior, GrowthPrior],
        rng: np.random.Generator,
    ) -> None:
        self.shapes, self._law, self._priors, self._rng = shapes, law, priors, rng
        self._life = shapes.life()
        first = np.array([np.interp(shapes.start, shapes.level, row) for row in shapes.clock])
        self._clock = (shapes.clock - first[:, None]) / self._life[:, None]
        far = self._clock[:, -1] - self._clock[:, 0]
        self._far = far
        share = (self._clock - self._clock[:, :1]) / far[:, None]
        self._keys = (share * (1.0 - 1e-12) + np.arange(len(far))[:, None]).ravel()
        self._pace = np.diff(shapes.level) / np.diff(self._clock, axis=1)
        self.renew(known=False)

    def renew(self, *, known: bool = True) -> None:
        """Start again with a new part; `known`: the history says that it is new."""
        shapes, law, rng = self.shapes, self._law, self._rng
        self.manner = draw_manner(_FIRST, shapes.free, shapes.prior, self._priors, rng)
        free = shapes.free[self.manner.row]
        drawn = draw_rates(free, law, self._priors, rng)
        slope = drawn.slope
        self.dormant, self.seen, self._fresh = law.dormant, 0, not known
        self.evidence = 0.0
        self.weight = (1.0 - law.dormant) * drawn.weight / drawn.weight.sum()
        self.mean = np.zeros((_FIRST, _STATES))
        self.mean[:, RATE], self.mean[:, SLOPE] = drawn.rate + self._lasting(slope, free), slope
        damage = np.interp(shapes.start, shapes.level, shapes.damage)
        near = np.interp(damage + max(law.start_spread, 1e-12), shapes.damage, shapes.level)
        _, pace = self._level(np.zeros(_FIRST), self.manner.row)
        self.cov = np.zeros((_FIRST, _STATES, _STATES))
        self.cov[:, PROGRESS, PROGRESS] = ((near - shapes.start) / pace) ** 2
        self.cov[:, RATE, RATE] = drawn.width**2
        self.cov[:, SLOPE, SLOPE] = np.where(free, _NARROW, 0.0) ** 2
        for pair in ((RATE, RATE), (RATE, WANDER), (WANDER, RATE), (WANDER, WANDER)):
            self.cov[:, pair[0], pair[1]] += self.manner.drift**2
        self.cov[:, COMMON, COMMON] = 1.0
        self._lives = np.zeros(_FIRST)

    def _lasting(self, slope: Floats, free: npt.NDArray[np.bool_]) -> Floats:
        """Return logarithms of the rate of a new unit at which a slope does not change the life.

        Of growth that follows no law; a law's rate is that of a new unit.
        """
        knee = float(self.shapes.knee[-1]) / self.shapes.span
        power = np.where(np.abs(slope - 1.0) < 1e-3, 1.001, slope)
        life = knee * (((1.0 + knee) / knee) ** (1.0 - power) - 1.0) / (1.0 - power)
        return np.asarray(np.where(free, np.log(life), 0.0))

    # -- growth

    def _level(self, progress: Floats, row: npt.NDArray[np.intp]) -> tuple[Floats, Floats]:
        """Return levels at a progress, and their slope over it."""
        points = self._clock.shape[1]
        share = (progress - self._clock[row, 0]) / self._far[row]
        key = np.clip(share, 0.0, 1.0) * (1.0 - 1e-12) + row
        k = np.clip(np.searchsorted(self._keys, key) - 1 - row * points, 0, points - 2)
        pace = self._pace[row, k]
        level = self.shapes.level[k] + pace * (progress - self._clock[row, k])
        return np.minimum(level, self.shapes.level[-1]), pace

    def grow(self, use: float, pace: float = 1.0, folds: float = 0.0) -> None:
        """Let the unit be used on.

        Parameters
        ----------
        use : float
            Repetitions.
        pace : float
            Of the law in the company of the unit's other faults, over the law alone.
        folds : float
            Rate times use at which dormant faults begin.
        """
        if use <= 0.0:
            return
        time = use * pace / self._life[self.manner.row] / _STEPS
        lives = np.zeros(len(time))
        expected = np.minimum(time * _STEPS * np.exp(np.minimum(self.mean[:, RATE], 5.0)), 1.0)
        changed = self._events(self.manner.changes * expected)
        for number in range(_STEPS):
            now = changed == number
            self.cov[now, RATE, RATE] += CHANGE**2
            lives += self._step(time)
        self._lives = np.minimum(self._lives + lives, 1.0)
        if folds > 0.0 and self.dormant > 0.0:
            share = self.dormant * -np.expm1(-folds)
            self.dormant -= share
            self.weight *= 1.0 + share / max(float(self.weight.sum()), 1e-300)

    def _events(self, expected: Floats) -> npt.NDArray[np.intp]:
        """Draw in which step, if any, of each particle an event is tried; weigh it as it is rare.

        Events are tried in `_PROPOSED` of the particles, so that a rare one that histories show is
        among them.
        """
        chance = -np.expm1(-expected)
        tried = np.maximum(chance, np.where(chance > 0.0, _PROPOSED, 0.0))
        draw = self._rng.random(len(chance))
        happens = draw < tried
        other = (1.0 - chance) / np.maximum(1.0 - tried, 1e-12)
        self.weight *= np.where(happens, chance / np.maximum(tried, 1e-12), other)
        number = self._rng.integers(0, _STEPS, len(chance))
        return np.where(happens, number, -1)

    def _step(self, time: Floats) -> Floats:
        """Grow all particles by a step of their clocks; return its share of a life."""
        mean, cov, row = self.mean, self.cov, self.manner.row
        level, pace = self._level(mean[:, PROGRESS], row)
        above = np.maximum(level - self.shapes.start, 0.0) + self.shapes.knee[row]
        # Half way: the rate there is that of the whole step.
        flow = np.exp(np.clip(mean[:, RATE], -GROWTHS, GROWTHS)) * time
        folds = np.clip(0.5 * mean[:, SLOPE] * pace * flow / above, -0.7, 0.7)
        moved = np.minimum(flow * np.exp(folds), self._far[row])
        after = np.minimum(mean[:, PROGRESS] + moved, self._far[row])
        beyond, _ = self._level(after, row)
        more = np.log((np.maximum(beyond - self.shapes.start, 0.0) + self.shapes.knee[row]) / above)
        cov[:, PROGRESS, :] += moved[:, None] * cov[:, RATE, :]
        cov[:, :, PROGRESS] += moved[:, None] * cov[:, :, RATE]
        grown = (beyond - level) / self.shapes.span
        lives = np.minimum(np.maximum(moved, grown), _LARGEST)
        # What fades does so with use, however slowly the fault grows.
        remains = np.exp(-np.maximum(lives, time) / self.manner.memory)
        fades = 1.0 - remains
        for part in (cov, np.swapaxes(cov, 1, 2)):
            part[:, RATE] += more[:, None] * part[:, SLOPE] - fades[:, None] * part[:, WANDER]
            part[:, WANDER] *= remains[:, None]
        new = self.manner.drift**2 * (1.0 - remains**2)
        for pair in ((RATE, RATE), (RATE, WANDER), (WANDER, RATE), (WANDER, WANDER)):
            cov[:, pair[0], pair[1]] += new
        rate = mean[:, RATE] + more * mean[:, SLOPE] - fades * mean[:, WANDER]
        mean[:, RATE] = np.clip(rate, -GROWTHS, GROWTHS)
        mean[:, WANDER] *= remains
        cov[:, PROGRESS, PROGRESS] += self._scatter_of_path(row) * moved
        self._bound(PROGRESS, 1.0)
        self._bound(RATE, 1.5)
        mean[:, PROGRESS] = after
        return np.asarray(lives)

    def _scatter_of_path(self, row: npt.NDArray[np.intp]) -> Floats:
        """Variance of the path in one life, of progress: the particle's own, the law's at least."""
        law = self._law.grain / self.shapes.span_of_damage
        return np.asarray(np.where(self.shapes.free[row], self.manner.path**2, law))

    def _bound(self, index: int, most: float) -> None:
        """Keep a variance below what a Gaussian can follow."""
        variance = np.maximum(self.cov[:, index, index], 1e-300)
        shrink = np.sqrt(np.minimum(most**2 / variance, 1.0))
        self.cov[:, index, :] *= shrink[:, None]
        self.cov[:, :, index] *= shrink[:, None]

    # -- diagnoses

    def expected(self) -> tuple[float, float]:
        """Return mean and variance of the level; of units without the fault it is 0."""
        level, pace = self._level(self.mean[:, PROGRESS], self.manner.row)
        level = np.append(np.maximum(level, 0.0), 0.0)
        weight = np.append(self.weight, self.dormant)
        weight = weight / weight.sum()
        mean = float(weight @ level)
        inner = np.append(pace**2 * self.cov[:, PROGRESS, PROGRESS], 0.0)
        return mean, float(weight @ (inner + (level - mean) ** 2))

    def update(self, seen: Seen) -> None:
        """Take in a diagnosis: a sighting, with its probability, or none."""
        if seen.severity is None:
            self._not_seen(seen)
        else:
            self._seen(seen, seen.severity)
            self.seen += int(seen.probability >= _LIKELY)
        self._fresh = False
        self._lives = np.zeros(len(self.weight))
        self._normalise()
        count = _LATER if self.seen >= _TOGETHER else _FIRST
        present = self.weight / max(float(self.weight.sum()), 1e-300)
        if len(present) > count or 1.0 / float(np.sum(present**2)) < _ALIKE * count:
            self._draw_again(count)

    def _seen(self, seen: Seen, severity: float) -> None:
        # A jump before this diagnosis, or a unit that entered worn.
        expected = np.full(len(self.weight), _ENTERS_WORN) if self._fresh else JUMPS * self._lives
        jumped = self._events(expected) >= 0
        self.cov[jumped, PROGRESS, PROGRESS] += (_WORN if self._fresh else JUMP) ** 2
        level, pace = self._level(self.mean[:, PROGRESS], self.manner.row)
        line = np.zeros_like(self.mean)
        line[:, PROGRESS], line[:, COMMON] = pace, seen.common
        off = severity - level - seen.common * self.mean[:, COMMON]
        stated = np.where(off > 0.0, seen.low, seen.high) * self.manner.scatter
        gain = np.einsum("nij,nj->ni", self.cov, line)
        variance = np.einsum("ni,ni->n", gain, line) + stated**2
        right = np.exp(-0.5 * off**2 / variance) / (_NORMAL * np.sqrt(variance))
        width = max(1.5 * self.shapes.limit, severity)
        chance = self._visible(seen.limit, level)
        real = seen.probability * (1.0 - _STRAY) * right
        # What a diagnosis says of a fault that is not what it saw: any severity is as likely.
        other = seen.probability * _STRAY / width
        false = (1.0 - seen.probability) * (1.0 - chance) / width
        total = real + other + false
        self.weight *= total
        self.dormant *= seen.probability * _STRAY / width + (1.0 - seen.probability) / width
        taken = self._rng.random(len(total)) * total < real
        step = np.where(taken, 1.0 / variance, 0.0)
        self.mean += (step * off)[:, None] * gain
        self.cov -= step[:, None, None] * gain[:, :, None] * gain[:, None, :]
        self._keep()

    def _visible(self, detectable: float, level: Floats) -> Floats:
        """Return the probability that an inspection sees a fault of a level (hit or miss).

        A lognormal curve through one half at the detection limit (MIL-HDBK-1823), up to the
        particle's share of faults that are missed however large they are.
        """
        if detectable <= 0.0:
            return np.asarray(1.0 - self.manner.missed)
        share = np.log(np.maximum(level, 1e-9 * detectable) / detectable) / self.manner.blur
        return (1.0 - self.manner.missed) * _below(share)

    def _not_seen(self, seen: Seen) -> None:
        """Bound the level by what could be detected, unless the inspection missed the fault."""
        level, pace = self._level(self.mean[:, PROGRESS], self.manner.row)
        line = np.zeros_like(self.mean)
        line[:, PROGRESS], line[:, COMMON] = pace, seen.common
        gain = np.einsum("nij,nj->ni", self.cov, line)
        limit = seen.limit
        blur = self.manner.blur * limit
        variance = np.einsum("ni,ni->n", gain, line) + blur**2
        z = (limit - level) / np.sqrt(variance)
        below = _below(z)
        chance = self.manner.missed + (1.0 - self.manner.missed) * below
        self.weight *= chance
        taken = self._rng.random(len(chance)) * chance >= self.manner.missed * (1.0 - below)
        hazard = np.where(taken, np.exp(-0.5 * z**2) / _NORMAL / np.maximum(below, 1e-12), 0.0)
        self.mean -= (hazard / np.sqrt(variance))[:, None] * gain
        shrink = np.clip(hazard * (hazard + z), 0.0, 1.0) / variance
        self.cov -= shrink[:, None, None] * gain[:, :, None] * gain[:, None, :]
        self._keep()

    def measure(
        self, model: Callable[[Floats], Floats], *, value: float, deviation: float,
        lasting: float, which: int, count: int,
    ) -> None:  # fmt: skip
        """Take in what depends on the level, with a lasting error of the model.

        Parameters
        ----------
        model : callable
            Levels, shape (n,), to the value, shape (n,).
        value, deviation : float
            What was measured.
        lasting : float
            Size of the model's error that stays, of the requirement `which` of `count`.
        """
        if self.mean.shape[1] == _STATES:
            self._widen(count)
        level, pace = self._level(self.mean[:, PROGRESS], self.manner.row)
        step = 1e-3 * self.shapes.span
        at, near = model(level), model(level + step)
        line = np.zeros_like(self.mean)
        line[:, PROGRESS] = pace * (near - at) / step
        line[:, _STATES + which] = lasting
        off = value - at - lasting * self.mean[:, _STATES + which]
        gain = np.einsum("nij,nj->ni", self.cov, line)
        variance = np.einsum("ni,ni->n", gain, line) + deviation**2
        score = -0.5 * (off**2 / variance + np.log(variance))
        wide = -0.5 * (_FAR_OFF**2 + np.log(deviation**2))
        present = float(self.weight.sum())
        self.weight = self.weight * np.exp(np.logaddexp(score, wide) - max(score.max(), wide))
        self.weight *= present / max(float(self.weight.sum()), 1e-300)
        trust = 1.0 / (1.0 + np.exp(np.clip(wide - score, -50.0, 50.0))) / variance
        self.mean += (trust * off)[:, None] * gain
        self.cov -= trust[:, None, None] * gain[:, :, None] * gain[:, None, :]
        self._keep()

    def _widen(self, count: int) -> None:
        """Add the model's errors of requirements to the state: one deviation each."""
        n, d = self.mean.shape
        mean, cov = np.zeros((n, d + count)), np.zeros((n, d + count, d + count))
        mean[:, :d], cov[:, :d, :d] = self.mean, self.cov
        index = np.arange(d, d + count)
        cov[:, index, index] = 1.0
        self.mean, self.cov = mean, cov

    def _keep(self) -> None:
        """Keep progress in the tables and variances above rounding."""
        row = self.manner.row
        first, last = self._clock[row, 0], self._clock[row, -1]
        np.clip(self.mean[:, PROGRESS], first, last, out=self.mean[:, PROGRESS])
        np.clip(self.mean[:, RATE], -GROWTHS, GROWTHS, out=self.mean[:, RATE])
        np.clip(self.mean[:, SLOPE], -SLOPES, SLOPES, out=self.mean[:, SLOPE])
        self.cov = 0.5 * (self.cov + np.swapaxes(self.cov, 1, 2))
        index = np.arange(self.cov.shape[1])
        self.cov[:, index, index] = np.maximum(self.cov[:, index, index], 1e-12)

    def _normalise(self) -> None:
        total = float(self.weight.sum()) + self.dormant
        if total < 1e-290:  # nothing agrees: all agree alike
            self.weight, total = np.full(len(self.weight), 1.0 / len(self.weight)), 1.0
            self.dormant = 0.0
        self.evidence += float(np.log(total))
        self.weight, self.dormant = self.weight / total, self.dormant / total

    def _draw_again(self, count: int) -> None:
        """Draw particles in proportion to a power of their weights; the rest of it they keep.

        What is unlikely so far stays among them, should later inspections show it.
        """
        present = 1.0 - self.dormant
        share = self.weight**_POWER
        index = _systematic(share, count, self._rng)
        weight = self.weight[index] / np.maximum(share[index], 1e-300)
        self.weight = present * weight / max(float(weight.sum()), 1e-300)
        self.manner = self.manner.picked(index).jittered(self._rng)
        self.mean, self.cov = self.mean[index], self.cov[index]
        self._lives = np.zeros(count)

    # -- what is known

    @property
    def measured(self) -> bool:
        """Whether a requirement's own value has been taken in."""
        return self.mean.shape[1] > _STATES

    def new_rates(self) -> Floats:
        """Return logarithms of each particle's rate as it was in a new unit, shape (n,).

        Without what fades, and without what its slope has added since.
        """
        row, slope = self.manner.row, self.mean[:, SLOPE]
        level, _ = self._level(self.mean[:, PROGRESS], row)
        grown = self.shapes.logarithm(level, row)
        begun = self._lasting(slope, self.shapes.free[row])
        return np.asarray(self.mean[:, RATE] - self.mean[:, WANDER] - slope * grown - begun)

    def rate_variance(self) -> Floats:
        """Return the variance of `new_rates` that each particle leaves open, shape (n,)."""
        row = self.manner.row
        level, _ = self._level(self.mean[:, PROGRESS], row)
        line = np.zeros_like(self.mean)
        line[:, RATE], line[:, WANDER] = 1.0, -1.0
        line[:, SLOPE] = -self.shapes.logarithm(level, row)
        return np.asarray(np.einsum("ni,nij,nj->n", line, self.cov, line))

    def by_law(self) -> float:
        """Return the probability that the fault, where it is there, grows by its law."""
        free = self.shapes.free[self.manner.row]
        return 1.0 - float(self.weight[free].sum() / max(float(self.weight.sum()), 1e-300))

    def draw(
        self, count: int, rng: np.random.Generator
    ) -> tuple[Floats, Floats, Manner, npt.NDArray[np.bool_]]:
        """Draw levels, states, shape (n, d), parameters, and whether the fault is there."""
        weight = np.append(self.weight, self.dormant)
        index = rng.permutation(_systematic(weight, count, rng))
        there = index < len(self.weight)
        absent = int(rng.integers(len(self.weight)))
        index = np.where(there, index, absent)
        used, where = np.unique(index, return_inverse=True)
        values, vectors = np.linalg.eigh(self.cov[used])
        root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        normal = rng.standard_normal((count, self.mean.shape[1]))
        state = self.mean[index] + np.einsum("nij,nj->ni", root[where], normal)
        manner = self.manner.picked(index)
        level, _ = self._level(state[:, PROGRESS], manner.row)
        level = np.clip(level, self.shapes.level[0], self.shapes.level[-1])
        return level, state, manner, there


def _systematic(weight: Floats, count: int, rng: np.random.Generator) -> npt.NDArray[np.intp]:
    """Return `count` indices in proportion to weights, evenly."""
    edges = np.cumsum(weight)
    at = (rng.random() + np.arange(count)) / count * edges[-1]
    return np.asarray(np.minimum(np.searchsorted(edges, at), len(edges) - 1), dtype=np.intp)


def _below(z: Floats) -> Floats:
    """Return the normal distribution function."""
    return np.array([0.5 * erfc(-x / sqrt(2.0)) for x in z.tolist()])
