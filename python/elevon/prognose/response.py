"""What severities do to the actuator: exposure by a mission and requirements, in tables."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.prognose.law import Law
from elevon.prognose.requirement import SEVERITY, Requirement
from elevon.units import display_unit, to_display

#: Points of each axis by the number of axes: at most 1 024 model runs a table.
_POINTS = {1: 13, 2: 9, 3: 7, 4: 5, 5: 4, 6: 3}


def axis_points(axes: int) -> int:
    """Return how many points each of several axes has."""
    return _POINTS.get(axes, 2)


@dataclass(frozen=True)
class Grid:
    """A grid of points.

    Attributes
    ----------
    axes : tuple of ndarray
        Rising values of each axis, two or more.
    """

    axes: tuple[Floats, ...]

    @property
    def shape(self) -> tuple[int, ...]:
        """Points of each axis."""
        return tuple(len(axis) for axis in self.axes)

    def points(self) -> Iterator[tuple[float, ...]]:
        """Yield all points, the last axis fastest."""
        return itertools.product(*(axis.tolist() for axis in self.axes))

    def weights(self, at: Sequence[Floats]) -> tuple[npt.NDArray[np.intp], Floats]:
        """Return flat indices and weights of the corners about each point, shape (c, n) each.

        Points outside the grid are moved to its border.
        """
        index = np.zeros((1, len(at[0])), dtype=np.intp)
        weight = np.ones((1, len(at[0])))
        for axis, value in zip(self.axes, at, strict=True):
            # Inner points alone are searched: no index is below the first cell or above the last.
            low = np.searchsorted(axis[1:-1], value, side="right")
            share = (value - axis[low]) / np.diff(axis)[low]
            share = np.minimum(np.maximum(share, 0.0), 1.0)
            index = np.concatenate((index * len(axis) + low, index * len(axis) + low + 1))
            weight = np.concatenate((weight * (1.0 - share), weight * share))
        return index, weight

    def interpolate(self, table: Floats, at: Sequence[Floats]) -> Floats:
        """Interpolate a table.

        Parameters
        ----------
        table : ndarray, shape (points, m)
            Values at `points`.
        at : sequence of ndarray, shape (n,)
            One an axis.

        Returns
        -------
        ndarray, shape (m, n)
        """
        index, weight = self.weights(at)
        return np.asarray(np.einsum("cnm,cn->mn", table[index], weight))


@dataclass(frozen=True)
class ResponseTables:
    """Tables over severities.

    Attributes
    ----------
    laws : tuple of Law
        One an axis.
    requirements : tuple of Requirement
        What must hold.
    thresholds, units : tuple
        Where each ends the life, SI; and its unit.
    grid : Grid
        Severities, and the factor on the loads as the last axis where that may vary.
    drivers : mapping of str to ndarray, shape (points,)
        Exposure by one repetition of the mission.
    values : ndarray, shape (points, m)
        What each requirement measures.
    runs : int
        Model runs behind it.
    fidelity : str
        Of the runs; ``low, corrected by high`` with snapshots.
    seconds : float
        Wall time that they took.
    """

    laws: tuple[Law, ...]
    requirements: tuple[Requirement, ...]
    thresholds: tuple[float, ...]
    units: tuple[str, ...]
    grid: Grid
    drivers: Mapping[str, Floats]
    values: Floats
    runs: int
    fidelity: str
    _tables: tuple[Floats, Floats] = field(init=False, repr=False)
    seconds: float = field(default=0.0, compare=False)

    def __post_init__(self) -> None:
        reserves = [
            requirement.reserve(self.values[:, k], self.thresholds[k])
            for k, requirement in enumerate(self.requirements)
        ]
        exposures = np.column_stack([self.drivers[name] for name in self.drivers])
        object.__setattr__(self, "_tables", (exposures, np.column_stack(reserves)))

    @property
    def units_by_name(self) -> dict[str, str]:
        """Requirements' names to the SI units of what they measure."""
        names = (item.name for item in self.requirements)
        return dict(zip(names, self.units, strict=True))

    @property
    def loaded(self) -> bool:
        """Whether the last axis is the load's factor."""
        return len(self.grid.axes) > len(self.laws)

    def exposed(self, severity: Floats, load: Floats) -> dict[str, Floats]:
        """Return the exposure of units of severities, shape (n, k), under load factors (n,)."""
        table = self.grid.interpolate(self._tables[0], self._at(severity, load))
        return dict(zip(self.drivers, table, strict=True))

    def reserve(self, severity: Floats) -> Floats:
        """Return the distance to each threshold, in thresholds, shape (m, n); negative: failed.

        Requirements are judged at the loads as the mission states them.
        """
        ones = np.ones(len(severity))
        return self._with_limits(
            self.grid.interpolate(self._tables[1], self._at(severity, ones)), severity
        )

    def state(self, severity: Floats, load: Floats) -> tuple[Floats, dict[str, Floats]]:
        """Return `reserve` and `exposed` of the same units; one search where loads are fixed."""
        if self.loaded:
            return self.reserve(severity), self.exposed(severity, load)
        both = self.grid.interpolate(self._both, self._at(severity, load))
        reserves = len(self.requirements)
        drivers = dict(zip(self.drivers, both[reserves:], strict=True))
        return self._with_limits(both[:reserves], severity), drivers

    @cached_property
    def _both(self) -> Floats:
        return np.hstack(self._tables[::-1])

    def _with_limits(self, out: Floats, severity: Floats) -> Floats:
        """Put limits on a fault itself in the place of what the tables say of them."""
        for k, requirement in enumerate(self.requirements):
            if requirement.measure == SEVERITY:
                at = [law.key for law in self.laws].index(str(requirement.fault))
                out[k] = requirement.reserve(severity[:, at], self.thresholds[k])
        return out

    def measured(self, severity: Floats) -> Floats:
        """Return what each requirement measures, shape (m, n), SI."""
        finite = np.where(np.isfinite(self.values), self.values, np.nan)
        return self.grid.interpolate(finite, self._at(severity, np.ones(len(severity))))

    def _at(self, severity: Floats, load: Floats) -> list[Floats]:
        columns = [severity[:, k] for k in range(len(self.laws))]
        return [*columns, load] if self.loaded else columns


def check_start(response: ResponseTables, severity: Floats) -> list[str]:
    """Return what is violated by a unit of these severities, shape (k,), in words."""
    reserve = response.reserve(severity[None, :])[:, 0]
    values = response.measured(severity[None, :])[:, 0]
    out = []
    for k, requirement in enumerate(response.requirements):
        if reserve[k] < 0.0:
            sign = "least" if requirement.at_least else "limit"
            unit = display_unit(response.units[k])
            value, limit = (
                f"{to_display(x, unit):.4g} {unit}" for x in (values[k], response.thresholds[k])
            )
            out.append(f"requirement {requirement.name}: {value}, {sign} {limit}")
    return out
