"""Examples in docstrings are run."""

import doctest
import importlib
import pkgutil

import pytest

import elevon

NAMES = [
    module.name
    for module in pkgutil.walk_packages(elevon.__path__, "elevon.")
    if not module.name.endswith(("._core", ".__main__"))
]


@pytest.mark.parametrize("name", ["elevon", *NAMES])
def test_examples(name):
    module = importlib.import_module(name)
    flags = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
    assert doctest.testmod(module, optionflags=flags).failed == 0
