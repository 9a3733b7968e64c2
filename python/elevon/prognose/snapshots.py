"""Runs of the switching model at a few severities, and what they correct."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.prognose.response import ResponseTables
from elevon.prognose.tabulate import severity_grid, tabulate
from elevon.progress import Progress

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.prognose.mission import Mission

_POINTS = 5  # severities of each axis


@dataclass(frozen=True)
class Correction:
    """What the switching model gives over the reduced-order one, along each axis from the origin.

    Between axes the ratios multiply: they are near one, so that what two faults do to a ratio
    together is small of second order.

    Attributes
    ----------
    axes : tuple of ndarray
        Points of each axis; the load's holds its stated value 1 in the middle.
    drivers : mapping of str to tuple of ndarray
        Ratios of the exposure along each axis.
    values : tuple of ndarray, shape (points, m)
        Ratios of what requirements measure, along each axis.
    runs : int
        Runs of the switching model behind it.
    """

    axes: tuple[Floats, ...]
    drivers: Mapping[str, tuple[Floats, ...]]
    values: tuple[Floats, ...]
    runs: int

    def of(self, low: ResponseTables) -> ResponseTables:
        """Return low-fidelity tables of the same axes, corrected."""
        points = np.array(list(low.grid.points()))
        drivers = {
            name: low.drivers[name] * self._ratio([r[:, None] for r in ratios], points)[:, 0]
            for name, ratios in self.drivers.items()
        }
        return replace(
            low,
            drivers=drivers,
            values=low.values * self._ratio(self.values, points),
            runs=low.runs + self.runs,
            fidelity="low, corrected by high",
        )

    def _ratio(self, tables: Sequence[Floats], points: Floats) -> Floats:
        """Return the product of the ratios along the axes, shape (n, m)."""
        origin = tables[0][0]
        out: Floats = np.ones((len(points), tables[0].shape[1])) * origin
        for axis, table, at in zip(self.axes, tables, points.T, strict=True):
            along = np.column_stack([np.interp(at, axis, column) for column in table.T])
            out *= along / origin
        return out


def correction(
    actuator: Actuator,
    mission: Mission,
    low: ResponseTables,
    progress: Progress | None = None,
) -> Correction:
    """Run a few points of each axis of the switching model; compare with the `low` tables.

    Points: nothing, and four of each axis up to its greatest severity.
    """
    axes = severity_grid(low.laws, mission, _POINTS).axes
    origin = tuple(1.0 if k == len(low.laws) else 0.0 for k in range(len(axes)))
    points = [origin]
    for k, axis in enumerate(axes):
        points += [(*origin[:k], float(v), *origin[k + 1 :]) for v in axis if float(v) != origin[k]]
    high = tabulate(actuator, mission, low.laws, low.grid, points=points, fidelity="high",
                     progress=progress)  # fmt: skip
    at = list(np.array(points).T)

    def ratio(table: Floats, other: Floats) -> Floats:
        with np.errstate(divide="ignore", invalid="ignore"):
            out = other / low.grid.interpolate(table, at).T
        return np.where(np.isfinite(out), out, 1.0)

    def along(table: Floats) -> tuple[Floats, ...]:
        rows = dict(zip(points, table, strict=True))
        return tuple(
            np.array([rows[(*origin[:k], float(v), *origin[k + 1 :])] for v in axis])
            for k, axis in enumerate(axes)
        )

    drivers = {
        name: tuple(r[:, 0] for r in along(ratio(low.drivers[name][:, None],
                                                 high.drivers[name][:, None])))
        for name in low.drivers
    }  # fmt: skip
    return Correction(axes, drivers, along(ratio(low.values, high.values)), high.runs)
