"""The package of the cases: its version is Elevon's, its command is found by its entry point."""

from importlib.metadata import entry_points, version

import elevon
from elevon.cli import registry


def test_the_version_is_that_of_elevon():
    assert version("elevon-cases") == elevon.__version__


def test_the_command_is_found_by_its_entry_point():
    (point,) = entry_points(group=registry.ENTRY_POINTS, name="reproduce")
    assert point.value == "elevon_cases.commands:app"
    assert registry.commands()["reproduce"].place == point.value
