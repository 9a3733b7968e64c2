"""What the pages of the published cases share: colours, tables of rows, how a page ends."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce

from elevon.report import Check, Report, ReportTable, provenance
from elevon.report.figures import COLOURS
from elevon_cases.catalogue import KINDS, published

BLUE, ORANGE, GREEN, RED, VIOLET, GREY = (
    COLOURS[name] for name in ("blue", "orange", "green", "red", "violet", "grey")
)
Column = tuple[str, str | Callable[..., object]] | tuple[str, str | Callable[..., object], str]
"""Heading; field of a row (``a.b``: of its field) or function of it; format of its numbers."""


def table_of(
    rows: Iterable[object],
    columns: Sequence[Column],
    caption: str = "",
    *,
    digits: int = 5,
    folded: str = "",
    marked: Callable[..., bool] | None = None,
) -> ReportTable:
    """Return a table of rows.

    Parameters
    ----------
    rows : iterable
        Records or mappings.
    columns : sequence of Column
        What of a row is shown.
    caption, digits, folded
        As of `elevon.report.ReportTable`.
    marked : callable, optional
        Whether a row is set apart by colour.
    """
    listed = list(rows)
    return ReportTable(
        [column[0] for column in columns],
        [[_cell(row, column[1]) for column in columns] for row in listed],
        caption,
        digits=digits,
        marked=frozenset(n for n, row in enumerate(listed) if marked is not None and marked(row)),
        formats=[column[2] if len(column) > 2 else "" for column in columns],
        folded=folded,
    )


def _cell(row: object, column: str | Callable[..., object]) -> object:
    if callable(column):
        return column(row)
    if isinstance(row, Mapping):
        return row[column]
    return reduce(getattr, column.split("."), row)


def with_end(
    report: Report,
    checks: Sequence[Check],
    command: str,
    made: Mapping[str, object] | None = None,
) -> Report:
    """Return a case's report with its checks and what makes it again.

    Parameters
    ----------
    report : Report
        All but that.
    checks : sequence of Check
        Of the case.
    command : str
        Words that follow ``elevon reproduce``.
    made : mapping, optional
        What else is stated, such as the seed; empty texts are left out.
    """
    section, record = report.section("Checks"), published()[command.split(maxsplit=1)[0]]
    for kind, about in KINDS.items():
        of_kind = [check for check in checks if record.judgement(check.name).kind == kind]
        if of_kind:
            section.heading(f"Held against {about}").checks(of_kind)
    known = {name: value for name, value in (made or {}).items() if value != ""}
    report.provenance(provenance(f"elevon reproduce {command} --out DIR", **known))
    return report


def sentence(words: str) -> str:
    """Return words as they open a sentence."""
    return words[:1].upper() + words[1:]
