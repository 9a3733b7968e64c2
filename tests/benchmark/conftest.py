"""The command line, as its own tests run it."""

from tests.cli.conftest import elevon_cli

__all__ = ["elevon_cli"]
