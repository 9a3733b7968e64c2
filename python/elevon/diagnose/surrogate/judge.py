"""What a surrogate is worth on units that it never saw."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from elevon.diagnose.surrogate.boosted import Opinion, honest
from elevon.diagnose.surrogate.fit import FALSE_ALARM, scores
from elevon.diagnose.surrogate.model import Head, Surrogate
from elevon.diagnose.surrogate.population import FAULTS
from elevon.diagnose.surrogate.sampling import Rows, severities
from elevon.diagnose.surrogate.table import SINGLE_FAULTS, TrainingTable

Index = npt.NDArray[np.int64]


def judged(surrogate: Surrogate, tables: Mapping[str, TrainingTable]) -> dict[str, object]:
    """Return the scores of a surrogate on drawn units: as trained, and with one baseline each.

    Parameters
    ----------
    surrogate : Surrogate
        It.
    tables : mapping of str to TrainingTable
        Test to runs.
    """
    out: dict[str, object] = {}
    for name, table in tables.items():
        rows_of = Rows.of(table)
        rows = rows_of.usable()
        for view, head in surrogate.tests[name].heads.items():
            for text, most in ((view, None), ("one baseline", 1)):
                if most is None or head.view.relative:
                    opinion = _opinion(head, rows_of, rows, most)
                    chance = head.chances(opinion)
                    said_of = scores(head, opinion, table.severity[rows], chance)
                    out[f"{name}.{text}"] = {**said_of, "outside": _outside(head, rows_of, rows)}
    return out


def judged_at(
    surrogate: Surrogate, tables: Mapping[str, TrainingTable], singles: Mapping[str, TrainingTable]
) -> dict[str, object]:
    """Return how often each fault of `ASKED` is called and named, alone, with one baseline.

    Parameters
    ----------
    surrogate : Surrogate
        It.
    tables, singles : mapping of str to TrainingTable
        Test to runs of drawn units, and to runs of the same units with those faults.
    """
    out: dict[str, object] = {}
    for name, table in singles.items():
        rows_of = Rows.of(TrainingTable.joined([tables[name], table]))
        rows = len(tables[name].unit) + np.arange(len(table.unit))
        rows = rows[rows_of.others[rows, 0] >= 0]
        head = surrogate.tests[name].heads["relative"]
        opinion = _opinion(head, rows_of, rows, 1)
        for key, severity in SINGLE_FAULTS[name].items():
            at = FAULTS.index(key)
            at_severity = np.flatnonzero(rows_of.table.severity[rows, at] != 0.0)
            out[f"{name}.{key}"] = _of_fault(head, _only(opinion, at_severity), at, severity)
    return out


def _opinion(head: Head, rows_of: Rows, rows: Index, most: int | None) -> Opinion:
    inputs = rows_of.inputs(head.view, rows, np.random.default_rng(0), most=most)
    return head.ensemble.says(inputs)


def _outside(head: Head, rows_of: Rows, rows: Index) -> int:
    """How many runs are reported outside the training set."""
    rng = np.random.default_rng(0)
    healthy = rows_of.references(rows, rng)[0] if head.view.relative else None
    change = head.view.change(rows_of.values(rows, rng), healthy)
    if healthy is None:
        return sum(bool(head.outside(row, None)) for row in change)
    context = head.view.context(healthy)
    return sum(bool(head.outside(*both)) for both in zip(change, context, strict=True))


def _only(opinion: Opinion, rows: Index) -> Opinion:
    return Opinion(opinion.presence[rows], opinion.size[rows], opinion.each[:, rows])


def _of_fault(head: Head, opinion: Opinion, at: int, severity: float) -> dict[str, object]:
    """Scores of runs with one fault of one severity, given as at the upper end of its range."""
    logit = honest(head.scaling[:-1], opinion.presence)
    alarm = head.chances(opinion) <= FALSE_ALARM
    first = logit.argmax(axis=1) == at
    alone = (logit > 0.0).sum(axis=1) == (logit[:, at] > 0.0)
    middle, low, high = (
        severities(opinion.size + k * head.conformal)[:, at] for k in (0.0, -1.0, 1.0)
    )
    return {
        "severity": severity,
        "runs": len(logit),
        "alarms": int(alarm.sum()),
        "first": int(first.sum()),
        "isolated": int((alarm & first & alone).sum()),
        "median_error": float(np.median(np.abs(middle - severity) / abs(severity))),
        "covered": int(((low <= severity) & (severity <= high)).sum()),
    }
