"""A model held against logs: the same command, its own closed loop, the errors signal by signal.

Of an actuator with a control unit of its own the recorded inputs are replayed: command, load and
the stand's settings come from the log; everything else that the log shows and the model has is
compared, role by role.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats, Ints
from elevon.calibrate.kinematics import command_fit
from elevon.errors import InputError, Interrupted, SimulationError, unknown
from elevon.experiment import Experiment, Inputs, ModelRun
from elevon.experiment.experiment import Table
from elevon.logs.command.curve import CommandCurve, command_curve, rebuilt_curve
from elevon.logs.command.note import align_noted
from elevon.logs.command.reconstruct import reconstruct
from elevon.logs.drive import drive_log
from elevon.logs.log import Log, on_clock
from elevon.number_text import quantity_text
from elevon.plain import STORED, Plain, in_unit, key
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.report import Report, ReportTable
from elevon.results import Result

#: Signals compared: name, unit.
SIGNALS: dict[str, str] = {
    "encoder_position": "rad",
    "motor_speed": "rad/s",
    "current_q_meas": "A",
}
_UNMEASURED = {"force", "on"}  # a brake of which no torque is known
TRANSIENT = 10.0  # s, as the published comparison leaves out


#: % of the signal's RMS about its mean: a model that leaves more explains less than three quarters
#: of what it does. ASSUMED
UNEXPLAINED = 50.0


#: Of the highest speed: below it the machine rests; of the largest change of speed: below it the
#: motion is steady; s that a start and a reversal last. ASSUMED
RESTS, STEADY, LASTS = 0.02, 0.1, 0.1
CONTACT = 0.1  # of the largest load: from it on the output pushes. ASSUMED
_LOADS = ("load", "load_cell")


def phases_of(time: Floats, speed: Floats, load: Floats | None = None) -> dict[str, Bools]:
    """Return the samples of a motion that start, run steadily, reverse, and push on a load.

    Parameters
    ----------
    time, speed : ndarray, shape (n,)
        s; in any unit.
    load : ndarray, shape (n,), optional
        As measured; None: nothing shows a contact.
    """
    top = float(np.nanmax(np.abs(speed), initial=0.0))
    moving = np.abs(np.nan_to_num(speed)) > RESTS * top
    period = float(np.median(np.diff(time)))
    width = max(round(LASTS / period), 1)
    direction = np.sign(speed) * moving
    at = np.flatnonzero(moving)
    turns = at[1:][direction[at[1:]] != direction[at[:-1]]]
    begins = np.flatnonzero(np.diff(moving.astype(np.int8), prepend=0) == 1)

    def after(instants: Ints) -> Bools:
        out = np.zeros(len(time), dtype=np.bool_)
        for k in instants:
            out[max(k - width, 0) : k + width] = True
        return out

    reversal = after(turns)
    start = after(np.setdiff1d(begins, turns)) & ~reversal
    smooth = np.convolve(np.nan_to_num(speed), np.ones(width) / width, mode="same")
    change = np.abs(np.gradient(smooth, period))
    steady = moving & (change < STEADY * float(change.max(initial=0.0))) & ~start & ~reversal
    phases = {"start": start, "steady": steady, "reversal": reversal}
    if load is not None:
        phases["contact"] = np.abs(load) > CONTACT * float(np.nanmax(np.abs(load), initial=0.0))
    return phases


@dataclass(frozen=True)
class SignalError(Plain):
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
    of_rms_away : float or None
        As `of_rms`, without what lies within 20 ms of a corner or step of the command; None where
        it has none.
    """

    log: str
    signal: str
    unit: str
    rms: float
    largest: Annotated[float, key("max")]
    of_rms: Annotated[float, key("rms_percent_of_rms"), in_unit("%")]
    of_range: Annotated[float, key("rms_percent_of_range"), in_unit("%")]
    largest_of_range: Annotated[float, key("max_percent_of_range"), in_unit("%")]
    limit: Annotated[float | None, key("limit_percent_of_range"), in_unit("%")]
    of_rms_away: Annotated[
        float | None, key("rms_percent_of_rms_away_from_corners"), in_unit("%")
    ] = None

    COMPUTED: ClassVar = ("passed",)

    @property
    def passed(self) -> bool | None:
        """Whether the threshold is kept and the model explains the signal; None without one.

        A threshold is twice what the fit itself left, so alone it would pass a signal that no fit
        explained.
        """
        if self.limit is None:
            return None
        return bool(self.of_range <= self.limit and not self.of_rms > UNEXPLAINED)


