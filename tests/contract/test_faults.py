"""One suite over every fault of every actuator; a new one is covered the day its catalogue line
exists.

The variants of a cell run as one batch, so a test looks at a whole catalogue and names what fails.
"""

from __future__ import annotations

import math
from functools import cache

import pytest

import elevon
from tests.contract import sets
from tests.contract.cells import Cell, Outcome, Variant, drives, fault, load, severe

#: Parts of the severe severity: away from whole counts, so that rounding inside a fault shows.
PARTS = (0.23, 0.61, 1.0)


def cells(*, every: bool) -> list[Cell]:
    """One drive and no load; or every drive, each with no load, an opposing and an aiding one."""
    return [
        Cell(name, fidelity, choices, push)
        for name in sets.names()
        for fidelity in sets.fidelities(name)
        for choices in (drives(name) if every else [()])
        for push in ((0.0, load(name), -load(name)) if every else (0.0,))
    ]


def titled(every: bool) -> pytest.MarkDecorator:
    """The cells as parameters of a test, each named."""
    return pytest.mark.parametrize("cell", cells(every=every), ids=lambda cell: cell.title)


@cache
def outcomes(cell: Cell, parts: tuple[float, ...]) -> dict[str, list[Outcome]]:
    """Outcomes of each fault at each part of its severe severity; the healthy run first."""
    names = [f"{kind}@{place}" for kind, place, _ in cell.faults()]
    variants = [
        Variant(
            f"{kind}@{place}={part}", faults=(fault(kind, place, record, part * severe(record)),)
        )
        for kind, place, record in cell.faults()
        for part in parts
    ]
    healthy, *broken = cell.run([Variant(), *variants])
    size = len(parts)
    rows = {name: broken[i * size : (i + 1) * size] for i, name in enumerate(names)}
    return {"healthy": [healthy], **rows}


def not_zero(cell: Cell, parts: tuple[float, ...]) -> list[str]:
    """Faults whose severity of zero is not the healthy run to the bit, with the signals."""
    found = dict(outcomes(cell, parts))
    healthy = found.pop("healthy")[0]
    assert healthy.status == "ok"
    return [
        f"{name}: {', '.join(changed)}"
        for name, (zero, *_) in found.items()
        if (changed := zero.differs(healthy))
    ]


def idle(cell: Cell, parts: tuple[float, ...]) -> list[str]:
    """Faults that change nothing when severe, or end in another way than a drive may."""
    found = dict(outcomes(cell, parts))
    healthy = found.pop("healthy")[0]
    return [
        f"{name}: {broken[-1].status}"
        for name, broken in found.items()
        if broken[-1].status not in {"ok", "tripped"} or not broken[-1].differs(healthy)
    ]


@titled(every=False)
def test_severity_zero_is_bit_identical_to_no_fault(cell: Cell) -> None:
    """All signals, every sample, every bit."""
    assert not_zero(cell, (0.0, 1.0)) == []


@titled(every=False)
def test_every_fault_does_something(cell: Cell) -> None:
    """A severe one changes some signal, or trips the drive."""
    assert idle(cell, (0.0, 1.0)) == []


@pytest.mark.parametrize("name", sets.names())
def test_severity_out_of_range_is_refused_by_name(name: str) -> None:
    """Above the maximum (if there is one), below the minimum, and NaN."""
    for kind, place, record in sets.places(name):
        ends = (record["maximum"] + 1.0, record["minimum"] - 1.0)
        for severity in (math.nan, *(end for end in ends if math.isfinite(end))):
            with pytest.raises(elevon.InputError) as caught:
                elevon.simulate(
                    sets.actuator(name),
                    sets.scenario(name, dict(fault(kind, place, record, severity))),
                )
            assert kind in str(caught.value) or "severity" in str(caught.value)
