"""Names say what the field says; words that say nothing of a value do not come back as names."""

from tests.contract import source
from tests.contract.source import PACKAGE

BANNED = {"found", "kept", "taking", "tamed", "pieces", "told", "astray", "lean", "quench"}


def banned(module):
    """Return the places of banned names: a name counts by its words."""
    return [(line, name) for name, line in module.names if BANNED & set(name.lower().split("_"))]


def test_no_module_gives_a_banned_name():
    for path in source.MODULES:
        place = path.relative_to(PACKAGE)
        assert not BANNED & set(path.stem.split("_")), place
        assert banned(source.of(path)) == [], place


def test_a_banned_name_is_seen_wherever_it_is_given():
    text = "def f(kept):\n    found_at = 1\nclass Lean: pass\nx.told = [pieces for pieces in y]\n"
    assert {name for _, name in banned(source.parsed(text))} == {
        "kept",
        "found_at",
        "Lean",
        "told",
        "pieces",
    }
