"""The doors `elevon.calibrate` and `elevon.validate`: logs and records choose the way.

Each subsystem is identified from what was measured at its input and at its output
(`subsystems.flow`). An actuator with a control unit of its own, a servo with a preloaded screw that
its logs weigh, a turning output with set point and both positions logged have further balances.
Logs that show a command but not the law that follows it are fitted in closed loop. Each way reads
logs, fits, holds logs out and validates in its manner.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Annotated

from elevon.actuator import Actuator
from elevon.calibrate.drops import is_drop_table, run_drops
from elevon.calibrate.outcome import Calibration
from elevon.calibrate.stages.context import LOAD, MOTION
from elevon.calibrate.validation import Validation
from elevon.calibrate.validation import validate as validate_drive
from elevon.errors import ElevonError, InputError
from elevon.estimate.held_out import held_out
from elevon.logs.drive import drive_log
from elevon.logs.log import Log
from elevon.logs.read import LogsLike, as_logs
from elevon.option import Option
from elevon.parameters.records import records, wirings
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.simulate.prepare import ActuatorLike, as_actuator


def calibrate(
    logs: LogsLike,
    actuator: ActuatorLike,
    free: Sequence[str] | None = None,
    *,
    per_log: Annotated[Sequence[str], Option(metavar="PATH")] = (),
    fidelity: str | None = None,
    transient: float | None = None,
    promise: bool = False,
    torque_constant: str | float | None = None,
    progress: Progress | None = None,
) -> Calibration:
    """Estimate what logs determine of an actuator.

    Parameters
    ----------
    logs : Log, path, or sequence of them
        Of one unit; or the file of a table of hung weights. `elevon.read_log` reads a log whose
        columns need a map.
    actuator : Actuator, str or path
        Values before; those that are not estimated stay.
    free : sequence of str, optional
        Paths to estimate; default: all that the logs determine.
    per_log : sequence of str
        Estimated for each log too, such as ``backlash.total``; only where both positions were
        logged.
    fidelity : str, optional
        Of the model runs, ``low`` or ``high``; default: low, or what the logs bear.
    transient : float, optional
        Left out at the beginning of each log [s].
    promise : bool
        Whether logs are held out in turn: what an actuator file takes its thresholds from.
    torque_constant : str or float, optional
        Torque at the motor for one unit of the logs' effort (``0.11 N m/A``), or force at a linear
        output (``35.15 N/V``): the scale of inertia, friction and load. Default: the actuator's.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Returns
    -------
    Calibration
        Its ``actuator`` has the values.

    Raises
    ------
    InputError
        A log that cannot be read, nothing determined, or not what was requested.
    Interrupted
        `progress` returned False.
    """
    model = as_actuator(actuator)
    table = logs[0] if isinstance(logs, (list, tuple)) and len(logs) == 1 else logs
    if isinstance(table, (str, os.PathLike)) and is_drop_table(Path(table)):
        return run_drops(Path(table), model)
    request = CalibrationRequest(
        model, free, per_log, fidelity, transient, promise, torque_constant, progress
    )
    return _refused(calibrate_any(as_logs(logs), request))


def _refused(result: Calibration) -> Calibration:
    """Say what a fidelity refuses of the values that were fitted: the fit runs one of them."""
    texts = []
    for fidelity in ("high", "low"):
        before = {str(f["path"]) for f in _errors(result.before, fidelity)}
        texts += [
            f"the {fidelity} fidelity refuses what was fitted: {finding['message']}"
            for finding in _errors(result.actuator, fidelity)
            if finding["path"] not in before
        ]
    return replace(result, findings=(*result.findings, *texts)) if texts else result


def _errors(actuator: Actuator, fidelity: str) -> list[Mapping[str, object]]:
    return [f for f in actuator.findings(fidelity) if f.get("severity", "error") == "error"]


def validate(
    logs: LogsLike,
    actuator: ActuatorLike,
    *,
    fidelity: str = "low",
    transient: float | None = None,
    progress: Progress | None = None,
) -> Validation:
    """Hold an actuator against logs that it was not fitted to, signal by signal.

    Parameters
    ----------
    logs : Log, path, or sequence of them
        As `calibrate`.
    actuator : Actuator, str or path
        The model; thresholds and the sensors' offsets from its ``[validation]`` table.
    fidelity : str
        ``low`` or ``high``.
    transient : float, optional
        Left out at the beginning of each log [s]; default: the actuator file's.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Raises
    ------
    InputError
        A log that cannot be compared, a transient longer than a log.
    """
    model = as_actuator(actuator)
    return validate_any(
        as_logs(logs),
        CalibrationRequest(model, fidelity=fidelity, transient=transient, progress=progress),
    )


def held_out_agreement(
    logs: Sequence[Log],
    before: Actuator,
    free: Sequence[str] | None,
    like: Validation,
    progress: Progress | None = None,
) -> Validation | None:
    """Calibrate without each log in turn and hold the outcome against that log.

    Parameters
    ----------
    logs : sequence of Log
        Healthy, as calibrated.
    before : Actuator
        Values before.
    free : sequence of str or None
        As calibrated.
    like : Validation
        Of the logs under values fitted to all: its transient and its offsets.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Returns
    -------
    Validation or None
        One row a log and signal; a log without which the others determine too little is left out.
        None where nothing could be held out (a single log).
    """
    from elevon.calibrate.calibration import calibrate as calibrate_drive

    if len(logs) < 2:
        return None

    def fit(others: Sequence[Log]) -> Actuator:
        return calibrate_drive(others, before, free=free, hold_out=False, model_runs=False).actuator

    def judge(log: Log, model: Actuator, _share: Progress | None) -> Validation:
        return validate_drive([log], model, transient=like.transient)

    rows = [
        row
        for _, judged in held_out(logs, fit, judge, progress)
        if judged is not None
        for row in judged.errors
    ]
    return replace(like, errors=tuple(rows)) if rows else None


_LONG = 120.0  # s: a log of temperatures is no log of a motion to be predicted
_NOT_COMPARED = "a log lacks a position: the closed loop is not compared"
_FROM_THE_FIT = "thresholds: from the fit itself, since no log could be held out"


@dataclass(frozen=True)
class CalibrationRequest:
    """What is to be estimated, or held against logs; see `calibrate` and `validate`."""

    actuator: Actuator
    free: Sequence[str] | None = None
    per_log: Sequence[str] = ()
    fidelity: str | None = None
    transient: float | None = None
    promise: bool = False
    torque_constant: str | float | None = None
    progress: Progress | None = None


def calibrate_any(logs: Sequence[Log], request: CalibrationRequest) -> Calibration:
    """Estimate what logs determine: subsystem by subsystem, in closed loop where that is needed.

    Raises
    ------
    InputError
        Logs that no way can read, or nothing determined.
    """
    from elevon.calibrate.subsystems.controller import EXPLAINED
    from elevon.calibrate.subsystems.flow import calibrate_machine, identifiable, identify
    from elevon.calibrate.subsystems.record import NOT, of_registers

    actuator = request.actuator
    way, error = _way(logs, actuator)
    machine = None
    if (way is None or isinstance(way, _ClosedLoop)) and identifiable(logs, actuator):
        try:
            late = request.transient
            counted = logs if late is None else [log.after(late) for log in logs]
            machine = identify(
                counted, actuator, scale=request.torque_constant, progress=request.progress
            )
        except InputError:
            if way is None or request.torque_constant is not None:
                raise
    if machine is None and request.torque_constant is not None:
        raise InputError(
            "--set motor.torque_constant: these logs have no effort and motion that it would scale"
        )
    if machine is not None and (way is None or machine.settles(request.free)):
        _check_machine(request)
        return calibrate_machine(machine, request.free)
    if way is None:
        assert error is not None
        raise error
    if machine is not None:
        request = replace(request, actuator=machine.actuator)
    result = way.calibrate(request)
    if machine is not None and request.free is None:
        explained = _explained(result)
        if explained < EXPLAINED and machine.subsystems["mechanics"].status != NOT:
            machine.without_controller(explained)
            return calibrate_machine(machine)
    parts = of_registers(result.estimates, result.undetermined)
    if machine is not None:
        parts |= {name: machine.subsystems[name] for name in ("electrics", "transmission")}
        parts["mechanics"] = parts["mechanics"].joined_with(machine.subsystems["mechanics"])
    return replace(result, facts={**result.facts, "subsystems": parts})


def _explained(result: Calibration) -> float:
    """Return the share of the current's variance that a closed loop explains on data held out."""
    rows = [] if result.promise is None else result.promise.errors
    shares = [(0.01 * row.of_rms) ** 2 for row in rows if row.signal in {"current", "voltage"}]
    return 1.0 - sum(shares) / len(shares) if shares else 1.0


