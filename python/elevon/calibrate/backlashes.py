"""Backlash of each log, where a campaign changed it between its logs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from statistics import fmean, stdev

from elevon.calibrate.backlash import BacklashFit, fit_backlash, median_width
from elevon.estimate.number import weighted_mean
from elevon.logs.log import Log

#: What may be estimated for each log on its own.
PER_LOG = ("backlash.total",)
_APART = 0.05  # relative difference of two backlashes that is one
_COUNTS = 3.0  # counts of the encoder that it also exceeds
_SIGMAS = 4.0  # deviations that it also exceeds


def differing_backlashes(logs: Sequence[Log], ratio: float, count: float) -> dict[str, BacklashFit]:
    """Return each log's own fit where the logs' backlashes differ, else nothing.

    Parameters
    ----------
    logs : sequence of Log
        Those without both positions, or without a reversal, are passed over.
    ratio : float
        Gear ratio.
    count : float
        One count of the encoder at the output [rad].
    """
    widths = [median_width(log, ratio, count) for log in logs]
    known = [width for width in widths if width is not None]
    if len(known) < 2 or not _apart(min(known), max(known), count, 0.0):
        return {}
    fits = {log.name: fit_backlash([log], ratio, count) for log in logs}
    backlashes = {name: fit for name, fit in fits.items() if fit is not None}
    least = min(backlashes.values(), key=lambda fit: fit.backlash[0])
    most = max(backlashes.values(), key=lambda fit: fit.backlash[0])
    std = math.hypot(least.backlash[1], most.backlash[1])
    return backlashes if _apart(least.backlash[0], most.backlash[0], count, std) else {}


def _apart(least: float, most: float, count: float, std: float) -> bool:
    return most - least > max(_COUNTS * count, _APART * most, _SIGMAS * std)


def mean_backlash(backlashes: dict[str, BacklashFit]) -> BacklashFit:
    """The mean of logs whose backlashes differ, its deviation that of one log about it."""
    widths = [fit.backlash[0] for fit in backlashes.values()]
    noise = max(fit.backlash[1] for fit in backlashes.values())
    first = next(iter(backlashes.values()))
    width = (fmean(widths), math.hypot(stdev(widths), noise))
    return replace(first, backlash=width, degrees=len(widths) - 1, logs=tuple(backlashes))


def pooled_backlash(backlashes: dict[str, BacklashFit]) -> BacklashFit:
    """Offset, gain and delay of the encoder over all logs; the backlash is the widest log's."""
    fits = list(backlashes.values())
    best = max(fits, key=lambda fit: fit.backlash[0])
    if any(fit.floats for fit in fits):
        return best
    return replace(
        best,
        offset=weighted_mean([fit.offset for fit in fits]),
        gain=weighted_mean([fit.gain for fit in fits]),
        delay=weighted_mean([fit.delay for fit in fits]),
        logs=tuple(backlashes),
    )


def backlashes_differ(backlashes: dict[str, BacklashFit], extra: float) -> str:
    """Say that the backlashes differ, with each log's, in degrees, and what becomes of it."""
    each = ", ".join(
        f"{name} {math.degrees(fit.backlash[0] - extra):.2f} deg"
        for name, fit in backlashes.items()
    )
    return (
        f"backlashes differ: {each}; backlash.total is their mean with the interval of one log, or "
        "left as it was where they differ by more than a quarter of it "
        "(--per-log backlash.total lists each "
        "log's with its interval)"
    )
