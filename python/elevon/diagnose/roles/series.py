"""Shapes of a channel over time: its noise, its means, its straight lines."""

from __future__ import annotations

import numpy as np

from elevon.arrays import Floats

_OVER = 4  # samples of the model to one of the log, which are averaged: loggers filter, too
_NORMAL = 1.4826  # deviation over the median of the size, of Gaussian noise


def smoothed(values: Floats, width: int) -> Floats:
    """Return the means over `width` samples about each, mirrored at the ends."""
    padded = np.pad(values, (width // 2, width - 1 - width // 2), mode="reflect")
    return np.convolve(padded, np.ones(width) / width, "valid")


def noise_deviation(values: Floats) -> float:
    """Return the deviation of what changes from sample to sample, by second differences."""
    return float(_NORMAL * np.median(np.abs(np.diff(values, 2))) / np.sqrt(6.0))


def lines(time: Floats, values: Floats, most: float) -> tuple[Floats, Floats]:
    """Return straight lines that miss no sample by more than `most` (Douglas and Peucker)."""
    corners = {0, len(time) - 1}
    open_parts = [(0, len(time) - 1)]
    while open_parts:
        first, last = open_parts.pop()
        if last - first < 2:
            continue
        inner = slice(first + 1, last)
        line = np.interp(time[inner], time[[first, last]], values[[first, last]])
        off = np.abs(values[inner] - line)
        worst = int(np.argmax(off))
        if off[worst] > most:
            middle = first + 1 + worst
            corners.add(middle)
            open_parts += [(first, middle), (middle, last)]
    at = np.array(sorted(corners))
    return time[at], values[at]


def averaged(values: Floats, over: int) -> Floats:
    """Return the means over `over` steps, an even number, about each sample but the ends."""
    if over == 1 or len(values) < 2 * over:
        return values
    half = over // 2
    total = np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]))))
    out = values.copy()
    out[half:-half] = (total[over:] - total[:-over]) / over
    return out


def oversampling(rate: float, step: float) -> int:
    """Samples of the model to one of a log, an even number as far as its steps allow it."""
    steps = round(1.0 / (rate * step))
    return next((n for n in (_OVER, 2) if steps % n == 0), 1)
