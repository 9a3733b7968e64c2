"""Every parameter of every actuator either changes something, or is reported to have no effect.

Both ways: what is reported to have no effect changes no bit. What a parameter needs to show itself
comes from its record and, failing that, from its neighbours; nothing here is a list kept by hand.
"""

from __future__ import annotations

import pytest

from elevon import _core
from elevon.parameters import records
from tests.contract import shipped
from tests.contract.acting import changed, claims, says, shows, variants
from tests.contract.cells import Cell, Variant, fault, load

CASES = [(name, fidelity) for name in shipped.names() for fidelity in shipped.fidelities(name)]
EVERY = pytest.mark.parametrize(("name", "fidelity"), CASES)
#: The longest motion at high fidelity takes ten seconds: only in the long run.
SHORT = pytest.mark.parametrize(
    ("name", "fidelity"),
    [
        pytest.param(
            *case, marks=[pytest.mark.long] if case == ("pisa-landing-gear", "high") else []
        )
        for case in CASES
    ],
)


def resting(cell: Cell) -> list[str]:
    """Parameters that the core says have no effect in a plain run of the cell."""
    actuator = cell.actuator()
    rows = _core.not_acting(actuator.wiring, cell.fidelity, actuator.parameters.vector(), [])
    return [row["path"] for row in rows]


def idle(name: str, fidelity: str, paths: list[str]) -> list[str]:
    """Parameters that change nothing in any company, though nothing says so."""
    cell = Cell(name, fidelity, load=load(name))
    known = records(cell.actuator().wiring)
    carried = [path for path in paths if fidelity in known[path].fidelities]
    return [path for path in carried if not shows(cell, path) and claims(cell, path)]


def false(name: str, fidelity: str, count: int | None) -> list[str]:
    """Parameters that are reported to have no effect, but change something; `count` values."""
    cell = Cell(name, fidelity)
    tried = [
        variant
        for path in resting(cell)
        for variant in variants(cell, path, Variant())[:count]
        if says(cell, path, variant)
    ]
    return [
        f"{what}: {signals}" for what, signals in changed(cell, Variant(), tried).items() if signals
    ]


@pytest.mark.parametrize("name", shipped.names())
def test_what_is_reported_without_effect_changes_no_bit_of_the_reduced_order_model(
    name: str,
) -> None:
    """One other value of each."""
    assert false(name, "low", 1) == []


@SHORT
def test_a_switch_is_as_it_was_below_one_half_by_value_and_by_fault(
    name: str, fidelity: str
) -> None:
    """Every parameter that a fault switches on or off."""
    cell = Cell(name, fidelity)
    known = records(cell.actuator().wiring)
    without_effect = resting(cell)
    # A fault that changes nothing with these values is refused (tests/simulate/test_not_acting.py).
    switched = [
        (kind, place, record)
        for kind, place, record in cell.faults()
        if "1: " in record["effect"] and not set(record["targets"][place]) <= set(without_effect)
    ]
    assert switched
    broken = [
        Variant(f"{kind}@{place}", faults=(fault(kind, place, record, 0.23),))
        for kind, place, record in switched
    ]
    off = [
        Variant(path, values={path: 0.23})
        for path in dict.fromkeys(path for _, place, r in switched for path in r["targets"][place])
        if cell.actuator().parameters.value(path) == 0.0 and known[path].text.startswith("1")
    ]
    assert off
    found = changed(cell, Variant(), [*broken, *off])
    assert {what: signals for what, signals in found.items() if signals} == {}


@pytest.mark.long
@EVERY
def test_what_is_reported_without_effect_changes_no_bit_at_any_value(
    name: str, fidelity: str
) -> None:
    """From near to extreme."""
    assert false(name, fidelity, None) == []


@pytest.mark.long
@EVERY
def test_every_parameter_has_an_effect_or_is_reported_without(name: str, fidelity: str) -> None:
    """All of them."""
    assert idle(name, fidelity, list(records(shipped.actuator(name).wiring))) == []
