"""What positions, speeds and set points tell without any torque.

Backlash, encoder gain and offset from the two positions; speed sensor from the motor's angle;
position
gain and amplitude of the command from set point and encoder; the speed limit where it is held.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Annotated, ClassVar

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.balance import saturated_speed
from elevon.errors import InputError
from elevon.estimate.covariance import block_covariance, joined, robust_covariance
from elevon.estimate.residual import fit_residual
from elevon.estimate.signals import integral
from elevon.logs.command.fit import FREE, WaveformFit, best_waveform, fit_waveform
from elevon.logs.command.note import NotedCommand, align_noted, noted_values
from elevon.logs.command.reconstruct import reconstruct
from elevon.logs.log import Log, per_log
from elevon.plain import REMAINDER, WORKING, Plain, key
from elevon.waveforms import evaluate

#: Paths that come from positions alone, not from the dynamic fit.
KINEMATIC = (
    "backlash.total",
    "sensor.encoder.offset",
    "sensor.encoder.gain",
    "control.position_gain",
    "control.speed_limit",
)
_LEAST = 200  # samples inside the limit
_EXACT = 1e-6  # of a limit: how near to it a set point that is held there stays
_HOLDS = 20  # samples, the fewest
_SMALL = 0.02  # RMS of the command's misfit over its spread, above which no waveform explains it


@dataclass(frozen=True)
class CommandFit(Plain):
    """Waveform of a log's command with the position gain fitted along.

    Attributes
    ----------
    log : str
        The log.
    waveform : WaveformFit
        With the gain of the actuator file.
    gain, gain_std : float
        Position gain [1/s].
    amplitude, amplitude_std : float
        Of the waveform [rad]; NaN where it has none.
    factor : float or None
        Amplitude over the amplitude the operator noted.
    reach : float
        Size of the following error the gain stands on [rad]: amplitude of a sine of its RMS.
    values : ndarray, shape (n,)
        The command at the log's instants [rad].
    """

    log: str
    waveform: Annotated[WaveformFit, REMAINDER]
    gain: Annotated[float, key("position_gain")]
    gain_std: Annotated[float, key("position_gain_std")]
    reach: Annotated[float, WORKING]
    values: Annotated[Floats, WORKING] = field(repr=False, compare=False)
    amplitude: Annotated[float, WORKING] = math.nan
    amplitude_std: Annotated[float, WORKING] = math.nan
    factor: Annotated[float | None, key("amplitude_factor")] = None

    COMPUTED: ClassVar = ("amplitude_factor_std",)

    @property
    def amplitude_factor_std(self) -> float | None:
        """Standard deviation of the factor."""
        if self.factor is None:
            return None
        return abs(self.factor) * self.amplitude_std / max(abs(self.amplitude), 1e-300)


@per_log
def command_fit(log: Log, gain: float, limit: float) -> CommandFit | None:
    """Fit the command's waveform and the position gain of one log.

    A command noted in full counts as noted; only its instant is fitted.

    Parameters
    ----------
    log : Log
        With the output's position.
    gain : float
        Position gain to start from [1/s].
    limit : float
        Limit of the speed set point [rad/s].

    Returns
    -------
    CommandFit or None
        None where the position is missing or no waveform explains the set point.
    """
    if not log.has("output_position"):
        return None
    try:
        trace = reconstruct(log.time, log.speed_ref, log.output, gain=gain, limit=limit)
        if log.note is not None and log.note.command is not None and log.note.command.terms:
            return _noted_with_gain(log, align_noted(trace, log.note), gain, limit)
        kind = log.note.waveform if log.note else None
        if kind == "chirp" and log.note is not None:
            known = {n: v for n, v in log.note.parameters.items() if n in {"sweep_time", "start"}}
            fit = fit_waveform(trace, "chirp", fixed=known)
        else:
            fit = fit_waveform(trace, kind) if kind else best_waveform(trace)
    except InputError:
        return None
    spread = float(np.std(log.output))
    if not spread > 0.0 or fit.rms > 3.0 * _SMALL * spread:
        return None
    return _with_gain(log, fit, gain, limit)


def _noted_with_gain(log: Log, noted: NotedCommand, gain: float, limit: float) -> CommandFit | None:
    """Gain under a command noted in full: noted = set point / gain + position, its instant free."""
    assert log.note is not None
    inside = log.good & (np.abs(log.speed_ref) < 0.999 * limit) & (log.time >= noted.start)
    t, ref, output = log.time[inside], log.speed_ref[inside] / gain, log.output[inside]
    if inside.sum() < _LEAST:
        return None
    slope = np.gradient(noted.values, log.time)[inside]
    design = np.column_stack((ref, slope))
    data = noted.values[inside] - output
    (inverse, shift), *_ = np.linalg.lstsq(design, data, rcond=None)
    misfit = data - design @ np.array([inverse, shift])
    if float(misfit.std()) > _SMALL * float(np.std(output)) or not inverse > 0.0:
        return None
    std = np.sqrt(np.maximum(np.diag(robust_covariance(design, misfit)), 0.0))
    start, rms = noted.start + float(shift), float(np.sqrt(np.mean(misfit**2)))
    waveform = WaveformFit(
        "noted", {"start": start}, {"start": float(std[1])}, np.array([[std[1] ** 2]]), rms,
        len(t), (noted.start, float(log.time[-1])), True,
    )  # fmt: skip
    return CommandFit(
        log=log.name,
        waveform=waveform,
        gain=gain / float(inverse),
        gain_std=gain * float(std[0]) / float(inverse) ** 2,
        reach=math.sqrt(2.0) * float(np.std(ref)),
        values=noted_values(log.note, "rad", log.time - start),
    )


def _with_gain(log: Log, fit: WaveformFit, gain: float, limit: float) -> CommandFit | None:
    """Waveform's parameters and the gain together: waveform = set point / gain + position."""
    names = [n for n in FREE[fit.kind] if math.isfinite(fit.values[n])]
    inside = log.good & (np.abs(log.speed_ref) < 0.999 * limit)
    inside &= (log.time >= fit.window[0]) & (log.time <= fit.window[1])
    t, ref, output = log.time[inside], log.speed_ref[inside] / gain, log.output[inside]
    start = np.array([*(fit.values[n] for n in names), 1.0])
    scale = np.array([*(max(abs(fit.values[n]), 1e-3) for n in names), 1.0])

    def residual(x: Floats) -> Floats:
        values = {**fit.values, **dict(zip(names, map(float, x[:-1]), strict=True))}
        return np.asarray(evaluate(fit.kind, values, t) - ref * x[-1] - output, dtype=np.float64)

    best = fit_residual(residual, start, scale=scale * 1e-2, jacobian="3-point", most=100)
    if not best.converged:
        return None
    if float(best.residual.std()) > _SMALL * float(np.std(output)):
        return None
    covariance = robust_covariance(best.jacobian, best.residual)
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    inverse, inverse_std = float(best.x[-1]), float(std[-1])
    if not inverse > 0.0:
        return None
    at = names.index("amplitude") if "amplitude" in names else None
    amplitude = math.nan if at is None else abs(float(best.x[at]))
    noted = log.note.parameters.get("amplitude") if log.note else None
    factor = amplitude / abs(noted) if noted and at is not None else None
    return CommandFit(
        log=log.name,
        waveform=fit,
        gain=gain / inverse,
        gain_std=gain * inverse_std / inverse**2,
        amplitude=amplitude,
        amplitude_std=math.nan if at is None else float(std[at]),
        factor=factor,
        reach=math.sqrt(2.0) * float(np.std(ref)),
        values=fit.at(log.time),
    )


