"""Published tables, re-entered as facts with their source named at the head of each file.

Tables of other packages stand beside the modules that use them, and are read from here too.
"""

import csv
import tomllib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

__all__ = ["packaged_toml", "read_table"]


def read_table(name: str) -> list[dict[str, str]]:
    """Read one of the packaged tables.

    Parameters
    ----------
    name : str
        File name without its ending.

    Returns
    -------
    list of dict
        One mapping of column name to the text as printed for each line.
    """
    text = (files(__package__) / f"{name}.csv").read_text("utf-8")
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return list(csv.DictReader(lines))


@cache
def packaged_toml(package: str, name: str) -> Mapping[str, Any]:
    """Read a TOML file that stands in one of the packages, once."""
    return tomllib.loads((files(package) / name).read_text("utf-8"))