def _check_machine(request: CalibrationRequest) -> None:
    """Refuse what regressions of subsystems have no meaning for."""
    if request.fidelity is not None:
        raise InputError(
            f"--fidelity {request.fidelity}: these logs are read by regressions, subsystem by "
            "subsystem; leave it out"
        )
    if request.per_log:
        raise InputError(
            "--per-log: these logs are read by regressions, and each log's own numbers are listed "
            "beside those of all; leave it out"
        )


def _way(
    logs: Sequence[Log], actuator: Actuator, *, validating: bool = False
) -> tuple[Way | None, InputError | None]:
    """Return the way that needs more than an effort and a motion; or why there is none."""
    if turns(actuator) and all(log.has("speed_ref") for log in logs):
        _check_rates(logs)
    try:
        way = way_of(logs, actuator, validating=validating)
        if isinstance(way, _ClosedLoop):
            way.logs  # noqa: B018 - read here, where an error is no end
    except InputError as error:
        return None, error
    return way, None


def validate_any(logs: Sequence[Log], request: CalibrationRequest) -> Validation:
    """Hold an actuator against logs, each subsystem driven by its measured input where it can be.

    Raises
    ------
    InputError
        Logs that no way can read.
    """
    from elevon.calibrate.subsystems.flow import identifiable, validate_machine

    way, error = _way(logs, request.actuator, validating=True)
    known = (request.actuator.validation or {}).get("law") is not None
    if (way is None or known) and identifiable(logs, request.actuator):
        return validate_machine(logs, request.actuator, progress=request.progress)
    if way is None:
        assert error is not None
        raise error
    return way.validate(request)


