"""Strokes of a recording: where the commanded position moves one way, and the rest after it."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError
from elevon.recording import Recording

LEAST_STROKE = 2.6
"""Shortest stroke that is used [s]: 1.6 s until the start has passed, then 1 s of steady motion."""
LEAST_HOLD = 2.4
"""Shortest rest that is used [s]: 1.4 s until the stop has passed, then 1 s of standstill."""


@dataclass(frozen=True, slots=True)
class StrokeSpan:
    """One motion in one direction.

    Attributes
    ----------
    start, stop : int
        Samples: the first whose reference has moved, and the first that no longer moves.
    end : int
        First sample that is no longer of the rest after it (the next motion, a gap, the end).
    direction : int
        1 or -1.
    """

    start: int
    stop: int
    end: int
    direction: int


def find_strokes(recording: Recording) -> list[StrokeSpan]:
    """Find the strokes in which the reference moves at one speed for long enough.

    Parameters
    ----------
    recording : Recording
        Holds ``position_ref`` [m].

    Returns
    -------
    list of Stroke
        In the order of time. A stroke does not cross a gap of the clock.

    Raises
    ------
    FormatError
        There is none of `LEAST_STROKE` in each direction: a sinusoid, a standstill, too short.
    """
    clock = recording.clock()
    reference = np.asarray(recording["position_ref"].values, dtype=np.float64)
    edges = [0, *(int(gap) + 1 for gap in clock.gaps), len(reference)]
    least = LEAST_STROKE / float(np.median(np.diff(clock.time)))
    strokes = [
        stroke
        for first, last in pairwise(edges)
        for stroke in _in_segment(reference, first, last)
        if stroke.stop - stroke.start >= least
    ]
    if {stroke.direction for stroke in strokes} != {-1, 1}:
        raise FormatError(
            f"{recording.meta.get('log', 'recording')}: no stroke of {LEAST_STROKE:g} s at one "
            "speed in each direction; these features need a trapezoidal motion with its return"
        )
    return strokes


def _in_segment(reference: npt.NDArray[np.float64], first: int, last: int) -> list[StrokeSpan]:
    values = reference[first:last]
    if len(values) < 3 or not np.isfinite(values).all():
        return []
    steps = np.diff(values)
    largest = float(np.abs(steps).max())
    if largest == 0.0:
        return []
    # Of one speed: within 3 % of the largest. A sinusoid is there for a twelfth of its period only.
    signs = np.where(np.abs(steps) > 0.97 * largest, np.sign(steps), 0.0)
    signs = np.concatenate((signs[:1], signs))
    changes = np.flatnonzero(np.diff(signs) != 0) + 1
    bounds = [0, *changes.tolist(), len(signs)]
    parts = list(pairwise(bounds))
    return [
        StrokeSpan(first + a, first + b, first + _rest_end(signs, parts, index), int(signs[a]))
        for index, (a, b) in enumerate(parts)
        if signs[a] != 0
    ]


def _rest_end(signs: npt.NDArray[np.float64], parts: list[tuple[int, int]], index: int) -> int:
    """Return where the rest after a part ends; the part's own end when it has none."""
    following = parts[index + 1] if index + 1 < len(parts) else None
    if following is None or signs[following[0]] != 0:
        return parts[index][1]
    return following[1]
