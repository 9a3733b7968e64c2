"""The Cranfield linear-actuator data: a ball-screw actuator with seeded faults.

Ruiz-Carcel and Starr, "Data-Based Detection and Diagnosis of Faults in Linear Actuators", IEEE
Transactions on Instrumentation and Measurement 67(9), 2018, doi 10.1109/TIM.2018.2814067. The data
are not part of this package: doi 10.17862/cranfield.rd.5097649.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from elevon.arrays import Floats
from elevon.errors import FormatError, did_you_mean
from elevon.logs.formats.table import DEFAULT_LIMITS, Limits, RawTable
from elevon.logs.formats.text import read_text_table
from elevon.logs.maps.column_map import shipped_map
from elevon.recording import Recording

DATA_DOI = "10.17862/cranfield.rd.5097649"
PAPER_DOI = "10.1109/TIM.2018.2814067"

_COLUMNS = ("set_point", "position_error", "current", "profile", "load", "run", "fault_type",
            "group", "time")  # fmt: skip
_GRAVITY = 9.80665
_RATE = 25.0
_FAULTS = ("normal", "backlash", "lackLubrication", "spalling")


def read_cranfield(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> list[Recording]:
    """Read one condition: a CSV file, plain or gzip, with the columns of the published tables.

    Parameters
    ----------
    path : path
        Such as ``backlash1.csv.gz``; the name tells the condition.
    limits : Limits
        Bounds on size.

    Returns
    -------
    list of Recording
        One for each (profile, load, run): ``position_ref``, ``position`` [m], ``current`` [A],
        ``load_force`` [N], ``cycle``; the condition and its stage are its label. The dwell between
        cycles is trimmed in the data: each join is a gap of the clock.

    Raises
    ------
    FormatError
        A column is missing, or a cycle whose time does not run forwards.
    """
    table = read_text_table(path, limits=limits, text_columns=("profile",))
    missing = [name for name in _COLUMNS if name not in table.columns]
    if missing:
        raise FormatError(
            f"{path}: not the Cranfield layout: no column {missing[0]!r}"
            f"{did_you_mean(missing[0], table.columns)}"
        )
    for name in _COLUMNS:
        if np.isnan(table.columns[name]).any():
            raise FormatError(f"{path}: a cell of column {name!r} is missing")
    keys = np.column_stack([table.columns[name] for name in ("profile", "load", "run")])
    starts = np.concatenate(([0], np.flatnonzero(np.any(np.diff(keys, axis=0) != 0, axis=1)) + 1))
    ends = np.concatenate((starts[1:], [len(keys)]))
    words = table.attributes.get("profile", "").split("\n")
    return [
        _recording(table, slice(int(a), int(b)), words, Path(path))
        for a, b in zip(starts, ends, strict=True)
    ]


def _recording(table: RawTable, rows: slice, words: list[str], path: Path) -> Recording:
    part = {name: values[rows] for name, values in table.columns.items()}
    time, gaps = _joined_time(part["group"], part["time"], str(path))
    reference = part["set_point"]
    condition = path.name.split(".")[0]
    fault = next((name for name in _FAULTS if condition.startswith(name)), condition)
    stage = int(part["fault_type"][0])
    return Recording.build(
        time,
        {
            "position_ref": reference,
            "position": reference - part["position_error"],
            "current": part["current"],
            "load_force": part["load"] * _GRAVITY,
            "cycle": part["group"],
        },
        {"position_ref": "mm", "position": "mm", "current": "A", "load_force": "N", "cycle": "1"},
        clock="drive",
        rate=_RATE,
        gaps=gaps,
        meta={
            "status": "measured",
            "log": path.name,
            "roles": {
                e.role_name: e.channel
                for e in shipped_map("cranfield").column
                if e.role_name != "time"
            },
            "source": f"doi {DATA_DOI}; {PAPER_DOI}",
            "condition": condition,
            "profile": words[int(part["profile"][0])],
            "load_kgf": float(part["load"][0]),
            "run": int(part["run"][0]),
        },
        labels=[] if fault == "normal" else [{"kind": fault, "stage": stage}],
    )


def _joined_time(group: Floats, time: Floats, source: str) -> tuple[Floats, list[int]]:
    """Put the cycles one after the other; each is timed from its own zero in the file."""
    joins = np.flatnonzero(np.diff(group) != 0)
    total = np.array(time, dtype=np.float64)
    for join in joins.tolist():
        # Two periods: how long the trimmed dwell lasted is not in the data, only that it was.
        total[join + 1 :] += total[join] - total[join + 1] + 2.0 / _RATE
    if np.any(np.diff(total) <= 0.0):
        raise FormatError(f"{source}: time does not run forwards within a cycle")
    return total, [int(join) for join in joins]
