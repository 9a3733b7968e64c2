"""Position gain and command of a log whose note names the waveform, by projection.

A sine of about the noted frequency, or a chirp of the noted sweep that began at an instant nobody
noted: one unknown enters nonlinearly, everything else is a linear regression

    output = a sin(phase) + b cos(phase) + c - speed_ref / gain.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.positions.features import regress

if TYPE_CHECKING:
    from elevon.logs.log import Log

Bools = npt.NDArray[np.bool_]
#: Unknown and instants to the phase [rad] and what the unknown does to it.
Phase = Callable[[float, Floats], tuple[Floats, Floats]]
_TAU = 2.0 * math.pi
_SMALL = 0.02  # RMS of the misfit over the spread, above which the note does not explain the log
_STEPS = 8  # of Gauss and Newton
_LATEST = 0.25  # of the log: a chirp begins before it
_SCAN = 0.02  # s between the starts tried
_THIN = 1200  # samples of a scan
_LEAST = 400
_OUTLIER = 8.0  # robust deviations beyond which an early sample was under another command


@dataclass(frozen=True)
class NotedWaveform:
    """What the note and the set point say together.

    Attributes
    ----------
    gain, gain_std : float
        Position gain [1/s].
    wave : ndarray, shape (n,)
        The command [rad] at the log's instants.
    window : (float, float)
        First and last instant at which it explains the log [s].
    """

    gain: float
    gain_std: float
    wave: Floats
    window: tuple[float, float]


def noted_command(log: Log, limit: float) -> NotedWaveform | None:
    """Fit the noted waveform; None where there is no note, or it does not explain the log.

    Parameters
    ----------
    log : Log
        With the output's position.
    limit : float
        Of the speed set point [rad/s]; what stands at it is left out.
    """
    note = log.note
    if note is None or not log.has("output_position") or note.waveform not in ("sine", "chirp"):
        return None
    # A drive may have another limit than stated; a sample beside one at it may be the mean of both.
    limit = min(limit, float(np.nanmax(np.abs(log.speed_ref))))
    cut = np.pad(np.abs(log.speed_ref) >= 0.999 * limit, 1)
    inside = log.good & ~(cut[:-2] | cut[1:-1] | cut[2:]) & np.isfinite(log.output)
    known = note.parameters
    if inside.sum() < _LEAST:
        return None
    if note.waveform == "sine":
        frequency = known.get("frequency", 0.0)
        return _solved(log, inside, frequency, _sine) if frequency * log.duration > 0.5 else None
    sweep = known.get("sweep_time", 0.0)
    if not sweep > 0.0 or not {"start_frequency", "end_frequency"} <= known.keys():
        return None
    phase = _chirp(known["start_frequency"], known["end_frequency"], sweep)
    return _solved(log, inside, _scanned(log, inside, phase), phase)


def _sine(frequency: float, time: Floats) -> tuple[Floats, Floats]:
    return _TAU * frequency * time, _TAU * time


def _chirp(first: float, last: float, sweep: float) -> Phase:
    rate = (last - first) / sweep

    def phase(start: float, time: Floats) -> tuple[Floats, Floats]:
        since = np.clip(time - start, 0.0, sweep)
        slope = np.where((since > 0.0) & (since < sweep), -_TAU * (first + rate * since), 0.0)
        return _TAU * (first + 0.5 * rate * since) * since, slope

    return phase


def _columns(log: Log, turn: Floats, at: npt.NDArray[np.intp]) -> list[Floats]:
    ref = log.speed_ref[at]
    return [np.sin(turn), np.cos(turn), np.ones(len(turn)), -ref, np.sign(ref)]


def _scanned(log: Log, inside: Bools, phase: Phase) -> float:
    """Coarse search of the chirp's start, on samples behind the latest one allowed."""
    at = np.flatnonzero(inside & (log.time > _LATEST * log.duration))
    at = at[:: max(1, len(at) // _THIN)]
    target, costs = log.output[at], []
    starts = np.arange(0.0, _LATEST * log.duration, _SCAN)
    for start in starts:
        rows = np.stack(_columns(log, phase(float(start), log.time[at])[0], at))
        right = rows @ target
        beta = np.linalg.lstsq(rows @ rows.T, right, rcond=1e-12)[0]
        costs.append(-float(beta @ right))
    return float(starts[int(np.argmin(costs))])


def _solved(log: Log, inside: Bools, first: float, phase: Phase) -> NotedWaveform | None:
    """Gauss and Newton in the one unknown, first on the late half, then on all it explains."""
    value = first
    at = np.flatnonzero(inside & (log.time > 0.5 * log.duration))
    for final in (False, True):
        for _ in range(_STEPS):
            beta, covariance, residual, step = _step(log, at, value, phase)
            value += step
        if not final:
            spread = 1.4826 * float(np.median(np.abs(residual - np.median(residual))))
            at = _explained(log, np.flatnonzero(inside), phase(value, log.time)[0], beta, spread)
    if len(at) < _LEAST or float(residual.std()) > _SMALL * float(np.std(log.output)):
        return None
    if not beta[3] > 0.0:
        return None
    turn, _ = phase(value, log.time)
    wave = beta[0] * np.sin(turn) + beta[1] * np.cos(turn) + beta[2]
    std = float(np.sqrt(max(covariance[3, 3], 0.0)))
    window = (float(log.time[at[0]]), float(log.time[at[-1]]))
    return NotedWaveform(1.0 / float(beta[3]), std / float(beta[3]) ** 2, wave, window)


def _step(
    log: Log, at: npt.NDArray[np.intp], value: float, phase: Phase
) -> tuple[Floats, Floats, Floats, float]:
    """Regression at one value of the unknown, and the step that its slope asks for."""
    turn, slope = phase(value, log.time[at])
    columns = _columns(log, turn, at)
    beta, _ = regress(columns, log.output[at])
    bend = slope * (beta[0] * columns[1] - beta[1] * columns[0])
    both, covariance = regress([*columns, bend], log.output[at])
    residual = log.output[at] - both @ np.stack([*columns, bend])
    return beta, covariance, residual, float(both[-1])


def _explained(
    log: Log, at: npt.NDArray[np.intp], turn: Floats, beta: Floats, spread: float
) -> npt.NDArray[np.intp]:
    """Samples behind the last one that the fit of the late half does not explain."""
    off = log.output[at] - beta @ np.stack(_columns(log, turn[at], at))
    strays = np.flatnonzero(np.abs(off[: len(off) // 2]) > max(_OUTLIER * spread, 1e-9))
    return at[strays[-1] + 1 :] if strays.size else at
