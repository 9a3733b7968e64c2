"""Thresholds of an actuator file, from errors on healthy data held out of the fit."""

from __future__ import annotations

import math

import numpy as np

from elevon.calibrate.validation import SignalError, Validation

_MARGIN = 2.0  # a threshold over the largest error seen on held-out data
_APART = 5.0  # times the median over the logs: a log that is not like the others ...
_BAD = 2.0  # ... and percent of the range: kinds of tests differ as much at small errors


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