@dataclass(frozen=True)
class ValidationTrace(Plain):
    """Measured and simulated signals of one log on its clock, for plots.

    `about` marks what lies about a corner or step of the command; None where nothing does.
    """

    log: str
    time: Floats
    measured: Mapping[str, Floats]
    simulated: Mapping[str, Floats]
    used: Bools
    about: Bools | None = None

    @classmethod
    def of(cls, log: Log, run: Log, names: Mapping[str, str]) -> ValidationTrace:
        """Return a log beside a run of it, channels by role named as stated."""
        roles = [role for role in names if log.has(role) and run.has(role)]
        measured, simulated = ({names[r]: item[r] for r in roles} for item in (log, run))
        curve = command_curve(log) if log.has("command") else None
        return cls(log.name, log.time, measured, simulated, log.good, about_breaks(curve, log))

    def phases(self) -> dict[str, Bools]:
        """Return the samples of each phase of the motion; none where no speed was compared."""
        speed = next((name for name in self.measured if name.endswith("speed")), None)
        if speed is None or len(self.time) < 2:
            return {}
        load = next((self.measured[name] for name in _LOADS if name in self.measured), None)
        return phases_of(self.time, self.measured[speed], load)

    def errors(
        self,
        units: Mapping[str, str],
        limits: Mapping[str, float] | None = None,
    ) -> list[SignalError]:
        """Return the error of every channel where samples count."""
        rows = []
        for name, simulated in self.simulated.items():
            mask = self.used & np.isfinite(self.measured[name])
            if not mask.any():
                continue  # a stretch shorter than what settles shows nothing
            data = self.measured[name][mask]
            error = simulated[mask] - data
            rms, largest = float(np.sqrt(np.mean(error**2))), float(np.abs(error).max())
            about, reach = float(np.std(data)), float(np.ptp(data))
            of_rms, of_range, largest_of_range = (
                100.0 * value / size if size > 0.0 else float("nan")
                for value, size in ((rms, about), (rms, reach), (largest, reach))
            )
            away = None if self.about is None else ~self.about[mask]
            rows.append(
                SignalError(
                    self.log, name, units[name], rms, largest, of_rms, of_range,
                    largest_of_range, (limits or {}).get(name), _share_of(error, data, away),
                )
            )  # fmt: skip
        return rows


def _share_of(error: Floats, data: Floats, away: Bools | None) -> float | None:
    """Return the RMS error of some samples in percent of the data's RMS there about its mean."""
    if away is None or not away.any() or not float(np.std(data[away])) > 0.0:
        return None
    return 100.0 * float(np.sqrt(np.mean(error[away] ** 2)) / np.std(data[away]))


def about_breaks(curve: CommandCurve | None, log: Log) -> Bools | None:
    """Return which samples of a log lie about a corner or step of its command; None: none does."""
    return curve.about_breaks(log.time) if curve is not None and curve.breaks else None


def sensor_text(name: str, value: float) -> str:
    """Return in words what a log's sensor adds: an offset, a delay or a filter."""
    channel, _, kind = name.rpartition("_")
    if kind == "delay" and channel:
        return f"{channel}: the log shows it {1e3 * value:.3g} ms late"
    if kind == "lag" and channel:
        return f"{channel}: the log shows it behind a filter of {1e3 * value:.3g} ms"
    return f"{name}: the sensor's offset of {value:.4g} is taken off the logs"


