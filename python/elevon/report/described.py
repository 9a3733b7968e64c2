"""A page from a description: its words, tables and drawings as data, filled from a result.

A description is a mapping (a TOML file) with ``title``, ``lead``, ``facts`` and a list ``part``. A
text is a Jinja template (``{{ result.seed }}``); what is marked *expression* below is a Jinja
expression without braces. Beside Jinja's own there are the filters ``where``, ``col``, ``opening``
and ``displayed``, the functions ``zip``, ``within``, ``degrees`` and ``display_unit``, and
``colours``.

A part
    ``section`` or ``heading`` (texts) begins one; ``text`` and ``points`` (lists of texts; points
    may be an expression), ``figure`` and ``table`` (lists) are added in this order, then the
    ``part`` within it. ``when``: expression, whether it is there. ``each``: expression, or a list:
    the part is repeated with ``item``, ``index`` and ``last`` (``outer``: the item around it).
    Figures, tables, axes and calls have both, too.
A table
    ``rows``: expression; ``columns``: lists of heading, field of the row or expression of ``row``,
    and the format of its numbers. Rows that are lists of cells: the field is empty. ``caption``,
    ``folded``, ``digits``, ``marked`` (expression of ``row``).
A figure
    ``caption``, ``size`` [in], ``grid``, ``options`` (of the axes' grid), and ``axes``: lists of
    calls, one after the other over the grid; or ``draw``: expression of a figure.
A call
    ``do``: a method of the axes (default ``plot``); ``at``: its positional arguments, expressions;
    every other key is an argument: a text, or a list in which a text is an expression. ``color``
    may name one of `elevon.report.figures.COLOURS`. Or ``calls``: several, repeated together.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.report.document import Report, ReportTable, Section
from elevon.report.figures import COLOURS, new_figure

if TYPE_CHECKING:
    import jinja2
    from matplotlib.figure import Figure

_Names = Mapping[str, Any]
_CONTROL = frozenset({"do", "at", "each", "when", "calls"})


def described(
    description: Mapping[str, object], names: Mapping[str, object], *, date: str | None = None
) -> Report:
    """Return the report that a description makes of named values.

    Raises
    ------
    jinja2.UndefinedError
        A text or an expression uses what is not there.
    """
    page: _Names = description
    report = Report(text(page["title"], names), text(page.get("lead", ""), names), date=date)
    for fact in page.get("facts", ()):
        report.fact(*(text(item, names) for item in fact))
    _parts(report, page, names)
    return report


def text(template: str, names: Mapping[str, object]) -> str:
    """Return a text with its values filled in."""
    return _environment().from_string(template).render(names) if "{" in template else template


def _value(expression: object, names: _Names) -> Any:
    """Return what an expression is; a list or a number stands for itself."""
    if not isinstance(expression, str):
        return expression
    return _environment().compile_expression(expression, undefined_to_none=False)(**names)


@cache
def _environment() -> jinja2.Environment:
    import jinja2

    from elevon.units import display_unit, to_display

    # Plain texts: the page escapes them.
    made = jinja2.Environment(undefined=jinja2.StrictUndefined, autoescape=False)  # noqa: S701
    made.filters |= {"where": _where, "col": _column, "opening": _opening, "displayed": to_display}
    made.globals |= {"zip": zip, "within": _within, "degrees": np.degrees}
    made.globals |= {"display_unit": display_unit, "colours": COLOURS}
    return made


def _where(rows: Iterable[object], **wanted: object) -> list[object]:
    """Rows whose fields are as given."""
    return [row for row in rows if all(_field(row, key) == want for key, want in wanted.items())]


def _opening(words: str) -> str:
    """Words as they open a sentence."""
    return words[:1].upper() + words[1:]


def _column(rows: Iterable[object], name: str) -> list[Any]:
    return [_field(row, name) for row in rows]


def _within(values: Floats, low: float, high: float) -> npt.NDArray[np.bool_]:
    """Which values lie between two others."""
    return (values > low) & (values < high)


def _field(row: Any, name: str) -> Any:
    return row[name] if isinstance(row, Mapping) else getattr(row, name)


def _repeated(entry: _Names, names: _Names) -> Iterator[_Names]:
    """Yield the names of each time that an entry is there."""
    if "each" in entry:
        items = list(_value(entry["each"], names))
        places = [
            {**names, "outer": names.get("item"), "item": item, "index": number,
             "last": number == len(items) - 1}
            for number, item in enumerate(items)
        ]  # fmt: skip
    else:
        places = [dict(names)]
    yield from (place for place in places if _value(entry.get("when", True), place))


def _parts(report: Report, entry: _Names, names: _Names) -> None:
    for part in entry.get("part", ()):
        for inside in _repeated(part, names):
            _add(report, part, inside)


def _add(report: Report, part: _Names, names: _Names) -> None:
    if "section" in part:
        report.section(text(part["section"], names))
    section = report.sections[-1]
    if "heading" in part:
        section.heading(text(part["heading"], names))
    section.text(*(text(paragraph, names) for paragraph in part.get("text", ())))
    if "points" in part:
        points = part["points"]
        section.points(
            _value(points, names)
            if isinstance(points, str)
            else [text(point, names) for point in points]
        )
    for figure in part.get("figure", ()):
        for inside in _repeated(figure, names):
            section.figure(_figure(figure, inside), text(figure["caption"], inside))
    for table in part.get("table", ()):
        for inside in _repeated(table, names):
            _table(section, table, inside)
    _parts(report, part, names)


def _table(section: Section, entry: _Names, names: _Names) -> None:
    rows = list(_value(entry["rows"], names))
    columns = entry["columns"]
    marked = entry.get("marked", False)
    section.table(
        ReportTable(
            [text(column[0], names) for column in columns],
            [_cells(row, columns, names) for row in rows],
            text(entry.get("caption", ""), names),
            digits=entry.get("digits", 5),
            marked=frozenset(
                n for n, row in enumerate(rows) if _value(marked, {**names, "row": row})
            ),
            formats=[text(column[2], names) if len(column) > 2 else "" for column in columns],
            folded=text(entry.get("folded", ""), names),
        )
    )


def _cells(row: Any, columns: Sequence[Sequence[str]], names: _Names) -> Sequence[object]:
    if len(columns[0]) < 2 or not columns[0][1]:
        return list(row)
    return [
        _field(row, cell) if cell.isidentifier() else _value(cell, {**names, "row": row})
        for _, cell, *_ in columns
    ]


def _figure(entry: _Names, names: _Names) -> Figure:
    if "draw" in entry:
        figure: Figure = _value(entry["draw"], names)
        return figure
    width, height = (_value(length, names) for length in entry.get("size", (8.0, 3.6)))
    grid = entry.get("grid", (1, 1))
    with new_figure(*grid, width=width, height=height, **entry.get("options", {})) as drawn:
        figure, axes = drawn
        places = iter(np.atleast_1d(axes).flat)
        for one in entry["axes"]:
            for inside in _repeated(one, names):
                place = next(places)
                for call in one["calls"]:
                    _call(place, call, inside)
    return figure


def _call(axes: Any, call: _Names, names: _Names) -> None:
    given = {key: item for key, item in call.items() if key not in _CONTROL}
    for inside in _repeated(call, names):
        if "calls" in call:
            for one in call["calls"]:
                _call(axes, one, inside)
            continue
        options = {key: _argument(key, item, inside) for key, item in given.items()}
        getattr(axes, call.get("do", "plot"))(
            *(_value(item, inside) for item in call.get("at", ())), **options
        )


def _argument(key: str, item: object, names: _Names) -> Any:
    if isinstance(item, list):
        return [_value(one, names) for one in item]
    if not isinstance(item, str):
        return item
    filled = text(item, names)
    return COLOURS.get(filled, filled) if key == "color" else filled
