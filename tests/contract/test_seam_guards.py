"""Every function that crosses the seam catches a panic of the core: read from its source."""

import re
from pathlib import Path

import pytest

SOURCE = Path(__file__).parents[2] / "crates" / "elevon-py" / "src"
FUNCTION = re.compile(r"^#\[pyfunction\]\n(?:#[^\n]*\n)*pub fn (\w+).*?^\}", re.M | re.S)
METHODS = re.compile(r"^#\[pymethods\]\nimpl \w+ \{(.*?)^\}", re.M | re.S)
METHOD = re.compile(r"^    fn (\w+).*?^    \}", re.M | re.S)


def _functions():
    for path in sorted(SOURCE.glob("*.rs")):
        text = path.read_text()
        for found in FUNCTION.finditer(text):
            yield found[1], found[0]
        for methods in METHODS.finditer(text):
            for found in METHOD.finditer(methods[1]):
                yield f"Session.{found[1]}", found[0]


CALLS = dict(_functions())


def test_the_source_is_read_whole():
    from elevon import _core

    public = {name for name in vars(_core) if not name.startswith("_")} - {"Session"}
    methods = {f"Session.{name}" for name in vars(_core.Session) if not name.startswith("_")}
    assert set(CALLS) == public | methods | {"Session.new"}


@pytest.mark.parametrize("name", CALLS)
def test_a_call_is_guarded(name):
    assert re.search(r"\bguarded\(|self\.on\(", CALLS[name]), CALLS[name]
