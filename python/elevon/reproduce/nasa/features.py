"""What a stand measures of one run, and which feature stands for which fault."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elevon.arrays import Floats
from elevon.recording import Recording

RECORD = "motor_position,motor_speed,current_ref,joint_force@2 kHz"
SETTLE = 1.0
"""Statistics begin here [s]."""
RMS = "current reference, rms"
PEAK = "load cell, peak"
ORDERS = {
    "current reference, order 1": 1.0,
    "current reference, order 2": 2.0,
    "current reference, order 8": 8.0,
    "current reference, order 8.55": 8.552,
    "current reference, order 9": 9.0,
}
"""Lines of the current reference per motor turn: unbalance, channel mismatch, turn short, groove
spall, dynamic eccentricity (docs/explanation/theory/ballscrew.md)."""
FEATURES = (RMS, *ORDERS, PEAK)
UNITS = dict.fromkeys(FEATURES, "A") | {PEAK: "N"}
_ROOTED = np.array([name in ORDERS for name in FEATURES])
LEAST_SPEED = 10.0
LEAST_TURNS = 4.0


def features(recording: Recording) -> Floats:
    """Return every feature of one run in the order of `FEATURES`."""
    late = recording["current_ref"].time >= SETTLE
    value = {name: recording[name].values[late] for name in recording.names}
    lines = orders(
        value["motor_position"], value["motor_speed"], value["current_ref"], list(ORDERS.values())
    )
    rms = float(np.sqrt(np.mean(value["current_ref"] ** 2)))
    return np.array([rms, *lines, float(np.max(np.abs(value["joint_force"])))])


def compared(values: Floats) -> Floats:
    """Return the features in the scale in which groups are compared, shape (units, features).

    The amplitude of a line has no sign, so its scatter between healthy units leans to one side;
    that of its root is nearly normal, as the intervals want it.
    """
    return np.where(_ROOTED, np.sqrt(np.abs(values)), values)


def orders(angle: Floats, speed: Floats, signal: Floats, wanted: Sequence[float]) -> list[float]:
    """Return the amplitude of a signal at some orders of the shaft, median over the strokes.

    Parameters
    ----------
    angle, speed, signal : ndarray, shape (n,)
        rad, rad/s, any unit.
    wanted : sequence of float
        Lines per turn.

    Returns
    -------
    list of float
        Peak amplitudes in the signal's unit; NaN where no stroke is long enough.
    """
    moving = np.flatnonzero(np.abs(speed) > LEAST_SPEED)
    strokes = np.split(moving, np.flatnonzero(np.diff(moving) > 1) + 1)
    levels = [
        _stroke_orders(angle[stroke], signal[stroke], wanted)
        for stroke in strokes
        if stroke.size > 2 and abs(angle[stroke[-1]] - angle[stroke[0]]) > 2 * np.pi * LEAST_TURNS
    ]
    if not levels:
        return [float("nan")] * len(wanted)
    return [float(x) for x in np.median(np.array(levels), axis=0)]


def _stroke_orders(angle: Floats, signal: Floats, wanted: Sequence[float]) -> list[float]:
    """Least squares over one stroke: a slow cubic trend and a windowed line at each order."""
    turned = np.abs(angle - angle[0])
    # The first and the last turn hold the reversal's transient.
    inner = (turned > 2 * np.pi) & (turned < turned[-1] - 2 * np.pi)
    grid = np.linspace(turned[inner][0], turned[inner][-1], int(inner.sum()))
    rising = np.concatenate([[True], np.diff(turned) > 0])
    line = np.interp(grid, turned[rising], signal[rising])
    scaled = (grid - grid.mean()) / np.ptp(grid)
    line = line - np.polyval(np.polyfit(scaled, line, 3), scaled)
    window = np.hanning(grid.size)
    weight = 2.0 / window.sum()
    return [float(abs(np.sum(window * line * np.exp(-1j * k * grid))) * weight) for k in wanted]
