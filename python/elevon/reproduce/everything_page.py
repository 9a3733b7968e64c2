"""The page of all published cases."""

from __future__ import annotations

from typing import TYPE_CHECKING
from urllib.parse import quote

from elevon.report import Report, ReportTable
from elevon.reproduce.catalogue import PublishedWork, works
from elevon.reproduce.provenance import provenance

if TYPE_CHECKING:
    from elevon.reproduce.everything import EveryCase, IndexRow

_COLUMNS = ("item", "case", "check", "ours", "theirs", "limit", "verdict", "reason", "definition")


def index_page(result: EveryCase, date: str | None) -> Report:
    """Return the page: rows by work, then every table and figure with what makes it."""
    counts = {name: result.count(name) for name in ("pass", "fail", "not run")}
    lead = ", ".join(f"{number} {name}" for name, number in counts.items())
    report = Report("Published results, recomputed", f"Checks: {lead}.", date=date)
    for name, number in counts.items():
        report.fact(name, str(number))
    wrong = [[row.case, row.check, row.verdict, row.reason] for row in result.rows
             if row.verdict != "pass"]  # fmt: skip
    if wrong:
        columns = ("case", "check", "verdict", "reason")
        report.section("Rows that do not pass").table(ReportTable(columns, wrong))
    for work in works():
        rows = [row for row in result.rows if row.paper == work.name]
        if rows:
            report.section(work.title).table(_table(rows))
    for work in works():
        report.section(f"Tables and figures: {work.title}").table(_items(work))
    command = f"elevon reproduce --all --seed {result.seed} --out DIR"
    report.provenance(provenance(command, Seed=result.seed))
    return report


def _table(rows: list[IndexRow]) -> ReportTable:
    cells = [[_cell(row, name) for name in _COLUMNS] for row in rows]
    marked = frozenset(n for n, row in enumerate(rows) if row.verdict == "fail")
    return ReportTable(_COLUMNS, cells, marked=marked, folded=_counts(rows))


def _counts(rows: list[IndexRow]) -> str:
    verdicts = [row.verdict for row in rows]
    return ", ".join(f"{verdicts.count(name)} {name}" for name in dict.fromkeys(verdicts))


def _cell(row: IndexRow, name: str) -> object:
    from markupsafe import Markup, escape

    value = getattr(row, name)
    if name == "case" and row.link:
        return Markup('<a href="{}">{}</a>').format(quote(row.link), escape(value))
    return value


def _items(work: PublishedWork) -> ReportTable:
    rows = [[i.name, i.text, "; ".join(i.commands), i.why] for i in work.items]
    made = sum(bool(item.commands) for item in work.items)
    folded = f"{made} of {len(rows)} are made by a command"
    return ReportTable(("item", "what it shows", "command", "why none, or what differs"), rows,
                       folded=folded)  # fmt: skip
