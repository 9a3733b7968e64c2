"""The door `elevon.doctor`."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal, TypedDict, TypeVar

from elevon.calibrate.door import validate
from elevon.calibrate.validation import TRANSIENT, Validation
from elevon.diagnose.door import diagnose
from elevon.doctor.answer import Examination, checks_of, columns_of
from elevon.errors import InputError
from elevon.logs.log import Log
from elevon.logs.maps.column_map import ColumnMap, find_map
from elevon.logs.maps.guess import guess_text
from elevon.logs.read import NO_ANSWERS, Answers, ForeignLog, import_foreign, named_apart, settled
from elevon.option import Option
from elevon.progress import Progress, part
from elevon.simulate.prepare import ActuatorLike, as_actuator

if TYPE_CHECKING:
    from elevon.actuator import Actuator

T = TypeVar("T")
PathLike = str | os.PathLike[str]
_SETTLES = 0.25  # share of a log that is left out where no actuator file states a transient


def doctor(
    logs: PathLike | Sequence[PathLike],
    actuator: ActuatorLike,
    baselines: Annotated[PathLike | Sequence[PathLike], Option("--baseline", metavar="LOG")] = (),
    *,
    map: Annotated[ColumnMap | str | Path | None, Option("--map")] = None,  # noqa: A002 - the option's name
    loadcells: Sequence[PathLike | None] = (),
    notes: Sequence[PathLike | None] = (),
    answers: Answers = NO_ANSWERS,
    false_alarm: float = 0.05,
    progress: Progress | None = None,
) -> Examination:
    """Look at logs for the first time: columns, data, the model's fit, the verdict.

    Parameters
    ----------
    logs : path, or sequence of paths
        Of one unit in one condition.
    actuator : Actuator, str or path
        The healthy unit, best calibrated.
    baselines : path, or sequence of paths
        Of the healthy unit in the same test.
    map : ColumnMap or path, optional
        What the columns are, in all logs; else their headers say it, or a guess.
    loadcells, notes : sequence of path or None
        One for each log; by default those that stand beside it.
    answers : Answers
        To what the guess of their columns asks: which drive, which column has a role.
    false_alarm : float
        Rate at which a healthy unit may be called faulty.
    progress : callable, optional
        Called with the done fraction; returns False to stop.

    Returns
    -------
    Examination
        What cannot be answered has its reason in `Examination.reasons`.

    Raises
    ------
    InputError
        No log, or one that cannot be read.
    """
    model = as_actuator(actuator)
    given, healthy = _paths(logs), _paths(baselines)
    if not given:
        raise InputError("doctor: needs at least one log")
    column_map = find_map(map) if isinstance(map, (str, Path)) else map
    read = _read([*given, *healthy], column_map, loadcells, notes, answers)
    named = named_apart([item.imported for item in read])
    unit, reference = named[: len(given)], named[len(given) :]
    fit, no_fit = _tried(lambda: _fit([*unit, *reference], model, part(progress, 0.0, 0.4)))
    verdict, no_verdict = _tried(lambda: diagnose(unit, model, reference, false_alarm=false_alarm))
    if progress is not None:
        progress(1.0)
    guessed = next((item.guess for item in read if item.guess is not None), None)
    names = [log.name for log in named]
    return Examination(
        model.name,
        tuple(log.name for log in unit),
        tuple(log.name for log in reference),
        _by(map, guessed is not None),
        tuple(c for name, item in zip(names, read, strict=True) for c in columns_of(name, item)),
        tuple(
            check for name, item in zip(names, read, strict=True) for check in checks_of(name, item)
        ),
        fit,
        verdict,
        {name: why for name, why in (("fit", no_fit), ("verdict", no_verdict)) if why},
        "" if guessed is None else guess_text(guessed),
        {log.name: log.recording for log in named if log.recording is not None},
    )


def _by(column_map: object, guessed: bool) -> Literal["map", "guess", "headers"]:
    return "map" if column_map is not None else "guess" if guessed else "headers"


def _paths(given: PathLike | Sequence[PathLike]) -> list[Path]:
    return [Path(p) for p in ([given] if isinstance(given, (str, os.PathLike)) else given)]


class Companions(TypedDict):
    """Files that stand beside a log."""

    loadcell: Path | None
    command: Path | None


def _read(
    paths: Sequence[Path],
    column_map: ColumnMap | None,
    loadcells: Sequence[PathLike | None],
    notes: Sequence[PathLike | None],
    answers: Answers,
) -> list[ForeignLog]:
    """Read the logs; the map guessed of one serves those after it that it does not contradict."""
    cells, texts = [*loadcells, *[None] * len(paths)], [*notes, *[None] * len(paths)]
    read: list[ForeignLog] = []
    for path, cell, note in zip(paths, cells, texts, strict=False):
        guessed = next((log.column_map for log in read if log.guess is not None), None)
        companions = Companions(loadcell=_path(cell), command=_path(note))
        try:
            read.append(import_foreign(path, column_map or guessed, **companions, answers=answers))
            settled(read[-1])
        except InputError as error:
            if column_map is None and guessed is not None:
                read.append(import_foreign(path, **companions, answers=answers))
                settled(read[-1])
            elif str(path) in str(error):
                raise
            else:
                raise InputError(f"{path}: {error}") from error
    return read


def _path(given: PathLike | None) -> Path | None:
    return None if given is None else Path(given)


def _tried(work: Callable[[], T]) -> tuple[T | None, str]:
    """Return an answer, or None and why there is none."""
    try:
        return work(), ""
    except InputError as error:
        return None, str(error)


def _fit(logs: Sequence[Log], actuator: Actuator, progress: Progress | None) -> Validation:
    """Hold the model against logs, with less left out of short ones where the file is silent."""
    stated = "transient" in (actuator.validation or {})
    shortest = min(log.duration for log in logs)
    transient = None if stated else min(TRANSIENT, _SETTLES * shortest)
    return validate(logs, actuator, transient=transient, progress=progress)
