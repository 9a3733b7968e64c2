"""A model held against logs: the same command, its own closed loop, the errors signal by signal."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.kinematics import command_fit
from elevon.calibrate.log import BenchLog
from elevon.errors import InputError, Interrupted, unknown
from elevon.logs.command.known import align_noted
from elevon.logs.command.reconstruct import reconstruct
from elevon.progress import Progress

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["SIGNALS", "SignalError", "Validation", "validate"]

Bools = npt.NDArray[np.bool_]

#: Signals compared: name, unit.
SIGNALS: dict[str, str] = {
    "encoder_position": "rad",
    "motor_speed": "rad/s",
    "current_q_meas": "A",
}
_UNMEASURED = {"force", "on"}  # a brake of which no torque is known
TRANSIENT = 10.0  # s, as the published comparison leaves out


@dataclass(frozen=True)
class SignalError:
    """Error of one signal of one log, after the transient.

    Attributes
    ----------
    log, signal, unit : str
        What.
    rms, largest : float
        RMS and maximum error, SI.
    of_rms, of_range : float
        RMS error in percent of the measured signal's RMS (about its mean) and range.
    largest_of_range : float
        Maximum error in percent of the range.
    limit : float or None
        Largest `of_range` allowed by the actuator file.
    """

    log: str
    signal: str
    unit: str
    rms: float
    largest: float
    of_rms: float
    of_range: float
    largest_of_range: float
    limit: float | None

    @property
    def passed(self) -> bool | None:
        """Whether the threshold is kept; None without one."""
        return None if self.limit is None else bool(self.of_range <= self.limit)

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        return {
            "log": self.log,
            "signal": self.signal,
            "unit": self.unit,
            "rms": self.rms,
            "max": self.largest,
            "rms_percent_of_rms": self.of_rms,
            "rms_percent_of_range": self.of_range,
            "max_percent_of_range": self.largest_of_range,
            "limit_percent_of_range": self.limit,
            "passed": self.passed,
        }


@dataclass(frozen=True)
class ValidationTrace:
    """Measured and simulated signals of one log on its clock, for plots."""

    log: str
    time: Floats
    measured: Mapping[str, Floats]
    simulated: Mapping[str, Floats]
    used: Bools


@dataclass(frozen=True)
class Validation:
    """Errors of all logs.

    Attributes
    ----------
    actuator : str
        The actuator.
    fidelity : str
        Of the runs.
    transient : float
        Seconds left out.
    errors : tuple of SignalError
        One a log and signal.
    commands : mapping of str to str
        How each log's command was found.
    traces : tuple of ValidationTrace
        For plots.
    offsets : mapping of str to float
        Taken off the logs: what the actuator file says its sensors add (SI).
    notes : mapping of str to str
        What to know of a log.
    """

    actuator: str
    fidelity: str
    transient: float
    errors: tuple[SignalError, ...]
    commands: Mapping[str, str]
    traces: tuple[ValidationTrace, ...]
    offsets: Mapping[str, float] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)

    @property
    def status(self) -> str:
        """``pass``, ``fail``, or ``measured`` where the actuator file has no thresholds."""
        judged = [error.passed for error in self.errors if error.passed is not None]
        if not judged:
            return "measured"
        return "pass" if all(judged) else "fail"

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "status": self.status,
            "actuator": self.actuator,
            "fidelity": self.fidelity,
            "transient_s": self.transient,
            "signals": [e.to_dict() for e in self.errors],
            "commands": dict(self.commands),
            "offsets": dict(self.offsets),
            "notes": dict(self.notes),
        }


def validate(
    logs: Sequence[BenchLog],
    actuator: Actuator,
    *,
    fidelity: str = "low",
    transient: float | None = None,
    progress: Progress | None = None,
) -> Validation:
    """Run the model on each log's command and compare.

    Parameters
    ----------
    logs : sequence of BenchLog
        With the encoder's position.
    actuator : Actuator
        The model; thresholds and the sensors' offsets from its ``[validation]`` table.
    fidelity : str
        ``low`` or ``high``.
    transient : float, optional
        Seconds left out; default: the actuator file's, else 10 s (half of a shorter log).
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        No position, a transient longer than a log, a threshold for a signal that is not compared.
    """
    limits, offsets = _promised(actuator, "limits"), _promised(actuator, "offsets")
    if not logs:
        raise InputError("validation needs at least one log")
    given = transient
    if given is None:
        given = float((actuator.validation or {}).get("transient", TRANSIENT))
        shortest = min(log.duration for log in logs)
        given = given if given < shortest else 0.5 * shortest
    errors: list[SignalError] = []
    traces, commands, notes = [], {}, {}
    for k, log in enumerate(logs):
        if progress is not None and not progress(k / len(logs)):
            raise Interrupted("validation stopped")
        if not given < log.duration:
            raise InputError(f"transient of {given:g} s: {log.name} lasts {log.duration:g} s")
        trace, commands[log.name] = _trace(log, actuator, fidelity, given, offsets)
        traces.append(trace)
        if log.brake.known in _UNMEASURED:
            notes[log.name] = (
                "the brake acted but its torque is not known: the run has none, nothing is judged"
            )
        errors += _errors(trace, {} if log.name in notes else limits)
    return Validation(
        actuator.name, fidelity, given, tuple(errors), commands, tuple(traces), offsets, notes
    )


def _promised(actuator: Actuator, key: str) -> dict[str, float]:
    """One table of the actuator file's ``[validation]``, its signals checked."""
    limits = dict((actuator.validation or {}).get(key, {}))
    for name in limits:
        if name not in SIGNALS:
            raise unknown("signal", name, SIGNALS, f"{actuator.name}: validation.{key}")
    return limits


