"""Names say what the field says; words that say nothing of a value do not come back as names."""

import ast
from pathlib import Path

import pytest

PACKAGE = Path(__file__).resolve().parents[2] / "python" / "elevon"
BANNED = {"found", "kept", "taking", "tamed", "pieces", "told", "astray", "lean", "quench"}
MODULES = sorted(PACKAGE.rglob("*.py"))


def _names(tree):
    """Yield every name that a module gives: of variables, arguments, functions, classes."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Store):
            yield node.id if isinstance(node, ast.Name) else node.attr, node.lineno
        elif isinstance(node, ast.arg):
            yield node.arg, node.lineno
        elif isinstance(node, ast.FunctionDef | ast.ClassDef):
            yield node.name, node.lineno


def banned(source):
    """Return the places of banned names: a name counts by its words."""
    names = _names(ast.parse(source))
    return [(line, name) for name, line in names if BANNED & set(name.lower().split("_"))]


@pytest.mark.parametrize("path", MODULES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_no_module_gives_a_banned_name(path):
    assert not BANNED & set(path.stem.split("_"))
    assert banned(path.read_text(encoding="utf-8")) == []


def test_a_banned_name_is_seen_wherever_it_is_given():
    source = "def f(kept):\n    found_at = 1\nclass Lean: pass\nx.told = [pieces for pieces in y]\n"
    assert {name for _, name in banned(source)} == {"kept", "found_at", "Lean", "told", "pieces"}
