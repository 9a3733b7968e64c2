"""The table of a campaign's runs: ``runs.parquet``, one row each."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.campaign.resolved import Resolved
from elevon.campaign.seal import packed

if TYPE_CHECKING:
    import pyarrow as pa

RUNS = "runs.parquet"


def runs_table(resolved: Resolved, outcome: Mapping[str, Sequence[object]]) -> pa.Table:
    """Return the table of the runs, one row each.

    Parameters
    ----------
    resolved : Resolved
        The plan.
    outcome : mapping
        ``status``, ``reason``, ``sim_s`` and ``steps`` of every run.
    """
    import pyarrow as pa

    index, count = resolved.index, len(resolved)
    units = index.unit if (index.unit >= 0).all() else index.draw
    ages = [] if np.isnan(index.age).all() else [("age", index.age, "1", "age of the unit, 0 to 1")]
    names = [v.name for v in resolved.variants]
    cases = np.array(names, dtype=object)[index.variant] if any(names) else None
    columns: list[tuple[str, Any, str, str]] = [
        ("run", np.arange(count, dtype=np.int64), "1", "number of the run"),
        ("unit", units, "1", "specimen: of the population, else one a draw"),
        *ages,
        *([] if cases is None else [("case", cases, "", "case of the plan")]),
        ("draw", index.draw, "1", "point of the design, or random draw"),
        ("block", index.block, "1", "block of the experiment"),
        ("replicate", index.replicate, "1", "replicate of the point"),
        ("seed", index.seed, "1", "seed of the random numbers"),
        ("split", index.split, "", "part of the data"),
        ("status", _texts(outcome["status"]), "", "planned, ok, tripped, diverged or refused"),
        ("reason", _texts(outcome["reason"]), "", "why the status is not ok"),
        ("sim_s", np.array(outcome["sim_s"], dtype=np.float64), "s", "simulated time"),
        ("steps", np.array(outcome["steps"], dtype=np.int64), "1", "solver steps"),
        *_faults(resolved),
        *((c.name, c.values, c.unit, c.kind) for c in resolved.columns if c.kind != "fault"),
    ]
    fields, arrays = [], []
    for name, values, unit, text in columns:
        written, kind = _arrow(values)
        about = {"unit": unit, "text": text, **({"form": "json"} if kind else {})}
        arrays.append(written)
        fields.append(pa.field(name, written.type, metadata=about))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def _texts(values: Sequence[object]) -> Any:
    return np.array(values, dtype=object)


def _arrow(values: Any) -> tuple[Any, bool]:
    """Return an Arrow array, and whether its values had to be written as JSON."""
    import pyarrow as pa

    if values.dtype != object:
        return pa.array(values), False
    if all(isinstance(value, str) for value in values):
        return pa.array(values.tolist(), pa.string()), False
    return pa.array([json.dumps(value) for value in values], pa.string()), True


def _faults(resolved: Resolved) -> list[tuple[str, Any, str, str]]:
    """Return the severity of each fault in each run (SI, 0 where absent)."""
    from elevon.units import parse_quantity

    rows = []
    drawn = {c.name: c.values for c in resolved.columns if c.kind == "fault"}
    for name, unit in resolved.fault_names().items():
        values = np.zeros(len(resolved))
        for number, variant in enumerate(resolved.variants):
            base = {**resolved.scenario, **variant.scenario}.get("fault", [])
            for fault in (*base, *variant.faults):
                if f"{fault['kind']}@{fault['place']}" == name:
                    severity = parse_quantity(fault["severity"], unit)
                    values[resolved.index.variant == number] = severity
        rows.append((name, drawn.get(name, values), unit, "severity of the fault; 0: absent"))
    return rows


def with_copy(table: pa.Table, plan: str, resolved: str, mark: str) -> pa.Table:
    """Return the table with a copy of the plan and of the resolved plan, for repairs."""
    about = packed({"plan_hash": mark, "plan": plan, "resolved": resolved})
    return table.replace_schema_metadata({"elevon": about})


def planned(count: int) -> dict[str, list[object]]:
    """Return the outcome of runs that are not done."""
    return {
        "status": ["planned"] * count,
        "reason": [""] * count,
        "sim_s": [0.0] * count,
        "steps": [0] * count,
    }


def read_outcome(path: Path) -> dict[str, list[object]]:
    """Return how every run of a finished campaign ended, from its table."""
    table = read_table(path)
    return {key: table[key].to_pylist() for key in planned(0)}


def read_table(path: Path) -> pa.Table:
    """Read a Parquet file whose pages are compared with their checksums."""
    import pyarrow.parquet as pq

    return pq.read_table(path, page_checksum_verification=True)
