"""Pages from a description: what it asks for is there."""

import pytest

from elevon.report.described import described


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