@dataclass(frozen=True)
class Validation(Result):
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
    transient: Annotated[float, key("transient_s"), in_unit("s")]
    errors: Annotated[tuple[SignalError, ...], key("signals")]
    commands: Mapping[str, str]
    traces: Annotated[tuple[ValidationTrace, ...], STORED]
    offsets: Mapping[str, float] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)

    KIND: ClassVar = "validation"
    COMPUTED: ClassVar = ("status", "phases")
    TABLE: ClassVar = "errors"
    BARS: ClassVar = ("signal", "rms_percent_of_range")

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        judged = [error for error in self.errors if error.passed is not None]
        over = [
            f"{e.signal} of {e.log}"
            + (f" ({e.of_rms:.0f} % of its RMS)" if e.of_rms > UNEXPLAINED else "")
            for e in judged
            if not e.passed
        ]
        if not judged:
            return f"{self.actuator}: measured; the actuator file has no thresholds."
        if over:
            return f"{self.actuator}: not passed; over its threshold: {', '.join(over)}."
        return f"{self.actuator}: passed; {len(judged)} signals within their thresholds."

    def text_tables(self) -> list[ReportTable]:
        """Return the errors, signal by signal."""
        rows = [
            (e.log, e.signal, quantity_text(e.rms, e.unit, 4)[0],
             *quantity_text(e.largest, e.unit, 4), f"{e.of_rms:.3g}", f"{e.of_range:.3g}",
             "" if e.of_rms_away is None else f"{e.of_rms_away:.3g}",
             "" if e.limit is None else f"{e.limit:.3g}",
             "" if e.passed is None else "pass" if e.passed else "FAIL")
            for e in self.errors
        ]  # fmt: skip
        away = "% away"
        columns = (
            "log", "signal", "RMS", "max", "unit", "% of RMS", "% of range", away, "limit %", "",
        )  # fmt: skip
        caption = (
            "% of RMS: RMS error over the logged signal's RMS about its mean; "
            f"% of range: over its range; {away}: % of RMS without the 20 ms about corners "
            f"and steps of the command; after {self.transient:g} s"
        )
        return [ReportTable(columns, rows, caption, optional=(away,))]

    @property
    def remarks(self) -> list[str]:
        """What is taken off the logs, and what was seen in them."""
        offsets = [sensor_text(name, offset) for name, offset in self.offsets.items()]
        return [*offsets, *(f"{name}: {text}" for name, text in self.notes.items())]

    def report(self, *, date: str | None = None) -> Report:
        """Return its page."""
        from elevon.calibrate.report import validation_report

        return validation_report(self, date=date)

    @property
    def phases(self) -> dict[str, list[SignalError]]:
        """Errors of what starts, runs steadily, reverses and pushes on a load, each apart."""
        units = {error.signal: error.unit for error in self.errors}
        out: dict[str, list[SignalError]] = {}
        for trace in self.traces:
            for name, samples in trace.phases().items():
                for signal, run in trace.simulated.items():
                    if signal in units:
                        used = trace.used & samples & np.isfinite(run)
                        one = replace(trace, simulated={signal: run}, used=used)
                        out.setdefault(name, []).extend(one.errors(units))
        return {name: rows for name, rows in out.items() if rows}

    @property
    def status(self) -> str:
        """``pass``, ``fail``, or ``measured`` where the actuator file has no thresholds."""
        judged = [error.passed for error in self.errors if error.passed is not None]
        if not judged:
            return "measured"
        return "pass" if all(judged) else "fail"


