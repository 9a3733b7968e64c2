"""One fault's state, known through many small Gaussians: a bank of Kalman filters.

Each component is a way of growth (a row of `Shapes`), a scale of the diagnoses' scatter and a
neighbourhood of growth factors, in which the flow of the row is close to linear (Alspach and
Sorenson 1972). Whether the last step was ordinary, a change of rate, a jump or a stray diagnosis is
a mode of each component, which remembers the last one (generalised pseudo-Bayes of second order:
Ackerson and Fu 1970, Blom and Bar-Shalom 1988). No component ever leaves: what was given up comes
back when diagnoses agree with it.
"""

from __future__ import annotations

from collections.abc import Callable
from math import erfc, sqrt

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.prognose.components import SCALE_PRIOR, SCALES, components
from elevon.prognose.observation import DETECTED, Seen
from elevon.prognose.shapes import Shapes

ORDINARY, FASTER, SLOWER, JUMP, STRAY = range(5)
_MODES = 5
#: ASSUMED, as the rest of the modes' numbers: one unit in some jumps in a life.
_JUMPS = 0.25  # in one life
_ENTERS_WORN = 0.1  # a unit whose history does not say that it began new
_STRAYS, _AGAIN = 0.03, 0.3  # share of diagnoses that are stray; after one that was
_MISSED = 1e-3  # share of diagnoses that do not see a fault that is well there
BEND, BEND_SPREAD = 0.9, 0.45  # of the logarithm of the rate
_LEAP, _WORN = 0.3, 0.4  # deviation of a jump's level, of the span of a life; of a worn unit's
_TOGETHER = 6  # diagnoses after which neighbourhoods are told apart no longer
_RETURN = 0.003  # share of the weights that goes back to the prior at each diagnosis
GROWTHS = 8.0  # bounds of the logarithm of a growth factor
_STATES = 3  # level, growth, common error
_FAR_OFF = 4.0  # deviations at which a measured value is taken as stray
_LOOSEST = 1.5  # deviation of a component's logarithm of the rate, at most
_LARGEST = 0.3  # of a life: a longer step counts as that for what may happen in it


