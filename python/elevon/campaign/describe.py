"""What is in a data set, in numbers: for the data card and for ``elevon dataset describe``."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.campaign.dataset import Dataset
from elevon.errors import InputError
from elevon.plain import fields_of

if TYPE_CHECKING:
    import pyarrow as pa

_BINS = 20
#: What a description takes over from the manifest.
_STATED = (
    "name", "text", "status", "actuator", "fidelity", "version", "plan_hash", "responses", "design",
    "not_acting", "sources",
)  # fmt: skip


def describe(ds: Dataset) -> dict[str, object]:
    """Return counts, distributions and columns of a data set, in JSON's types.

    Returns
    -------
    dict
        ``name``, ``status``, ``runs``, ``bytes``, ``statuses``, ``splits``, ``cases``, ``units``,
        ``faults`` (with the runs that have each), ``varied`` (distribution of each varied
        quantity), ``clocks``, ``not_acting``, ``failed``.
    """
    table = ds.runs.to_arrow()
    status = table["status"].to_pylist()
    failed = [n for n, s in enumerate(status) if s in {"diverged", "refused"}]
    reasons = table["reason"].to_pylist()
    manifest = ds.manifest
    return {
        **fields_of(manifest, *_STATED),
        "runs": len(ds),
        "bytes": sum(about["bytes"] for item in ds.items for about in item.files.values()),
        "statuses": counted(status),
        "failed": [{"run": n, "status": status[n], "reason": reasons[n]} for n in failed[:100]],
        "splits": counted([s for s in table["split"].to_pylist() if s]),
        "cases": counted(table["case"].to_pylist()) if "case" in table.column_names else {},
        "units": len(set(table["unit"].to_pylist())),
        "seeds": len(set(table["seed"].to_pylist())),
        "blocks": len(set(table["block"].to_pylist())),
        "replicates": len(set(table["replicate"].to_pylist())),
        "healthy": _healthy(ds, table),
        "faults": [_fault(item, table) for item in manifest.faults],
        "varied": [
            {**item, **distribution(table[item["name"]])}
            for item in manifest.columns
            if item["kind"] != "fault"
        ],
        "clocks": [
            {"name": c["name"], "rate": c["rate"], "columns": c["columns"]} for c in manifest.clocks
        ],
        "features": _features(ds),
    }


def counted(items: Sequence[str]) -> dict[str, int]:
    """Return how often each text occurs, in order of the first."""
    return dict(Counter(items))


def distribution(column: pa.ChunkedArray) -> dict[str, object]:
    """Return smallest, largest, mean, quartiles and histogram of a column; counts of texts."""
    if not str(column.type).startswith(("double", "int")):
        return {"counts": counted([str(value) for value in column.to_pylist()])}
    values = column.to_numpy().astype(np.float64)
    return _spread(values)


def typical_runs(ds: Dataset, most: int = 12) -> dict[str, tuple[int, int]]:
    """Return for each fault a run of middling severity and a run to compare it with.

    Both are ``ok`` or ``tripped``; the faulty one has as few other faults as there are, the other
    one has none, or as few as there are.
    """
    names = [item["name"] for item in ds.manifest.faults][:most]
    if not names:
        return {}
    table = ds.runs.to_arrow(["status", *(item["name"] for item in ds.manifest.faults)])
    usable = np.isin(table["status"].to_pylist(), ["ok", "tripped"])
    severity = {i["name"]: np.abs(table[i["name"]].to_numpy()) for i in ds.manifest.faults}
    count = sum((values > 0.0).astype(int) for values in severity.values())
    pairs = {}
    for name in names:
        faulty = np.flatnonzero(usable & (severity[name] > 0.0))
        others = np.flatnonzero(usable & (severity[name] == 0.0))
        if len(faulty) and len(others):
            alone = faulty[count[faulty] == count[faulty].min()]
            middle = alone[np.argsort(severity[name][alone])[len(alone) // 2]]
            pairs[name] = (int(middle), int(others[np.argmin(count[others])]))
    return pairs


def _fault(item: dict[str, Any], table: Any) -> dict[str, Any]:
    values = table[item["name"]].to_numpy()
    present = values[values != 0.0]
    return {**item, "runs": len(present), **(_spread(present) if len(present) else {})}


def _healthy(ds: Dataset, table: Any) -> int:
    faulty = np.zeros(table.num_rows, dtype=bool)
    for item in ds.manifest.faults:
        faulty |= table[item["name"]].to_numpy() != 0.0
    return int((~faulty).sum())


def _features(ds: Dataset) -> list[str]:
    try:
        return [name for name in ds.features.columns if name != "run"]
    except InputError:
        return []


def _spread(values: npt.NDArray[np.float64]) -> dict[str, Any]:
    low, high = float(values.min()), float(values.max())
    counts, _ = np.histogram(values, _BINS, (low, high) if high > low else (low - 0.5, low + 0.5))
    quarter, middle, third = (float(q) for q in np.quantile(values, [0.25, 0.5, 0.75]))
    return {
        "min": low,
        "max": high,
        "mean": float(values.mean()),
        "quartiles": [quarter, middle, third],
        "histogram": counts.tolist(),
    }
