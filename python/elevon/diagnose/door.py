"""The doors `elevon.diagnose` and `elevon.monitor`."""

from __future__ import annotations

import os
import time as clock
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING

from elevon.calibrate.ways import turns
from elevon.diagnose.by_model import diagnose as by_model
from elevon.diagnose.by_model import traces_of
from elevon.diagnose.engine.answer import Diagnosis
from elevon.diagnose.engine.spread import LearnedSpread
from elevon.diagnose.monitor.answer import Monitoring
from elevon.diagnose.monitor.monitor import FALSE_ALARM_TIME, Monitor
from elevon.errors import InputError, unknown
from elevon.logs.read import as_logs
from elevon.simulate.prepare import as_actuator

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.learning.classes import LearnedClasses
    from elevon.diagnose.surrogate import Surrogate
    from elevon.logs.log import Log
    from elevon.logs.read import LogsLike
    from elevon.simulate.prepare import ActuatorLike

METHODS = ("model", "surrogate", "both", "learned")


def diagnose(
    logs: LogsLike,
    actuator: ActuatorLike,
    baselines: LogsLike = (),
    *,
    method: str = "model",
    surrogate: Surrogate | str | os.PathLike[str] | None = None,
    faults: Sequence[str] | None = None,
    false_alarm: float = 0.05,
    spread: LearnedSpread | str | os.PathLike[str] | None = None,
    model: LearnedClasses | str | os.PathLike[str] | None = None,
) -> Diagnosis:
    """Say what is wrong with the unit that wrote the logs, where, how bad, how sure.

    Parameters
    ----------
    logs : Log, path, or sequence of them
        Of one unit in one condition.
    actuator : Actuator, str or path
        The healthy unit, calibrated.
    baselines : Log, path, or sequence of them
        Of the healthy unit; those of the same test serve.
    method : str
        ``model``; ``surrogate``; ``both``: the surrogate proposes, the model refines; ``learned``:
        by `elevon.learn` from labelled logs.
    surrogate : Surrogate or path, optional
        Default: the package's own.
    faults : sequence of str, optional
        ``KIND@PLACE`` of the candidates; default: all.
    false_alarm : float
        Rate at which a healthy unit may be called faulty.
    spread : LearnedSpread or path, optional
        By `elevon.learn_spread`; default: what the package states. Serves ``model``.
    model : LearnedClasses or path, optional
        By `elevon.learn`, or by ``elevon diagnose-train``. Serves ``learned``.

    Raises
    ------
    InputError
        A log that cannot be diagnosed, no candidate, a rate outside 0 to 1, a method that does not
        serve this actuator.
    """
    unit = as_actuator(actuator)
    if method == "learned":
        answer = _learned(logs, unit, baselines, model, faults=faults, rate=false_alarm)
        return _signed(answer, unit, (), method)
    if model is not None:
        raise InputError("--model: serves --method learned")
    run = _method(method, surrogate, spread)
    if not 0.0 < false_alarm < 1.0:
        raise InputError(f"false-alarm rate {false_alarm:g} must be between 0 and 1")
    if method != "model" and not turns(unit):
        raise InputError(f"--method {method}: serves turning outputs; {unit.name} has none")
    data, healthy = as_logs(logs), _healthy(baselines)
    result = run(data, unit, baselines=healthy, faults=faults, false_alarm=false_alarm)
    draw = partial(traces_of, data, unit, result, healthy)
    return replace(_signed(result, unit, healthy, method), draw=draw)


def _signed(result: Diagnosis, unit: Actuator, baselines: Sequence[Log], method: str) -> Diagnosis:
    """Return an answer with what it stands on."""
    from elevon import __version__

    names = tuple(log.name for log in baselines)
    return replace(
        result, actuator=unit.name, parameter_hash=unit.hash, baselines=names,
        made_by=__version__, method=method,
    )  # fmt: skip