class FaultBank:
    """What is known of one fault.

    The state of a component: level, logarithm of the growth factor, common error of the diagnoses
    in their deviations, and the model's errors of requirements that have been measured.

    Parameters
    ----------
    shapes : Shapes
        Ways of growth.
    start_spread : float
        Deviation of the damage of a new unit.
    dormant : float
        Share of units that have not the fault.

    Attributes
    ----------
    weight : ndarray, shape (h, 5)
        Of each component and mode.
    mean, cov : ndarray, shape (h, 5, d) and (h, 5, d, d)
    row, scale : ndarray, shape (h,)
        Row of `shapes` and scale of each component.
    dormant : float
        Probability that the fault is not there.
    """

    def __init__(self, shapes: Shapes, start_spread: float, dormant: float) -> None:
        self.shapes, self._share = shapes, dormant
        count = len(shapes.clock)
        self._far = shapes.clock[:, -1]
        share = shapes.clock / self._far[:, None]
        self._keys = (share * (1.0 - 1e-12) + np.arange(count)[:, None]).ravel()
        self._pace = np.diff(shapes.level) / np.diff(shapes.clock, axis=1)
        self._slope = np.gradient(shapes.damage, shapes.level)
        self._life, self._span = shapes.life(), shapes.span_of_damage
        slope = float(np.interp(shapes.start, shapes.level, self._slope))
        self._start_spread = start_spread / max(slope, 1e-12)
        self.renew(known=False)

    def renew(self, *, known: bool = True) -> None:
        """Start again with a new part; `known`: the history says that it is new."""
        shapes = self.shapes
        self.row, self.scale, prior, growth, width = components(shapes)
        h = len(self.row)
        self._prior = prior
        self.weight = np.zeros((h, _MODES))
        self.weight[:, ORDINARY] = (1.0 - self._share) * prior
        self.mean = np.zeros((h, _MODES, _STATES))
        self.mean[..., 0], self.mean[..., 1] = shapes.start, growth[:, None]
        self.cov = np.zeros((h, _MODES, _STATES, _STATES))
        self.cov[..., 0, 0] = self._start_spread**2
        self.cov[..., 1, 1] = width[:, None] ** 2
        self.cov[..., 2, 2] = 1.0
        self.dormant, self.seen = self._share, 0
        self._fresh = not known
        self._initial = (self.mean[:, 0].copy(), self.cov[:, 0].copy())
        self.lives = np.zeros((h, _MODES))  # part of a life since the last diagnosis, shape (h, 5)

    # -- growth

    def _clock(self, level: Floats, row: npt.NDArray[np.intp]) -> Floats:
        shapes = self.shapes
        k = np.clip(np.searchsorted(shapes.level, level) - 1, 0, len(shapes.level) - 2)
        clock = shapes.clock[row, k] + (level - shapes.level[k]) / self._pace[row, k]
        return np.maximum(clock, 0.0)

    def _level(self, clock: Floats, row: npt.NDArray[np.intp]) -> tuple[Floats, Floats]:
        """Return level and pace of rows at a use."""
        shapes, points = self.shapes, self.shapes.clock.shape[1]
        key = np.minimum(clock / self._far[row], 1.0) * (1.0 - 1e-12) + row
        k = np.clip(np.searchsorted(self._keys, key) - 1 - row * points, 0, points - 2)
        pace = self._pace[row, k]
        level = shapes.level[k] + pace * (clock - shapes.clock[row, k])
        return np.minimum(level, shapes.level[-1]), pace

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
        shapes, row = self.shapes, self.row[:, None]
        level = np.clip(self.mean[..., 0], shapes.level[0], shapes.level[-1])
        row = np.broadcast_to(row, level.shape)
        flown = np.exp(np.minimum(self.mean[..., 1], 20.0)) * use * pace
        before = self._clock(level, row)
        after, speed = self._level(before + flown, row)
        _, speed_before = self._level(before, row)
        along = np.clip(speed / speed_before, 0.02, 50.0)
        by_rate = speed * np.minimum(flown, self._life[row])
        cov = self.cov
        cov[..., 0, :] = along[..., None] * cov[..., 0, :] + by_rate[..., None] * cov[..., 1, :]
        cov[..., :, 0] = along[..., None] * cov[..., :, 0] + by_rate[..., None] * cov[..., :, 1]
        lives = np.minimum(flown / self._life[row], _LARGEST)
        slope = np.interp(after, shapes.level, self._slope)  # damage over level
        grown = np.maximum(after - level, 0.0)
        cov[..., 0, 0] += shapes.grain[row] * grown / np.maximum(slope, 1e-12)
        # Where growth hastens, most of it lies in a small part of the life: rates drift with both.
        moved = np.maximum(lives, np.minimum(grown * slope / self._span, _LARGEST))
        cov[..., 1, 1] += shapes.drift[row] ** 2 * moved
        for index, most in ((0, shapes.span**2), (1, _LOOSEST**2)):
            shrink = np.sqrt(np.minimum(most / np.maximum(cov[..., index, index], 1e-300), 1.0))
            cov[..., index, :] *= shrink[..., None]
            cov[..., :, index] *= shrink[..., None]
        self.mean[..., 0] = after
        self.lives = self.lives + lives
        if folds > 0.0 and self.dormant > 0.0:
            self._begin(self.dormant * -np.expm1(-folds))

    def _begin(self, share: float) -> None:
        """Let a part of the units without the fault have it from now on."""
        self.dormant -= share
        mean, cov = self._initial
        added = share * self._prior
        old = self.weight[:, JUMP]
        total = old + added
        part = np.where(total > 0.0, added / np.maximum(total, 1e-300), 0.0)
        gap = mean - self.mean[:, JUMP]
        self.mean[:, JUMP] += part[:, None] * gap
        mixed = (1.0 - part)[:, None, None] * self.cov[:, JUMP] + part[:, None, None] * cov
        self.cov[:, JUMP] = mixed + (part * (1.0 - part))[:, None, None] * _outer(gap)
        self.weight[:, JUMP] = total

    # -- diagnoses

    def expected(self) -> tuple[float, float]:
        """Return mean and variance of the level; of units without the fault it is 0."""
        weight = np.concatenate((self.weight.ravel(), [self.dormant]))
        weight = weight / weight.sum()
        level = np.append(np.maximum(self.mean[..., 0].ravel(), 0.0), 0.0)
        mean = float(weight @ level)
        var = np.append(self.cov[..., 0, 0].ravel(), 0.0)
        return mean, float(weight @ (var + (level - mean) ** 2))

    def update(self, seen: Seen) -> None:
        """Take in a diagnosis."""
        if seen.severity is None:
            self._not_seen(seen)
        else:
            self._seen(seen, seen.severity)
        self._fresh = False
        if seen.severity is not None:
            self.seen += 1
            if self.seen == _TOGETHER:
                self._join()
        self.lives = np.zeros_like(self.weight)

    def _modes(self) -> Floats:
        """Return the probability of each mode of this step after each of the last, (h, 5, 5)."""
        lives = self.lives
        out = np.zeros((*self.weight.shape, _MODES))
        out[..., FASTER] = out[..., SLOWER] = self.shapes.bends[self.row][:, None] * lives
        out[..., JUMP] = _ENTERS_WORN if self._fresh else _JUMPS * lives
        out[..., STRAY] = _STRAYS
        out[:, STRAY, STRAY] = _AGAIN
        out[..., ORDINARY] = 1.0 - out[..., 1:].sum(axis=-1)
        return out

    def _seen(self, seen: Seen, severity: float) -> None:
        shapes, d = self.shapes, self.mean.shape[-1]
        mean = np.repeat(self.mean[:, :, None], _MODES, axis=2)
        cov = np.repeat(self.cov[:, :, None], _MODES, axis=2)
        mean[..., FASTER, 1] += BEND
        mean[..., SLOWER, 1] -= BEND
        cov[..., (FASTER, SLOWER), 1, 1] += BEND_SPREAD**2
        cov[..., JUMP, 0, 0] += ((_WORN if self._fresh else _LEAP) * shapes.span) ** 2
        row = np.zeros(d)
        row[0], row[2] = 1.0, seen.common
        off = severity - mean @ row
        deviation = np.where(off > 0.0, seen.low, seen.high) * self.scale[:, None, None]
        gain = cov @ row
        variance = gain @ row + deviation**2
        score = -0.5 * (off**2 / variance + np.log(2.0 * np.pi * variance))
        wide = np.log(1.0 / max(1.5 * shapes.limit, severity))
        score[..., STRAY] = wide
        step = np.where(np.arange(_MODES) == STRAY, 0.0, 1.0 / variance)
        mean += (step * off)[..., None] * gain
        cov -= (step[..., None] * gain)[..., None] * gain[..., None, :]
        alike = sum(
            p * _normal(severity, s * max(seen.low, 1e-300), seen.common)
            for p, s in zip(SCALE_PRIOR, SCALES, strict=True)
        )
        without = (1.0 - _STRAYS) * alike + _STRAYS * np.exp(wide)
        self._weigh(score, mean, cov, np.log(max(without, 1e-300)))

    def _not_seen(self, seen: Seen) -> None:
        """Bound the level: what could be detected lies at `DETECTED` of the stated deviations."""
        row = np.zeros(self.mean.shape[-1])
        row[0], row[2] = 1.0, seen.common
        gain = self.cov @ row
        variance = gain @ row + (seen.high * self.scale[:, None]) ** 2
        z = (DETECTED * seen.high - self.mean @ row) / np.sqrt(variance)
        below = 0.5 * np.array([erfc(-x / sqrt(2.0)) for x in z.ravel()]).reshape(z.shape)
        chance = _MISSED + (1.0 - _MISSED) * below
        hazard = (1.0 - _MISSED) * np.exp(-0.5 * z**2) / sqrt(2.0 * np.pi) / chance
        mean = self.mean - (hazard / np.sqrt(variance))[..., None] * gain
        shrink = np.clip(hazard * (hazard + z), 0.0, 1.0) / variance
        cov = self.cov - (shrink[..., None] * gain)[..., None] * gain[..., None, :]
        score = np.repeat(np.log(chance)[:, :, None], _MODES, axis=2)
        out_mean = np.repeat(mean[:, :, None], _MODES, axis=2)
        out_cov = np.repeat(cov[:, :, None], _MODES, axis=2)
        out_mean[..., FASTER, 1] += BEND
        out_mean[..., SLOWER, 1] -= BEND
        out_cov[..., (FASTER, SLOWER), 1, 1] += BEND_SPREAD**2
        self._weigh(score, out_mean, out_cov, 0.0)

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
        if self.mean.shape[-1] == _STATES:
            self._widen(count)
        level = self.mean[..., 0].ravel()
        step = 1e-3 * self.shapes.span
        at, near = model(level), model(level + step)
        shape = self.weight.shape
        row = np.zeros(self.mean.shape)
        row[..., 0] = ((near - at) / step).reshape(shape)
        row[..., _STATES + which] = lasting
        off = value - at.reshape(shape) - lasting * self.mean[..., _STATES + which]
        gain = np.einsum("hjde,hje->hjd", self.cov, row)
        variance = np.einsum("hjd,hjd->hj", gain, row) + deviation**2
        score = -0.5 * (off**2 / variance + np.log(variance))
        wide = -0.5 * (_FAR_OFF**2 + np.log(deviation**2))
        weight = self.weight * np.exp(np.logaddexp(score, wide) - max(float(score.max()), wide))
        share = weight.sum() / max(float(self.weight.sum()), 1e-300)
        self.weight = weight / share
        trust = 1.0 / (1.0 + np.exp(np.clip(wide - score, -50.0, 50.0))) / variance
        self.mean = self.mean + (trust * off)[..., None] * gain
        self.cov = self.cov - (trust[..., None] * gain)[..., None] * gain[..., None, :]
        self._keep()

    def _widen(self, count: int) -> None:
        """Carry the model's errors of requirements, too."""
        h, _, d = self.mean.shape
        wide = np.zeros((h, _MODES, d + count, d + count))
        wide[..., :d, :d] = self.cov
        index = np.arange(d, d + count)
        wide[..., index, index] = 1.0
        self.mean = np.concatenate((self.mean, np.zeros((h, _MODES, count))), axis=-1)
        self.cov = wide
        mean, cov = self._initial
        first = np.zeros((h, d + count, d + count))
        first[:, :d, :d] = cov
        first[:, index, index] = 1.0
        self._initial = (np.concatenate((mean, np.zeros((h, count))), axis=-1), first)

    def _weigh(self, score: Floats, mean: Floats, cov: Floats, without: float) -> None:
        """Weigh all branches, and join those that end in the same mode of a component."""
        top = max(float(score.max()), without)
        weight = self.weight[..., None] * self._modes() * np.exp(score - top)
        dormant = self.dormant * np.exp(without - top)
        total = float(weight.sum()) + dormant
        weight, self.dormant = weight / total, float(dormant / total)
        joined = weight.sum(axis=1)
        part = weight / np.maximum(joined, 1e-300)[:, None]
        self.mean = np.einsum("hij,hijd->hjd", part, mean)
        gap = mean - self.mean[:, None]
        self.cov = np.einsum("hij,hijde->hjde", part, cov + _outer(gap))
        back = _RETURN * joined.sum() * self._prior
        joined *= 1.0 - _RETURN
        joined[:, ORDINARY] += back
        self.weight = joined
        self._keep()

    def _keep(self) -> None:
        """Keep levels in the tables and variances above rounding."""
        shapes, d = self.shapes, self.mean.shape[-1]
        np.clip(self.mean[..., 0], shapes.level[0], shapes.level[-1], out=self.mean[..., 0])
        np.clip(self.mean[..., 1], -GROWTHS, GROWTHS, out=self.mean[..., 1])
        self.cov = 0.5 * (self.cov + np.swapaxes(self.cov, -1, -2))
        index = np.arange(d)
        least = np.full(d, 1e-12)
        least[0] = (1e-6 * shapes.span) ** 2
        self.cov[..., index, index] = np.maximum(self.cov[..., index, index], least)

    def _join(self) -> None:
        """Join the neighbourhoods of growth factors: what is seen now tells them."""
        kinds = np.unique(np.column_stack((self.row, self.scale)), axis=0, return_inverse=True)
        which = kinds[1].ravel()
        count = int(which.max()) + 1
        weight = np.zeros((count, _MODES))
        np.add.at(weight, which, self.weight)
        part = self.weight / np.maximum(weight, 1e-300)[which]
        mean = np.zeros((count, *self.mean.shape[1:]))
        np.add.at(mean, which, part[..., None] * self.mean)
        gap = self.mean - mean[which]
        cov = np.zeros((count, *self.cov.shape[1:]))
        np.add.at(cov, which, part[..., None, None] * (self.cov + _outer(gap)))
        prior = np.zeros(count)
        np.add.at(prior, which, self._prior)
        first = np.zeros((count, *self._initial[0].shape[1:]))
        share = self._prior / prior[which]
        np.add.at(first, which, share[:, None] * self._initial[0])
        spread = np.zeros((count, *self._initial[1].shape[1:]))
        gap0 = self._initial[0] - first[which]
        np.add.at(spread, which, share[:, None, None] * (self._initial[1] + _outer(gap0)))
        rows, scales = kinds[0].T
        self.row, self.scale = rows.astype(np.intp), scales.astype(np.float64)
        self.weight, self.mean, self.cov = weight, mean, cov
        self._prior, self._initial = prior, (first, spread)

    # -- what is known

    def families(self) -> dict[str, float]:
        """Return the probability of each family of growth, where the fault is there."""
        out = dict.fromkeys(self.shapes.names, 0.0)
        total = max(float(self.weight.sum()), 1e-300)
        for row, weight in zip(self.row.tolist(), self.weight.sum(axis=1).tolist(), strict=True):
            out[self.shapes.names[row]] += weight / total
        return out

    def draw(
        self, count: int, rng: np.random.Generator
    ) -> tuple[Floats, npt.NDArray[np.intp], npt.NDArray[np.bool_]]:
        """Draw states, shape (n, d), their rows, and whether the fault is there."""
        weight = np.append(self.weight.ravel(), self.dormant)
        edges = np.cumsum(weight)
        at = (rng.random() + np.arange(count)) / count * edges[-1]
        index = rng.permutation(np.minimum(np.searchsorted(edges, at), len(edges) - 1))
        there = index < self.weight.size
        index = np.minimum(index, self.weight.size - 1)
        d = self.mean.shape[-1]
        cov = self.cov.reshape(-1, d, d)
        used, where = np.unique(index, return_inverse=True)
        values, vectors = np.linalg.eigh(cov[used])
        root = vectors * np.sqrt(np.maximum(values, 0.0))[:, None, :]
        state = self.mean.reshape(-1, d)[index]
        state = state + np.einsum("nij,nj->ni", root[where], rng.standard_normal((count, d)))
        state[:, 0] = np.clip(state[:, 0], self.shapes.level[0], self.shapes.level[-1])
        return state, self.row[index // _MODES], there


def _outer(gap: Floats) -> Floats:
    return gap[..., :, None] * gap[..., None, :]


def _normal(value: float, deviation: float, common: float) -> float:
    variance = deviation**2 + common**2
    return float(np.exp(-0.5 * value**2 / variance) / np.sqrt(2.0 * np.pi * variance))
