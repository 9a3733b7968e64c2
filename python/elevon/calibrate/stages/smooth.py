"""Channels of a log, all smoothed alike; the samples that count in a balance."""

from __future__ import annotations

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.estimate.signals import local_polynomial
from elevon.logs.log import Log, per_log

LOAD = ("load", "load_cell")
_WIDTH = 0.05  # s of the polynomials that smooth all channels alike
#: Eighth order, in the order in which a convolution takes it.
_STENCIL = np.array([-3, 32, -168, 672, 0, -672, 168, -32, 3]) / 840.0
_SLOPES = {"acceleration": "motor_speed", "current_slope": "torque_current"}
_SLOWEST = 0.01  # s between samples, from which a log shows temperatures only
_MOVES = 0.05  # of the largest speed: below it the friction's sign is open
CORNERS = (
    0.06,
    0.1,
)  # s about a reversal or a limit that do not count; the second is a choice as good
_LIMIT = 0.98  # of the largest set point of the current: the drive is limited


def quick(log: Log) -> bool:
    """Whether the motion is sampled quickly enough for balances."""
    return log.period < _SLOWEST


def loaded(log: Log) -> bool:
    """Whether the force on the ram was measured."""
    return any(log.has(role) for role in LOAD)


@per_log
def smooth(log: Log) -> dict[str, Floats]:
    """All channels, and slopes of speed, position and current, through one smoother."""
    slopes = {name: slope(log[role], log.period) for name, role in _SLOPES.items() if log.has(role)}
    every = {**log.channels, **slopes}
    return {role: smoothed(values, log.period) for role, values in every.items()}


def apart(log: Log, corner: float = CORNERS[0]) -> Bools:
    """Return the samples in motion, so long apart from reversals and limits."""
    speed = smooth(log)["motor_speed"]
    away = np.abs(speed) < _MOVES * float(np.max(np.abs(speed)))
    if log.has("current_ref"):
        size = np.abs(log["current_ref"])
        top = float(np.max(size))
        away |= (size > _LIMIT * top) & (np.median(size) < 0.5 * top)
    width = 2 * round(corner / log.period) + 1
    near = np.convolve(away.astype(float), np.ones(width), mode="same") > 0.5
    edge = (log.time < _WIDTH) | (log.time > log.time[-1] - _WIDTH)
    return np.asarray(~near & ~edge)


def smoothed(values: Floats, period: float) -> Floats:
    """Values through the polynomials that smooth all channels alike."""
    return local_polynomial(values, period, _WIDTH, order=3)


def slope(values: Floats, period: float) -> Floats:
    """Slope by central differences of eighth order: in a balance it is smoothed like the rest.

    The slope of a polynomial through the smoother's window is smoothed more than the values are:
    at the corners of a trapezoid that made masses 10 % too large.
    """
    padded = np.pad(values, 4, mode="edge")
    return np.asarray(np.convolve(padded, _STENCIL / period, mode="valid"), dtype=np.float64)
