"""The resolved plan in a campaign's folder: ``resolved.json``, with the table of the runs."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.actuator import Actuator
from elevon.campaign.draw import Column
from elevon.campaign.resolved import CaseChanges, Index, Resolved
from elevon.campaign.store import (
    READ,
    RESOLVED,
    SCHEMA,
    Manifest,
    packed,
    read_manifest,
    repair_hint,
)
from elevon.errors import FormatError, InputError
from elevon.files import read_regular
from elevon.parameters import ParameterSet
from elevon.parameters.set import Parameter
from elevon.plain import fields_of
from elevon.retired import current, mapped
from elevon.transaction import located
from elevon.worklog import Item

if TYPE_CHECKING:
    import pyarrow as pa


LONGEST = 2**30
"""Bytes of a resolved plan."""
_COPIED = (
    "name", "text", "fidelity", "record", "features", "scenario", "responses", "allow_not_acting",
    "runs_per_file", "files", "sources", "design",
)  # fmt: skip
_COLUMN = ("name", "kind", "unit", "role", "attributes", "profile")
SPLIT_IS_NO_PART = 3
"""First version whose hash leaves the split out: runs can be dealt anew."""


def resolved_text(resolved: Resolved) -> str:
    """Return the resolved plan as JSON: everything but the table of the runs."""
    actuator = resolved.actuator
    content = {
        "schema": SCHEMA,
        **fields_of(resolved, *_COPIED, "split"),
        "actuator": {
            **fields_of(actuator, "name", "title", "wiring", "references"),
            "parameters": [asdict(item) for item in actuator.parameters.values()],
        },
        "variants": [asdict(variant) for variant in resolved.variants],
        "columns": [fields_of(column, *_COLUMN) for column in resolved.columns],
    }
    return json.dumps(content, indent=1) + "\n"


def plan_hash(resolved: Resolved) -> str:
    """Return the SHA-256 of everything that decides a campaign's results."""
    return _hash_of(json.loads(resolved_text(resolved)), resolved)


def _hash_of(content: Mapping[str, Any], resolved: Resolved) -> str:
    # Where a file stood, and what only readers read, decides nothing: its points do.
    reading = {"sources", "text", "responses", "runs_per_file", "split"}
    deciding = {key: value for key, value in content.items() if key not in reading}
    mark = hashlib.sha256(json.dumps(deciding, sort_keys=True).encode())
    index = dict(vars(resolved.index))
    if content["schema"] >= SPLIT_IS_NO_PART:
        del index["split"]
    for values in (*(column.values for column in resolved.columns), *index.values()):
        mark.update(_compressed_bytes(values))
    return mark.hexdigest()


def _compressed_bytes(values: Any) -> bytes:
    if values.dtype == object:
        return json.dumps(values.tolist()).encode()
    raw: bytes = np.ascontiguousarray(values).tobytes()
    return raw


def read_resolved(folder: Path, manifest: Manifest | None = None) -> Resolved:
    """Read the resolved plan of a campaign's folder.

    Raises
    ------
    FormatError
        It is damaged: its content is not the one that the manifest's hash stands for.
    """
    import pyarrow as pa

    manifest = manifest or read_manifest(folder)
    try:
        path = located(folder, RESOLVED, manifest.files.get(RESOLVED))
        content = json.loads(read_regular(path, LONGEST))
        table = read_table(located(folder, RUNS, manifest.files.get(RUNS)))
        resolved, mark = _check_values(content, table)
    except (OSError, ValueError, KeyError, TypeError, RecursionError, pa.ArrowException) as error:
        raise FormatError(
            f"{folder}: {RESOLVED} or {RUNS} is damaged ({error!r}){repair_hint(folder)}"
        ) from error
    tables = {n: a for n, a in manifest.files.items() if n in {RESOLVED, RUNS}}
    waiting = {n for n, a in tables.items() if located(folder, n, a) != folder / n}
    damaged = set(Item("tables", tables, {}).damaged(folder)) - waiting
    if mark != manifest.plan_hash or damaged:
        raise FormatError(
            f"{folder}: {RESOLVED} or {RUNS} is not as it was written{repair_hint(folder)}"
        )
    resolved.mark = mark
    return resolved


def _check_values(content: Mapping[str, Any], table: Any) -> tuple[Resolved, str]:
    """Return the resolved plan and the hash of its content, of an old one before it is mapped."""
    if content["schema"] == SCHEMA:
        resolved = rebuilt(content, table)
        return resolved, plan_hash(resolved)
    if content["schema"] not in READ:
        raise InputError(f"its form is number {content['schema']!r}")
    present = table.rename_columns([current(name) for name in table.column_names])
    resolved = rebuilt(mapped(content), present)
    return resolved, _hash_of(content, resolved)  # the values are the same under either name


def rebuilt(content: Mapping[str, Any], table: Any) -> Resolved:
    """Return the resolved plan of its JSON content and of the table of the runs."""
    data = content["actuator"]
    entries = {item["path"]: _parameter(item) for item in data["parameters"]}
    actuator = Actuator(
        data["name"],
        data["wiring"],
        ParameterSet(data["wiring"], entries),
        title=data["title"],
        references=data["references"],
    )
    variants = [CaseChanges(**item) for item in content["variants"]]
    return Resolved(
        **{key: content[key] for key in _COPIED},
        split=content.get("split", {}),
        actuator=actuator,
        variants=variants,
        columns=[
            Column(**item, values=_values(table, item["name"])) for item in content["columns"]
        ],
        index=_index(table, variants),
    )


def _parameter(item: Mapping[str, Any]) -> Parameter:
    interval = item["interval"]
    return Parameter(**{**item, "interval": None if interval is None else tuple(interval)})


def _values(table: Any, name: str) -> Any:
    column = table[name]
    if (table.schema.field(name).metadata or {}).get(b"form") == b"json":
        read = np.empty(len(column), dtype=object)
        read[:] = [json.loads(text) for text in column.to_pylist()]
        return read
    return column.to_numpy()


def _index(table: Any, variants: Sequence[CaseChanges]) -> Index:
    names = {variant.name: number for number, variant in enumerate(variants)}
    count = table.num_rows
    population = "age" in table.column_names
    cases = table["case"].to_pylist() if "case" in table.column_names else [""] * count
    whole = ("draw", "block", "replicate", "seed")
    return Index(
        unit=table["unit"].to_numpy() if population else np.full(count, -1, dtype=np.int64),
        age=table["age"].to_numpy() if population else np.full(count, np.nan),
        variant=np.array([names[case] for case in cases], dtype=np.int64),
        split=np.array(table["split"].to_pylist(), dtype=object),
        **{name: table[name].to_numpy() for name in whole},
    )


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