def way_of(logs: Sequence[Log], actuator: Actuator, *, validating: bool = False) -> Way:
    """Return the way that suits an actuator's records and the roles of its logs.

    Raises
    ------
    InputError
        Logs that no way can read.
    """
    if "position" not in wirings()[actuator.wiring]["modes"]:
        return _Balances(logs, unit=True)
    if not validating and preloaded(actuator) and balanced(logs):
        return _Balances(logs, unit=False)
    if not turns(actuator):
        return _ClosedLoop(logs)
    try:
        read = [drive_log(log) for log in logs]
    except InputError as error:
        loop = _ClosedLoop(logs, f"in closed loop, since {error}")
        try:
            loop.logs  # noqa: B018 - read here, for the better of two errors
        except InputError:
            raise error from None
        return loop
    _check_rates(logs)
    return _Signals(read)


def _check_rates(logs: Sequence[Log]) -> None:
    """Refuse signals of two rates: what is fitted to both counts samples."""
    first = logs[0]
    for log in logs[1:]:
        if abs(log.period - first.period) > 0.01 * first.period:
            raise InputError(
                f"{first.name} runs at {1.0 / first.period:.4g} Hz, {log.name} at "
                f"{1.0 / log.period:.4g} Hz; logs used together must have one rate"
            )


def preloaded(actuator: Actuator) -> bool:
    """Whether the actuator has a preloaded screw with an efficiency in each direction."""
    return {"screw.preload", "screw.efficiency_aiding"} <= records(actuator.wiring).keys()


def balanced(logs: Sequence[Log]) -> bool:
    """Whether the balances suit: torque, motion and load in every log."""
    return all(
        log.has("torque_current")
        and any(log.has(role) for role in MOTION)
        and any(log.has(role) for role in LOAD)
        for log in logs
    )


