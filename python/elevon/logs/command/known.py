"""A command that the operator noted in full: its values, and when in the log it began."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.logs.command.note import CommandNote
from elevon.logs.command.reconstruct import CommandTrace
from elevon.scenario.compile import evaluate_terms

_MOST = 2000  # samples compared, and starts tried first
_REFINED = 4  # searches, each five times finer than the one before


@dataclass(frozen=True, slots=True)
class NotedCommand:
    """A noted command laid over a log.

    Attributes
    ----------
    start : float
        Log time [s] of the note's zero.
    values : ndarray, shape (n,)
        The command at the log's instants [rad or m].
    rms : float
        Of the difference from the trace it was laid over, in the same unit.
    """

    start: float
    values: Floats
    rms: float


def noted_values(note: CommandNote, unit: str, time: npt.ArrayLike) -> Floats:
    """Return the noted command at instants counted from the note's own zero, shape (n,).

    Raises
    ------
    InputError
        The note holds no sum of waveforms, or units of another kind.
    """
    if note.command is None or not note.command.terms:
        raise InputError(f"{note.source}: no command of waveforms is noted")
    return evaluate_terms(note.command.terms, unit, time, f"{note.source}: command")


def align_noted(trace: CommandTrace, note: CommandNote, unit: str = "rad") -> NotedCommand:
    """Find when the noted command began, from where it fits the command's trace best.

    Parameters
    ----------
    trace : CommandTrace
        Rebuilt from set point and position, or logged.
    note : CommandNote
        With a command of waveforms.
    unit : str
        ``rad`` or ``m``.

    Raises
    ------
    InputError
        As `noted_values`, or fewer than ten samples of the trace are known.
    """
    t, y = trace.time[trace.valid], trace.position[trace.valid]
    if len(t) < 10:
        raise InputError(f"{note.source}: the command's trace has {len(t)} samples; 10 needed")
    span = float(trace.time[-1] - trace.time[0])
    thin = max(1, len(t) // _MOST)
    t, y = t[::thin], y[::thin]
    begin, reach = float(trace.time[0]), span
    step = max(float(np.median(np.diff(trace.time))), 2.0 * span / _MOST)
    for _ in range(_REFINED):
        starts = begin + np.arange(-reach, reach + 0.5 * step, step)
        misfit = [float(np.mean((noted_values(note, unit, t - s) - y) ** 2)) for s in starts]
        # Of equals the one nearest the log's own zero: a constant fits anywhere.
        least = min(misfit)
        ties = [s for s, r in zip(starts, misfit, strict=True) if r <= least * (1.0 + 1e-9)]
        begin = float(min(ties, key=lambda s: abs(s - trace.time[0])))
        reach, step = 2.0 * step, 0.2 * step
    values = noted_values(note, unit, trace.time - begin)
    rest_valid = values[trace.valid] - trace.position[trace.valid]
    rms = float(np.sqrt(np.mean(rest_valid**2)))
    return NotedCommand(begin, values, rms)
