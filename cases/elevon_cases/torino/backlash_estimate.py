"""Backlash from an encoder signal alone, under a position loop that is closed on the encoder.

The backlash is crossed while the encoder stands still, where the encoder says nothing of the motor.
How long the flat lasts depends on how the loop drives the motor through the gap, on friction, and
on the relays' chance. One thing does not: the loop's integral action. Over half a period, from
shortly before one reversal to shortly before the next, the motor turns the encoder's own travel
plus the backlash. The speed reference is G (command - encoder), and a speed loop with integral
action follows it up to what it needs to turn the friction round, the same with and without
backlash. So, for two runs of one command, with backlash B and without (a blank),

    B = +- G * integral over half a period of (encoder with backlash - encoder of the blank) dt,

plus at a top, minus at a bottom. No inertia, friction, gain of the speed loop or timing enters.
With a speed loop that has no integral action, or one frozen by an anti-windup scheme, the equality
does not hold.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError

LEAD = 0.1
"""How long before the encoder's extremes the half periods are cut, in periods: the loop has had
four tenths of a period to settle, and neither friction nor backlash has begun to turn round."""


@dataclass(frozen=True, slots=True)
class BacklashEstimate:
    """Backlash recovered from an encoder signal.

    Attributes
    ----------
    total : float
        Total backlash at the output side, mean over the reversals [rad].
    spread : float
        Standard deviation over the reversals [rad]; 0 when there is only one.
    each : ndarray, shape (n,)
        Backlash of each reversal [rad].
    """

    total: float
    spread: float
    each: Floats


def backlash_from_encoder(
    time: Floats,
    encoder: Floats,
    blank: Floats,
    *,
    frequency: float,
    loop_gain: float,
    start: float,
) -> BacklashEstimate:
    """Recover the total backlash from two encoder signals of one sine command.

    Parameters
    ----------
    time : ndarray, shape (n,)
        Common time of both signals [s], strictly increasing.
    encoder, blank : ndarray, shape (n,)
        Encoder positions at the output side with and without backlash [rad].
    frequency : float
        Frequency of the commanded sine [Hz].
    loop_gain : float
        Speed of the output side that the position loop commands a unit of error [1/s]: the
        position gain over the gear ratio.
    start : float
        Samples before this time are left out [s].

    Returns
    -------
    BacklashEstimate

    Raises
    ------
    InputError
        Signals of different lengths or not finite, or no whole half period after `start`.
    """
    if not time.shape == encoder.shape == blank.shape:
        raise InputError(
            f"backlash: time, encoder and blank have {time.size}, {encoder.size} and {blank.size} "
            "samples"
        )
    if not (np.isfinite(encoder).all() and np.isfinite(blank).all()):
        raise InputError("backlash: the encoder signals must be finite")
    cuts, signs = _half_periods(time, encoder, frequency, start)
    area = _integral(time, encoder - blank)
    ends = np.interp(cuts + 0.5 / frequency, time, area)
    each = signs * loop_gain * (ends - np.interp(cuts, time, area))
    return BacklashEstimate(float(each.mean()), float(each.std()), each)


def lost_motion(time: Floats, motor: Floats, encoder: Floats, start: float) -> float:
    """Return the range of motor position (at the output) less encoder after `start` [rad]."""
    return float(np.ptp((motor - encoder)[time >= start]))


def flat_lengths(time: Floats, encoder: Floats, frequency: float, start: float) -> Floats:
    """Return how long the encoder stands still at each of its extremes after `start` [s]."""
    centres = _half_periods(time, encoder, frequency, start)[0] + LEAD / frequency
    moves = np.flatnonzero(np.diff(encoder) != 0.0)
    lengths = []
    for centre in centres:
        # The flat begins at or after the sine's extreme: look from the standstill nearest to it.
        near = (time[moves] > centre - 0.2 / frequency) & (time[moves] < centre + 0.3 / frequency)
        lengths.append(float(np.diff(time[moves[near]]).max(initial=0.0)))
    return np.array(lengths)


def _half_periods(
    time: Floats, encoder: Floats, frequency: float, start: float
) -> tuple[Floats, Floats]:
    """Begin of each half period around an extreme, and +1 for a top, -1 for a bottom."""
    used = time >= start
    angle = 2.0 * np.pi * frequency * time[used]
    if not angle.size:
        raise InputError(f"backlash: no samples at or after {start:g} s")
    design = np.column_stack([np.ones_like(angle), np.sin(angle), np.cos(angle)])
    _, sine, cosine = np.linalg.lstsq(design, encoder[used], rcond=None)[0]
    phase = float(np.arctan2(cosine, sine))
    turns = np.arange(0, int(2.0 * frequency * time[-1]) + 2)
    extremes = (np.pi / 2.0 + np.pi * turns - phase) / (2.0 * np.pi * frequency)
    cuts = extremes - LEAD / frequency
    whole = (cuts >= start) & (cuts + 0.5 / frequency <= time[-1])
    if not whole.any():
        raise InputError(
            f"backlash: no whole half period of {0.5 / frequency:g} s after {start:g} s"
        )
    signs = np.where(turns % 2 == 0, 1.0, -1.0)
    return cuts[whole], signs[whole]


def _integral(time: Floats, values: Floats) -> Floats:
    steps = np.diff(time) * (values[1:] + values[:-1]) / 2.0
    return np.concatenate([[0.0], np.cumsum(steps)])
