"""Every fault of every actuator has a test of its signature, which says so itself: it carries the
mark `signature(kind, place)`. A machine of its own kind has them in files that bear its name, the
servos, whose shaft and drives are the same, in the others.
"""

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from elevon import _core

PHYSICS = Path(__file__).resolve().parents[1] / "physics"
UNIT = PHYSICS.parent / "control_unit"


def owner(place: str) -> str:
    """`sensor.current_a` -> current, `inverter.a_high` -> inverter."""
    parts = place.split(".")
    return parts[1].split("_")[0] if parts[0] == "sensor" else parts[0]


def signatures_of(wiring: str) -> set[tuple[str, str]]:
    """Kind and kind of place of every fault of a wiring."""
    return {
        (record["kind"], owner(place))
        for record in _core.faults(wiring)
        for place in record["places"]
    }


def machines() -> list[str]:
    """Wirings that are no servo: they follow no position."""
    return [each["name"] for each in _core.wirings() if "position" not in each["modes"]]


def files(wiring: str) -> list[Path]:
    """Physics tests that speak of a wiring; a control unit is a machine's of its own kind."""
    units = dict.fromkeys(UNIT.glob("test_*.py"), "landing_gear")
    named = {path: name for name in machines() for path in PHYSICS.glob(f"test_{name}*.py")}
    wanted = wiring if wiring in machines() else None
    every = sorted([*PHYSICS.glob("test_*.py"), *units])
    return [path for path in every if {**named, **units}.get(path) == wanted]


def marked(wiring: str) -> Iterator[tuple[str, ...]]:
    """Yield what the marks of a wiring's physics tests name."""
    for path in files(wiring):
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.FunctionDef) and node.name.startswith("test_"):
                yield from (named for mark in node.decorator_list if (named := _signature(mark)))


def _signature(mark: ast.expr) -> tuple[str, ...]:
    if isinstance(mark, ast.Call) and ast.unparse(mark.func) == "pytest.mark.signature":
        return tuple(ast.literal_eval(argument) for argument in mark.args)
    return ()


@pytest.mark.parametrize("wiring", [each["name"] for each in _core.wirings()])
def test_every_fault_has_a_signature_test(wiring: str) -> None:
    """A fault whose mark no test carries fails here."""
    assert signatures_of(wiring) - set(marked(wiring)) == set()


def test_every_signature_test_names_a_fault() -> None:
    """A mark that no catalogue knows is misspelt or left behind."""
    names = [each["name"] for each in _core.wirings()]
    servos = {fault for name in names if name not in machines() for fault in signatures_of(name)}
    for name in names:
        known = signatures_of(name) if name in machines() else servos
        assert set(marked(name)) - known == set()
