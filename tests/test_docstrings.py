"""Examples in docstrings are run."""

import doctest
import importlib
from pathlib import Path

import pytest

import elevon

PACKAGE = Path(elevon.__file__).parent
NAMES = [
    ".".join(("elevon", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")
    for path in sorted(PACKAGE.rglob("*.py"))
    if ">>> " in path.read_text("utf-8")
]


@pytest.mark.parametrize("name", NAMES)
def test_examples(name):
    module = importlib.import_module(name)
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    assert doctest.testmod(module, optionflags=flags).failed == 0


def test_there_are_examples():
    assert {"elevon.units.quantity"} <= set(NAMES)