def turns(actuator: Actuator) -> bool:
    """Whether the actuator is a servo whose output turns: its positions give the backlash."""
    from elevon.scenario.compile import signal_records

    position = signal_records(actuator.wiring, "high").get("output_position")
    moved = position is not None and position["unit"] == "rad"
    return moved and "position" in wirings()[actuator.wiring]["modes"]


@dataclass(frozen=True)
class _Signals:
    """Set point, speed and current of a turning servo: regressions on the signals."""

    logs: Sequence[Log]

    def calibrate(self, request: CalibrationRequest) -> Calibration:
        from elevon.calibrate.calibration import calibrate as calibrate_drive

        result = calibrate_drive(
            self.logs, request.actuator, free=request.free, per_log=request.per_log,
            fidelity=request.fidelity or "low", transient=request.transient,
            progress=part(request.progress, 0.0, 0.8),
        )  # fmt: skip
        result = self._compared(result, request.transient)
        if not request.promise or result.validation is None:
            return replace(result, promise=result.validation)
        return self._held_out(result, request)

    def _compared(self, result: Calibration, transient: float | None) -> Calibration:
        """Old and new values in closed loop on the same logs, where positions were logged."""
        if any(not log.has("output_position", "motor_position") for log in self.logs):
            return _with(result, _NOT_COMPARED)
        try:
            after = validate_drive(self.logs, result.actuator, transient=transient)
            before = validate_drive(self.logs, result.before, transient=after.transient)
        except InputError as error:
            return _with(result, f"the closed loop is not compared: {error}")
        return replace(result, validation_before=before, validation=after)

    def _held_out(self, result: Calibration, request: CalibrationRequest) -> Calibration:
        from elevon.calibrate.write import outliers

        after = result.validation
        assert after is not None
        progress = part(request.progress, 0.85, 1.0)
        agreement = held_out_agreement(self.logs, result.before, request.free, after, progress)
        if agreement is None:
            return _with(replace(result, promise=after), _FROM_THE_FIT)
        apart = "predicted far worse than the other logs; the thresholds leave it out"
        texts = [f"{name}: {apart}" for name in outliers(agreement)]
        return _with(replace(result, promise=agreement), *texts)

    def validate(self, request: CalibrationRequest) -> Validation:
        return validate_drive(
            self.logs, request.actuator, fidelity=request.fidelity or "low",
            transient=request.transient, progress=request.progress,
        )  # fmt: skip


@dataclass(frozen=True)
class _ClosedLoop:
    """Few channels: a servo's loop run on the logged command."""

    given: Sequence[Log]
    why: str = ""

    @cached_property
    def logs(self) -> list[Log]:
        from elevon.calibrate.stages.closed_loop import loop_log

        return [loop_log(log) for log in self.given]

    def calibrate(self, request: CalibrationRequest) -> Calibration:
        from elevon.calibrate.stages.closed_loop import calibrate_loop
        from elevon.calibrate.stages.closed_loop.result import validate_loop

        _check_loop(request)
        structure = request.actuator.parameters["control.structure"]
        result = calibrate_loop(
            self.logs, request.actuator,
            # One that the caller sets is no question any more.
            structure=str(structure.value) if structure.confidence == "override" else None,
            free=request.free, transient=request.transient, progress=request.progress,
        )  # fmt: skip
        offsets = None if result.promise is None else result.promise.offsets
        after = validate_loop(self.logs, result.actuator, request.transient, offsets)
        return _with(replace(result, validation=after), *filter(None, [self.why]))

    def validate(self, request: CalibrationRequest) -> Validation:
        from elevon.calibrate.stages.closed_loop.result import validate_loop

        return validate_loop(self.logs, request.actuator, request.transient)


def _check_loop(request: CalibrationRequest) -> None:
    """Refuse what the closed loop has no meaning for."""
    from elevon.simulate.prepare import check_fidelity

    fidelity = request.fidelity or "low"
    check_fidelity(request.actuator.wiring, fidelity)
    if fidelity != "low":
        raise InputError(
            f"--fidelity {fidelity}: the closed loop is searched over some 10 000 runs, which are "
            "of the low fidelity; leave it out, and validate the set with elevon compare"
        )
    if request.per_log:
        raise InputError(
            "--per-log: these logs have no two positions and set points to estimate each log's "
            "backlash from; leave it out"
        )


