"""Published tables, re-entered as facts with their source named at the head of each file."""

import csv
from importlib.resources import files

__all__ = ["read_table"]


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
