"""Values of an axis or a random draw, in SI; what is no number stays as it is written."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.campaign.grammar import Axis, Draw, Growth, Random, Spread, Target
from elevon.errors import InputError
from elevon.faults import find_record
from elevon.parameters.records import record_of
from elevon.units import check_kind, parse_quantity, parse_unit, si_unit, split_quantity, to_si

Values = npt.NDArray[Any]
Ranged = Axis | Draw | Spread | Growth


@dataclass(frozen=True)
class Column:
    """One quantity that the plan varies.

    Attributes
    ----------
    name : str
        Path of a parameter, ``KIND@PLACE`` of a fault, or place of the scenario.
    kind : str
        ``parameter``, ``fault`` or ``scenario``.
    unit : str
        SI unit of the values; empty for choices and texts.
    role : str
        ``control`` or ``nuisance``.
    attributes, profile
        What goes with a fault.
    values : ndarray, shape (runs,)
        float64 (SI; a fault that a run is spared is 0), or objects where they are no numbers.
    """

    name: str
    kind: str
    unit: str
    role: str
    values: Values
    attributes: dict[str, Any] = field(default_factory=dict)
    profile: Any = None

    @property
    def numeric(self) -> bool:
        """Whether the values are numbers."""
        return self.values.dtype == np.float64


def column_of(target: Target, unit: str, values: Values) -> Column:
    """Return the column of a target."""
    kind = "parameter" if target.parameter else "fault" if target.fault else "scenario"
    return Column(
        target.name, kind, unit, target.role, values, dict(target.attributes), target.profile
    )


def axis_values(axis: Axis, wiring: str, place: str) -> tuple[str, Values]:
    """Return unit and values of one axis, in order.

    Raises
    ------
    InputError
        No values, an unknown name, a wrong unit, two ends in different units, or a logarithmic
        range that touches zero.
    """
    if axis.values is not None:
        if not axis.values:
            raise InputError(f"{place}: 'values' is empty")
        return read_values(axis, list(axis.values), wiring, place)
    count = axis.count or 1
    fractions = np.linspace(0.0, 1.0, count) if count > 1 else np.zeros(1)
    return ranged(axis, fractions, wiring, place)


def random_values(plan: Random, repeats: int, wiring: str, place: str) -> list[tuple[str, Values]]:
    """Return unit and drawn values of each quantity, shape (repeats * count,); 0 for no fault.

    Parameters
    ----------
    plan : Random
        What is drawn.
    repeats : int
        How often the whole series of draws is made, each time anew.

    Raises
    ------
    InputError
        As `axis_values`; also when a Sobol sequence is given a count that is no power of two.
    """
    points = sample(plan.method, (plan.count, 2 * len(plan.draw)), plan.seed, repeats, place)
    columns = []
    for index, draw in enumerate(plan.draw):
        at = f"{place}.draw[{index}]"
        unit, values = _unit_cube_points(draw, points[:, 2 * index], wiring, at)
        if draw.probability < 1.0:
            values = np.where(points[:, 2 * index + 1] < draw.probability, values, 0.0)
        columns.append((unit, values))
    return columns


def _unit_cube_points(draw: Draw, fractions: Floats, wiring: str, place: str) -> tuple[str, Values]:
    if draw.values is None:
        return ranged(draw, fractions, wiring, place)
    unit, levels = read_values(draw, list(draw.values), wiring, place)
    chosen = np.minimum((fractions * len(levels)).astype(int), len(levels) - 1)
    return unit, levels[chosen]


def sample(method: str, shape: tuple[int, int], seed: int, repeats: int, place: str) -> Floats:
    """Return points of the unit cube, shape (repeats * count, dimension).

    Raises
    ------
    InputError
        A Sobol sequence of a count that is no power of two: it would not be balanced.
    """
    count, dimension = shape
    if count < 1:
        return np.empty((0, dimension))
    generator = np.random.default_rng(seed)
    if method in {"uniform", "random"}:
        return generator.random((repeats * count, dimension))
    if method == "sobol" and count & (count - 1):
        low = 1 << (count.bit_length() - 1)
        raise InputError(
            f"{place}: a Sobol sequence is balanced only for a power of two, "
            f"count = {count}; nearest: {low} or {2 * low}"
        )
    from scipy.stats import qmc

    engines = {"latin_hypercube": qmc.LatinHypercube, "sobol": qmc.Sobol, "halton": qmc.Halton}
    engine = engines[method](dimension, seed=generator)
    return np.concatenate([np.asarray(engine.random(count)) for _ in range(repeats)])


def ranged(
    target: Ranged, fractions: Sequence[float] | Floats, wiring: str, place: str
) -> tuple[str, Values]:
    """Return unit and SI values at fractions (0 to 1) of a target's range, shape (n,)."""
    low, written = _number_and_unit(target.start, place)
    high, other = _number_and_unit(target.stop, place)
    if written != other:
        raise InputError(
            f"{place}: 'from' is in {written or 'no unit'!r} and 'to' in {other or 'no unit'!r}; "
            "write both in one unit"
        )
    spacing = getattr(target, "spacing", "linear")
    if spacing == "log" and (low <= 0.0 or high <= 0.0):
        raise InputError(f"{place}: a logarithmic range must stay above zero ({low:g} to {high:g})")
    u = np.asarray(fractions, dtype=np.float64)
    if spacing == "log":
        numbers = np.exp(np.log(low) + u * (np.log(high) - np.log(low)))
    else:
        numbers = low + u * (high - low)
    numbers = np.where(u == 0.0, low, np.where(u == 1.0, high, numbers))
    unit = _unit_of_target(target, wiring, place)
    if unit is None:
        unit = si_unit(written) if written else ""
    if written:
        check_kind(written, unit or "1", f"{place}: {target.name}")
    return unit, to_si(numbers, written) if written else numbers


