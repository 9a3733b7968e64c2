"""The pages of published cases: what a description asks for is there."""

import tomllib
from importlib.resources import files

import pytest

from elevon.report.described import _environment, described

PAGES = sorted(
    item.name.removesuffix(".toml")
    for item in (files("elevon_cases") / "pages").iterdir()
    if item.name.endswith(".toml")
)
EXPRESSIONS = ("each", "when", "rows", "marked", "draw")
KNOWN = {
    "part": {"section", "heading", "text", "points", "figure", "table", "each", "when"},
    "table": {"rows", "columns", "caption", "folded", "digits", "marked", "each", "when"},
    "figure": {"caption", "size", "grid", "options", "axes", "draw", "each", "when"},
    "axes": {"calls", "each", "when"},
}


def strings(entry):
    """Yield each expression and each text of an entry, with which it is."""
    for key, item in entry.items():
        if key in EXPRESSIONS and isinstance(item, str):
            yield True, item
        elif key == "at":
            yield from ((True, one) for one in item)
        elif key == "columns":
            yield from ((True, one[1]) for one in item if one[1])
        elif isinstance(item, str):
            yield False, item


def entries(kind, entry):
    """Yield each entry of a description, with its kind."""
    yield kind, entry
    for inner in ("part", "figure", "table", "axes", "calls"):
        for item in entry.get(inner, ()):
            yield from entries(inner, item)


@pytest.mark.parametrize("name", PAGES)
def test_each_text_and_expression_is_one(name):
    page = tomllib.loads((files("elevon_cases") / f"pages/{name}.toml").read_text("utf-8"))
    for kind, entry in entries("page", page):
        assert set(entry) <= KNOWN.get(kind, set(entry)), kind
        for expression, text in strings(entry):
            if expression:
                _environment().compile_expression(text)
            else:
                _environment().from_string(text)


def test_a_description_is_filled_from_a_result():
    page = {
        "title": "{{ n }} rows",
        "part": [
            {"section": "{{ item }}", "each": ["a", "b"], "when": "item != 'b'"},
            {"table": [{"rows": "rows", "columns": [["x", "x", ".2f"], ["twice", "2 * row.x"]],
                        "marked": "row.x > 1"}]},
        ],
    }  # fmt: skip
    report = described(page, {"n": 2, "rows": [{"x": 1.0}, {"x": 2.0}]})
    (section,) = report.sections
    (table,) = (item["table"] for item in section.items)
    assert (report.title, section.title) == ("2 rows", "a")
    assert table.rows == [[1.0, 2.0], [2.0, 4.0]]
    assert (table.formats, table.marked) == ([".2f", ""], {1})


def test_what_is_not_there_is_refused():
    from jinja2 import UndefinedError

    with pytest.raises(UndefinedError):
        described({"title": "{{ missing }}", "part": []}, {})
    with pytest.raises(UndefinedError):
        described({"title": "", "part": [{"section": "", "when": "missing.x"}]}, {})
