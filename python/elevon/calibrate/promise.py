"""What an actuator file promises of its agreement with a log: from healthy held-out data."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.calibrate.log import BenchLog
from elevon.calibrate.validation import SignalError, Validation, validate
from elevon.errors import InputError
from elevon.progress import Progress, part

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["held_out_agreement", "outliers", "thresholds"]

_MARGIN = 2.0  # a threshold over the largest error seen on held-out data
_APART = 5.0  # times the median over the logs: a log that is not like the others ...
_BAD = 2.0  # ... and percent of the range: kinds of tests differ as much at small errors


def held_out_agreement(
    logs: Sequence[BenchLog],
    before: Actuator,
    free: Sequence[str] | None,
    like: Validation,
    progress: Progress | None = None,
) -> Validation | None:
    """Calibrate without each log in turn and hold the outcome against that log.

    Parameters
    ----------
    logs : sequence of BenchLog
        Healthy, as calibrated.
    before : Actuator
        Values before.
    free : sequence of str or None
        As calibrated.
    like : Validation
        Of the logs under values fitted to all: its transient and its offsets.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Returns
    -------
    Validation or None
        One row a log and signal; a log without which the others determine too little is left out.
        None where nothing could be held out (a single log).
    """
    from elevon.calibrate.calibration import calibrate

    rows: list[SignalError] = []
    if len(logs) < 2:
        return None
    for k, log in enumerate(logs):
        others = [other for j, other in enumerate(logs) if j != k]
        share = part(progress, k / len(logs), (k + 1) / len(logs))
        try:
            fitted = calibrate(
                others, before, free=free, hold_out=False, model_runs=False, progress=share
            )
            validated = validate([log], fitted.actuator, transient=like.transient)
        except InputError:
            continue
        rows += validated.errors
    return replace(like, errors=tuple(rows)) if rows else None


def outliers(validation: Validation) -> list[str]:
    """Return the logs that are far worse than the others: no measure of a healthy machine."""
    names = set()
    for rows in _by_signal(validation).values():
        middle = float(np.median([row.of_range for row in rows]))
        if len(rows) > 2:
            names |= {row.log for row in rows if row.of_range > max(_APART * middle, _BAD)}
    return sorted(names)


def thresholds(validation: Validation) -> dict[str, float]:
    """Return twice the largest error of each signal over the logs, two digits, rounded up.

    Of three logs or more those that are far worse than the others do not count.
    """
    apart = outliers(validation)
    limits = {}
    for name, rows in _by_signal(validation).items():
        largest = max((row.of_range for row in rows if row.log not in apart), default=0.0)
        if largest > 0.0:
            limits[name] = _up(_MARGIN * largest)
    return limits


def _by_signal(validation: Validation) -> dict[str, list[SignalError]]:
    groups: dict[str, list[SignalError]] = {}
    for row in validation.errors:
        if math.isfinite(row.of_range) and row.log not in validation.notes:
            groups.setdefault(row.signal, []).append(row)
    return groups


def _up(value: float) -> float:
    unit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / unit) * unit:.6g}")
