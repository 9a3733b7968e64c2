"""What a log's clock and channels look like: rate, jitter, gaps, duplicates, clipped, stuck."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np
import numpy.typing as npt

from elevon.arrays import Bools, Floats
from elevon.errors import FormatError
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
