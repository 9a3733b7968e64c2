"""Envelope of an accelerometer over the angle of a shaft: what passes so many times a turn.

A ball that falls into a spall knocks; the structure rings at its own frequency, so that a line at
the passes' order stands in the spectrum of the envelope and hardly in that of the signal. The
envelope is sampled anew over the angle, since the speed varies (order tracking).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from elevon.arrays import Floats

HARMONICS = 8
_SAMPLES = 256  # a turn
_LEAST_TURNS = 2.0  # of a stretch
_STEADY = 0.7  # of the fastest: the speed of a stretch
_ORDERS = (2.0, 60.0)  # between which the level beside the lines is taken
_SPEED = 0.01  # s over which the angle's slope is taken
_EDGE = 4.0  # rings of the band that a filter's ends need


@dataclass(frozen=True)
class EnvelopeOrders:
    """Power of an envelope at orders of a shaft, a stretch of steady direction each.

    Attributes
    ----------
    turns : tuple of float
        Length of each stretch.
    power : mapping of str to ndarray, shape (stretches, harmonics)
        Squared amplitude at the harmonics of each name's order.
    level : ndarray, shape (stretches,)
        Mean squared amplitude beside all lines: noise.
    levels : float
        Independent lines of noise that the level is known from.
    """

    turns: tuple[float, ...]
    power: Mapping[str, Floats]
    level: Floats
    levels: float

    def score(self, name: str) -> float:
        """Return the sum over stretches and harmonics of power over level."""
        return float(np.sum(self.power[name] / self.level[:, None]))

    @property
    def count(self) -> int:
        """Number of lines that a score sums."""
        return int(next(iter(self.power.values())).size)

    def amplitudes(self, name: str) -> Floats:
        """Return the amplitude of each harmonic, the level taken off, shape (harmonics,)."""
        excess = np.mean(self.power[name] - self.level[:, None], axis=0)
        return np.asarray(np.sqrt(np.maximum(excess, 0.0)))

    def deviations(self) -> Floats:
        """Return the deviation of each harmonic's amplitude by noise, shape (harmonics,)."""
        spread = float(np.sqrt(np.mean(self.level) / (2.0 * len(self.level))))
        return np.full(next(iter(self.power.values())).shape[1], spread)


def ball_passes(
    balls: float, ball: float, pitch: float, angle: float, ratio: float
) -> dict[str, float]:
    """Return passes a turn of the motor by the kinematics of a ball screw.

    Parameters
    ----------
    balls : float
        In one turn of the groove.
    ball, pitch : float
        Diameters of a ball and of the circle on which they run [m].
    angle : float
        Of contact [rad].
    ratio : float
        Turns of the motor a turn of the screw.
    """
    slip = ball * float(np.cos(angle)) / pitch
    return {
        "screw.groove": 0.5 * balls * (1.0 + slip) / ratio,
        "screw.nut": 0.5 * balls * (1.0 - slip) / ratio,
        "screw.ball": pitch / ball * (1.0 - slip * slip) / ratio,
    }


def envelope(values: Floats, rate: float, band: tuple[float, float] | None) -> Floats:
    """Return the envelope of a signal within a band; without a band the signal itself.

    Parameters
    ----------
    values : ndarray, shape (n,)
        The signal.
    rate : float
        Hz.
    band : (float, float) or None
        Hz.
    """
    from scipy.signal import butter, hilbert, sosfiltfilt

    if band is None:
        return values
    sections = butter(4, band, "bandpass", fs=rate, output="sos")
    return np.abs(hilbert(sosfiltfilt(sections, values)))