def validate(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    fidelity: str = "low",
    transient: float | None = None,
    progress: Progress | None = None,
) -> Validation:
    """Run the model on each log's command and compare.

    Parameters
    ----------
    logs : sequence of Log
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
    limits, offsets = (promised(actuator, key, SIGNALS) for key in ("limits", "offsets"))
    if not logs:
        raise InputError("validation needs at least one log")
    logs = [drive_log(log) for log in logs]
    given = transient
    if given is None:
        given = promised_transient(actuator, None, TRANSIENT)
        shortest = min(log.duration for log in logs)
        given = given if given < shortest else 0.5 * shortest
    errors: list[SignalError] = []
    traces, commands, notes = [], {}, {}
    for k, log in enumerate(logs):
        if progress is not None and not progress(k / len(logs)):
            raise Interrupted("validation stopped")
        trace, commands[log.name] = _trace(log, actuator, fidelity, given, offsets)
        traces.append(trace)
        if log.brake.known in _UNMEASURED:
            notes[log.name] = (
                "the brake acted but its torque is not known: the run has none, nothing is judged"
            )
        errors += trace.errors(SIGNALS, {} if log.name in notes else limits)
    return Validation(
        actuator.name, fidelity, given, tuple(errors), commands, tuple(traces), offsets, notes
    )


def promised(
    actuator: Actuator, what: str, known: Collection[str] | None = None
) -> dict[str, float]:
    """Return ``limits`` or ``offsets`` of an actuator file, by signal.

    Raises
    ------
    UnknownNameError
        One of a signal that is not among those known.
    """
    table = dict((actuator.validation or {}).get(what, {}))
    for name in table:
        if known is not None and name not in known:
            raise unknown("signal", name, known, f"{actuator.name}: validation.{what}")
    return table


def promised_transient(actuator: Actuator, given: float | None, default: float) -> float:
    """Return the seconds left out of a log: as given, else as the actuator file or the default."""
    stated = (actuator.validation or {}).get("transient", default)
    return float(stated) if given is None else given


def _trace(
    log: Log,
    actuator: Actuator,
    fidelity: str,
    transient: float,
    offsets: Mapping[str, float],
) -> tuple[ValidationTrace, str]:
    late, (experiment, how) = log.after(transient), bench_experiment(log, actuator, fidelity)
    about = about_breaks(_command(log, actuator)[0], log)
    run = next(experiment.run()).seen(log)
    logged = (log.output, log.speed, log.current)
    measured = {
        name: values - offsets.get(name, 0.0) for name, values in zip(SIGNALS, logged, strict=True)
    }
    return ValidationTrace(log.name, log.time, measured, run.channels, late.good, about), how


def bench_experiment(
    log: Log,
    actuator: Actuator,
    fidelity: str,
    shows: Sequence[str] = tuple(SIGNALS),
    loads: Mapping[str, Table] | None = None,
) -> tuple[Experiment, str]:
    """Return the test of a log of the rotary bench, and how its command was rebuilt.

    Parameters
    ----------
    log : Log
        With both positions and the set point of the speed.
    actuator : Actuator
        The model.
    fidelity : str
        ``low`` or ``high``.
    shows : sequence of str
        Signals of the model that a run shows.
    loads : mapping of str to (ndarray, ndarray), optional
        Port to time and load, beside the brake's.

    Raises
    ------
    InputError
        A position is missing, or the command cannot be rebuilt.
    """
    if not log.has("output_position") or not log.has("motor_position"):
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
    inputs = Inputs(
        log.duration, "position", command.points, loads={"brake": brake, **(loads or {})},
        initial={
            "motor_position": shift,
            "motor_speed": float(log.speed[0]),
            "output_position": _start(log, offset, middle, actuator),
        },
    )  # fmt: skip
    model = actuator
    feedback = str(actuator.parameters["control.position_feedback"].value)
    if feedback == "output" and offset != 0.0:
        model = actuator.with_values({"control.position_feedback": "encoder"})
    rate = _rate(model, fidelity, log.period)
    names = {name: name for name in shows}
    return Experiment(log, model, inputs, names, rate=rate, fidelity=fidelity, notices=True), how


def _rate(actuator: Actuator, fidelity: str, period: float) -> str:
    """The log's rate, or every step where that is no whole number of steps."""
    from elevon.simulate import solver_step

    step = solver_step(actuator, fidelity)
    steps = float(f"{period / step:.9g}")
    whole = abs(steps - round(steps)) < 1e-6 * steps and round(steps) >= 1
    return f"{1.0 / (round(steps) * step):.12g} Hz" if whole else "every"


