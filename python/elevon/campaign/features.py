"""The table of features: one row a run, a column a feature."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.features import feature_records
from elevon.seam import CoreResult
from elevon.simulate.prepare import Prepared

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
