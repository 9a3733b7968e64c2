"""Do the columns agree with each other? A position is the integral of its speed, and so on.

What a map states and the data contradict is refused with the figure; what nothing shows stays as
stated. Where both a command and the position that follows it are logged, they must run the same
way and be of one size.
"""

from __future__ import annotations

import math

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.estimate.signals import integral
from elevon.logs.maps.column_map import ColumnMap
from elevon.logs.report import ImportReport
from elevon.recording import Recording

#: What follows what: (role, reference, how the reference is turned into it).
_PAIRS = (
    ("output_position", "output_speed", "integral"),
    ("output_speed", "motor_speed", "ratio"),
    ("output_position", "command", "follows"),
    ("motor_speed", "speed_ref", "follows"),
)
_AGAINST = {"integral": "the integral of {}", "ratio": "{} over the ratio", "follows": "{}"}
_EXPLAINED = 0.9  # share of the variance below which nothing is concluded
_OFF = 0.15  # log of the factor by which an integral or a ratio may be off
_FOLLOWS = math.log(2.0)  # a servo follows its command within this factor, where it follows
_LEAST = 30  # samples
_SHAFTS = (("output_position", "output_speed"), ("motor_position", "motor_speed"))
_STRETCHES = 8  # whose lags are compared
_CERTAIN = 4.0  # deviations of their mean: a lag that is stated
_SHORTEST = 0.5  # of a sampling period: a shorter one is not stated


def check_agreement(
    recording: Recording, ratio: float | None, report: ImportReport, column_map: ColumnMap | None
) -> None:
    """Compare the columns of a log with each other.

    Parameters
    ----------
    recording : Recording
        With roles.
    ratio : float or None
        Motor over output, rad a rad or rad a m.
    report : ImportReport
        Findings are added to it.
    column_map : ColumnMap or None
        What the caller states: a contradiction is an error; without a map it is a warning.

    Raises
    ------
    InputError
        The data contradict the map; role, figure and reference are named.
    """
    for role, other, how in _PAIRS:
        if role not in recording.roles or other not in recording.roles:
            continue
        value, reference = recording.role(role), recording.role(other)
        if how == "follows" and value.unit != reference.unit:
            continue
        if how == "ratio" and ratio is None:
            continue
        seen = np.asarray(reference.values, dtype=np.float64)
        if how == "integral":
            seen = integral(value.time, np.where(np.isfinite(seen), seen, 0.0))
        elif how == "ratio":
            seen = seen / float(ratio or 1.0)
        slope, explained = slope_and_fit(seen, np.asarray(value.values, dtype=np.float64))
        if explained < _EXPLAINED:
            continue
        if slope > 0.0 and abs(math.log(slope)) < (_FOLLOWS if how == "follows" else _OFF):
            continue
        text = f"{role} moves {slope:.4g} times {_AGAINST[how].format(other)}"
        if column_map is not None:
            raise InputError(
                f"{report.source}: the map contradicts the data: {text}; "
                "check unit, scale, sign and ratio of both columns"
            )
        report.say(role, "disagrees", text)
    for place, rate in _SHAFTS:
        if {place, rate} <= recording.roles.keys():
            _lagging(recording, place, rate, report)


def _lagging(recording: Recording, place: str, rate: str, report: ImportReport) -> None:
    """Report by how much a position comes later than the speed of its shaft; nothing is shifted."""
    position, speed = recording.role(place), recording.role(rate)
    if position.clock is not speed.clock or len(position) < _STRETCHES * _LEAST:
        return
    lag, deviation = lag_of(position.time, position.values, speed.values)
    period = float(np.median(np.diff(position.time)))
    if abs(lag) > max(_CERTAIN * deviation, _SHORTEST * period):
        first, second = (place, rate) if lag > 0.0 else (rate, place)
        report.say(first, "lag", 1e3 * abs(lag), 1e3 * deviation, second)


def lag_of(time: Floats, position: Floats, speed: Floats) -> tuple[float, float]:
    """Return how much later than its speed a position was recorded, and the deviation [s].

    Over each of eight stretches the position is the speed's integral less the speed times the lag.
    Stretches with missing samples, at rest, or in which a position is something else say nothing.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s.
    position, speed : ndarray, shape (n,)
        Of one shaft.

    Returns
    -------
    lag, deviation : float
        (0, inf) where fewer than three stretches show it.
    """
    lags = []
    for part in np.array_split(np.arange(len(time)), _STRETCHES):
        t, p, v = time[part] - time[part[0]], position[part], speed[part]
        if not (np.isfinite(p).all() and np.isfinite(v).all() and np.ptp(v) > 0.0):
            continue
        turned = integral(t, v)
        size = np.array([np.ptp(turned), np.ptp(v), 1.0, t[-1]])
        design = np.column_stack((turned, v, np.ones(len(t)), t)) / size
        fit, *_ = np.linalg.lstsq(design, p, rcond=None)
        left = p - design @ fit
        if fit[0] != 0.0 and float(np.var(left)) < (1.0 - _EXPLAINED) * float(np.var(p)):
            lags.append(-float(fit[1] / size[1]) / float(fit[0] / size[0]))
    if len(lags) < 3:
        return 0.0, math.inf
    return float(np.mean(lags)), float(np.std(lags, ddof=1) / math.sqrt(len(lags)))


def slope_and_fit(x: Floats, y: Floats) -> tuple[float, float]:
    """Slope of y over x and the share of y's variance that it explains; (0, 0) where x stands."""
    good = np.isfinite(x) & np.isfinite(y)
    if good.sum() < _LEAST:
        return 0.0, 0.0
    dx, dy = x[good] - x[good].mean(), y[good] - y[good].mean()
    power, spread = float(dx @ dx), float(dy @ dy)
    if not (power > 0.0 and spread > 0.0):
        return 0.0, 0.0
    slope = float(dx @ dy) / power
    return slope, 1.0 - float(np.sum((dy - slope * dx) ** 2)) / spread


def evened(time: Floats) -> Floats:
    """Return a time column with the repeated readings of a coarse clock spread evenly.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Never going back, rising somewhere.
    """
    count = len(time)
    first = np.flatnonzero(np.diff(time, prepend=-np.inf) > 0.0)
    # The last reading lasts as long as the usual one.
    length = float(np.median(np.diff(first)))
    rate = float(np.median(np.diff(time[first]))) / length
    rows = np.append(first, count)
    readings = np.append(time[first], time[-1] + rate * (count - first[-1]))
    return np.asarray(np.interp(np.arange(count), rows, readings), dtype=np.float64)
