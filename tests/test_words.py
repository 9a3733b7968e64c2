"""The lint of retired words sees each of them, and only where they may not stand."""

import importlib.util
import subprocess
from pathlib import Path

import pytest

TOOL = Path(__file__).resolve().parents[1] / "tools" / "words.py"


@pytest.fixture
def lint(tmp_path, monkeypatch):
    """The tool in a repository of its own: file and text in, exit code out."""
    spec = importlib.util.spec_from_file_location("words", TOOL)
    tool = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(tool)
    monkeypatch.chdir(tmp_path)
    subprocess.run(["git", "init", "-q"], check=True)

    def run(name, text):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
        subprocess.run(["git", "add", "-A"], check=True)
        return tool.main([])

    return run


PLANTED = [
    ("page.md", "The gear has some pla" + "y.\n", "backlash"),
    ("core.rs", "let user_" + "position = 0.0;\n", "output_..."),
    ("page.md", "It gives wa" + "y under load.\n", "compliance"),
    ("page.md", "The fast sha" + "ft turns.\n", "motor shaft"),
    ("page.html", "it stands of" + "f by 3\n", "deviates by"),
    ("unit.py", "WEIGH" + "ED = 1\n", "candidate"),
    ("unit.py", "def shown(x):\n    return x\n", "a noun or verb"),
    ("unit.py", "def f(said):\n    return said\n", "a noun or verb"),
]


@pytest.mark.parametrize(("name", "text", "better"), PLANTED)
def test_a_planted_word_is_found_with_its_place(lint, capsys, name, text, better):
    code = lint(name, text)
    out = capsys.readouterr().out
    assert code == bool(better)
    assert (f"{name}:1: " in out and better in out) if better else not out


def test_quotations_and_the_changelog_are_left_alone(lint, capsys):
    word = "pla" + "y"
    assert lint("CHANGELOG.md", f"{word} is called backlash\n") == 0
    assert lint("page.md", f"> the mechanical {word} <!-- quoted: -->\n") == 0
    assert lint("other.md", "display, player and replay are other words\n") == 0
    assert not capsys.readouterr().out
