"""Play of each log, where a campaign changed it between its logs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from elevon.calibrate.log import BenchLog
from elevon.calibrate.play import PlayFit, fit_play, median_width

__all__ = ["PER_LOG", "differing_plays", "plays_differ", "pooled_play"]

#: What may be estimated for each log on its own.
PER_LOG = ("play.total",)
_APART = 0.05  # relative difference of two plays that is one
_COUNTS = 3.0  # counts of the encoder that it also exceeds
_SIGMAS = 4.0  # deviations that it also exceeds


def differing_plays(logs: Sequence[BenchLog], ratio: float, count: float) -> dict[str, PlayFit]:
    """Return each log's own fit where the logs' plays differ, else nothing.

    Parameters
    ----------
    logs : sequence of BenchLog
        Those without both positions, or without a reversal, are passed over.
    ratio : float
        Gear ratio.
    count : float
        One count of the encoder at the user [rad].
    """
    widths = [median_width(log, ratio, count) for log in logs]
    known = [width for width in widths if width is not None]
    if len(known) < 2 or not _apart(min(known), max(known), count, 0.0):
        return {}
    fits = {log.name: fit_play([log], ratio, count) for log in logs}
    plays = {name: fit for name, fit in fits.items() if fit is not None}
    least = min(plays.values(), key=lambda fit: fit.play[0])
    most = max(plays.values(), key=lambda fit: fit.play[0])
    std = math.hypot(least.play[1], most.play[1])
    return plays if _apart(least.play[0], most.play[0], count, std) else {}


def _apart(least: float, most: float, count: float, std: float) -> bool:
    return most - least > max(_COUNTS * count, _APART * most, _SIGMAS * std)


def pooled_play(plays: dict[str, PlayFit]) -> PlayFit:
    """Offset, gain and delay of the encoder over all logs; the play is the widest log's."""
    fits = list(plays.values())
    best = max(fits, key=lambda fit: fit.play[0])
    if any(fit.floats for fit in fits):
        return best
    return replace(
        best,
        offset=_mean([fit.offset for fit in fits]),
        gain=_mean([fit.gain for fit in fits]),
        delay=_mean([fit.delay for fit in fits]),
        logs=tuple(plays),
    )


def _mean(pairs: Sequence[tuple[float, float]]) -> tuple[float, float]:
    """Weighted mean; its deviation grows with the scatter where that is larger."""
    weight = [1.0 / max(std, 1e-12) ** 2 for _, std in pairs]
    total = sum(weight)
    mean = sum(w * value for w, (value, _) in zip(weight, pairs, strict=True)) / total
    chi = sum(w * (value - mean) ** 2 for w, (value, _) in zip(weight, pairs, strict=True))
    return mean, math.sqrt(max(1.0, chi / max(len(pairs) - 1, 1)) / total)


def plays_differ(plays: dict[str, PlayFit], extra: float) -> str:
    """Say that the plays differ, with each log's, in degrees."""
    each = ", ".join(
        f"{name} {math.degrees(fit.play[0] - extra):.2f} deg" for name, fit in plays.items()
    )
    return (
        f"plays differ: {each}; play.total is left as it was (--per-log play.total lists each "
        "log's with its interval)"
    )