def _start(log: Log, offset: float, middle: float, actuator: Actuator) -> float:
    """Return where the output begins: as the encoder shows it, at an end of the backlash at most.

    What noise and errors of the sensors add beyond the backlash is nowhere an actuator can stand.
    """
    first = float(log.output[0]) - offset if np.isfinite(log.output[0]) else middle
    value = actuator.parameters.value
    half = 0.5 * (value("backlash.total") + value("backlash.extra"))
    return float(np.clip(first, middle - half, middle + half))


def _command(log: Log, actuator: Actuator) -> tuple[CommandCurve, str]:
    """The command: a waveform where one explains the set point, else the trace itself.

    Where the set point is held at its limit the trace is not known; the waveform fills it, or a
    straight line.
    """
    value = actuator.parameters.value
    gain, limit = value("control.position_gain"), value("control.speed_limit")
    trace = reconstruct(log.time, log.speed_ref, log.output, gain=gain, limit=limit)
    if trace.coverage < 0.05:
        raise InputError(
            f"{log.name}: the speed set point is inside its limit ({limit:.4g} rad/s) for only "
            f"{100 * trace.coverage:.0f} % of the log: the command cannot be rebuilt"
        )
    if log.note is not None and log.note.command is not None and log.note.command.terms:
        noted = align_noted(trace, log.note)
        return rebuilt_curve(log.time, noted.values), f"as noted, from {noted.start:.4g} s"
    known = np.interp(log.time, log.time[trace.valid], trace.position[trace.valid])
    fit = command_fit(log, gain, limit)
    if fit is None:
        return CommandCurve(log.time, known), "rebuilt from set point and position"
    inside = (log.time >= fit.waveform.window[0]) & (log.time <= fit.waveform.window[1])
    saturated = ~trace.valid & (log.time <= fit.waveform.window[1])
    wave = np.where(inside | saturated, fit.values, known)
    return rebuilt_curve(log.time, wave), f"{fit.waveform.kind} fitted to the log"


_INPUTS = ("command", "load")
_SMOOTH = 0.5  # s over which the ram's imposed speed is taken from its position
_SHORTEST = 64  # samples that a filter of the recorder needs


def unit_experiment(
    log: Log, actuator: Actuator, fidelity: str, *, period: float | None = None
) -> Experiment:
    """Return the test of a log as it was commanded, the actuator as the log's stand had it.

    Raises
    ------
    InputError
        A role that is needed is missing, or the model shows nothing of the log.
    """
    position, stand = log["output_position"], log.stand
    loads = {}
    if stand.moves_output:
        loads["rig_speed"] = (log.time, _imposed_speed(log.time, position))
    elif log.has("load"):
        loads["output"] = (log.time, log["load"])
    inputs = Inputs(
        log.duration, "gear", actions=_actions(log, actuator.wiring), loads=loads,
        initial=dict(stand.initial) or {"nut_position": float(position[0])},
    )  # fmt: skip
    ready = actuator.with_values(dict(stand.parameters), source="stand of the log", place=log.name)
    shows = {
        role: signal
        for role, signal in _role_signals(actuator.wiring, fidelity).items()
        if log.has(role) and role not in _INPUTS and (stand.moves_output or role != "load_cell")
    }
    if not shows:
        raise InputError(f"{log.name}: shows nothing that the model has; roles: {', '.join(log)}")
    return Experiment(log, ready, inputs, shows, period=period, fidelity=fidelity, notices=True)


def _role_signals(wiring: str, fidelity: str) -> dict[str, str]:
    """Role to the model's signal, the last of a role."""
    from elevon.scenario.compile import signal_records

    records = signal_records(wiring, fidelity)
    return {item["role"]: name for name, item in records.items() if item["role"] is not None}


