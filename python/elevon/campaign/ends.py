"""How each run ended: its status and the last value of every signal, one row a run.

With it the table of the runs can be made again without simulating, and a run read back has its
last values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.scenario.compile import signal_records
from elevon.seam import CoreResult
from elevon.simulate.prepare import Prepared
from elevon.simulate.result import final_values
from elevon.worklog import Item

if TYPE_CHECKING:
    import pyarrow as pa

    from elevon.campaign.resolved import Resolved

ENDS = "ends"
"""Folder of the tables."""
_OUTCOME = {
    "status": ("", "ok, tripped, diverged or refused"),
    "reason": ("", "why the status is not ok"),
    "sim_s": ("s", "simulated time"),
    "steps": ("1", "solver steps"),
}


def ends_table(
    resolved: Resolved,
    numbers: Sequence[int],
    prepared: Sequence[Prepared],
    results: Sequence[CoreResult],
    outcome: Mapping[str, Sequence[object]],
) -> pa.Table:
    """Return how a block's runs ended; NaN where a run was refused."""
    import pyarrow as pa

    known = signal_records(resolved.wiring, resolved.fidelity)
    rows = [
        final_values(result["final"], {name for plan in item.plan for name in plan.signals})
        for item, result in zip(prepared, results, strict=True)
    ]
    names = dict.fromkeys(name for row in rows for name in row)
    fields = [pa.field("run", pa.int64(), metadata={"unit": "1", "text": "number of the run"})]
    arrays = [pa.array(np.asarray(numbers, dtype=np.int64))]
    for name, (unit, text) in _OUTCOME.items():
        array = pa.array(outcome[name])
        fields.append(pa.field(name, array.type, metadata={"unit": unit, "text": text}))
        arrays.append(array)
    for name in names:
        unit = prepared[0].command_unit if name == "command" else known[name]["unit"] or "1"
        about = {"unit": unit, "text": f"last value: {known[name]['text']}"}
        fields.append(pa.field(name, pa.float64(), metadata=about))
        arrays.append(pa.array(np.array([row.get(name, np.nan) for row in rows])))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def last_values(row: Mapping[str, Any]) -> dict[str, float]:
    """Return the last values of a row of the table; none of a refused run."""
    if row["status"] == "refused":
        return {}
    return {name: value for name, value in row.items() if name not in {"run", *_OUTCOME}}


def read_ends(
    folder: Path, files: Mapping[str, dict[str, object]]
) -> dict[str, list[object]] | None:
    """Return how a block's runs ended, from its own table; None where that is not whole."""
    import pyarrow.parquet as pq

    mine = {name: about for name, about in files.items() if name.startswith(f"{ENDS}/")}
    if not mine or not Item(ENDS, mine, {}).intact(folder):
        return None
    table = pq.read_table(folder / next(iter(mine)), columns=list(_OUTCOME))
    return {name: table[name].to_pylist() for name in _OUTCOME}
