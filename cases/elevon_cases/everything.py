"""Every published case in one folder: one index of rows, ours beside theirs."""

from __future__ import annotations

import hashlib
import json
import time
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote

from elevon.errors import ElevonError, Interrupted
from elevon.files import check_output, write_text
from elevon.progress import Progress, part
from elevon.report import Report, ReportTable, provenance
from elevon.report.checks import Check
from elevon.results import finite
from elevon.worklog import Item, finished, sweep
from elevon_cases.catalogue import (
    KINDS,
    SELF_CONSISTENCY,
    Judgement,
    Published,
    PublishedWork,
    works,
)

PASS, FAIL, NOT_RUN = "pass", "fail", "not_run"
_INDEX = ("index.html", "index.json")
_NOTED = ("passed", "kind", "basis")
"""What the JSON form of a check says beside the check itself."""
UNEXPLAINED = "no reason is known"


@dataclass(frozen=True, slots=True)
class IndexRow:
    """One check of one case beside what is printed.

    Attributes
    ----------
    paper, item : str
        The work; its table or figure.
    case, check : str
        The command; the check's name.
    kind, basis : str
        What it is held against, as `Judgement` has it; empty where the catalogue has no such check.
    ours : float or None
        The number found; None where the case was not run.
    unit : str
        Its unit; empty for a plain number.
    theirs : str
        What is printed, with its unit; empty where nothing is.
    value : float or None
        The check's value, such as the difference of both; None where the case was not run.
    limit : str
        What the check's value is held to.
    verdict : str
        ``pass``, ``fail`` or ``not_run``.
    reason : str
        Why, where it is not ``pass``.
    definition : str
        What the value is and where the limit comes from.
    link : str
        Page of the case within the folder; empty: none.
    """

    paper: str
    item: str
    case: str
    check: str
    kind: str
    basis: str
    ours: float | None
    unit: str
    theirs: str
    value: float | None
    limit: str
    verdict: str
    reason: str
    definition: str
    link: str


@dataclass(frozen=True, slots=True)
class CaseRun:
    """A case that can be run.

    Attributes
    ----------
    record : Published
        What it recomputes.
    work : callable
        Takes a folder and a progress, writes its files there, returns its JSON object.
    absent : str
        Why it cannot be run here; empty: it can.
    """

    record: Published
    work: Callable[[Path, Progress | None], Mapping[str, Any]]
    absent: str = ""


@dataclass(frozen=True, slots=True)
class EveryCase:
    """Rows of every published case; processor time [s] of each that ran."""

    rows: tuple[IndexRow, ...]
    checks: tuple[Check, ...]
    seed: int
    seconds: Mapping[str, float] = field(default_factory=dict)

    @property
    def status(self) -> str:
        """``fail`` where a row is, else ``not_run`` where one is: neither is a pass."""
        found = {row.verdict for row in self.rows}
        return next((verdict for verdict in (FAIL, NOT_RUN) if verdict in found), PASS)

    def counts(self) -> dict[str, dict[str, int]]:
        """Return how many rows of each kind have each verdict; kinds are never added."""
        found = Counter((row.kind, row.verdict) for row in self.rows)
        return {
            kind: {verdict: found[kind, verdict] for verdict in (PASS, FAIL, NOT_RUN)}
            for kind in KINDS
            if any(row.kind == kind for row in self.rows)
        }

    def to_dict(self) -> dict[str, object]:
        """Return the JSON object: status, checks, rows, counts by kind and verdict."""
        import elevon

        return {
            "status": self.status,
            "checks": [check.to_dict() for check in self.checks],
            "counts": self.counts(),
            "rows": [asdict(row) for row in self.rows],
            "cpu_s": dict(self.seconds),
            "seed": self.seed,
            "version": elevon.__version__,
        }


