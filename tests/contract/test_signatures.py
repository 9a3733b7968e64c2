"""Every fault of the servos has a test of its signature, which says so itself: it carries the mark
`signature(kind, place)`.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from elevon import _core

PHYSICS = Path(__file__).resolve().parents[1] / "physics"


def room(place: str) -> str:
    """`sensor.current_a` -> current, `inverter.a_high` -> inverter."""
    parts = place.split(".")
    return parts[1].split("_")[0] if parts[0] == "sensor" else parts[0]


def asked(wiring: str) -> set[tuple[str, str]]:
    """Kind and kind of place of every fault of a wiring."""
    return {
        (record["kind"], room(place))
        for record in _core.faults(wiring)
        for place in record["places"]
    }


def marked() -> Iterator[tuple[str, ...]]:
    """Yield what the marks of the physics tests name."""
    for path in sorted(PHYSICS.glob("test_*.py")):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                yield from (named for mark in node.decorator_list if (named := _signature(mark)))


def _signature(mark: ast.expr) -> tuple[str, ...]:
    if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "pytest.mark.signature":
        return tuple(ast.literal_eval(argument) for argument in mark.args)
    return ()


@pytest.mark.parametrize("wiring", ["rotary", "ballscrew"])
def test_every_fault_of_a_servo_has_a_signature_test(wiring: str) -> None:
    """A fault whose mark no test carries fails here."""
    assert asked(wiring) - set(marked()) == set()


def test_every_signature_test_names_a_fault() -> None:
    """A mark that no catalogue knows is misspelt or left behind."""
    known = {fault for wiring in _core.wirings() for fault in asked(wiring["name"])}
    assert set(marked()) - known == set()
