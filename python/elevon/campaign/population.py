"""Units of one kind: each with parameters of its own, and with a history of growth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.campaign.draw import ranged
from elevon.campaign.grammar import Growth, Population, Spread, Target
from elevon.errors import InputError
from elevon.parameters.records import record_of
from elevon.units import parse_quantity


@dataclass(frozen=True)
class Units:
    """Every unit at every age, the ages of one unit following each other.

    Attributes
    ----------
    targets, columns : list
        What differs, with unit and values, shape (units * ages,).
    unit, age : ndarray, shape (units * ages,)
        Number and age (0 to 1).
    """

    targets: list[Target]
    columns: list[tuple[str, Any]]
    unit: npt.NDArray[np.int64]
    age: Floats


def units_of(population: Population, actuator: Actuator, place: str) -> Units:
    """Return the units of a population.

    Raises
    ------
    InputError
        An unknown name, a wrong unit, a choice that has no spread; the place is named.
    """
    ages = _ages(population)
    count = population.units
    unit, age = np.repeat(np.arange(count), len(ages)), np.tile(ages, count)
    # Each quantity has a generator of its own: one more leaves the others as they are.
    seeds = np.random.SeedSequence(population.seed).spawn(
        len(population.spread) + len(population.growth)
    )
    targets: list[Target] = [*population.spread, *population.growth]
    columns: list[tuple[str, Any]] = []
    for k, spread in enumerate(population.spread):
        generator = np.random.default_rng(seeds[k])
        unit_text, values = _spread(spread, actuator, count, generator, f"{place}.spread[{k}]")
        columns.append((unit_text, values[unit]))
    for k, growth in enumerate(population.growth):
        generator = np.random.default_rng(seeds[len(population.spread) + k])
        columns.append(
            _grown(growth, actuator.wiring, (unit, age), generator, f"{place}.growth[{k}]")
        )
    return Units(targets, columns, unit, age)


def _ages(population: Population) -> Floats:
    if population.ages:
        return np.array(population.ages, dtype=np.float64)
    points = population.points or 1
    return np.linspace(0.0, 1.0, points) if points > 1 else np.zeros(1)


def _spread(
    spread: Spread, actuator: Actuator, count: int, generator: np.random.Generator, place: str
) -> tuple[str, Floats]:
    """Return the values of one parameter of all units."""
    path = str(spread.parameter)
    record = record_of(actuator.wiring, path, place)
    if record.choices is not None:
        raise InputError(f"{place}: {path} is a choice: it has no spread")
    if spread.distribution == "uniform":
        return ranged(spread, generator.random(count), actuator.wiring, place)
    nominal = actuator.parameters.value(path)
    sd, relative = _deviation(spread, record.unit, place)
    normal = _cut_normal(generator.random(count), float(spread.cut))
    if spread.distribution == "lognormal":
        if not relative:
            raise InputError(f"{place}: the 'sd' of a lognormal spread is a fraction: '3 %'")
        return record.unit, nominal * np.exp(sd * normal)
    return record.unit, nominal + (nominal * sd if relative else sd) * normal


def _deviation(spread: Spread, unit: str, place: str) -> tuple[float, bool]:
    """Return the standard deviation, and whether it is a fraction of the value."""
    text = spread.sd
    if isinstance(text, str) and text.strip().endswith("%"):
        sd, relative = parse_quantity(text, "1", f"{place}: sd"), True
    else:
        sd, relative = parse_quantity(text or 0.0, unit or "1", f"{place}: sd"), False
    if sd <= 0.0:
        raise InputError(f"{place}: sd = {text} must be positive")
    return sd, relative


def _cut_normal(uniform: Floats, cut: float) -> Floats:
    """Return standard normal values cut at so many standard deviations, from uniform ones."""
    from scipy.special import ndtr, ndtri

    low, high = ndtr(-cut), ndtr(cut)
    values: Floats = ndtri(low + (high - low) * uniform)
    return values


def _grown(
    growth: Growth,
    wiring: str,
    where: tuple[npt.NDArray[np.int64], Floats],
    generator: np.random.Generator,
    place: str,
) -> tuple[str, Floats]:
    """Return the severity or value at every age of every unit."""
    unit, age = where
    text, ends = ranged(growth, np.array([0.0, 1.0]), wiring, place)
    count = int(unit.max()) + 1
    onset = growth.onset[0] + (growth.onset[1] - growth.onset[0]) * generator.random(count)
    factor = np.exp(growth.spread * _cut_normal(generator.random(count), 3.0))
    grows = generator.random(count) < growth.probability
    fraction = np.clip((age - onset[unit]) / (1.0 - onset[unit]), 0.0, 1.0)
    size = np.where(grows, (ends[1] - ends[0]) * factor, 0.0)
    return text, ends[0] + size[unit] * _law(growth, fraction)


def _law(growth: Growth, fraction: Floats) -> Floats:
    if growth.law == "linear":
        return fraction
    if growth.law == "power":
        return fraction ** float(growth.exponent)
    rate = float(growth.exponent)
    grown: Floats = np.expm1(rate * fraction) / np.expm1(rate)
    return grown
