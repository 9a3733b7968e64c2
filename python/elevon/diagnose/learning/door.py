"""The door `elevon.learn`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.campaign import Dataset, load_campaign
from elevon.campaign.store import MANIFEST
from elevon.diagnose.learning.examples import (
    examples_of_dataset,
    examples_of_logs,
    pole_pairs_of,
    run_logs,
)
from elevon.diagnose.learning.fit import learned_classes
from elevon.diagnose.learning.labels import HEALTHY, LabelledLog, read_labels
from elevon.diagnose.learning.model import LearnedModel
from elevon.diagnose.learning.spread import learned_spread
from elevon.errors import InputError
from elevon.logs.log import Log
from elevon.logs.read import read_logs
from elevon.progress import part
from elevon.simulate.prepare import as_actuator

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.spread import LearnedSpread
    from elevon.logs.read import LogsLike
    from elevon.progress import Progress
    from elevon.simulate.prepare import ActuatorLike

_SPREAD = 0.5  # share of the work, where classes are learnt as well. ASSUMED
#: Of a data set: healthy runs of a unit, and units, that the spread is learnt from at most; each
#: run is replayed by the model, so all of them would take hours. ASSUMED.
_DAYS, _UNITS = 4, 30


def learn(
    logs: LogsLike | Dataset,
    labels: Sequence[LabelledLog] | str | os.PathLike[str] | None = None,
    *,
    actuator: ActuatorLike | None = None,
    pole_pairs: float | None = None,
    seed: int = 0,
    progress: Progress | None = None,
) -> LearnedModel:
    """Learn classes, severities and how healthy days differ.

    Parameters
    ----------
    logs : Log, path, or sequence of them; or Dataset, or the path of its folder
        Labelled logs, or a campaign that recorded what a log has.
    labels : sequence of LabelledLog, or path, optional
        What is known of each log, or a table (CSV) with columns ``log``, ``label``, and ``unit``,
        ``condition``, ``severity``, ``healthy``, ``day`` where known. A label is ``healthy``,
        ``KIND@PLACE`` or a word. Without it all logs are healthy days of one unit. A data set has
        its own labels.
    actuator : Actuator, str or path, optional
        As `elevon.diagnose` will be given it: the spread of the healthy logs is learnt, too.
    pole_pairs : float, optional
        Of the motor, for what turns with the electrical angle; default: the actuator's.
    seed : int
        Of boosting, and of the baselines that logs are held against.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Returns
    -------
    LearnedModel
        Its ``save`` writes what ``diagnose(..., model=)`` takes.

    Raises
    ------
    InputError, FormatError
        Logs of several motions, too few of a class, none that is healthy, nothing to learn; a
        table that does not name each log once; a data set without a fault or without signals.
    Interrupted
        `progress` returned False.
    """
    unit = None if actuator is None else as_actuator(actuator)
    if unit is not None and pole_pairs is None and "motor.pole_pairs" in unit.parameters:
        pole_pairs = unit.parameters.value("motor.pole_pairs")
    if (data := as_dataset(logs)) is not None:
        if labels is not None:
            raise InputError("--labels: a data set has its own labels")
        return _learn_dataset(data, unit, pole_pairs, seed, progress)
    items = _one_by_one(logs)
    if labels is None or not isinstance(labels, (str, os.PathLike)):
        known = [LabelledLog()] * len(items) if labels is None else list(labels)
    else:
        known = read_labels(labels, [i.name if isinstance(i, Log) else Path(i) for i in items])
    return learn_logs(_read_files(items), known, unit, pole_pairs, seed=seed, progress=progress)


def learn_logs(
    logs: Sequence[Log],
    known: Sequence[LabelledLog],
    actuator: Actuator | None = None,
    pole_pairs: float | None = None,
    *,
    seed: int = 0,
    progress: Progress | None = None,
) -> LearnedModel:
    """Learn from logs that are read already; as `learn`."""
    if len(logs) != len(known):
        raise InputError(f"{len(logs)} logs, but labels of {len(known)}")
    healthy = [k for k, item in enumerate(known) if item.label == HEALTHY]
    spread = classes = None
    report: dict[str, Any] = {"logs": len(logs)}
    several = len(healthy) < len(known)
    if actuator is None and not several:
        raise InputError(
            "all logs are healthy: give --labels for classes, or --actuator to learn how healthy "
            "days differ"
        )
    if actuator is not None and healthy:
        days = [(known[k].unit, known[k].day or str(k)) for k in healthy]
        stage = part(progress, 0.0, _SPREAD if several else 1.0)
        spread = learned_spread([logs[k] for k in healthy], actuator, days, stage)
        report["spread"] = spread_report(spread)
    if several:
        examples, motion = examples_of_logs(logs, known, pole_pairs)
        stage = part(progress, 0.0 if spread is None else _SPREAD, 1.0)
        classes, counted = learned_classes(
            examples, motion, pole_pairs=pole_pairs, seed=seed, progress=stage
        )
        report |= counted
    return LearnedModel(spread, classes, report)


def _learn_dataset(
    ds: Dataset,
    actuator: Actuator | None,
    pole_pairs: float | None,
    seed: int,
    progress: Progress | None,
) -> LearnedModel:
    pole_pairs = pole_pairs_of(ds) if pole_pairs is None else pole_pairs
    examples, motion, lost, _ = examples_of_dataset(ds, pole_pairs, part(progress, 0.0, 0.3))
    classes, report = learned_classes(
        examples, motion, pole_pairs=pole_pairs, seed=seed, progress=part(progress, 0.3, 0.7)
    )
    report["left_out_runs"] = lost
    spread = None
    if actuator is not None:
        logs, days = _healthy_runs(ds)
        spread = learned_spread(logs, actuator, days, part(progress, 0.7, 1.0))
        report["spread"] = spread_report(spread)
    return LearnedModel(spread, classes, report)


def _healthy_runs(ds: Dataset) -> tuple[list[Log], list[tuple[str, str]]]:
    """Return healthy runs of some units as logs, with their unit and day."""
    table = ds.runs.to_pandas().set_index("run")
    kinds = [item["name"] for item in ds.manifest.faults]
    healthy = table[(table[kinds] == 0.0).all(axis=1) & (table["status"] == "ok")]
    by = "unit" if table["unit"].nunique() > 1 else "draw"
    some = healthy[healthy[by].isin(healthy[by].unique()[:_UNITS])].groupby(by).head(_DAYS)
    wanted = set(some.index)
    runs = list(run_logs(ds, wanted=wanted.__contains__))
    return [log for _, log in runs], [(str(some.at[n, by]), str(n)) for n, _ in runs]


def spread_report(spread: LearnedSpread) -> dict[str, Any]:
    """Return what is said of a spread: counts, and deviations over the stated ones by feature."""
    names = ("days", "days_low", "days_high", "mismatch", "mismatch_low", "mismatch_high")
    return {
        "actuator": spread.actuator, "logs": spread.logs, "units": spread.units,
        "days": spread.days,
        "features": {
            feature: dict(zip(names, values.tolist(), strict=True))
            for feature, values in spread.deviations().items()
        },
    }  # fmt: skip


def as_dataset(given: LogsLike | Dataset) -> Dataset | None:
    """Return the data set that was given, itself or by its folder; None of logs."""
    if isinstance(given, Dataset):
        return given
    if isinstance(given, (list, tuple)) and len(given) == 1:
        given = given[0]
    if isinstance(given, (str, os.PathLike)) and (Path(given).expanduser() / MANIFEST).is_file():
        return load_campaign(given)
    return None


def _one_by_one(logs: LogsLike | Dataset) -> list[Log | str | os.PathLike[str]]:
    return [logs] if isinstance(logs, (Log, str, os.PathLike)) else list(logs)  # type: ignore[arg-type]


def _read_files(items: Sequence[Log | str | os.PathLike[str]]) -> list[Log]:
    """Return logs, read where they are files; days may bear one name, and have other rates."""
    paths = [Path(item) for item in items if not isinstance(item, Log)]
    imported = iter(read_logs(paths, one_rate=False) if paths else ())
    return [item if isinstance(item, Log) else next(imported) for item in items]
