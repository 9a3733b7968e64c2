"""The doors `elevon.diagnose` and `elevon.monitor`."""

from __future__ import annotations

import os
import time as clock
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated

from elevon.diagnose.by_model import DiagnosisRequest
from elevon.diagnose.by_model import diagnose as diagnose_by_model
from elevon.diagnose.engine.answer import Diagnosis
from elevon.diagnose.learning.answer import diagnose_by_classes, diagnose_by_spread_and_classes
from elevon.diagnose.learning.model import LearnedModel
from elevon.diagnose.monitor.answer import Monitoring
from elevon.diagnose.monitor.monitor import FALSE_ALARM_TIME, Monitor
from elevon.errors import InputError
from elevon.logs.read import LogsLike, as_logs
from elevon.option import Option
from elevon.simulate.prepare import ActuatorLike, as_actuator

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log


def diagnose(
    logs: LogsLike,
    actuator: ActuatorLike,
    baselines: Annotated[LogsLike, Option("--baseline", "LOG")] = (),
    *,
    model: LearnedModel | str | os.PathLike[str] | None = None,
    faults: Annotated[Sequence[str] | None, Option("--fault", "KIND@PLACE")] = None,
    false_alarm: float = 0.05,
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
    model : LearnedModel or path, optional
        Learnt by `elevon.learn`: spread, classes or both. Its spread takes the place of the
        stated one; its classes answer in place of the actuator's model, or, where it holds both,
        what that model cannot name.
    faults : sequence of str, optional
        ``KIND@PLACE`` of the candidates; default: all.
    false_alarm : float
        Rate at which a healthy unit may be called faulty.

    Raises
    ------
    InputError
        A log that cannot be diagnosed, no candidate, a rate outside 0 to 1.
    FormatError
        A file that is no model.
    """
    unit = as_actuator(actuator)
    learned = _model(model)
    if not 0.0 < false_alarm < 1.0:
        raise InputError(f"false-alarm rate {false_alarm:g} must be between 0 and 1")
    data, healthy = as_logs(logs), _healthy(baselines)
    if learned.classes is None:
        result = diagnose_by_model(
            data, unit, baselines=healthy, faults=faults, false_alarm=false_alarm,
            spread=learned.spread,
        )  # fmt: skip
    elif learned.spread is None:
        if faults:
            raise InputError("--fault: the classes are those of --model, which holds no spread")
        result = diagnose_by_classes(
            data, learned.classes, baselines=healthy, false_alarm=false_alarm
        )
    else:
        result = diagnose_by_spread_and_classes(
            data, unit, learned.spread, learned.classes, baselines=healthy, faults=faults,
            false_alarm=false_alarm,
        )  # fmt: skip
    return _signed(result, data, unit, healthy)


def _signed(
    result: Diagnosis, logs: Sequence[Log], unit: Actuator, baselines: Sequence[Log]
) -> Diagnosis:
    """Return an answer with what it stands on; one of the model can draw the logs beside it."""
    from elevon import __version__

    return replace(
        result, actuator=unit.name, parameter_hash=unit.hash, made_by=__version__,
        baselines=tuple(log.name for log in baselines),
        request=DiagnosisRequest(logs, baselines, unit) if result.method == "model" else None,
    )  # fmt: skip


def _model(given: LearnedModel | str | os.PathLike[str] | None) -> LearnedModel:
    """Return what was learnt, read where it is a file; without a model nothing."""
    if isinstance(given, LearnedModel):
        return given
    return LearnedModel() if given is None else LearnedModel.load(given)


def _healthy(baselines: LogsLike) -> list[Log]:
    none = not isinstance(baselines, (str, os.PathLike)) and isinstance(baselines, Sequence)
    return [] if none and not len(baselines) else as_logs(baselines)  # type: ignore[arg-type]


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
