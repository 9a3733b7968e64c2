"""The doors `elevon.learn_spread` and `elevon.learn`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from elevon.diagnose.engine.spread import LearnedSpread
from elevon.diagnose.learning.classes import LearnedClasses
from elevon.diagnose.learning.classify import LabelledLog, learned_classes
from elevon.diagnose.learning.log_table import log_table, looked_up
from elevon.diagnose.learning.spread import learned_spread
from elevon.logs.log import Log
from elevon.logs.read import read_logs
from elevon.simulate.prepare import as_actuator

if TYPE_CHECKING:
    from elevon.logs.read import LogsLike
    from elevon.progress import Progress
    from elevon.simulate.prepare import ActuatorLike


def learn_spread(
    logs: LogsLike,
    actuator: ActuatorLike,
    units: Sequence[tuple[str, str]] | str | os.PathLike[str] | None = None,
    *,
    progress: Progress | None = None,
) -> LearnedSpread:
    """Learn from healthy logs how a unit differs from day to day, and from the model.

    Parameters
    ----------
    logs : Log, path, or sequence of them
        Of healthy units.
    actuator : Actuator, str or path
        As `elevon.diagnose` will be given it.
    units : sequence of (str, str), or path, optional
        Unit and day of each log, or a table (CSV) with columns ``log``, ``unit``, ``day``; default:
        one unit, each log a day of its own.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Returns
    -------
    LearnedSpread
        Its ``save`` writes what ``diagnose(..., spread=)`` takes.

    Raises
    ------
    InputError, FormatError
        A log that cannot be diagnosed; a table that does not name each log once.
    Interrupted
        `progress` returned False.
    """
    items = listed(logs)
    data = read(items)
    if units is None or not isinstance(units, (str, os.PathLike)):
        return learned_spread(data, as_actuator(actuator), units, progress)
    rows = looked_up(log_table(units, ("unit", "day")), names_of(items), units)
    days = [(row["unit"], row["day"]) for row in rows]
    return learned_spread(data, as_actuator(actuator), days, progress)


def learn(
    logs: LogsLike,
    labels: Sequence[LabelledLog] | str | os.PathLike[str],
    *,
    pole_pairs: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> LearnedClasses:
    """Learn classes from labelled logs of one motion.

    Parameters
    ----------
    logs : Log, path, or sequence of them
        Of one motion that repeats.
    labels : sequence of LabelledLog, or path
        What is known of each, or a table (CSV) with columns ``log``, ``label``, and ``unit``,
        ``condition`` where known. A label is ``healthy``, ``KIND@PLACE`` or a word.
    pole_pairs : float, optional
        Of the motor, for what turns with the electrical angle.
    seed : int
        Of boosting.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Returns
    -------
    LearnedClasses
        Its ``save`` writes what ``diagnose(..., method="learned", model=)`` takes.

    Raises
    ------
    InputError, FormatError
        Logs of several motions, too few of a class, none that is healthy; a table that does not
        name each log once.
    Interrupted
        `progress` returned False.
    """
    items = listed(logs)
    known = labelled(labels, names_of(items)) if isinstance(labels, (str, os.PathLike)) else labels
    return learned_classes(read(items), known, pole_pairs=pole_pairs, seed=seed, progress=progress)


def labelled(table: str | os.PathLike[str], logs: Sequence[str | Path]) -> list[LabelledLog]:
    """Return what a table says of logs; errors as `looked_up`."""
    rows = looked_up(log_table(table, ("label",), ("unit", "condition")), logs, table)
    return [LabelledLog(r["label"], r.get("unit", ""), r.get("condition", "")) for r in rows]


def listed(logs: LogsLike) -> list[Log | str | os.PathLike[str]]:
    """Return logs one by one."""
    return [logs] if isinstance(logs, (Log, str, os.PathLike)) else list(logs)


def read(items: Sequence[Log | str | os.PathLike[str]]) -> list[Log]:
    """Return logs, read where they are files; days may bear one name, and have other rates."""
    paths = [Path(item) for item in items if not isinstance(item, Log)]
    imported = iter(read_logs(paths, one_rate=False) if paths else ())
    return [item if isinstance(item, Log) else next(imported) for item in items]


def names_of(items: Sequence[Log | str | os.PathLike[str]]) -> list[str | Path]:
    """Return logs as a table names them: by file, of one that was read by its name."""
    return [item.name if isinstance(item, Log) else Path(item) for item in items]
