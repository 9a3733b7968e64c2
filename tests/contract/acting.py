"""For every parameter the values that should show it, and the company it needs, from its record."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import islice
from typing import Any

from elevon.parameters import records
from tests.contract.cells import Cell, Variant, fault, severe

#: A threshold this much above another number of its unit is crossed at once.
JUST_ABOVE = 1.00004
#: Steps away from a value, and numbers of every size for those that are zero.
FACTORS = (1.3, 0.7, 0.02, 50.0)
SIZES = (0.1, 1e-3, 1.0, 30.0, 1e-6, 1e3, -0.1, -1.0, 0.0)
#: Companies tried before a parameter counts as idle: more would only cost time.
MOST = 80
#: Supplies of the run that a set does by default: what watches speed and supply acts there.
WHOLE = (1.0, 1.3, 0.5)
#: Parameters of other groups that are tried because a parameter's text names them.
SPOKEN = 6
#: What a companion that must be away from neutral is set to, tried in this order.
COMPANY = (0.2, 1e-3, 1.0, 20.0, 1e-5)

_CHOSEN = re.compile(r"(\S+) = (\S+)")
_AWAY = re.compile(r"(\S+) away from (\S+)")


def inside(record: Any, value: float) -> bool:
    """Is the value in the record's range?"""
    try:
        record.check(value)
    except ValueError:
        return False
    return True


def others(record: Any, value: float | str) -> list[float | str]:
    """Other values of a parameter: every other choice, or numbers from near to far."""
    if record.choices is not None:
        return [choice for choice in record.choices if choice != value]
    assert isinstance(value, float)
    numbers = [value * factor for factor in FACTORS if value] + list(SIZES)
    numbers += [value + size for size in (1.0, -1.0) if value]
    if (
        record.unit == "K"
    ):  # just above what the actuator starts at: limits that a short run reaches
        numbers[:0] = [293.15 + 1e-7, 293.15 + 1e-4]
    return [
        number for number in dict.fromkeys(numbers) if number != value and inside(record, number)
    ]


def company(
    cell: Cell, path: str, size: float, seen: tuple[str, ...] = ()
) -> Iterator[dict[str, Any]]:
    """Yield settings under which the record says that a parameter acts, one an alternative."""
    actuator = cell.actuator()
    known = records(actuator.wiring)
    met: list[dict[str, Any]] = [{}]
    for condition in known[path].when:
        ways = [way for part in _alternatives(condition, cell.fidelity)
                for way in _met(cell, part, size, (*seen, path))]  # fmt: skip
        met = [{**one, **way} for one in met for way in ways or [{}]]
    yield from met[:6]


def _alternatives(condition: str, fidelity: str) -> list[str]:
    """Split ``a or b`` into its conditions; those of another fidelity ask nothing."""
    words, _, other = condition.partition(" (fidelity ")
    if other and other.rstrip(")") != fidelity:
        return []
    parts: list[str] = []
    for piece in re.split(r" or | and ", words):
        if " = " in piece or " away from " in piece:
            parts.append(piece)
    return parts


def _met(
    cell: Cell, condition: str, size: float, seen: tuple[str, ...]
) -> Iterator[dict[str, Any]]:
    actuator = cell.actuator()
    known = records(actuator.wiring)
    if match := _CHOSEN.match(condition):
        path, wanted = match[1], match[2]
    else:
        match = _AWAY.match(condition)
        assert match is not None, condition
        path, wanted = match[1], ""
    if path not in known or path in seen:
        return
    setting = wanted or _moved(known[path], actuator.parameters.value(path), match[2], size)
    below = list(company(cell, path, size, seen)) or [{}]
    for one in below:
        yield {**one, path: setting}


def _moved(record: Any, value: float, neutral: str, size: float) -> float:
    """A number away from neutral: as it is if it is away already."""
    try:
        neutral_value = float(neutral)
    except ValueError:
        neutral_value = value
    if value != neutral_value:
        return value
    top = record.maximum if math.isfinite(record.maximum) else math.inf
    for number in (
        neutral_value + size,
        neutral_value - size,
        neutral_value - 0.5 * size,
        neutral_value + min(size, 0.5 * (top - neutral_value)),
    ):
        if number != neutral_value and inside(record, number):
            return float(number)
    return value


