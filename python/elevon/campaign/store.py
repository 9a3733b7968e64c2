"""What a campaign's folder says of itself: manifest, resolved plan, table of the runs."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.actuator import Actuator
from elevon.campaign.block import write_table
from elevon.campaign.draw import Column
from elevon.campaign.resolved import CaseChanges, Index, Resolved
from elevon.errors import FormatError, InputError
from elevon.files import write_text
from elevon.parameters import ParameterSet
from elevon.parameters.parameter import Parameter
from elevon.worklog import WorkLog

if TYPE_CHECKING:
    import pyarrow as pa

__all__ = ["SCHEMA", "Manifest", "plan_hash", "read_manifest", "read_resolved", "write_runs"]

SCHEMA = 2
"""Version of the folder's form, apart from the package's."""
MANIFEST, RESOLVED, RUNS, PLAN = "manifest.json", "resolved.json", "runs.parquet", "plan.toml"
LOG = "progress.log"
"""The log of finished blocks, while the campaign runs."""


@dataclass
class Manifest:
    """What a campaign folder holds.

    Attributes
    ----------
    plan_hash : str
        Of everything that decides the results; a folder takes no other plan.
    edges : list of int
        Where the blocks begin, and the end; fixed when the campaign begins.
    status : str
        ``running``, ``ok`` or ``failed`` (some run diverged or was refused).
    version, core : str
        The program, and the SHA-256 of its compiled core.
    clocks : list of dict
        Name, rate, folder, and the columns (name, unit, text) of each clock's files.
    faults, columns : list of dict
        Label columns; varied quantities with kind, unit and role.
    not_acting : list of str
        What is set where it cannot act, allowed by the plan.
    sources : dict
        Files that the plan named, with the SHA-256 of their content.
    files : dict
        Size and SHA-256 of the tables beside the blocks.
    blocks : list of dict
        Name, first and last run, files with size and SHA-256, and how the runs ended.
    """

    name: str
    plan_hash: str
    total: int
    edges: list[int]
    version: str
    core: str
    status: str = "running"
    text: str = ""
    actuator: str = ""
    wiring: str = ""
    fidelity: str = ""
    clocks: list[dict[str, Any]] = field(default_factory=list)
    faults: list[dict[str, Any]] = field(default_factory=list)
    columns: list[dict[str, Any]] = field(default_factory=list)
    responses: list[str] = field(default_factory=list)
    not_acting: list[str] = field(default_factory=list)
    estimate: dict[str, float] = field(default_factory=dict)
    design: dict[str, Any] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)
    files: dict[str, dict[str, Any]] = field(default_factory=dict)
    blocks: list[dict[str, Any]] = field(default_factory=list)
    schema: int = SCHEMA

    def write(self, folder: Path) -> None:
        """Write the manifest, whole or not at all, with a checksum of its own."""
        content = asdict(self)
        content["check"] = _seal(content)
        write_text(folder / MANIFEST, json.dumps(content, indent=1) + "\n", force=True)


def read_manifest(folder: str | os.PathLike[str]) -> Manifest:
    """Read a campaign folder's manifest.

    Raises
    ------
    InputError
        No campaign folder.
    FormatError
        Damaged, or of a form this version does not know.
    """
    path = Path(folder) / MANIFEST
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{folder}: is not a campaign folder (no {MANIFEST})") from error
    except ValueError as error:
        raise FormatError(f"{path}: damaged: {error}") from error
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise FormatError(f"{path}: its form is not number {SCHEMA}, the one this version reads")
    seal = data.pop("check", None)
    if seal != _seal(data):
        raise FormatError(f"{path}: damaged: its content does not match its checksum")
    try:
        return Manifest(**data)
    except TypeError as error:
        raise FormatError(f"{path}: damaged: {error}") from error


def work_log(folder: Path, manifest: Manifest) -> WorkLog | None:
    """Return the log of a campaign that runs or was interrupted; None where it is finished."""
    log = WorkLog.read(folder / LOG)
    return log if log is not None and log.key == manifest.plan_hash else None


def _seal(content: Mapping[str, Any]) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def resolved_text(resolved: Resolved) -> str:
    """Return the resolved plan as JSON: everything but the table of the runs."""
    actuator = resolved.actuator
    content = {
        "schema": SCHEMA,
        "name": resolved.name,
        "text": resolved.text,
        "fidelity": resolved.fidelity,
        "record": resolved.record,
        "features": resolved.features,
        "actuator": {
            "name": actuator.name,
            "title": actuator.title,
            "wiring": actuator.wiring,
            "references": dict(actuator.references),
            "parameters": [asdict(item) for item in actuator.parameters.values()],
        },
        "scenario": resolved.scenario,
        "variants": [asdict(variant) for variant in resolved.variants],
        "columns": [_about(column) for column in resolved.columns],
        "responses": resolved.responses,
        "allow_not_acting": resolved.allow_not_acting,
        "runs_per_file": resolved.runs_per_file,
        "files": resolved.files,
        "sources": resolved.sources,
        "design": resolved.design,
    }
    return json.dumps(content, indent=1) + "\n"


def plan_hash(resolved: Resolved) -> str:
    """Return the SHA-256 of everything that decides a campaign's results."""
    content = json.loads(resolved_text(resolved))
    # Where a file stood, and what only readers read, decides nothing: its points do.
    for key in ("sources", "text", "responses", "runs_per_file"):
        del content[key]
    mark = hashlib.sha256(json.dumps(content, sort_keys=True).encode())
    for values in (*(c.values for c in resolved.columns), *vars(resolved.index).values()):
        mark.update(_bytes(values))
    return mark.hexdigest()


