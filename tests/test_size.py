"""The counter of code: what counts, where code stands in texts, and both ways to call it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

TOOLS = Path(__file__).resolve().parents[1] / "tools"
MODULE = '''"""Docstring
of two lines."""

# A comment.
from typing import Any

TEXT = """two lines
of a value"""


def plain(x: int) -> int:
    """Docstring."""
    return x  # counted


def given(x: dict[str, Any]) -> None: ...


class Shell:
    """Docstring."""

    def __init__(self, x: Any) -> None:
        self.x = x

    def _own(self) -> Any: ...

    def kept(self) -> list[Any]:
        return [self.x]


def _own(x: Any) -> None: ...
'''


PAGE = """# a page as data
title = "Errors of {{ result.name }}"

rows = ["result.rows"]
"""
RULES = """# formulas, names, units, words
speed = "motor_speed / ratio"
force = 'max(force_a, force_b)'
unit = ["rad/s", "N m", "motor.inertia", "terms[0].amplitude"]
words = ["bearing (front)", "load and cell in motion", "1 - 2", "a well-known value"]
held = "error < limit"
many = "[item for item in rows]"
"""
TEMPLATE = """<p>
{% for row in rows
   if row %}
<b>{{ row }}</b>
{# a comment #}
{% endfor %}
"""


@pytest.fixture
def package(tmp_path):
    """A package of three modules, one of them not public, and three texts with code."""
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "one.py").write_text(MODULE, "utf-8")
    (tmp_path / "_own.py").write_text("from typing import Any\ndef f(x: Any): ...\n", "utf-8")
    (tmp_path / "empty.py").write_text("\n\n# nothing\n", "utf-8")
    (tmp_path / "page.toml").write_text(PAGE, "utf-8")
    (tmp_path / "inner" / "rules.toml").write_text(RULES, "utf-8")
    (tmp_path / "inner" / "page.html.j2").write_text(TEMPLATE, "utf-8")
    (tmp_path / "inner" / "data.toml").write_text('kind = "sine"\n', "utf-8")
    return tmp_path


def run(*words):
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


@pytest.mark.parametrize("call", [[sys.executable, TOOLS / "size.py"], [TOOLS / "size"]])
def test_figures_in_all_and_by_package(package, call):
    code, text = run(*call, "--json", package)
    result = json.loads(text)
    assert code == 0
    lines = {name: part["lines"] for name, part in result["packages"].items()}
    assert lines == {"inner": 13 + 4 + 4, "_own": 2, "empty": 0, "page": 2}
    assert (result["lines"], result["in_texts"]) == (25, 10)
    assert (result["modules"], result["classes"]) == (3, 1)
    assert result["imports_share"] == pytest.approx(2 / 15, abs=1e-4)
    assert result["packages"]["inner"]["imports_share"] == pytest.approx(1 / 13, abs=1e-4)
    assert result["signatures"] == 4
    assert [item.split()[1] for item in result["any"]] == ["given", "Shell.__init__", "Shell.kept"]


def test_the_table_ends_with_the_sums(package):
    code, text = run(TOOLS / "size", package)
    assert code == 0
    assert text.splitlines()[-3:] == [
        f"     25        3        1    13.3%  {package.name}, in all",
        "     10  of these lines in templates and TOML files",
        "3 of 4 public signatures with Any",
    ]


def test_the_product_comes_with_cases_and_tests():
    code, text = run(TOOLS / "size", "--json")
    result = json.loads(text)
    assert code == 0
    assert {"report", "cli", "simulate"} <= result["packages"].keys()
    assert result["tests"]["lines"] > 10_000
    assert "lines" in result["cases"]


def test_a_folder_that_is_not_there(tmp_path):
    code, text = run(TOOLS / "size", tmp_path / "none")
    assert (code, text) == (2, "")
