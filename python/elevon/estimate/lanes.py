"""Fit of model runs: Levenberg and Marquardt from several starts, the runs of a step one batch.

Residuals are in deviations, one channel of one log after the other; what is believed of each
number before the data counts like one residual more. All samples of a channel count for the share
of them that is independent.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from elevon.arrays import Floats, Ints
from elevon.estimate.covariance import block_length, joined, memory
from elevon.estimate.free import Free, bounds, inner, outer

#: Points of a fit to the channels of each, one after another as in `Lanes.channels`; None where a
#: run left the finite numbers.
Runs = Callable[[Sequence[Mapping[str, float]]], Sequence[Sequence[Floats | None]]]
SOFT = 3.0  # deviations beyond which a residual weighs less
_BIG = 1e3  # residual of a run that left the finite numbers
_LEAST = 2e-4  # of a channel's spread: its deviation at least
_LADDER = (0.03, 0.5, 10.0, 300.0)  # damping tried in each step, over the last one
_STEP = 0.03  # of a logarithm, or of an offset's spread: over the switching instants
_FLOOR = 1e-12  # of the strongest parameter's curvature: what damps one that moves nothing
_SETTLED = 1e-4  # relative fall of the cost below which a start rests


@dataclass(frozen=True)
class LaneChannel:
    """Samples of one channel of one log that count.

    Attributes
    ----------
    log : int
        Number of the log.
    name : str
        Of the channel.
    time, data : ndarray, shape (n,)
        Instants [s] and values, SI.
    period : float
        Of the log [s].
    size : float
        Spread of the data.
    first : float
        First deviation of the residual.
    """

    log: int
    name: str
    time: Floats
    data: Floats
    period: float
    size: float
    first: float


@dataclass
class Point:
    """One start on its way."""

    x: Floats
    residual: Floats
    cost: float
    damping: float = 1.0
    slow: bool = False
    settled: bool = False


class Lanes:
    """Residuals by point, stacked over logs and channels, and their minimum.

    Parameters
    ----------
    free : sequence of Free
        What moves; its spreads are what is believed before.
    runs : callable
        Values by path, one mapping a point, to each point's channels.
    channels : sequence of LaneChannel
        The data.
    belief : float
        Weight of what is believed before; 0: nothing is.

    Attributes
    ----------
    scales : ndarray, shape (c,)
        Deviation of each channel.
    share : ndarray, shape (n,)
        Independent share of each sample.
    """

    def __init__(
        self, free: Sequence[Free], runs: Runs, channels: Sequence[LaneChannel], belief: float = 1.0
    ) -> None:
        self.free = tuple(free)
        self.channels = tuple(channels)
        self.belief = belief
        self.first = inner(free)
        self.low, self.high = bounds(free)
        self.scales = np.array([max(item.first, 1e-12) for item in channels])
        self.share = np.ones(sum(len(item.data) for item in channels))
        self._runs = runs
        ends = np.cumsum([0, *(len(item.data) for item in channels)]).tolist()
        self.slices = [slice(a, b) for a, b in pairwise(ends)]

    def predicted(self, x: Floats) -> Sequence[Floats | None]:
        """Return the channels of one point, shape (p,)."""
        return self._runs([outer(self.free, x)])[0]

    def residual(self, x: Floats) -> Floats:
        """Stacked residuals of points, shape (m, p) to (m, n)."""
        points = [outer(self.free, row) for row in np.atleast_2d(x)]
        return np.array([self._row(predicted) for predicted in self._runs(points)])

    def _row(self, predicted: Sequence[Floats | None]) -> Floats:
        parts = []
        for item, values, scale in zip(self.channels, predicted, self.scales, strict=True):
            off = np.full(len(item.data), _BIG) if values is None else (values - item.data) / scale
            parts.append(np.clip(off, -_BIG, _BIG))
        return np.concatenate(parts)

    def prior(self, x: Floats) -> Floats:
        """Rows of the belief: how far from the first value, in its spreads; shape (p,)."""
        return np.asarray((x - self.first) * self.belief)

    def cost(self, residual: Floats, x: Floats) -> float:
        """Robust cost of one point: that of its samples and of the belief."""
        return float(np.sum(self.costs(residual)) + np.sum(self.prior(x) ** 2))

    def costs(self, residual: Floats) -> Floats:
        """Robust cost of each sample, for the share of it that is independent, shape (n,)."""
        soft = 2.0 * SOFT**2 * (np.sqrt(1.0 + (residual / SOFT) ** 2) - 1.0)
        return np.asarray(self.share * soft)

    def weight(self, residual: Floats) -> Floats:
        """Weight of each sample in the normal equations: independent share, robust."""
        return np.asarray(self.share / np.sqrt(1.0 + (residual / SOFT) ** 2))

    def normal(self, jac: Floats, weight: Floats) -> Floats:
        """Normal equations of weighted samples and the belief, shape (p, p)."""
        return np.asarray(jac.T @ (weight[:, None] * jac) + self.belief**2 * np.eye(jac.shape[1]))

    def slope(self, point: Point, jac: Floats, weight: Floats) -> Floats:
        """Half the derivative of the cost, shape (p,)."""
        return np.asarray(jac.T @ (weight * point.residual) + self.belief * self.prior(point.x))

    def refresh(self, x: Floats) -> None:
        """Set deviations and independent shares to what the residuals really have.

        The position remembers an integral action for a second, the current nothing: counted alike,
        the position would decide everything, down to single ticks of a saturated integrator.
        """
        residual = self.residual(x[None, :])[0]
        for k, (item, place) in enumerate(zip(self.channels, self.slices, strict=True)):
            bounded = np.clip(residual[place], -2.0 * SOFT, 2.0 * SOFT)
            rms = float(np.sqrt(np.mean(bounded**2)))
            self.scales[k] = max(self.scales[k] * rms, _LEAST * item.size, 1e-12)
            self.share[place] = 1.0 / memory(bounded)

    def point(self, x: Floats) -> Point:
        """Return a point with its residual and cost."""
        residual = self.residual(x[None, :])[0]
        return Point(x, residual, self.cost(residual, x))

    def blocks(self, residual: Floats) -> Ints:
        """Number the blocks of all samples, shape (n,): of time, longer than a residual's memory.

        The channels of a log share its blocks.
        """
        numbers: list[Ints] = []
        for log in dict.fromkeys(item.log for item in self.channels):
            mine = [k for k, item in enumerate(self.channels) if item.log == log]
            period = self.channels[mine[0]].period
            length = max(block_length(residual[self.slices[k]], period) for k in mine)
            times = np.concatenate([self.channels[k].time for k in mine])
            numbers.append(np.floor(times / length).astype(np.int64))
        return joined(numbers)

    def jacobian(self, points: Sequence[Point], *, central: bool = False) -> list[Floats]:
        """Return derivatives of the residuals by differences over a batch, (n, p) a point."""
        h = np.array([_STEP / f.spread if f.log_scale else _STEP for f in self.free])
        size = len(h)
        # Away from a bound that is near.
        signs = [np.where(point.x + h > self.high, -1.0, 1.0) for point in points]
        rows = []
        for point, sign in zip(points, signs, strict=True):
            rows += [point.x + np.diag(h * sign)]
            rows += [point.x - np.diag(h * sign)] if central else []
        residuals = self.residual(np.vstack(rows))
        width = size * (2 if central else 1)
        jacs = []
        for k, (point, sign) in enumerate(zip(points, signs, strict=True)):
            ahead = residuals[k * width : k * width + size]
            back = residuals[k * width + size : (k + 1) * width] if central else point.residual
            jacs.append(((ahead - back) / ((1 + central) * h * sign)[:, None]).T)
        return jacs

    def solve(
        self,
        starts: Floats,
        *,
        rounds: int,
        keep: int | None = None,
        central: bool = False,
        advance: Callable[[float], object] = lambda _f: None,
    ) -> list[Point]:
        """Return the starts after some rounds, best first; shape of `starts` (m, p).

        After two rounds only the best `keep` go on.
        """
        starts = np.clip(np.atleast_2d(starts), self.low, self.high)
        first = self.residual(starts)
        points = [Point(x, r, self.cost(r, x)) for x, r in zip(starts, first, strict=True)]
        points.sort(key=lambda point: point.cost)
        points = points if keep is None else points[: 3 * keep]
        for number in range(rounds):
            if keep is not None and number == 2:
                points = points[:keep]
            going = [point for point in points if not point.settled]
            if not going:
                break
            self._round(going, central)
            points.sort(key=lambda point: point.cost)
            advance((number + 1) / rounds)
        return points

    def _round(self, points: list[Point], central: bool) -> None:
        """One step of every point: the best of a ladder of dampings."""
        jacs = self.jacobian(points, central=central)
        trials = np.vstack([self._trials(p, jac) for p, jac in zip(points, jacs, strict=True)])
        residuals = self.residual(trials)
        width = len(_LADDER)
        for k, point in enumerate(points):
            part = slice(k * width, (k + 1) * width)
            costs = [self.cost(r, x) for r, x in zip(residuals[part], trials[part], strict=True)]
            best = int(np.argmin(costs))
            if not costs[best] < point.cost:
                point.settled = point.damping >= 1e6
                point.damping = min(point.damping * 100.0, 1e6)
                continue
            # One small step is a narrow valley, two are the end.
            small = point.cost - costs[best] < _SETTLED * point.cost
            point.settled = small and point.slow
            point.slow = small
            point.damping = min(max(point.damping * _LADDER[best] * 0.3, 1e-8), 1e6)
            point.x, point.residual = trials[part][best], residuals[part][best]
            point.cost = costs[best]

    def _trials(self, point: Point, jac: Floats) -> Floats:
        """Steps under each damping, from the weighted normal equations; (len(_LADDER), p)."""
        weight = self.weight(point.residual)
        normal, slope = self.normal(jac, weight), self.slope(point, jac, weight)
        # What moves nothing here is damped like the rest, so that it stays.
        size = np.diag(normal)
        diagonal = np.diag(np.maximum(size, _FLOOR * max(float(size.max()), _FLOOR)))
        steps = [np.linalg.solve(normal + point.damping * f * diagonal, -slope) for f in _LADDER]
        moved = point.x + np.clip(np.array(steps), -1.0, 1.0)
        return np.asarray(np.clip(moved, self.low, self.high), dtype=np.float64)
