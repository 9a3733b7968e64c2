"""Features of the catalogue that count among a log's numbers, as far as its roles allow them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from elevon.arrays import Floats

if TYPE_CHECKING:
    from elevon.features.records import FeatureRecord

_FAMILIES = ("level", "friction", "transmission", "orders", "bands")
#: What levels say already, and what a single moment decides.
_LEFT_OUT = ("mean", "kurtosis", "peak", "moving")
_AGAIN = 16  # times that they are read with noise added


class CatalogueValue(NamedTuple):
    """A feature of a log, and its deviation by the channels' noise."""

    record: FeatureRecord
    value: float
    noise: float


def catalogue_values(
    channels: Mapping[str, Floats],
    rate: float,
    pole_pairs: float | None,
    noise: Mapping[str, float],
) -> list[CatalogueValue]:
    """Return the features.

    Parameters
    ----------
    channels : mapping of str to ndarray, shape (n,)
        Role to values; no states.
    rate : float
        Of the log [Hz].
    pole_pairs : float or None
        Of the motor, for orders of the electrical turn.
    noise : mapping of str to float
        Role to the deviation of its noise; none: it is not asked for.
    """
    from elevon import _core
    from elevon.features.plan import core_plan
    from elevon.features.records import wanted_records

    every = wanted_records(["all"], {r: r for r in channels}, rate, "features")[0]
    records = [
        r
        for r in every
        if r.family in _FAMILIES
        and not any(word in r.name.split("_") for word in _LEFT_OUT)
        and not (r.name.endswith("_rms") and not r.name.startswith("tracking"))
        and ("electrical" not in r.name or pole_pairs is not None)
    ]
    roles = sorted({role for r in records for role in r.roles})
    if not records:
        return []
    plan = core_plan([r.name for r in records], roles, rate=rate, pole_pairs=pole_pairs or 1.0)

    def read(columns: list[Floats]) -> Floats:
        return np.asarray(_core.features(plan, columns), dtype=np.float64)

    columns = [np.ascontiguousarray(channels[role]) for role in roles]
    values, deviations = read(columns), np.zeros(len(records))
    if noise:  # orders and bands know no sum of their noise: the log with as much noise again
        rng, sizes = np.random.default_rng(15), [noise.get(role, 0.0) for role in roles]
        more = [[s * rng.standard_normal(len(columns[0])) for s in sizes] for _ in range(_AGAIN)]
        rows = [read([x + n for x, n in zip(columns, each, strict=True)]) for each in more]
        deviations = np.std(np.where(np.isfinite(rows), rows, values), axis=0, ddof=1)
    rows_of = zip(records, values.tolist(), deviations.tolist(), strict=True)
    return [CatalogueValue(*row) for row in rows_of]
