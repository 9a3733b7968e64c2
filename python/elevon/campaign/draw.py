"""Values of an axis or a random draw: numbers keep the unit they are written in."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.campaign.plan import Axis, Draw, Random
from elevon.errors import InputError

__all__ = ["ABSENT", "axis_values", "random_values"]

#: A fault that this draw leaves out.
ABSENT = None

_QUANTITY = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*", re.S)


def axis_values(axis: Axis, place: str) -> list[Any]:
    """Return the values of one axis, in order.

    Raises
    ------
    InputError
        No values, two ends in different units, or a logarithmic range that touches zero.
    """
    if axis.values is not None:
        if not axis.values:
            raise InputError(f"{place}: 'values' is empty")
        return list(axis.values)
    count = axis.count or 1
    fractions = np.linspace(0.0, 1.0, count) if count > 1 else np.zeros(1)
    return _spread(axis, fractions, place)


def random_values(plan: Random, place: str) -> list[list[Any]]:
    """Return the drawn values: one list a draw, one value a quantity; `ABSENT` for no fault.

    Raises
    ------
    InputError
        As `axis_values`; also when a Sobol sequence is asked for a count that is no power of two.
    """
    points = _sample(plan, place)
    columns: list[list[Any]] = []
    for index, draw in enumerate(plan.draw):
        at = f"{place}.draw[{index}]"
        values = _column(draw, points[:, 2 * index], at)
        there = points[:, 2 * index + 1] < draw.probability
        columns.append([v if keep else ABSENT for v, keep in zip(values, there, strict=True)])
    return [list(row) for row in zip(*columns, strict=True)]


def _column(draw: Draw, fractions: npt.NDArray[np.float64], place: str) -> list[Any]:
    if draw.values is not None:
        count = len(draw.values)
        return [draw.values[min(int(u * count), count - 1)] for u in fractions]
    return _spread(draw, fractions, place)


def _sample(plan: Random, place: str) -> npt.NDArray[np.float64]:
    """Return points in the unit cube, shape (count, 2 * quantities): value and presence."""
    from scipy.stats import qmc

    dimension = 2 * len(plan.draw)
    if plan.method == "uniform":
        return np.random.default_rng(plan.seed).random((plan.count, dimension))
    if plan.method == "sobol" and plan.count & (plan.count - 1):
        low = 1 << (plan.count.bit_length() - 1)
        raise InputError(
            f"{place}: a Sobol sequence is balanced only for a power of two, "
            f"count = {plan.count}; nearest: {low} or {2 * low}"
        )
    engines = {"latin_hypercube": qmc.LatinHypercube, "sobol": qmc.Sobol, "halton": qmc.Halton}
    generator = np.random.default_rng(plan.seed)
    return np.asarray(engines[plan.method](dimension, seed=generator).random(plan.count))


def _spread(
    target: Axis | Draw, fractions: Sequence[float] | npt.NDArray[np.float64], place: str
) -> list[Any]:
    low, unit = _split(target.start, place)
    high, other = _split(target.stop, place)
    if unit != other:
        raise InputError(
            f"{place}: 'from' is in {unit or 'no unit'!r} and 'to' in {other or 'no unit'!r}; "
            "write both in one unit"
        )
    if target.spacing == "log" and (low <= 0.0 or high <= 0.0):
        raise InputError(f"{place}: a logarithmic range must stay above zero ({low:g} to {high:g})")
    numbers = []
    for u in fractions:
        if target.spacing == "log":
            number = math.exp(math.log(low) + float(u) * (math.log(high) - math.log(low)))
        else:
            number = low + float(u) * (high - low)
        numbers.append(high if u == 1.0 else low if u == 0.0 else number)
    return [f"{number!r} {unit}" if unit else number for number in numbers]


def _split(given: Any, place: str) -> tuple[float, str]:
    if isinstance(given, str):
        match = _QUANTITY.fullmatch(given)
        if match is None:
            raise InputError(f"{place}: {given!r} is not a number with a unit")
        return float(match[1]), match[2]
    return float(given), ""