def reproduce_everything(
    cases: Sequence[CaseRun],
    folder: Path,
    *,
    seed: int,
    key: str,
    force: bool = False,
    date: str | None = None,
    progress: Progress | None = None,
) -> EveryCase:
    """Run every case and write ``index.json`` and ``index.html``; what is finished is kept.

    Parameters
    ----------
    cases : sequence of CaseRun
        In the order of the index.
    folder : Path
        Each case has its own below it.
    seed : int
        As the cases were given it.
    key : str
        Tells this work from any other: a folder of other work is not gone on with, nor is one of
        another package (`package_digest`).
    force : bool
        Whether the index of other work may be replaced.
    date : str, optional
        Printed on the page.
    progress : callable, optional
        Takes the done fraction.

    Raises
    ------
    OutputExistsError
        The folder has an index of other work.
    BusyError, OutputError
        As `elevon.worklog.finished`.
    """
    key = f"{key} package {package_digest()}"
    if not _same_work(folder, key):
        for name in _INDEX:
            check_output(folder / name, force=force)
    total = sum(case.record.seconds for case in cases)
    done, rows, checks, seconds = 0.0, [], [], {}
    with finished(folder, key) as log:
        assert log is not None
        sweep(folder)
        for case in cases:
            share = part(progress, done / total, (done + case.record.seconds) / total)
            more = _run(case, folder, log, share)
            done += case.record.seconds
            rows += more[0]
            checks += more[1]
            if (item := log.items.get(case.record.name)) is not None:
                seconds[case.record.name] = item.data["cpu_s"]
            if progress is not None:
                progress(min(done / total, 1.0))
        result = EveryCase(tuple(rows), tuple(checks), seed, seconds)
        text = json.dumps(finite(result.to_dict()), allow_nan=False, indent=1)

        write_text(folder / "index.json", text + "\n", force=True)
        index_page(result, date).save(folder / "index.html", force=True, links=False)
    return result


@cache
def package_digest() -> str:
    """Return digits of every file of Elevon and of the cases, on any of which an answer depends."""
    import elevon

    content = hashlib.sha256()
    for root in (Path(str(elevon.__file__)).parent, Path(__file__).parent):
        for path in sorted(root.rglob("*")):
            if path.is_file() and "__pycache__" not in path.parts:
                content.update(path.relative_to(root).as_posix().encode() + b"\0")
                with path.open("rb") as stream:
                    content.update(hashlib.file_digest(stream, "sha256").digest())
    return content.hexdigest()[:16]


def _same_work(folder: Path, key: str) -> bool:
    """Whether a folder's log is that of this work."""
    from elevon import __version__
    from elevon.worklog import WorkLog

    log = WorkLog.read(folder / "finished.log") if folder.is_dir() else None
    return log is not None and log.key == f"{key} {__version__}"


def _run(
    case: CaseRun, folder: Path, log: Any, progress: Progress | None
) -> tuple[list[IndexRow], list[Check]]:
    """Run a case, or take what is finished; return its rows and its checks."""
    record = case.record
    if case.absent:
        return rows_without(record, NOT_RUN, case.absent), []
    item: Item | None = log.intact(record.name)
    if item is None:
        place = folder / record.name
        begin = time.process_time()
        try:
            values = case.work(place, progress)
        except Interrupted:
            raise
        except ElevonError as error:
            return rows_without(record, FAIL, str(error)), []
        files = [path for path in (place / "report.html", place / "rows.csv") if path.is_file()]
        spent = round(time.process_time() - begin, 1)
        item = log.note(record.name, files, checks=finite(values["checks"]), cpu_s=spent)
    checks = [_check(entry) for entry in item.data["checks"]]
    page = f"{record.name}/report.html"
    link = page if page in item.files else ""
    named = [replace(check, name=f"{record.name}: {check.name}") for check in checks]
    return rows_of(record, checks, link), named


