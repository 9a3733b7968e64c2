"""`elevon reproduce`: recompute a published table or figure, with checks."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli import interrupt
from elevon.cli.groups import NamingGroup, UsageError, group
from elevon.cli.output import answer, print_json, print_table, progress_bar, say
from elevon.cli.shell import styled
from elevon.option import Option
from elevon_cases.case import PublishedCase, add_command, compute
from elevon_cases.cases import CASES

if TYPE_CHECKING:
    from elevon_cases.everything import CaseRun


#: What judges Elevon itself stands outside the package.
STUDIES = (
    "benchmark-set",
    "controllers",
    "diagnosis-limits",
    "diagnosis-optimisers",
    "fault-limits",
    "independent",
    "inspection-error",
    "learned",
    "learned-campaign",
    "lives",
    "monitor-delay",
    "monitor-hours",
    "next-test",
    "prognosis",
)


class _Group(NamingGroup):
    """Published cases; the name of a study is answered with where it is."""

    example = "--all --out all"

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:
        """Return the command of the first argument, or raise `UsageError`."""
        if args and args[0] in STUDIES:
            raise UsageError(
                f"'{args[0]}' is no published case but a study of Elevon itself: run "
                f"python -m studies {args[0]} in a checkout of the sources",
                ctx,
            )
        return super().resolve_command(ctx, args)


_Folder = Annotated[Path | None, Option(metavar="DIR")]


def reproduce_all(
    context: typer.Context,
    *,
    everything: Annotated[bool, Option("--all")] = False,
    out: _Folder = None,
    only: Annotated[list[str] | None, Option(metavar="CASE")] = None,
    data: _Folder = None,
    seed: int = 0,
    date: str | None = None,
    force: bool = False,
    as_json: bool = False,
) -> int:
    """Recompute a published table or figure; exit code 1 when a check fails.

    Parameters
    ----------
    everything : bool
        Every published case, one index.
    out : path
        With --all: folder of index and cases.
    only : list of str
        With --all: only this one; repeatable.
    data : path
        With --all: the foreign data, a folder for each case of its name; else not run.
    seed : int
        With --all: seed of every random number.
    date : str
        With --all: date on the index.
    force : bool
        With --all: replace another index.
    as_json : bool
        With --all: print one JSON object.
    """
    case = context.invoked_subcommand
    if case is not None:
        if everything:
            raise UsageError(f"--all runs every case: leave out '{case}'")
        if (
            only
            or out is not None
            or data is not None
            or date is not None
            or force
            or as_json
            or seed
        ):
            raise UsageError(f"options of one case stand behind its name: {case} --out DIR")
        return 0
    if not everything:
        answer(context.get_help())
        return 0
    if out is None:
        raise UsageError("--all needs --out DIR: each case writes its page there")
    return _reproduce(out, only or (), data, seed, date, force=force, as_json=as_json)


def _reproduce(
    out: Path,
    only: Sequence[str],
    data: Path | None,
    seed: int,
    date: str | None,
    *,
    force: bool,
    as_json: bool,
) -> int:
    from elevon_cases.everything import counted, reproduce_everything

    cases = case_runs(only, data, seed, date)
    key = f"reproduce --all only {sorted(only)} seed {seed} data {data} date {date}"
    with interrupt.telling(lambda: _story(out)), progress_bar("published cases") as advance:
        result = reproduce_everything(
            cases, out, seed=seed, key=key, force=force, date=date, progress=advance
        )
    say(f"index: {out / 'index.html'}")
    if as_json:
        print_json(result.to_dict())
        return int(result.status == "fail")
    counts = "; ".join(f"{kind} {counted(found)}" for kind, found in result.counts().items())
    answer(f"{result.status}: {counts}; of {len(cases)} cases")
    rows = [[row.case, row.check, row.kind, row.verdict, row.reason] for row in result.rows
            if row.verdict != "pass"]  # fmt: skip
    headings = ["case", "check", "kind", "verdict", "reason"]
    print_table(headings, rows, title="rows that do not pass")
    return int(result.status == "fail")


def case_runs(
    only: Sequence[str] = (), data: Path | None = None, seed: int = 0, date: str | None = None
) -> list[CaseRun]:
    """Return each published case as it is run with all others."""
    from elevon.errors import unknown
    from elevon_cases.everything import CaseRun

    records = {case.name: record for case in CASES if (record := case.published) is not None}
    for name in only:
        if name not in records:
            raise unknown("published case", name, records, "--only")
    runs = []
    for case in CASES:
        record = records.get(case.name)
        if record is None or (only and case.name not in only):
            continue
        given = {"data": _data_of(case.name, data, only)} if record.needs else {}
        options = case.defaults() | dict(record.options) | given | {"seed": seed, "date": date}
        missing = record.needs and given.get(record.needs.removeprefix("--")) is None
        if missing and list(only) == [case.name]:
            raise UsageError(f"{case.name} needs its data: give {record.needs}")
        absent = f"data absent: give {record.needs} FOLDER" if missing else ""
        runs.append(CaseRun(record, partial(_work, case, options), absent))
    return runs


def _data_of(name: str, data: Path | None, only: Sequence[str]) -> Path | None:
    """Return a case's part of the folder of foreign data: the folder of its name, or all of it."""
    if data is None:
        return None
    folder = data / name.removeprefix("real-")
    if folder.is_dir():
        return folder
    return data if name == "cranfield" or list(only) == [name] else None


def _work(case: PublishedCase, options: Mapping[str, Any], out: Path, progress: Any) -> Any:
    _, values = compute(case, {**options, "out": out, "force": True}, progress)
    return values


def _story(out: Path) -> str:
    from elevon.worklog import WorkLog

    log = WorkLog.read(out / "finished.log") if out.is_dir() else None
    done = 0 if log is None else len(log.items)
    return f"{done} cases are finished in {out}; the same command goes on from there"


app = group("Recompute a published table or figure; exit code 1 when a check fails.", _Group)
app.callback(invoke_without_command=True)(styled(reproduce_all))
for _case in CASES:
    add_command(app, _case, _case.example or (f"--out {_case.name}" if _case.page else "--json"))