@dataclass(frozen=True)
class _Balances:
    """Each number from its own balance; `unit`: of an actuator with a control unit of its own."""

    given: Sequence[Log]
    unit: bool

    def calibrate(self, request: CalibrationRequest) -> Calibration:
        from elevon.calibrate.stages import calibrate_parts

        result = calibrate_parts(
            self._read(self.given, request.actuator), request.actuator, free=request.free,
            fidelity=self._fidelity(request),
            progress=part(request.progress, 0.0, 0.3 if request.promise else 1.0),
        )  # fmt: skip
        if request.transient is not None or (request.fidelity and not self.unit):
            text = "--transient, and --fidelity without model runs: not used for these logs"
            result = _with(result, text)
        return self._held_out(result, request) if request.promise else result

    def _fidelity(self, request: CalibrationRequest) -> str:
        return (request.fidelity or "auto") if self.unit else "auto"

    @staticmethod
    def _read(logs: Sequence[Log], actuator: Actuator) -> list[Log]:
        from elevon.calibrate.stages import role_log

        return [role_log(_recording(log), log.name, actuator) for log in logs]

    def _predicted(self, actuator: Actuator) -> list[str]:
        """Names of the logs of motions that the model can predict."""
        from elevon.calibrate.stages.rig import moves_of

        return [
            log.name
            for log in self._read(self.given, actuator)
            if (moves_of(log) if self.unit else log.has("command") and log.duration < _LONG)
        ]

    def _held_out(self, result: Calibration, request: CalibrationRequest) -> Calibration:
        """Thresholds of the actuator file, from motions held out where there are several.

        A single motion, or one without which too little is determined, is held against the values
        of all.
        """
        names = self._predicted(result.before)
        if not names:
            return _with(result, "no thresholds: no log of a motion to be predicted")
        apart, judged = len(names) > 1, []
        try:
            for name in names:
                model = self._without(name, request) if apart else None
                apart = model is not None
                way = replace(self, given=[log for log in self.given if log.name == name])
                fitted = result.actuator if model is None else model
                judged.append(way.validate(CalibrationRequest(fitted)))
        except ElevonError as error:
            return _with(result, f"no thresholds: {error}")
        errors = tuple(row for item in judged for row in item.errors)
        how = {log: text for item in judged for log, text in item.commands.items()}
        promise = replace(judged[0], errors=errors, traces=(), commands=how)
        return _with(replace(result, promise=promise), *([] if apart else [_FROM_THE_FIT]))

    def _without(self, name: str, request: CalibrationRequest) -> Actuator | None:
        """Return the actuator calibrated from all other logs; None: they determine too little."""
        from elevon.calibrate.stages import calibrate_parts

        others = [log for log in self.given if log.name != name and _ends(log) < _LONG]
        before, free, fidelity = request.actuator, request.free, self._fidelity(request)
        try:
            read = self._read(others, before)
            return calibrate_parts(read, before, free=free, fidelity=fidelity).actuator
        except InputError:
            return None

    def validate(self, request: CalibrationRequest) -> Validation:
        from elevon.calibrate.validation import validate_replay

        if not self.unit:
            return _ClosedLoop(self.given).validate(request)
        named = [(log.name, _recording(log)) for log in self.given]
        return validate_replay(
            named, request.actuator, fidelity=request.fidelity or "low",
            transient=request.transient, progress=request.progress,
        )  # fmt: skip


#: Logs of one kind, ready to be calibrated to and validated with.
Way = _Signals | _ClosedLoop | _Balances


def _with(result: Calibration, *texts: str) -> Calibration:
    """Return the answer with something more to know."""
    return replace(result, findings=(*result.findings, *texts))


def _ends(log: Log) -> float:
    return float(log.time[-1] - log.time[0])


def _recording(log: Log) -> Recording:
    if log.recording is None:
        raise InputError(f"{log.name}: was changed since it was read; read it again")
    return log.recording