def _check(entry: Mapping[str, Any]) -> Check:
    """Return a check as it was kept; a value that was not finite is null there."""
    known = {name: value for name, value in entry.items() if name not in _NOTED}
    value = entry["value"]
    return Check(**known | {"value": float("nan") if value is None else value})


def rows_of(record: Published, checks: Sequence[Check], link: str = "") -> list[IndexRow]:
    """Return the rows of a case that ran: its checks, and what it was to check and did not."""
    rows = []
    for check in checks:
        rows.append(_row(record, check, record.judgement(check.name), link))
    for judged in record.checks:
        if not any(judged.judges(check.name) for check in checks):
            rows.append(_without(record, judged, NOT_RUN, "the case made no such check", link))
    return rows


def rows_without(record: Published, verdict: str, reason: str) -> list[IndexRow]:
    """Return the rows of a case that has no result."""
    return [_without(record, judged, verdict, reason, "") for judged in record.checks]


def _row(record: Published, check: Check, judged: Judgement, link: str) -> IndexRow:
    paper, _, item = judged.item.partition(" ")
    sign, unit = (">=" if check.at_least else "<="), f" {check.unit}".removesuffix(" 1").rstrip()
    beyond = "below" if check.at_least else "above"
    why = f"{check.value:.5g} is {beyond} {check.limit:.5g}{unit}"
    reason = "" if check.passed else f"{why}: {judged.known or UNEXPLAINED}"
    return IndexRow(
        paper=paper,
        item=item,
        case=record.name,
        check=check.name,
        kind=judged.kind,
        basis=judged.basis,
        ours=check.value if check.ours is None else check.ours,
        unit=(check.unit if check.ours_unit is None else check.ours_unit).removesuffix("1"),
        theirs=judged.theirs,
        value=check.value,
        limit=f"{sign} {check.limit:.5g}{unit}",
        verdict=PASS if check.passed else FAIL,
        reason=reason,
        definition=judged.definition,
        link=link,
    )


def _without(
    record: Published, judged: Judgement, verdict: str, reason: str, link: str
) -> IndexRow:
    paper, _, item = judged.item.partition(" ")
    return IndexRow(paper, item, record.name, judged.check, judged.kind, judged.basis, None, "",
                    judged.theirs, None, "", verdict, reason, judged.definition, link)  # fmt: skip


_COLUMNS = (
    "item",
    "case",
    "check",
    "kind",
    "basis",
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
    report = Report(
        "Published results, recomputed",
        "A check is held against what a work prints, a closed form, another program, a real log, "
        "or only against ourselves; these are counted apart.",
        date=date,
    )
    for kind, counts in result.counts().items():
        report.fact(kind.replace("_", " "), counted(counts), KINDS[kind])
    _failed(report, [row for row in result.rows if row.verdict == FAIL])
    _not_run(report, [row for row in result.rows if row.verdict == NOT_RUN])
    for apart in (False, True):
        for work in works():
            mine = [row for row in result.rows if row.paper == work.name]
            rows = [row for row in mine if apart == (row.kind == SELF_CONSISTENCY)]
            if rows:
                title = f"Self-consistency: {work.title}" if apart else work.title
                report.section(title).table(_table(rows))
    for work in works():
        report.section(f"Tables and figures: {work.title}").table(_items(work))
    command = f"elevon reproduce --all --seed {result.seed} --out DIR"
    report.provenance(provenance(command, Seed=result.seed))
    return report


def counted(counts: Mapping[str, int]) -> str:
    """Return counts by verdict in words, those that are there."""
    return ", ".join(f"{number} {verdict}" for verdict, number in counts.items() if number)


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
    made = [item for item in work.items if item.commands]
    compared = sum(item.compared for item in made)
    folded = (
        f"{compared} of {len(rows)} made and compared, {len(made) - compared} made and not "
        f"compared, {len(rows) - len(made)} not made"
    )
    return ReportTable(("item", "what it shows", "command", "why none, or what differs"), rows,
                       folded=folded)  # fmt: skip