def _learned(
    logs: LogsLike,
    actuator: Actuator,
    baselines: LogsLike,
    model: LearnedClasses | str | os.PathLike[str] | None,
    *,
    faults: Sequence[str] | None,
    rate: float,
) -> Diagnosis:
    """Diagnose by a file of `elevon.learn`, or by a surrogate: both are learnt, in one format."""
    from elevon.diagnose.learning.answer import diagnose_by_classes
    from elevon.diagnose.learning.archive import read_archive
    from elevon.diagnose.learning.classes import KIND, LearnedClasses

    if model is None:
        raise InputError(
            "--method learned needs --model FILE (elevon learn, elevon diagnose-train)"
        )
    if not isinstance(model, LearnedClasses) and read_archive(model)[0] != KIND:
        return diagnose(
            logs, actuator, baselines, method="surrogate", surrogate=model, faults=faults,
            false_alarm=rate,
        )  # fmt: skip
    if faults or _healthy(baselines):
        raise InputError("--method learned: classes are those of the model; no fault, no baseline")
    classes = model if isinstance(model, LearnedClasses) else LearnedClasses.load(model)
    result = diagnose_by_classes(as_logs(logs), classes, false_alarm=rate)
    return replace(result, actuator=actuator.name)


def _healthy(baselines: LogsLike) -> list[Log]:
    none = not isinstance(baselines, (str, os.PathLike)) and isinstance(baselines, Sequence)
    return [] if none and not len(baselines) else as_logs(baselines)  # type: ignore[arg-type]


def _method(
    method: str,
    given: Surrogate | str | os.PathLike[str] | None,
    spread: LearnedSpread | str | os.PathLike[str] | None,
) -> Callable[..., Diagnosis]:
    """Return what diagnoses; files of a surrogate and of a spread are read before any log."""
    if method not in METHODS:
        raise unknown("method", method, METHODS, "--method")
    if method == "model":
        if given is not None:
            raise InputError("--surrogate: serves --method surrogate and both")
        if spread is not None and not isinstance(spread, LearnedSpread):
            spread = LearnedSpread.load(spread)
        return partial(by_model, spread=spread)
    if spread is not None:
        raise InputError("--spread: serves --method model")
    from elevon.diagnose.surrogate import (
        Surrogate,
        diagnose_by_both,
        diagnose_by_surrogate,
        shipped,
    )

    if not isinstance(given, Surrogate):
        given = shipped() if given is None else Surrogate.load(given)
    by = diagnose_by_surrogate if method == "surrogate" else diagnose_by_both
    return partial(by, surrogate=given)


def monitor(
    logs: LogsLike,
    actuator: ActuatorLike,
    baselines: LogsLike,
    *,
    window: float | None = None,
    false_alarm_time: float = FALSE_ALARM_TIME,
    days: int | None = None,
    longest: float | None = None,
    faults: Sequence[str] | None = None,
) -> Monitoring:
    """Watch logs window by window, each a day of the unit; alarm where a fault begins.

    `elevon.diagnose.monitor.Monitor` takes samples as they come.

    Parameters
    ----------
    logs : Log, path, or sequence of them
        In the order of time.
    actuator : Actuator, str or path
        The healthy unit, calibrated.
    baselines : Log, path, or sequence of them
        Of the healthy unit in the motion that is watched.
    window : float, optional
        Width [s]; default: the period of a noted sine.
    false_alarm_time : float
        Mean time between false alarms [s].
    days : int, optional
        Days on which the unit is watched; default: as many as logs.
    longest : float, optional
        Length of the longest of them [s]; default: that of the longest log.
    faults : sequence of str, optional
        ``KIND@PLACE``; default: all candidates.

    Raises
    ------
    InputError
        As `Monitor`; no window that could be used.
    """
    begin = clock.perf_counter()
    stream = as_logs(logs)
    watch = Monitor(
        as_actuator(actuator), as_logs(baselines), window=window,
        false_alarm_time=false_alarm_time, faults=faults,
        days=len(stream) if days is None else days,
        longest=max(item.duration for item in stream) if longest is None else longest,
    )  # fmt: skip
    for item in stream:
        watch.feed_log(item)
    if all(step.skipped for step in watch.steps):
        raise InputError(
            f"no window of {watch.width:g} s could be used: "
            + (watch.steps[0].skipped if watch.steps else "the logs are shorter than one")
        )
    return replace(watch.result(), seconds=clock.perf_counter() - begin)
