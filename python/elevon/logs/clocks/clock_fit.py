"""Offset and drift of a second clock from what two logs saw, with honest deviations.

The load cell's value is a linear combination of the drive's signals, so only the two numbers of the
clock are searched for; the weights follow from them (variable projection). Three things are known
beside the logs and enter as observations: the trigger's edge, what a resonator may be off, and how
late one log may be against the other for reasons that are no clock's (a converter settles, a
current passes a filter). Without the last the trigger would turn every such delay into a drift.

The residuals of such a fit are anything but white: how much less the logs determine than white
noise would let them is estimated, and both the weight against what is known beforehand and the
deviations follow it. The weights and the clock take their share of the few independent samples that
they are worth; where none are left there is no fit.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated

import numpy as np
import numpy.typing as npt

from elevon.arrays import Bools, Floats
from elevon.errors import FormatError
from elevon.estimate.covariance import correlated, long_run_covariance
from elevon.plain import WORKING, Plain, key

IntArray = npt.NDArray[np.intp]
_GAP = 1.5  # an interval longer than this many periods is a gap
_RUN = 5  # samples in a row at the extreme that make clipping


@dataclass(frozen=True, slots=True)
class ClockQuality(Plain):
    """The clock of a log.

    Attributes
    ----------
    samples : int
        Rows used.
    duration : float
        Seconds from first to last.
    period : float
        Nominal period [s]: the slope of time over the sample number, gaps counted.
    rate : float
        1 / period [Hz].
    jitter_rms, jitter_max : float
        Departure of the time stamps from the nominal grid [s].
    gaps : tuple of (float, float, int)
        Start [s], end [s] and samples missing of each gap.
    duplicates : int
        Time stamps that repeat the one before; the first of each is used.
    keep : ndarray of int, shape (samples,)
        Rows used.
    """

    samples: int
    duration: Annotated[float, key("duration_s")]
    rate: Annotated[float, key("rate_hz")]
    period: Annotated[float, key("period_s")]
    jitter_rms: Annotated[float, key("jitter_rms_s")]
    jitter_max: Annotated[float, key("jitter_max_s")]
    gaps: tuple[tuple[float, float, int], ...]
    duplicates: int
    keep: Annotated[IntArray, WORKING]


def clock_quality(source: str, time: Floats) -> ClockQuality:
    """Examine a time column [s].

    Raises
    ------
    FormatError
        Missing time stamps, time that runs backwards, or fewer than two instants.
    """
    if np.isnan(time).any():
        row = int(np.argmax(np.isnan(time))) + 1
        raise FormatError(f"{source}, row {row}: no time stamp")
    steps = np.diff(time)
    back = np.flatnonzero(steps < 0.0)
    if back.size:
        row = int(back[0]) + 1
        raise FormatError(
            f"{source}, row {row + 1}: time runs backwards, from {time[row - 1]:.6g} s "
            f"to {time[row]:.6g} s"
        )
    keep = np.concatenate(([0], np.flatnonzero(steps > 0.0) + 1)).astype(np.intp)
    instants = time[keep]
    if len(instants) < 2:
        raise FormatError(f"{source}: a single instant; a log needs two or more")
    return _examine(instants, keep, len(time) - len(instants))


def _examine(instants: Floats, keep: IntArray, duplicates: int) -> ClockQuality:
    steps = np.diff(instants)
    period = float(np.median(steps))
    # Whole periods between samples: time stamps rounded to 1 ms alternate 2 and 3 ms at 400 Hz, so
    # the median is refined by the slope until the count of periods no longer changes.
    for _ in range(5):
        ticks = np.concatenate(([0.0], np.cumsum(np.maximum(1.0, np.rint(steps / period)))))
        slope = float(np.polyfit(ticks - ticks.mean(), instants - instants.mean(), 1)[0])
        if abs(slope - period) <= 1e-12 * period:
            break
        period = slope
    off = instants - instants.mean() - period * (ticks - ticks.mean())
    long = np.flatnonzero(steps > _GAP * period)
    gaps = tuple(
        (float(instants[k]), float(instants[k + 1]), int(np.rint(steps[k] / period)) - 1)
        for k in long
        if np.rint(steps[k] / period) >= 2
    )
    return ClockQuality(
        samples=len(instants),
        duration=float(instants[-1] - instants[0]),
        period=period,
        rate=1.0 / period,
        jitter_rms=float(np.sqrt(np.mean(off**2))),
        jitter_max=float(np.max(np.abs(off))),
        gaps=gaps,
        duplicates=duplicates,
        keep=keep,
    )


def clipped_share(values: Floats) -> tuple[float, float]:
    """Return the shares of samples that sit in runs at the exact minimum and maximum.

    A run is five samples or more; a constant channel has no clipping.
    """
    good = values[np.isfinite(values)]
    if good.size < _RUN or np.ptp(good) == 0.0:
        return 0.0, 0.0
    return _in_runs(good == good.min()) / good.size, _in_runs(good == good.max()) / good.size


def stuck_spans(
    time: Floats, values: Floats, travel: Floats, allowed: float
) -> list[tuple[float, float]]:
    """Return the spans in which a position stands still although its drive travels.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Seconds.
    values : ndarray, shape (n,)
        The position examined.
    travel : ndarray, shape (n,)
        Position of what drives it, in the same unit.
    allowed : float
        Travel that may leave it still (backlash, resolution).

    Returns
    -------
    list of (float, float)
        Start and end [s].
    """
    changed = np.flatnonzero(np.diff(values) != 0.0) + 1
    edges = np.concatenate(([0], changed, [len(values)]))
    lengths = np.diff(edges)
    spans = []
    for start, length in zip(edges[:-1][lengths >= _RUN], lengths[lengths >= _RUN], strict=True):
        inside = travel[start : start + length]
        if np.ptp(inside) > allowed:
            spans.append((float(time[start]), float(time[start + length - 1])))
    return spans


def _in_runs(mask: Bools) -> int:
    edges = np.flatnonzero(np.diff(np.concatenate(([0], mask.astype(np.int8), [0]))))
    lengths = edges[1::2] - edges[::2]
    return int(lengths[lengths >= _RUN].sum())


RESONATOR_TOLERANCE = 0.005
"""Relative: a ceramic resonator keeps within 0.5 %."""

RESONATOR_STD = RESONATOR_TOLERANCE / math.sqrt(3.0)
"""Its deviation: anywhere within alike."""

_DELAY = 2.0
"""Periods of the slower log: a delta-sigma converter as the load cell's settles in four samples,
so what it shows is late by about two."""

_DETERMINED = 1.0 / 3.0  # of a resonator's deviation: a drift known no better is not used
_APART = 2e-3
"""Seconds: the drive passes its current through a filter (100 Hz: 1.6 ms) and its speed not, so
its signals are late by different amounts, and whichever counts most decides when."""

_RANK = 1e-6  # of the largest singular value: a combination below it says nothing of its own
_ROUNDS = 6  # of estimating how coloured the residuals are
_STEPS = 25
_DONE = 1e-8  # s
_LONGEST = 0.05  # s a step: the filter's width, within which the derivative means something
_FEWEST = 20  # samples
_LEAST_FREEDOM = 2.0  # independent samples beyond the unknowns: Student's has no variance for fewer

_TWICE = [0, 1, 0]  # the unknowns' columns: a delay moves the prediction as the offset does
_DRIFT = np.array([0.0, 1.0, 0.0])
_LATE = np.array([0.0, 0.0, 1.0])


@dataclass(frozen=True)
class SharedLogs:
    """Two logs of one thing, passed through one filter.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Drive's clock [s].
    signals : ndarray, shape (n, m)
        Drive's signals.
    second : ndarray, shape (k,)
        The other clock [s].
    value : ndarray, shape (k,)
        What is explained by the signals and a constant.
    period : float
        Of the slower log [s].
    width : float
        Standard deviation of the filter [s].
    """

    time: Floats
    signals: Floats
    second: Floats
    value: Floats
    period: float
    width: float

    def basis(self, at: Floats) -> Floats:
        """Return a constant and the signals at instants of the drive's clock, (len, 1 + m)."""
        return _columns(self.time, self.signals, at, 1.0)

    def inside(self, offset: float) -> Bools:
        """Which samples of the second log fall into the first, for an offset [s]."""
        at = self.second + offset
        return np.asarray((at >= self.time[0]) & (at <= self.time[-1]))

    def explained(self, offset: float) -> float:
        """Share of the value's variance explained where the logs overlap; 0 without overlap."""
        inside = self.inside(offset)
        if int(inside.sum()) < _FEWEST:
            return 0.0
        target = self.value[inside]
        power = float(np.sum((target - target.mean()) ** 2))
        if power == 0.0:
            return 0.0
        misfit, _ = self.misfit(offset, inside)
        return 1.0 - float(misfit @ misfit) / power

    def misfit(self, offset: float, among: Bools) -> tuple[Floats, int]:
        """Return what the signals leave of some samples for an offset [s], and their rank."""
        basis = self.basis(self.second[among] + offset)
        weights, _, rank, _ = np.linalg.lstsq(basis, self.value[among], rcond=_RANK)
        return self.value[among] - basis @ weights, int(rank)

    def alike(self) -> float:
        """How many samples of the second log one filter makes one of."""
        step = float(np.median(np.diff(self.second)))
        return max(1.0, 2.0 * math.sqrt(math.pi) * self.width / step)

    def independent(self, misfit: Floats) -> float:
        """Return how many independent samples residuals in the order of time are worth."""
        return len(misfit) / max(self.alike(), correlated(misfit))