def read_values(
    target: Target, given: Sequence[float | str], wiring: str, place: str
) -> tuple[str, Values]:
    """Return unit and values of a list; choices, modes and the like stay texts.

    Raises
    ------
    InputError
        A name, a unit or a value that cannot be; the index is in the message.
    """
    if target.scenario is not None:
        return _read_scenario_values(given, place)
    if target.parameter is not None:
        record = record_of(wiring, target.parameter, place)
        read = [record.read(v, f"{place}: {target.parameter}") for v in given]
        unit = "" if record.choices is not None else record.unit
        return unit, np.array(read, dtype=object if record.choices is not None else np.float64)
    unit = _unit_of_target(target, wiring, place) or ""
    at = f"{place}: {target.fault}"
    return unit, np.array([parse_quantity(v, unit or "1", at) for v in given], dtype=np.float64)


def _unit_of_target(target: Target, wiring: str, place: str) -> str | None:
    """Return the SI unit of a target; None where only the values decide it."""
    if target.parameter is not None:
        record = record_of(wiring, target.parameter, place)
        if record.choices is not None:
            listed = ", ".join(record.choices)
            raise InputError(
                f"{place}: {target.parameter} is a choice ({listed}): give 'values', no range"
            )
        return record.unit
    if target.fault is not None:
        kind, at = target.fault.split("@")
        return find_record(kind, at, wiring, place).unit
    return None


def _read_scenario_values(given: Sequence[Any], place: str) -> tuple[str, Values]:
    """Read values of a place of the scenario: numbers where all of them are."""
    read = [_quantity_or_none(value, place) for value in given]
    if all(item is not None for item in read):
        units = {unit for _, unit in filter(None, read) if unit}
        if len(units) < 2:
            numbers = [number for number, _ in filter(None, read)]
            return next(iter(units), ""), np.array(numbers, dtype=np.float64)
    values = np.empty(len(given), dtype=object)
    values[:] = list(given)
    return "", values


def _quantity_or_none(value: Any, place: str) -> tuple[float, str] | None:
    """Return a value in SI and its unit, None where it is no quantity."""
    if isinstance(value, (int, float)) and not isinstance(value, bool):
        return float(value), ""
    parts = split_quantity(value) if isinstance(value, str) else None
    if parts is None:
        return None
    try:
        parse_unit(parts[1] or "1")
    except InputError:
        return None
    unit = si_unit(parts[1]) if parts[1] else ""
    return parse_quantity(value, unit or "1", place), unit


def _number_and_unit(given: Any, place: str) -> tuple[float, str]:
    if isinstance(given, str):
        parts = split_quantity(given)
        if parts is None:
            raise InputError(f"{place}: {given!r} is not a number with a unit")
        return float(parts[0]), parts[1]
    try:
        return float(given), ""
    except OverflowError:
        raise InputError(
            f"{place}: a whole number of {given.bit_length()} bits is too large"
        ) from None
