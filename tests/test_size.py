"""The counter of code lines: what counts, what does not, and both ways to call it."""

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


@pytest.fixture
def package(tmp_path):
    """A package of three files, one of them not public."""
    (tmp_path / "inner").mkdir()
    (tmp_path / "inner" / "one.py").write_text(MODULE, "utf-8")
    (tmp_path / "_own.py").write_text("from typing import Any\ndef f(x: Any): ...\n", "utf-8")
    (tmp_path / "empty.py").write_text("\n\n# nothing\n", "utf-8")
    return tmp_path


def run(*words):
    done = subprocess.run(list(map(str, words)), capture_output=True, text=True, check=False)
    return done.returncode, done.stdout


@pytest.mark.parametrize("call", [[sys.executable, TOOLS / "size.py"], [TOOLS / "size"]])
def test_code_lines_and_signatures(package, call):
    code, text = run(*call, "--json", package)
    result = json.loads(text)
    assert code == 0
    assert result["packages"] == {"inner": 13, "_own": 2, "empty": 0}
    assert result["code_lines"] == 15
    assert result["signatures"] == 4
    assert [item.split()[1] for item in result["any"]] == ["given", "Shell.__init__", "Shell.kept"]


def test_the_table_ends_with_the_sums(package):
    code, text = run(TOOLS / "size", package)
    assert code == 0
    assert text.splitlines()[-2:] == [
        f"     15  code lines of {len(MODULE.splitlines()) + 5} in all",
        "3 of 4 public signatures with Any",
    ]


def test_a_folder_that_is_not_there(tmp_path):
    code, text = run(TOOLS / "size", tmp_path / "none")
    assert (code, text) == (2, "")