def envelope_orders(
    angle: Floats,
    values: Floats,
    rate: float,
    orders: Mapping[str, float],
    *,
    band: tuple[float, float] | None = None,
    harmonics: int = HARMONICS,
) -> EnvelopeOrders:
    """Return the power of a signal's envelope at harmonics of orders of a shaft.

    Parameters
    ----------
    angle, values : ndarray, shape (n,)
        Of the shaft [rad]; the signal, both on one even clock.
    rate : float
        Hz.
    orders : mapping of str to float
        Passes a turn, by name.
    band : (float, float) or None
        Hz, where the structure rings.
    harmonics : int
        Of each order.

    Raises
    ------
    ValueError
        No stretch of two turns in one direction at a steady speed.
    """
    level_of = envelope(values, rate, band)
    parts = stretches(angle, rate, 0.0 if band is None else _EDGE / (band[1] - band[0]))
    if not parts:
        raise ValueError("no stretch of two turns in one direction at a steady speed")
    rows: dict[str, list[Floats]] = {name: [] for name in orders}
    levels, turns, known = [], [], 0.0
    for part in parts:
        even, length = _over_angle(angle[part], level_of[part])
        count = np.arange(1.0, harmonics + 1.0)
        lines = {name: np.asarray(order * count) for name, order in orders.items()}
        for name, at in lines.items():
            rows[name].append(_power(even, at))
        level, lines_of_noise = _level(even, length, list(orders.values()))
        levels.append(level)
        known += lines_of_noise
        turns.append(length)
    power = {name: np.array(items) for name, items in rows.items()}
    return EnvelopeOrders(tuple(turns), power, np.array(levels), known)


def stretches(angle: Floats, rate: float, edge: float = 0.0) -> list[slice]:
    """Return where a shaft turns in one direction at a steady speed for two turns or more."""
    width = max(1, round(_SPEED * rate))
    slope = np.zeros(len(angle))
    slope[width:-width] = (angle[2 * width :] - angle[: -2 * width]) / (2.0 * width / rate)
    fast = np.abs(slope) > _STEADY * float(np.quantile(np.abs(slope), 0.9))
    signed = np.where(fast, np.sign(slope), 0.0)
    ends = np.flatnonzero(np.diff(signed)) + 1
    bounds = [0, *ends.tolist(), len(angle)]
    cut = round(edge * rate)
    parts = [slice(a + cut, b - cut) for a, b in pairwise(bounds)
             if signed[a] != 0.0 and b - a > 2 * cut + 2]  # fmt: skip
    return [p for p in parts if abs(angle[p.stop - 1] - angle[p.start]) >= _LEAST_TURNS * 2 * np.pi]


def _over_angle(angle: Floats, values: Floats) -> tuple[Floats, float]:
    """Return a signal on an even grid of the angle, and the turns that it covers."""
    turned = np.maximum.accumulate(np.abs(angle - angle[0])) / (2.0 * np.pi)
    grid = np.arange(int(turned[-1] * _SAMPLES)) / _SAMPLES
    return np.interp(grid, turned, values), float(turned[-1])


def _power(values: Floats, orders: Floats) -> Floats:
    """Return the squared amplitudes at orders, under a Hann window; shape of `orders`."""
    window = np.hanning(len(values))
    weighted = (values - np.average(values, weights=window)) * window
    turned = 2.0j * np.pi * np.arange(len(values)) / _SAMPLES
    lines = np.exp(-np.outer(orders, turned)) @ weighted
    return np.asarray(np.abs(2.0 * lines / np.sum(window)) ** 2)


def _level(values: Floats, turns: float, orders: Sequence[float]) -> tuple[float, float]:
    """Return the mean power beside the lines, and from how many lines it is known.

    From the median, which single lines do not move; it knows half as much as the mean would.
    """
    low, high = _ORDERS
    grid: Floats = np.arange(low, high, 2.0 / turns)
    away = np.ones(len(grid), dtype=bool)
    for order in orders:
        away &= np.abs(grid / order - np.rint(grid / order)) * order > min(2.0 / turns, 0.3 * order)
    chosen: Floats = grid[away] if away.sum() > 8 else grid
    level = float(np.median(_power(values, chosen)) / np.log(2.0))
    return level, len(chosen) * float(np.log(2.0)) ** 2
