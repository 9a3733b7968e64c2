"""One name, one class: no two public classes of the package are called the same."""

from collections import defaultdict

from tests.contract import source
from tests.contract.source import PACKAGE


def classes(sources):
    """Return the places of each public class of some modules, by its name."""
    places = defaultdict(list)
    for place, module in sources:
        for name, line in module.classes:
            places[name].append(f"{place}:{line}")
    return places


def shared(sources):
    """Return the names that more than one class has."""
    return {name: where for name, where in classes(sources).items() if len(where) > 1}


def test_no_two_public_classes_share_a_name():
    sources = [(str(path.relative_to(PACKAGE)), source.of(path)) for path in source.MODULES]
    assert len(classes(sources)) > 100
    assert shared(sources) == {}


def test_a_name_given_twice_is_seen():
    texts = {"a.py": "class Plan: pass\nclass _Own: pass\n", "b.py": "class Plan: pass\n"}
    sources = [(name, source.parsed(text)) for name, text in texts.items()]
    assert shared(sources) == {"Plan": ["a.py:1", "b.py:1"]}
