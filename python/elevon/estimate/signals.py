"""What becomes of a signal: integral, local polynomial, passage through a backlash."""

from __future__ import annotations

import numpy as np

from elevon.arrays import Floats


def integral(time: Floats, values: Floats) -> Floats:
    """Return the integral from the first sample on, by trapezoids, shape (samples,)."""
    return np.concatenate(([0.0], np.cumsum(0.5 * (values[1:] + values[:-1]) * np.diff(time))))


def local_polynomial(
    values: Floats, period: float, span: float, *, order: int = 2, slope: bool = False
) -> Floats:
    """Return a signal, or its slope, by polynomials over a span [s] about each sample."""
    from scipy.signal import savgol_filter

    width = max(5, 2 * round(0.5 * span / period) + 1)
    fitted = savgol_filter(values, width, order, deriv=int(slope), delta=period)
    return np.asarray(fitted, dtype=np.float64)


def through_backlash(driver: Floats, width: float) -> Floats:
    """Return where a part stands that friction holds and a driver pushes through a backlash.

    Parameters
    ----------
    driver : ndarray, shape (samples,)
        Position of the driving side, at the driven one.
    width : float
        Total backlash.
    """
    half = 0.5 * width
    out = []
    state = float(driver[0])
    # Two comparisons: this loop goes through whole logs, `min` and `max` take three times as long.
    for low, high in zip((driver - half).tolist(), (driver + half).tolist(), strict=True):
        if state < low:
            state = low
        elif state > high:
            state = high
        out.append(state)
    return np.array(out)