def _trace(
    log: BenchLog,
    actuator: Actuator,
    fidelity: str,
    transient: float,
    offsets: Mapping[str, float],
) -> tuple[ValidationTrace, str]:
    from elevon.scenario import Scenario
    from elevon.simulate import simulate

    if log.output is None or log.motor is None:
        raise InputError(
            f"{log.name}: validation needs both positions (r4820, r4821): they give the command "
            "and the backlash"
        )
    command, how = _command(log, actuator)
    known = log.brake.known not in _UNMEASURED
    brake = (log.brake.time, log.brake.level) if known else (log.time[[0, -1]], np.zeros(2))
    ratio = actuator.parameters.value("gear.ratio")
    offset = actuator.parameters.value("sensor.encoder.offset")
    # The model's own zero is the motor's; the encoder's offset moves the command along.
    shift = float(log.motor[0])
    middle = shift / ratio
    scenario = Scenario.from_dict(
        {
            "duration": log.duration,
            "command": {
                "mode": "position",
                "terms": [
                    {"kind": "table", "times": log.time.tolist(), "values": command.tolist()}
                ],
            },
            "load": {
                "brake": {
                    "terms": [
                        {
                            "kind": "table",
                            "times": brake[0].tolist(),
                            "values": brake[1].tolist(),
                        }
                    ]
                }
            },
            "initial": {
                "motor_position": shift,
                "motor_speed": float(log.speed[0]),
                "output_position": _start(log, offset, middle, actuator),
            },
        }
    )
    model = actuator
    feedback = str(actuator.parameters["control.position_feedback"].value)
    if feedback == "output" and offset != 0.0:
        model = actuator.with_values({"control.position_feedback": "encoder"})
    rate = f"{1.0 / log.period:.9g} Hz"
    recording = simulate(model, scenario, fidelity=fidelity, record=_record(model, fidelity, rate))
    clock = recording["motor_speed"].time
    simulated = {name: np.interp(log.time, clock, recording[name].values) for name in SIGNALS}
    logged = {
        "encoder_position": log.output,
        "motor_speed": log.speed,
        "current_q_meas": log.current,
    }
    measured = {name: values - offsets.get(name, 0.0) for name, values in logged.items()}
    used = log.good & (log.time >= transient)
    return ValidationTrace(log.name, log.time, measured, simulated, used), how


def _record(actuator: Actuator, fidelity: str, rate: str) -> str:
    """Signals at the log's rate, or at every step where that is no whole number of steps."""
    from elevon.simulate import solver_step

    step = solver_step(actuator, fidelity)
    steps = 1.0 / (float(rate.split(maxsplit=1)[0]) * step)
    whole = abs(steps - round(steps)) < 1e-6 * steps and round(steps) >= 1
    return f"{','.join(SIGNALS)}@{f'{1.0 / (round(steps) * step):.12g} Hz' if whole else 'every'}"


def _start(log: BenchLog, offset: float, middle: float, actuator: Actuator) -> float:
    """Return where the output begins: as the encoder shows it, at an end of the backlash at most.

    What noise and errors of the sensors add beyond the backlash is nowhere an actuator can stand.
    """
    assert log.output is not None
    first = float(log.output[0]) - offset if np.isfinite(log.output[0]) else middle
    value = actuator.parameters.value
    half = 0.5 * (value("backlash.total") + value("backlash.extra"))
    return float(np.clip(first, middle - half, middle + half))


def _command(log: BenchLog, actuator: Actuator) -> tuple[Floats, str]:
    """The command: a waveform where one explains the set point, else the trace itself.

    Where the set point is held at its limit the trace is not known; the waveform fills it, or a
    straight line.
    """
    value = actuator.parameters.value
    gain, limit = value("control.position_gain"), value("control.speed_limit")
    assert log.output is not None
    trace = reconstruct(log.time, log.speed_ref, log.output, gain=gain, limit=limit)
    if trace.coverage < 0.05:
        raise InputError(
            f"{log.name}: the speed set point is inside its limit ({limit:.4g} rad/s) for only "
            f"{100 * trace.coverage:.0f} % of the log: the command cannot be rebuilt"
        )
    if log.note is not None and log.note.command is not None and log.note.command.terms:
        noted = align_noted(trace, log.note)
        return noted.values, f"as noted, from {noted.start:.4g} s"
    known = np.interp(log.time, log.time[trace.valid], trace.position[trace.valid])
    fit = command_fit(log, gain, limit)
    if fit is None:
        return known, "rebuilt from set point and position"
    inside = (log.time >= fit.waveform.window[0]) & (log.time <= fit.waveform.window[1])
    saturated = ~trace.valid & (log.time <= fit.waveform.window[1])
    return np.where(inside | saturated, fit.values, known), f"{fit.waveform.kind} fitted to the log"


def _errors(trace: ValidationTrace, limits: Mapping[str, float]) -> list[SignalError]:
    errors = []
    for name, unit in SIGNALS.items():
        data, model = trace.measured[name][trace.used], trace.simulated[name][trace.used]
        error = model - data
        rms, largest = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
        spread, reach = float(np.std(data)), float(np.ptp(data))
        errors.append(
            SignalError(
                trace.log,
                name,
                unit,
                rms,
                largest,
                100.0 * rms / spread if spread > 0.0 else float("nan"),
                100.0 * rms / reach if reach > 0.0 else float("nan"),
                100.0 * largest / reach if reach > 0.0 else float("nan"),
                limits.get(name),
            )
        )
    return errors