def _bytes(values: Any) -> bytes:
    if values.dtype == object:
        return json.dumps(values.tolist()).encode()
    raw: bytes = np.ascontiguousarray(values).tobytes()
    return raw


def _about(column: Column) -> dict[str, Any]:
    return {
        "name": column.name,
        "kind": column.kind,
        "unit": column.unit,
        "role": column.role,
        "attributes": column.attributes,
        "profile": column.profile,
    }


def runs_table(resolved: Resolved, outcome: Mapping[str, Sequence[Any]]) -> pa.Table:
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


def _texts(values: Sequence[str]) -> Any:
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


def write_runs(folder: Path, resolved: Resolved, outcome: Mapping[str, Sequence[Any]]) -> Path:
    """Write ``runs.parquet``."""
    path = folder / RUNS
    write_table(runs_table(resolved, outcome), path)
    return path


def planned(count: int) -> dict[str, list[Any]]:
    """Return the outcome of runs that are not done."""
    return {
        "status": ["planned"] * count,
        "reason": [""] * count,
        "sim_s": [0.0] * count,
        "steps": [0] * count,
    }


def read_outcome(folder: Path) -> dict[str, list[Any]]:
    """Return how every run of a finished campaign ended, from ``runs.parquet``."""
    table = _table(folder / RUNS)
    return {key: table[key].to_pylist() for key in planned(0)}


_MEND = "elevon campaign run PLAN --out {} makes both again, and simulates nothing that is whole"


def read_resolved(folder: Path) -> Resolved:
    """Read the resolved plan of a campaign's folder.

    Raises
    ------
    FormatError
        It is damaged: its content is not the one that the manifest's hash stands for.
    """
    import pyarrow as pa

    manifest = read_manifest(folder)
    try:
        content = json.loads((folder / RESOLVED).read_text("utf-8"))
        resolved = _resolved(content, _table(folder / RUNS))
        whole = plan_hash(resolved) == manifest.plan_hash
    except (OSError, ValueError, KeyError, TypeError, pa.ArrowException) as error:
        raise FormatError(
            f"{folder}: {RESOLVED} or {RUNS} is damaged ({error!r}); {_MEND.format(folder)}"
        ) from error
    if not whole:
        raise FormatError(
            f"{folder}: {RESOLVED} or {RUNS} is not as it was written; {_MEND.format(folder)}"
        )
    return resolved


def _table(path: Path) -> Any:
    import pyarrow.parquet as pq

    return pq.read_table(path, page_checksum_verification=True)


_COPIED = ("name", "text", "fidelity", "record", "features", "scenario", "responses")


def _resolved(content: Mapping[str, Any], table: Any) -> Resolved:
    data = content["actuator"]
    entries = {item["path"]: _parameter(item) for item in data["parameters"]}
    actuator = Actuator(
        data["name"],
        data["wiring"],
        ParameterSet(data["wiring"], entries),
        title=data["title"],
        references=data["references"],
    )
    copied = {c: content[c] for c in _COPIED}
    keys = ("allow_not_acting", "runs_per_file", "files", "sources", "design")
    variants = [CaseChanges(**item) for item in content["variants"]]
    return Resolved(
        **copied,
        **{key: content[key] for key in keys},
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


@lru_cache(maxsize=1)
def core_hash() -> str:
    """Return the SHA-256 of the compiled core: with the plan it decides every bit."""
    from elevon import _core

    return hashlib.sha256(Path(str(_core.__file__)).read_bytes()).hexdigest()