def speed_sensor(logs: Sequence[Log]) -> dict[str, tuple[float, float]] | None:
    """Gain and offset of the logged speed against the motor's angle, with deviations.

    The integral of the speed is regressed on the angle and on time: angle = (int w - o t)/g + c.
    """
    rows, data, blocks = [], [], []
    used = [log for log in logs if log.has("motor_position") and np.ptp(log.motor) > 0.0]
    for k, log in enumerate(used):
        turned = integral(log.time, log.speed)
        starts = [np.full_like(turned, float(j == k)) for j in range(len(used))]
        # Differences over a block of time: their noise is that of the speed, not its sum.
        step = max(1, round(0.05 / log.period))
        columns = np.column_stack((log.motor, log.time, *starts))
        rows.append(columns[step::step] - columns[:-step:step][: len(columns[step::step])])
        data.append(turned[step::step] - turned[:-step:step][: len(turned[step::step])])
        blocks.append(np.arange(len(data[-1])) // 10)
    if not used:
        return None
    design = np.vstack(rows)[:, :2]
    target = np.concatenate(data)
    normal = design.T @ design
    if np.linalg.cond(normal / np.outer(*[np.sqrt(np.diag(normal))] * 2)) > 1e12:
        return None
    beta = np.linalg.solve(normal, design.T @ target)
    misfit = target - design @ beta
    covariance, _ = block_covariance(normal, misfit[:, None] * design, joined(blocks))
    std = np.sqrt(np.diag(covariance))
    return {"gain": (float(beta[0]), float(std[0])), "offset": (float(beta[1]), float(std[1]))}


def speed_limit(logs: Sequence[Log]) -> float | None:
    """Level at which the set point is held flat, where any log shows one [rad/s]."""
    tops = [
        top for log in logs if math.isfinite(top := saturated_speed(log)) and _at_limit(log, top)
    ]
    return max(tops) if tops else None


def _at_limit(log: Log, top: float) -> bool:
    """Whether a level is held, and not the round crest of a slow sine."""
    return int((np.abs(log.speed_ref) > top * (1.0 - _EXACT)).sum()) >= _HOLDS
