"""One block of runs: simulated together, its tables written whole, one file a clock."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.campaign.resolved import Resolved
from elevon.campaign.resolved_file import plan_hash
from elevon.campaign.store import ENDS, MANIFEST, SCHEMA, block_description, ends_table
from elevon.errors import InputError, OutputError
from elevon.features import feature_records
from elevon.files import atomic_path, check_owned
from elevon.record_plan import ClockPlan
from elevon.scenario.compile import signal_records
from elevon.seam import CoreResult, CoreRows
from elevon.simulate.batch import simulate_prepared
from elevon.simulate.prepare import Prepared
from elevon.worklog import Item, digest

if TYPE_CHECKING:
    import pyarrow as pa

    from elevon.campaign.resolved import Resolved


def feature_schema(resolved: Resolved, prepared: Prepared) -> pa.Schema:
    """Return the columns of the features' files, each with ``unit`` and ``text``."""
    import pyarrow as pa

    fields = [pa.field("run", pa.int64(), metadata={"unit": "1", "text": "number of the run"})]
    records, rates = feature_records(), {}
    for plan in prepared.features:
        for name, unit in zip(plan.names, plan.units, strict=True):
            about = {"unit": unit, "text": records[name].text}
            fields.append(pa.field(name, pa.float64(), metadata=about))
            rates[name] = plan.rate
    signals = {r: s for p in prepared.features for r, s in zip(p.roles, p.signals, strict=True)}
    head = {"schema": 2, "name": resolved.name, "rates": rates, "signals": signals}
    return pa.schema(fields, metadata={"elevon": json.dumps(head)})


def feature_table(
    resolved: Resolved,
    numbers: Sequence[int],
    prepared: Sequence[Prepared],
    results: Sequence[CoreResult],
) -> pa.Table:
    """Return a block's features; NaN where a run gives none, or was refused."""
    import pyarrow as pa

    schema = feature_schema(resolved, prepared[0])
    values = np.full((len(numbers), len(schema) - 1), np.nan)
    for row, (item, result) in enumerate(zip(prepared, results, strict=True)):
        if result["features"]:
            values[row] = np.concatenate([result["features"][p.name] for p in item.features])
    columns = [pa.array(np.asarray(numbers, dtype=np.int64))]
    columns += [pa.array(np.ascontiguousarray(column)) for column in values.T]
    return pa.Table.from_arrays(columns, schema=schema)


#: Rows of a row group: reading one run reads no more than some of these.
_GROUP = 32_768


def block_name(index: int) -> str:
    """Return the name of a block, that of its files."""
    return f"block_{index:05d}"


def run_block(
    resolved: Resolved,
    folder: Path,
    index: int,
    numbers: Sequence[int],
    *,
    threads: int | None = None,
    progress: Callable[[float], object] | None = None,
) -> Item:
    """Simulate a block and write its tables; what is returned goes into the work's log.

    Parameters
    ----------
    resolved : Resolved
        The plan.
    folder : path
        The campaign's.
    index : int
        The block's number.
    numbers : sequence of int
        Its runs.

    Raises
    ------
    Interrupted
        `progress` returned False.
    OutputError
        A file cannot be written.
    """
    prepared = [resolved.prepared(number) for number in numbers]
    results = simulate_block(resolved, prepared, threads, progress)
    return finish_block(resolved, folder, index, numbers, prepared=prepared, results=results)


def finish_block(
    resolved: Resolved,
    folder: Path,
    index: int,
    numbers: Sequence[int],
    *,
    prepared: Sequence[Prepared],
    results: Sequence[CoreResult],
) -> Item:
    """Write what a block's runs gave; arguments and errors as `run_block`."""
    tables = block_tables(resolved, numbers, prepared, results)
    mark = resolved.mark or plan_hash(resolved)
    return write_block(folder, index, numbers, tables, block_outcome(results), mark=mark)


def block_tables(
    resolved: Resolved,
    numbers: Sequence[int],
    prepared: Sequence[Prepared],
    results: Sequence[CoreResult],
) -> dict[str, pa.Table]:
    """Return a block's tables by folder: ``runs/CLOCK`` of each clock, ``features``, ``ends``."""
    clocks = {clock.name: clock for item in prepared for clock in item.plan}
    tables = {
        f"runs/{name}": _sample_table(resolved, clock, numbers, prepared, results)
        for name, clock in clocks.items()
    }
    if resolved.features:
        tables["features"] = feature_table(resolved, numbers, prepared, results)
    outcome = block_outcome(results)
    tables[ENDS] = ends_table(resolved, numbers, prepared, results, outcome)
    return tables


def block_outcome(results: Sequence[CoreResult]) -> dict[str, Sequence[object]]:
    """Return how each run of a block ended, in JSON's types."""
    return {
        "status": [str(result["status"]) for result in results],
        "reason": [str(result["message"]) for result in results],
        "sim_s": [float(result["time"]) for result in results],
        "steps": [int(result["steps"]) for result in results],
    }


def write_block(
    folder: Path,
    index: int,
    numbers: Sequence[int],
    tables: Mapping[str, pa.Table],
    outcome: Mapping[str, Sequence[object]],
    *,
    mark: str,
) -> Item:
    """Write a block's tables, each whole or not at all, and return its item for the log.

    The table of ends comes last; it carries the block's own description, with the plan's hash
    (`mark`).
    """
    check_there(folder)
    files: dict[str, dict[str, Any]] = {}
    span = (int(numbers[0]), int(numbers[-1]))
    for place in sorted(tables, key=lambda name: name == ENDS):
        table = tables[place]
        if place == ENDS:
            about = block_description(mark, block_name(index), span, files)
            table = table.replace_schema_metadata(about)
        path = folder / place / f"{block_name(index)}.parquet"
        check_owned(folder, path)
        write_table(table, path)
        files[path.relative_to(folder).as_posix()] = digest(path)
    return Item(block_name(index), files, {"first": span[0], "last": span[1], **outcome})


