"""The tables that stand beside the commands as TOML, each read once."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any


@cache
def read_table(name: str, package: str = "elevon.cli") -> Mapping[str, Any]:
    """Read a TOML file of a package, such as ``options.toml``."""
    return tomllib.loads((files(package) / name).read_text("utf-8"))
