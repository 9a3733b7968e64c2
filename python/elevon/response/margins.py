"""Margins of an open loop: gain, phase and disk, each with an interval."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, ClassVar

import numpy as np

from elevon.arrays import Complex, Floats
from elevon.plain import Plain, in_unit, key
from elevon.response.bode import zero_between

LEVEL = 0.90
_DRAWS = 400  # of the loop within its deviation: the ends of an interval to a twentieth of it
_FINE = 40  # points between two lines, where the loop is interpolated


@dataclass(frozen=True)
class Margin(Plain):
    """One margin.

    Attributes
    ----------
    value : float or None
        In the unit of its name; None where the frequencies measured do not reach it.
    interval : tuple of float or None
        Of 90 %, from the deviation of the loop; None without one.
    frequency : float or None
        Hz at which it is met.
    """

    value: float | None
    interval: tuple[float, float] | None
    frequency: Annotated[float | None, key("frequency_hz"), in_unit("Hz")]


@dataclass(frozen=True)
class Margins(Plain):
    """Margins of a loop ``L`` under negative feedback.

    Attributes
    ----------
    crossover : Margin
        Hz at which the gain falls through one for good.
    phase : Margin
        Degrees that may be lost there.
    gain : Margin
        Decibels that may be gained where the phase passes -180 degrees.
    disk : Margin
        Symmetric disk margin ``alpha``: the least ``2 |1 + L| / |1 - L|``. Gain by a factor between
        ``(2 - alpha)/(2 + alpha)`` and its inverse and phase by ``2 atan(alpha/2)``, at once
        (P. Seiler, A. Packard, P. Gahinet, IEEE Control Systems Magazine 40(5), 2020).
    """

    crossover: Annotated[Margin, key("crossover_hz"), in_unit("Hz")]
    phase: Annotated[Margin, key("phase_margin_deg"), in_unit("deg")]
    gain: Annotated[Margin, key("gain_margin_db"), in_unit("dB")]
    disk: Annotated[Margin, key("disk_margin")]

    COMPUTED: ClassVar = ("interval_level",)
    interval_level: ClassVar = LEVEL


def margins(frequency: Floats, loop: Complex, std: Floats, seed: int = 0) -> Margins:
    """Return the margins of a loop measured at lines.

    Parameters
    ----------
    frequency : ndarray, shape (n,)
        Hz, rising.
    loop : ndarray of complex, shape (n,)
        Open loop.
    std : ndarray, shape (n,)
        Relative deviation of its gain, and of its phase in rad; NaN: no intervals.
    seed : int
        Of the draws within the deviation.
    """
    draws = []
    if np.isfinite(std).all():
        generator = np.random.default_rng(seed)
        for _ in range(_DRAWS):
            error = generator.normal(size=len(loop)) + 1j * generator.normal(size=len(loop))
            draws.append(loop * np.exp(std * error))
    crossover, phase, gain, disk = (
        _with_interval(reader, frequency, loop, draws)
        for reader in (_crossover, _phase, _gain, _disk)
    )
    return Margins(crossover, phase, gain, disk)


_Point = tuple[float, float] | None


def _with_interval(
    reader: Callable[[Floats, Complex], _Point],
    frequency: Floats,
    loop: Complex,
    draws: list[Complex],
) -> Margin:
    """Return a margin; an interval only where nearly all draws reach it, too."""
    point = reader(frequency, loop)
    if point is None:
        return Margin(None, None, None)
    values = [item[0] for draw in draws if (item := reader(frequency, draw)) is not None]
    if len(values) < LEVEL * _DRAWS:
        return Margin(point[0], None, point[1])
    low, high = np.quantile(values, [0.5 - LEVEL / 2.0, 0.5 + LEVEL / 2.0])
    return Margin(point[0], (float(low), float(high)), point[1])


def _crossover(frequency: Floats, loop: Complex) -> _Point:
    level = np.log(np.abs(loop))
    above = np.flatnonzero(level >= 0.0)
    if not above.size or above[-1] == len(level) - 1:
        return None
    at = zero_between(frequency, level, int(above[-1]))
    return at, at


def _phase(frequency: Floats, loop: Complex) -> _Point:
    point = _crossover(frequency, loop)
    if point is None:
        return None
    phase = np.interp(np.log(point[0]), np.log(frequency), _turned(loop))
    return float(180.0 + np.rad2deg(phase)), point[0]


def _gain(frequency: Floats, loop: Complex) -> _Point:
    """Where the phase passes -180 degrees with the largest gain below one."""
    beyond = _turned(loop) + np.pi
    gain = np.log(np.abs(loop))
    rows = []
    for at in np.flatnonzero((beyond[:-1] >= 0.0) & (beyond[1:] < 0.0)):
        where = zero_between(frequency, beyond, int(at))
        level = float(np.interp(np.log(where), np.log(frequency), gain))
        if level < 0.0:
            rows.append((float(-20.0 / np.log(10.0)) * level, where))
    return min(rows) if rows else None


def _disk(frequency: Floats, loop: Complex) -> _Point:
    grid = np.log(frequency)
    share = np.arange(_FINE) / _FINE
    fine = np.append((grid[:-1, None] + np.diff(grid)[:, None] * share).ravel(), grid[-1])
    between = np.exp(
        np.interp(fine, grid, np.log(np.abs(loop))) + 1j * np.interp(fine, grid, _turned(loop))
    )
    size = 2.0 * np.abs(1.0 + between) / np.maximum(np.abs(1.0 - between), 1e-300)
    at = int(np.argmin(size))
    return float(size[at]), float(np.exp(fine[at]))


def _turned(loop: Complex) -> Floats:
    """Phase in rad, unwrapped, the first line's between -270 and 90 degrees: loops lag."""
    phase = np.unwrap(np.angle(loop))
    first = np.ceil((phase[0] - np.pi / 2.0) / (2.0 * np.pi))
    return np.asarray(phase - 2.0 * np.pi * first)