@dataclass(frozen=True, slots=True)
class ClockEstimate:
    """What the logs and what is known beforehand say together; deviations with each.

    Attributes
    ----------
    offset, drift, residual : tuple of (float, float)
        Seconds, relative, seconds: where the second clock's zero lies, how much it loses, by how
        much the first log's signals are late against the second's.
    explained : float
        Share of the value's variance.
    refused : tuple of (float, float) or None
        The drift that the logs hint at but do not determine; `drift` is then none, give or take
        what a resonator may be off, and the others are what they are without a drift.
    """

    offset: tuple[float, float]
    drift: tuple[float, float]
    residual: tuple[float, float]
    explained: float
    refused: tuple[float, float] | None


@dataclass(frozen=True)
class _Frame:
    """The samples that count, their clock seen from its middle, and what is known beforehand.

    Unknowns, all in seconds: the offset in the middle of the second log, what the drift adds by its
    end, and the delay. `known` and `guess` are their information matrix and their values; `rates`
    the derivatives of the signals by time.
    """

    logs: SharedLogs
    rates: Floats
    second: Floats
    value: Floats
    middle: float
    half: float
    known: Floats
    guess: Floats

    def linear(self, unknown: Floats) -> tuple[Floats, Floats, int]:
        """Return residual, derivative of the prediction by the first two unknowns, and rank."""
        turn = (self.second - self.middle) / self.half
        at = self.second + unknown[0] + unknown[1] * turn + unknown[2]
        basis = self.logs.basis(at)
        space, weights = _range(basis, self.value)
        misfit = self.value - space @ (space.T @ self.value)
        rate = _columns(self.logs.time, self.rates, at, 0.0) @ weights
        jacobian = np.column_stack((rate, rate * turn))
        return misfit, jacobian - space @ (space.T @ jacobian), space.shape[1]

    def cost(self, unknown: Floats, noise: float) -> float:
        """Misfit to minimise, for a variance of the residuals."""
        misfit, *_ = self.linear(unknown)
        off = unknown - self.guess
        return float(misfit @ misfit) / noise + float(off @ self.known @ off)