def _actions(log: Log, wiring: str) -> tuple[tuple[float, str], ...]:
    """Return the actions commanded: a held number, one round higher when it is repeated."""
    from elevon.parameters.records import wirings

    names: list[str] = wirings()[wiring]["actions"]
    command = log if log.recording is None else log.on("command")
    values = np.rint(command["command"])
    changes = np.flatnonzero(np.diff(values)) + 1
    start = command.start - log.start
    return tuple(
        (float(command.time[k] + start), names[int(values[k]) % len(names)]) for k in changes
    )


def _imposed_speed(time: Floats, position: Floats) -> Floats:
    """Speed of a ram that is moved: the slope of its position over half a second."""
    from scipy.signal import savgol_filter

    period = float(np.median(np.diff(time)))
    width = max(5, 2 * round(0.5 * _SMOOTH / period) + 1)
    slope = savgol_filter(position, min(width, len(position) - 1 | 1), 1, deriv=1, delta=period)
    return np.asarray(slope, dtype=np.float64)


def replayed(experiment: Experiment, progress: Progress | None = None) -> ModelRun:
    """Run a log's test once.

    Raises
    ------
    SimulationError
        It left the finite numbers.
    """
    run = next(experiment.run(progress=progress))
    if run.status == "diverged":
        raise SimulationError(f"{experiment.log.name}: the run diverges", run.status)
    return run


def as_recorded(log: Log, run: ModelRun, role: str, *, stepped: bool = False) -> Floats:
    """Return a run's channel on the log's instants, through the filter of its recorder, if any.

    States, and what else is `stepped`, are as they were written last.
    """
    from scipy.signal import butter, sosfiltfilt

    values, unit = run.log[role], "1" if stepped else log.units.get(role, "")
    rate = 1.0 / run.log.period
    if unit != "1" and 0.0 < log.stand.cutoff < 0.5 * rate and len(values) >= _SHORTEST:
        values = sosfiltfilt(butter(4, log.stand.cutoff, fs=rate, output="sos"), values)
    return on_clock(run.log.time, values, log.time, unit)


def validate_replay(
    logs: Sequence[tuple[str, Recording]],
    actuator: Actuator,
    *,
    fidelity: str = "low",
    transient: float | None = None,
    progress: Progress | None = None,
) -> Validation:
    """Run the model on what the logs' inputs were and compare what came out.

    Parameters
    ----------
    logs : sequence of (str, Recording)
        Name and log, with the roles ``command`` and ``output_position`` at least.
    actuator : Actuator
        The model; what a log says that its stand fixed replaces its values.
    fidelity : str
        Of the runs.
    transient : float, optional
        Left out at the beginning [s]; default the actuator file's, else 0.
    progress : callable, optional
        As for `elevon.simulate`.

    Raises
    ------
    InputError
        A log without command, or with nothing to compare.
    SimulationError
        A run did not reach its end.
    """
    given, offsets = promised_transient(actuator, transient, 0.0), promised(actuator, "offsets")
    traces, errors = [], []
    for number, (name, recording) in enumerate(logs):
        share = part(progress, number / len(logs), (number + 1) / len(logs))
        log = Log.of(recording, name, clock="output_position")
        trace = _replayed_trace(log, actuator, fidelity, given, offsets, share)
        traces.append(trace)
        limits = promised(actuator, "limits", trace.measured)
        errors += trace.errors(log.units, limits)
    how = {name: "as logged" for name, _ in logs}
    return Validation(actuator.name, fidelity, given, tuple(errors), how, tuple(traces), offsets)


def _replayed_trace(  # noqa: PLR0917 - what a log is held against
    log: Log,
    actuator: Actuator,
    fidelity: str,
    transient: float,
    offsets: Mapping[str, float],
    progress: Progress | None,
) -> ValidationTrace:
    late, experiment = log.after(transient), unit_experiment(log, actuator, fidelity)
    run = replayed(experiment, progress)
    roles = [role for role in experiment.shows if log.units.get(role) != "1"]
    simulated = {role: as_recorded(log, run, role) for role in roles}
    used = late.good & (log.time <= run.seconds)
    measured = {role: log[role] - offsets.get(role, 0.0) for role in roles}
    return ValidationTrace(log.name, log.time, measured, simulated, used)
