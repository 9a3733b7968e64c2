"""How a commanded motion repeats: its period, or the action with which it begins again."""

from __future__ import annotations

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError

_CLOSE = 0.06  # of the command's range, RMS: two periods differ by less; square waves by a sample
_AWAY = 0.15  # likewise: a command has gone away
_REPEATS = 1.0  # periods, beside the first, that a command must show


def period_of(time: Floats, command: Floats, name: str) -> float:
    """Return the period of a command [s].

    Parameters
    ----------
    time : ndarray, shape (n,)
        Even, from the instant at which it began [s].
    command : ndarray, shape (n,)
        What was commanded.
    name : str
        Of the log.

    Raises
    ------
    InputError
        It does not repeat, or not within the log.
    """
    lags, off = _differences(command)
    size = max(float(np.ptp(command)), 1e-300)
    away = np.flatnonzero(off > _AWAY * size)
    back = np.flatnonzero(off < _CLOSE * size)
    back = back[back > away[0]] if away.size else back[:0]
    if not back.size:
        raise InputError(
            f"{name}: its command does not repeat within {time[-1] - time[0]:g} s, so it is not "
            "watched: elevon diagnose takes such a log as a whole; a longer baseline, or --window "
            "with the width of one period, where the motion does repeat"
        )
    near = back[: int(np.argmax(np.append(np.diff(back), 2) > 1)) + 1]  # the first dip
    lowest = int(near[np.argmin(off[near])])
    return float(_between(lags, off, lowest) * (time[1] - time[0]))


def _differences(command: Floats) -> tuple[Floats, Floats]:
    """Lags, in samples, and the RMS of the command's change over each."""
    count = len(command)
    most = int(count / (1.0 + _REPEATS))
    x = command - command.mean()
    size = 1 << (2 * count - 1).bit_length()
    spectrum = np.fft.rfft(x, size)
    product = np.fft.irfft(spectrum * spectrum.conj(), size)[: most + 1]
    square = np.concatenate(([0.0], np.cumsum(x**2)))
    lags = np.arange(most + 1)
    ends = square[count - lags] + square[count] - square[lags]
    off = np.sqrt(np.maximum(ends - 2.0 * product, 0.0) / (count - lags))
    return lags.astype(np.float64), off


def _between(lags: Floats, off: Floats, lowest: int) -> float:
    """Where the square of a dip is least, by the parabola through three lags."""
    if not 0 < lowest < len(lags) - 1:
        return float(lags[lowest])
    before, here, after = off[lowest - 1 : lowest + 2] ** 2
    bend = before - 2.0 * here + after
    return float(lags[lowest] + (0.5 * (before - after) / bend if bend > 0.0 else 0.0))


def least_difference(a: Floats, b: Floats) -> float:
    """Return the RMS by which two periods of equal length differ, one turned to fit best."""
    x, y = a - a.mean(), b - b.mean()
    product = np.fft.irfft(np.fft.rfft(x) * np.fft.rfft(y).conj(), len(x))
    square = np.mean(x**2) + np.mean(y**2) - 2.0 * float(product.max()) / len(x)
    return float(np.sqrt(max(square, 0.0)))


def begins(command: Floats, action: int) -> list[int]:
    """Return the samples at which an action is commanded anew."""
    level = np.rint(command)
    return [int(k) for k in np.flatnonzero((level[1:] == action) & (level[:-1] != action)) + 1]


def first_action(command: Floats, name: str) -> int:
    """Return the action that is commanded first.

    Raises
    ------
    InputError
        None is.
    """
    level = np.rint(command[np.isfinite(command)])
    turns = np.flatnonzero(np.diff(level)) + 1
    if not turns.size:
        raise InputError(f"{name}: nothing is commanded: the command never changes")
    return int(level[turns[0]])