def companies(cell: Cell, path: str) -> Iterator[Variant]:
    """Yield what a parameter is tried with, from what its record asks to wider circles.

    First its conditions, met by values; then with each fault that moves what it requests, coming
    in the middle of the run; then with each neighbour of its group moved.
    """
    plain = [Variant(values=one) for one in _accepted(cell, path)]
    yield from plain
    first = plain[0] if plain else Variant()
    for broken in (*_faults(cell, path), *_spoken_faults(cell, path)):
        yield Variant(values=first.values, faults=(broken,))
    for company in plain[:2] or [Variant()]:
        for values in _neighbours(cell, path, company):
            yield Variant(values={**company.values, **values})


def _accepted(cell: Cell, path: str) -> Iterator[dict[str, Any]]:
    tried: list[dict[str, Any]] = []
    for size in COMPANY:
        for one in company(cell, path, size):
            if one not in tried and not cell.refused(Variant(values=one)):
                yield one
            tried.append(one)


def _faults(cell: Cell, path: str) -> Iterator[Any]:
    """Yield the faults that move what the parameter requests; and one that grows smoothly."""
    conditions = " ".join(records(cell.actuator().wiring)[path].when)
    half = 0.5 * cell.scenario().seconds
    for kind, place, record in cell.faults():
        if any(target in conditions for target in record["targets"][place]):
            yield fault(kind, place, record, severe(record), {"kind": "step", "time": half})
    kind, place, record = cell.faults()[0]
    yield fault(kind, place, record, 0.5 * severe(record), {"kind": "ramp", "end": 2.0 * half})


def _neighbours(cell: Cell, path: str, base: Variant) -> Iterator[dict[str, Any]]:
    """Yield other values of the parameters of the same group, all at once and one at a time.

    Those whose names share most words with its own come first: knot 8 of a table needs speed 8.
    """
    group = path.rpartition(".")[0]
    actuator = cell.actuator()
    moved = {
        other: others(record, actuator.parameters[other].value)[:6]
        for other, record in records(actuator.wiring).items()
        if other.rpartition(".")[0] == group and other != path
    }
    words = set(path.split(".")) | set(path.rpartition(".")[2].split("_"))
    common = {other: len(words & set(other.rpartition(".")[2].split("_"))) for other in moved}
    moved = dict(sorted(moved.items(), key=lambda item: -common[item[0]]))
    known = records(actuator.wiring)
    numbers = {
        other: actuator.parameters.value(other) for other in moved if known[other].choices is None
    }
    # Together, and those of one unit alone, so that the knots of a table stay in order.
    for unit in (None, *dict.fromkeys(known[other].unit for other in numbers)):
        alike = [other for other in numbers if unit in (None, known[other].unit)]
        for factor in FACTORS:
            scaled = {other: numbers[other] * factor for other in alike}
            yield {other: value for other, value in scaled.items() if inside(known[other], value)}
    # A limit acts only where those that it must keep away from leave it room.
    named = _refusing(cell, path, base)
    near = [other for other in moved if other in named]
    yield from ({other: value} for other in near for value in moved[other])
    # A threshold is crossed in a short run where it stands just above what is there already.
    alike = [
        other for other, value in numbers.items() if known[other].unit == known[path].unit and value
    ]
    pairs = ((a, JUST_ABOVE * numbers[b]) for a in alike for b in alike if a != b)
    yield from islice(({a: value} for a, value in pairs if inside(known[a], value)), SPOKEN)
    yield from _spoken_of(cell, path)
    far = {other: values for other, values in moved.items() if other not in near}
    yield from ({other: value} for other, values in far.items() for value in values)


def _refusing(cell: Cell, path: str, base: Variant) -> set[str]:
    """Names in the reasons why other values of a parameter are refused."""
    record = records(cell.actuator().wiring)[path]
    values = others(record, cell.actuator(base.values).parameters[path].value)
    refusals = (cell.refused(Variant(values={**base.values, path: value})) for value in values)
    return {name for text in refusals for name in re.findall(r"[a-z_]+(?:\.\w+)+", text)}


def _words(cell: Cell, path: str) -> set[str]:
    """Words of a parameter's text, without a plural's s."""
    text = records(cell.actuator().wiring)[path].text.lower()
    return {word.removesuffix("es").removesuffix("s") for word in re.findall(r"[a-z]{4,}", text)}