def check_there(folder: Path) -> None:
    """Raise `OutputError` when a campaign's folder has gone: writing would make half a new one."""
    if not (folder / MANIFEST).is_file():
        raise OutputError(
            f"{folder}: the folder has gone since the campaign began; nothing more is written"
        )


def write_table(table: pa.Table, path: Path) -> None:
    """Write a Parquet file, whole or not at all."""
    with atomic_path(path, force=True) as temporary:
        write_rows(table, temporary)


def write_rows(table: pa.Table, path: Path) -> None:
    """Write a Parquet file to a temporary path; its pages carry checksums."""
    import pyarrow.parquet as pq

    pq.write_table(
        table,
        path,
        compression="snappy",
        use_dictionary=False,
        use_byte_stream_split=False,
        write_page_checksum=True,
        row_group_size=_GROUP,
    )


def simulate_block(
    resolved: Resolved,
    prepared: Sequence[Prepared],
    threads: int | None,
    progress: Callable[[float], object] | None,
) -> list[CoreResult]:
    """Simulate a block; a run that the core refuses after all is set apart, with its reason."""
    options = {"fidelity": resolved.fidelity, "threads": threads}
    try:
        return simulate_prepared(prepared, progress=progress, **options)  # type: ignore[arg-type]
    except InputError:
        results = []
        for item in prepared:
            try:
                results += simulate_prepared([item], progress=progress, **options)  # type: ignore[arg-type]
            except InputError as error:
                results.append(_refused_result(item, str(error)))
        return results


def _refused_result(prepared: Prepared, reason: str) -> CoreResult:
    columns = len(prepared.core["faults"])
    clocks: dict[str, CoreRows] = {
        clock.name: {"time": np.empty(0), "values": np.empty((0, len(clock.signals) + columns))}
        for clock in prepared.plan
    }
    return {
        "status": "refused", "message": reason, "time": 0.0, "steps": 0, "wall_s": 0.0,
        "clocks": clocks, "features": {}, "final": {},
    }  # fmt: skip


def _sample_table(
    resolved: Resolved,
    clock: ClockPlan,
    numbers: Sequence[int],
    prepared: Sequence[Prepared],
    results: Sequence[CoreResult],
) -> pa.Table:
    """Return one clock's samples: run, time, the channels, and the severity of every fault."""
    import pyarrow as pa

    parts = [
        (number, item, result["clocks"][clock.name])
        for number, item, result in zip(numbers, prepared, results, strict=True)
        if clock.name in result["clocks"]
    ]
    lengths = np.array([len(rows["time"]) for _, _, rows in parts])
    runs = np.repeat(np.array([number for number, _, _ in parts], dtype=np.int64), lengths)
    columns = {"run": runs, "time": np.concatenate([rows["time"] for _, _, rows in parts])}
    values = np.concatenate([rows["values"][:, : len(clock.signals)] for _, _, rows in parts])
    columns.update({name: values[:, k].copy() for k, name in enumerate(clock.signals)})
    columns.update(_severity_columns(resolved, clock, parts, lengths))
    schema = signal_schema(resolved, clock, parts[0][1].command_unit)
    return pa.Table.from_arrays([pa.array(columns[name]) for name in schema.names], schema=schema)


def _severity_columns(
    resolved: Resolved, clock: ClockPlan, parts: Sequence[Any], lengths: Any
) -> dict[str, Any]:
    """Return each fault's severity as it was applied at each sample; 0 in a run without it."""
    ends = np.cumsum(lengths)
    severities = {name: np.zeros(int(ends[-1])) for name in resolved.fault_names()}
    for (_, item, rows), start, end in zip(parts, ends - lengths, ends, strict=True):
        for place, fault in enumerate(item.core["faults"], start=len(clock.signals)):
            name = f"{fault['kind']}@{fault['place']}"
            severities[name][start:end] = rows["values"][:, place]
    return severities


def signal_schema(resolved: Resolved, clock: ClockPlan, command_unit: str) -> pa.Schema:
    """Return the columns of a clock's files, each with ``unit`` and ``text`` in its metadata."""
    import pyarrow as pa

    known = signal_records(resolved.wiring, resolved.fidelity)
    fields = [
        pa.field("run", pa.int64(), metadata={"unit": "1", "text": "number of the run"}),
        pa.field("time", pa.float64(), metadata={"unit": "s", "text": "time from the start"}),
    ]
    for name in clock.signals:
        unit = command_unit if name == "command" else known[name]["unit"] or "1"
        about = {"unit": unit, "text": known[name]["text"]}
        fields.append(pa.field(name, pa.float64(), metadata=about))
    for name, unit in resolved.fault_names().items():
        about = {"unit": unit, "text": f"severity of {name} as applied; 0: absent"}
        fields.append(pa.field(name, pa.float64(), metadata=about))
    head = {"schema": SCHEMA, "name": resolved.name, "clock": clock.name, "rate": clock.rate}
    return pa.schema(fields, metadata={"elevon": json.dumps(head)})