def fit_clock(
    logs: SharedLogs, guess: float, edge: tuple[float, float] | None
) -> ClockEstimate | None:
    """Estimate offset and drift from a first guess of the offset.

    Parameters
    ----------
    logs : SharedLogs
        Filtered alike.
    guess : float
        Offset [s], right within the filter's width.
    edge : tuple of (float, float) or None
        The trigger's instant and its deviation [s].

    Returns
    -------
    ClockEstimate or None
        None where the logs hardly overlap, hold nothing that moves in time, or are worth hardly
        more independent samples than there are unknowns.
    """
    frame = _frame(logs, guess, edge)
    if frame is None:
        return None
    unknown = frame.guess
    inflation, few = logs.alike(), 1.0  # of a guess that is off the residuals are no noise
    for _ in range(_ROUNDS):
        misfit, jacobian, rank = frame.linear(unknown)
        normal = jacobian.T @ jacobian
        if not np.all(np.isfinite(normal)) or normal[0, 0] <= 0.0:
            return None
        unknown = _descend(frame, unknown, _noise(frame, misfit) * inflation)
        misfit, jacobian, rank = frame.linear(unknown)
        worth = logs.independent(misfit)
        free = worth - rank - jacobian.shape[1] - _LEAST_FREEDOM
        if free <= 0.0:
            return None
        few = worth / free
        inflation = few * max(len(misfit) / worth, _coloured(jacobian, misfit))
    return _estimate(frame, unknown, inflation, few)


def _coloured(jacobian: Floats, misfit: Floats) -> float:
    """How many times white noise's variance is theirs, of the residuals or of their scores."""
    power = max(float(misfit @ misfit), 1e-300)
    scores = long_run_covariance(jacobian * misfit[:, None])
    normal = np.linalg.pinv(jacobian.T @ jacobian, rcond=_RANK)
    of_scores = 0.5 * float(np.trace(normal @ scores)) * len(misfit) / power
    return max(float(long_run_covariance(misfit[:, None])[0, 0]) / power, of_scores)


