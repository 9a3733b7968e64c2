"""The command that drove a log, which the drive does not record.

The position loop is proportional: w_ref = sat(G (command - output position)). So wherever the speed
set point is inside its limit, command = w_ref / G + measured output position (test-bench thesis,
"Results"; G = (1000/60) 124 1/s). A waveform is then fitted to that trace (`fit_command`).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Bools, Floats
from elevon.errors import InputError, RangeError

POSITION_GAIN = 1000.0 / 60.0 * 124.0  # 1/s, output rad to motor-shaft rad/s
SPEED_LIMIT = 500.0 * math.pi / 30.0  # rad/s
_MARGIN = 1e-3  # of the limit: a saturated set point comes back rounded or filtered


@dataclass(frozen=True, slots=True)
class CommandTrace:
    """The position command where it can be known.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Seconds on the log's clock.
    position : ndarray, shape (n,)
        Command [rad at the output]; meaningless where `valid` is false.
    valid : ndarray of bool, shape (n,)
        True where the speed set point was inside its limit and both signals are present.
    """

    time: Floats
    position: Floats
    valid: Bools

    @property
    def coverage(self) -> float:
        """Share of the samples where the command is known."""
        return float(np.mean(self.valid)) if self.valid.size else 0.0


def reconstruct(
    time: npt.ArrayLike,
    speed_ref: npt.ArrayLike,
    output_position: npt.ArrayLike,
    *,
    gain: float = POSITION_GAIN,
    limit: float = SPEED_LIMIT,
) -> CommandTrace:
    """Rebuild the position command from the speed set point and the measured output position.

    Parameters
    ----------
    time : array_like, shape (n,)
        Seconds.
    speed_ref : array_like, shape (n,)
        Speed set point of the motor shaft [rad/s]; NaN where missing.
    output_position : array_like, shape (n,)
        Measured output position [rad]; NaN where missing.
    gain : float
        Position gain [1/s].
    limit : float
        Limit of the speed set point [rad/s].

    Returns
    -------
    CommandTrace
        On the log's clock.

    Raises
    ------
    InputError
        Shapes that differ.
    RangeError
        A gain or limit that is not positive.
    """
    t, speed, output = (np.asarray(a, dtype=np.float64) for a in (time, speed_ref, output_position))
    if not t.shape == speed.shape == output.shape or t.ndim != 1:
        raise InputError(
            f"command: time, set point and position have shapes {t.shape}, {speed.shape}, "
            f"{output.shape}"
        )
    for name, value in (("gain", gain), ("limit", limit)):
        if not (math.isfinite(value) and value > 0.0):
            raise RangeError(f"command: {name} = {value!r} must be above 0")
    position = speed / gain + output
    valid = np.isfinite(position) & (np.abs(speed) < limit * (1.0 - _MARGIN))
    return CommandTrace(t, position, valid)