def _spoken_faults(cell: Cell, path: str) -> Iterator[Any]:
    """Yield severe faults of what the parameter's own text names."""
    words, half = _words(cell, path), 0.5 * cell.scenario().seconds
    for kind, place, record in cell.faults():
        if words & set(re.findall(r"[a-z]+", f"{kind} {place}".replace("proximity", "switch"))):
            yield fault(kind, place, record, severe(record), {"kind": "step", "time": half})


def _spoken_of(cell: Cell, path: str) -> Iterator[dict[str, Any]]:
    """Yield other values of what the text names: a limit of the supply needs a supply."""
    known = records(cell.actuator().wiring)
    words = _words(cell, path)
    named = [other for other in known
             if other.rpartition(".")[0] != path.rpartition(".")[0]
             and words & set(other.rpartition(".")[2].split("_"))]  # fmt: skip
    for other in named[:SPOKEN]:
        value = cell.actuator().parameters[other].value
        yield from ({other: number} for number in others(known[other], value)[: len(FACTORS)])


def variants(cell: Cell, path: str, base: Variant) -> list[Variant]:
    """Other values of a parameter in some company, those that the cell accepts."""
    actuator = cell.actuator(base.values)
    record = records(actuator.wiring)[path]
    tried = [
        Variant(f"{path}={value}", {**base.values, path: value}, base.faults)
        for value in others(record, actuator.parameters[path].value)
    ]
    refused = [bool(cell.refused(variant)) for variant in tried]
    accepted = [variant for variant, no in zip(tried, refused, strict=True) if not no]
    if base.values or base.faults:
        return accepted
    return accepted + [
        _nearest(cell, path, actuator.parameters[path].value, variant.values[path])
        for variant, no in zip(tried[: len(FACTORS)], refused, strict=False)
        if no and record.choices is None
    ]


def _nearest(cell: Cell, path: str, accepted: float, refused: float) -> Variant:
    """The value next to one that another parameter forbids: a limit acts where it is reached."""
    for _ in range(12):
        middle = 0.5 * (accepted + refused)
        if cell.refused(Variant(values={path: middle})):
            refused = middle
        else:
            accepted = middle
    return Variant(f"{path}={accepted}", {path: accepted})


def changed(cell: Cell, base: Variant, tried: Sequence[Variant]) -> dict[str, list[str]]:
    """Signals that each variant changes against its company alone."""
    if not tried:
        return {}
    healthy, *moved = cell.run([base, *tried])
    return {item.name: outcome.differs(healthy) for item, outcome in zip(tried, moved, strict=True)}


def says(cell: Cell, path: str, variant: Variant) -> bool:
    """Does the program say of this variant that the parameter has no effect?"""
    return any(text.startswith(f"{path} = ") for text in cell.resting(variant))


def claims(cell: Cell, path: str) -> bool:
    """Is there a company in which nothing says that the parameter rests?"""
    for base in islice(companies(cell, path), MOST):
        if not cell.refused(base):
            tried = variants(cell, path, base)
            if any(not says(cell, path, item) for item in tried):
                return True
    return False


def shows(cell: Cell, path: str) -> bool:
    """Does the parameter change some signal in some company, where nothing says that it rests?

    Against the load and with it, to and fro and onwards: a load may keep what it holds back from
    its lock, or from falling.
    """
    ways = [
        replace(cell, load=push, onwards=onwards)
        for push in (cell.load, -cell.load)
        for onwards in (False, True)
    ]
    return any(
        _shows(way, path, base) for base in islice(companies(cell, path), MOST) for way in ways
    ) or _shows_over_the_whole(cell, path)


def _shows_over_the_whole(cell: Cell, path: str) -> bool:
    """In the actuator file's own run: under several supplies, with each severe fault."""
    if any(_shows(replace(cell, load=0.0, whole=supply), path, Variant()) for supply in WHOLE):
        return True
    whole = replace(cell, load=0.0, whole=1.0)
    broken = (fault(kind, place, record, severe(record)) for kind, place, record in cell.faults())
    return any(_shows(whole, path, Variant(faults=(one,))) for one in broken)


def _shows(cell: Cell, path: str, base: Variant) -> bool:
    if cell.refused(base):
        return False
    tried = [item for item in variants(cell, path, base) if not says(cell, path, item)]
    return any(any(changed(cell, base, part).values()) for part in (tried[:2], tried[2:]))