def _frame(logs: SharedLogs, guess: float, edge: tuple[float, float] | None) -> _Frame | None:
    inside = logs.inside(guess)
    if int(inside.sum()) < _FEWEST:
        return None
    second, value = logs.second[inside], logs.value[inside]
    middle, half = 0.5 * float(second[0] + second[-1]), 0.5 * float(second[-1] - second[0])
    known = np.zeros((3, 3))
    known[1, 1] = (RESONATOR_STD * half) ** -2
    known[2, 2] = (_DELAY * logs.period) ** -2
    if edge is not None:
        lever = _lever(middle, half)
        known += np.outer(lever, lever) / max(edge[1], _DONE) ** 2
    rates = np.gradient(logs.signals, logs.time, axis=0)
    return _Frame(logs, rates, second, value, middle, half, known, np.array([guess, 0.0, 0.0]))


def _lever(middle: float, half: float) -> Floats:
    """Offset at the second clock's zero, as a combination of the unknowns."""
    return np.array([1.0, -middle / half, 0.0])


def _noise(frame: _Frame, misfit: Floats) -> float:
    floor = (1e-9 * float(np.std(frame.value))) ** 2
    return max(float(misfit @ misfit) / len(misfit), floor, 1e-300)


def _descend(frame: _Frame, unknown: Floats, noise: float) -> Floats:
    """Gauss-Newton with halved steps."""
    cost = frame.cost(unknown, noise)
    for _ in range(_STEPS):
        misfit, jacobian, _ = frame.linear(unknown)
        jacobian = jacobian[:, _TWICE]
        pull = jacobian.T @ misfit / noise - frame.known @ (unknown - frame.guess)
        step = np.linalg.solve(jacobian.T @ jacobian / noise + frame.known, pull)
        step *= min(1.0, _LONGEST / max(float(np.abs(step).max()), 1e-300))
        while float(np.abs(step).max()) > _DONE:
            tried = frame.cost(unknown + step, noise)
            if tried < cost:
                break
            step = step / 2.0
        else:
            return unknown
        unknown, cost = unknown + step, tried
    return unknown


def _estimate(frame: _Frame, unknown: Floats, inflation: float, few: float) -> ClockEstimate:
    """Deviations: of the scores as they are, `few` times for so few, and of what was known."""
    misfit, two, _ = frame.linear(unknown)
    noise = _noise(frame, misfit) * inflation
    jacobian = two[:, _TWICE]
    information = jacobian.T @ jacobian / noise + frame.known
    inverse = np.asarray(np.linalg.inv(information), dtype=np.float64)
    scores = few * long_run_covariance(two * misfit[:, None])[np.ix_(_TWICE, _TWICE)] / noise**2
    misplaced = (information - frame.known) @ np.diag([0.0, _APART, _APART])
    covariance = inverse @ (scores + frame.known + misplaced @ misplaced.T) @ inverse
    drift = _pair(_DRIFT / frame.half, unknown, covariance)
    refused = None
    if drift[1] > _DETERMINED * RESONATOR_STD:
        refused = drift
        unknown, covariance = _without_drift(frame, unknown, covariance, inverse)
        drift = (0.0, RESONATOR_STD)
    spread = frame.value - frame.value.mean()
    return ClockEstimate(
        offset=_pair(_lever(frame.middle, frame.half), unknown, covariance),
        drift=drift,
        residual=_pair(_LATE, unknown, covariance),
        explained=1.0 - float(misfit @ misfit) / float(spread @ spread),
        refused=refused,
    )


def _without_drift(
    frame: _Frame, unknown: Floats, covariance: Floats, inverse: Floats
) -> tuple[Floats, Floats]:
    """Return what the others are with the drift held at zero, and what its true value may do."""
    share = inverse[:, 1] / inverse[1, 1]
    turn = np.eye(3) - np.outer(share, _DRIFT)
    misplaced = np.outer(share, share) * (RESONATOR_STD * frame.half) ** 2
    return turn @ unknown, turn @ covariance @ turn.T + misplaced


def _pair(row: Floats, unknown: Floats, covariance: Floats) -> tuple[float, float]:
    """Return a combination of the unknowns and its deviation."""
    return float(row @ unknown), math.sqrt(max(float(row @ covariance @ row), 0.0))


def _range(basis: Floats, value: Floats) -> tuple[Floats, Floats]:
    """Orthonormal columns that span the basis, and weights of it that explain the value best."""
    size = np.linalg.norm(basis, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    left, singular, right = np.linalg.svd(basis / size, full_matrices=False)
    significant = singular > _RANK * singular[0]
    left = left[:, significant]
    weights = right[significant].T @ ((left.T @ value) / singular[significant]) / size
    return left, weights


def _columns(time: Floats, signals: Floats, at: Floats, constant: float) -> Floats:
    columns = [np.interp(at, time, signals[:, k]) for k in range(signals.shape[1])]
    return np.column_stack((np.full_like(at, constant), *columns))
