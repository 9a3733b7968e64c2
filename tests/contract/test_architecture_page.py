"""The architecture page names every part of the package and every function of the seam."""

import re
from pathlib import Path

from elevon import _core

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs" / "explanation" / "architecture.md").read_text(encoding="utf-8")


def test_every_package_is_in_the_table_and_every_row_is_a_package() -> None:
    """Folders and modules of the package that do not begin with an underscore."""
    package = ROOT / "python" / "elevon"
    there = {path.stem for path in package.glob("[!_]*.py")} | {
        path.parent.name for path in package.glob("*/__init__.py")
    }
    rows = [line.split("|")[1] for line in PAGE.splitlines() if line.startswith("| `python/")]
    named = {
        Path(name.removeprefix("python/elevon/").split("/")[0]).stem
        for row in rows
        for name in re.findall(r"`([^`]+)`", row)
    }
    assert named == there


def test_the_list_of_the_seam_is_the_seam() -> None:
    """Functions at four spaces in the section, against the extension's own."""
    section = PAGE.partition("## The seam")[2].partition("One run (a dict)")[0]
    lines = [line for line in section.splitlines() if re.match(r" {4}\w", line)]
    listed = {name for line in lines for name in re.findall(r"(\w+)\([^)]*\)", line.split("#")[0])}
    functions = {name for name in dir(_core) if not name.startswith("_")}
    assert listed == functions
