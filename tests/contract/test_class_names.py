"""One name, one class: no two public classes of the package are called the same."""

import ast
from collections import defaultdict
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "python" / "elevon"


def classes(sources):
    """Return the places of each public class of some modules, by its name."""
    places = defaultdict(list)
    for name, source in sources:
        for node in ast.parse(source).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places[node.name].append(f"{name}:{node.lineno}")
    return places


def shared(sources):
    """Return the names that more than one class has."""
    return {name: where for name, where in classes(sources).items() if len(where) > 1}


def test_no_two_public_classes_share_a_name():
    modules = sorted(PACKAGE.rglob("*.py"))
    sources = [(str(path.relative_to(PACKAGE)), path.read_text("utf-8")) for path in modules]
    assert len(classes(sources)) > 100
    assert shared(sources) == {}


def test_a_name_given_twice_is_seen():
    sources = [("a.py", "class Plan: pass\nclass _Own: pass\n"), ("b.py", "class Plan: pass\n")]
    assert shared(sources) == {"Plan": ["a.py:1", "b.py:1"]}
