"""The page of all published cases."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import TYPE_CHECKING
from urllib.parse import quote

from elevon.report import Report, ReportTable, provenance
from elevon.reproduce.catalogue import PublishedWork, works

if TYPE_CHECKING:
    from elevon.reproduce.everything import EveryCase, IndexRow

_COLUMNS = (
    "item",
    "case",
    "check",
    "ours",
    "unit",
    "theirs",
    "value",
    "limit",
    "verdict",
    "definition",
)


def index_page(result: EveryCase, date: str | None) -> Report:
    """Return the page: rows by work, then every table and figure with what makes it."""
    counts = {name: result.count(name) for name in ("pass", "fail", "not run")}
    lead = ", ".join(f"{number} {name}" for name, number in counts.items())
    report = Report("Published results, recomputed", f"Checks: {lead}.", date=date)
    for name, number in counts.items():
        report.fact(name, str(number))
    _failed(report, [row for row in result.rows if row.verdict == "fail"])
    _not_run(report, [row for row in result.rows if row.verdict == "not run"])
    for work in works():
        rows = [row for row in result.rows if row.paper == work.name]
        if rows:
            report.section(work.title).table(_table(rows))
    for work in works():
        report.section(f"Tables and figures: {work.title}").table(_items(work))
    command = f"elevon reproduce --all --seed {result.seed} --out DIR"
    report.provenance(provenance(command, Seed=result.seed))
    return report


def _failed(report: Report, rows: list[IndexRow]) -> None:
    columns = ("case", "check", "reason")
    cells = [[_cell(row, name) for name in columns] for row in rows]
    if cells:
        report.section("Checks that fail").table(ReportTable(columns, cells))


def _not_run(report: Report, rows: list[IndexRow]) -> None:
    """One row a case and reason: a case that did not run has one reason for all its checks."""
    counts = Counter((row.case, row.reason) for row in rows)
    cells = [[case, count, reason] for (case, reason), count in counts.items()]
    if cells:
        report.section("Checks that were not run").table(
            ReportTable(("case", "checks", "reason"), cells)
        )


def _table(rows: list[IndexRow]) -> ReportTable:
    """Every check of a work; a definition stands at the first of the checks that share it."""
    before = [None, *rows]
    rows = [
        replace(row, definition="") if last and _same(last, row) else row
        for last, row in zip(before, rows, strict=False)
    ]
    columns = [name for name in _COLUMNS if any(_cell(row, name) not in ("", None) for row in rows)]
    cells = [[_cell(row, name) for name in columns] for row in rows]
    marked = frozenset(n for n, row in enumerate(rows) if row.verdict == "fail")
    return ReportTable(columns, cells, marked=marked, folded=_counts(rows))


def _same(one: IndexRow, other: IndexRow) -> bool:
    return (one.case, one.definition) == (other.case, other.definition)


def _counts(rows: list[IndexRow]) -> str:
    verdicts = [row.verdict for row in rows]
    return ", ".join(f"{verdicts.count(name)} {name}" for name in dict.fromkeys(verdicts))


def _cell(row: IndexRow, name: str) -> object:
    from markupsafe import Markup, escape

    value = getattr(row, name)
    if name == "case" and row.link:
        return Markup('<a href="{}">{}</a>').format(quote(row.link), escape(value))
    if name == "value" and row.value == row.ours:
        return None  # it stands under "ours" already
    if name == "limit":  # the sign stays beside its number
        return value.replace("<= ", "\N{LESS-THAN OR EQUAL TO}\N{NO-BREAK SPACE}").replace(
            ">= ", "\N{GREATER-THAN OR EQUAL TO}\N{NO-BREAK SPACE}"
        )
    return value


def _items(work: PublishedWork) -> ReportTable:
    rows = [[i.name, i.text, "; ".join(i.commands), i.why] for i in work.items]
    made = sum(bool(item.commands) for item in work.items)
    folded = f"{made} of {len(rows)} are made by a command"
    return ReportTable(("item", "what it shows", "command", "why none, or what differs"), rows,
                       folded=folded)  # fmt: skip
