"""``elevon demo``: a unit's life and its end as predicted; or a bench with hidden values."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli import interrupt
from elevon.cli.output import answer, print_table, progress_bar, say
from elevon.cli.shell import Answer, command
from elevon.option import Option

if TYPE_CHECKING:
    from elevon.demo.life.results import LifeDemo
    from elevon.demo.run import Demo
    from elevon.report.checks import Check

_PARTS = ("life", "bench")
app = typer.Typer(rich_markup_mode=None)


@command(app)
def demo(
    *,
    out: Annotated[Path, Option(metavar="DIR")] = Path("out/demo"),
    which: Annotated[str, Option("--part")] = "life",
    seed: int = 0,
    force: bool = False,
) -> Answer:
    """Let a unit live and predict its end from bench logs; one page tells the story.

    Interrupted, it goes on where it was when the same command is given again.

    Parameters
    ----------
    out : path
        Folder for reports and logs.
    which : str
        life: a unit wears, is inspected, diagnosed, its end predicted. bench: a published table,
        then a bench's hidden values from its logs.
    """
    from elevon.errors import unknown
    from elevon.report.checks import all_passed

    if which not in _PARTS:
        raise unknown("part", which, _PARTS, "--part")
    if which == "bench":
        return _bench(out, seed, force=force)
    from elevon.demo.life.run import run_life

    with interrupt.telling(lambda: _story(out)), progress_bar("demo") as advance:
        result = run_life(out, seed=seed, force=force, progress=advance)
    code = 0 if all_passed(result.checks) else 1
    return Answer(result.to_dict(), lambda: _print_life(result), code)


def _print_life(result: LifeDemo) -> None:
    from elevon.demo.life.page import lead

    answer(lead(result))
    values = result.to_dict()
    rows = [
        (f"{r['usage']:.0f}", " + ".join(r["faults"]) or r["status"], f"{r['rul']:.0f}",
         f"{r['low']:.0f} to {r['high']:.0f}", f"{r['truth']:.0f}")
        for r in values["rows"]
    ]  # fmt: skip
    print_table(("flights", "diagnosis", "remain", "90 %", "truth"), rows)
    _print_steps(values["steps"], result.seconds)
    _print_checks(result.checks)
    say(f"report: {result.folder / 'report.html'}")


def _bench(out: Path, seed: int, *, force: bool) -> Answer:
    """Recompute a published table, then find a bench's hidden values from its logs.

    Interrupted, it goes on where it was when the same command is given again.
    """
    from elevon.demo.run import run_demo
    from elevon.report.checks import all_passed

    with interrupt.telling(lambda: _story(out)), progress_bar("demo") as advance:
        result = run_demo(out, seed=seed, force=force, progress=advance)
    code = 0 if all_passed(result.checks) else 1
    return Answer(result.to_dict(), lambda: _print(result), code)


def _story(out: Path) -> str:
    from elevon.demo.finished import finished_steps

    done = finished_steps(out.expanduser())
    if not done:
        return "no step is finished; give the same command again to start over"
    return f"kept in {out}: {', '.join(done)}; give the same command again to go on"


def _row(row: dict[str, Any], result: Demo) -> tuple[str, ...]:
    """Return a row of the table, in the file's unit, with the digits of the interval."""
    from elevon.number_text import estimate_texts, written_unit
    from elevon.units import to_display

    unit = written_unit(result.base, row["path"])
    interval = (row["low"], row["high"])
    value, low, high, unit_text = estimate_texts(row["value"], interval, row["unit"], unit)
    before, truth = (
        "" if row[name] is None else f"{float(to_display(row[name], unit_text or '1')):.5g}"
        for name in ("before", "truth")
    )
    return row["path"], before, truth, value, f"{low} to {high}", unit_text


def _print(result: Demo) -> None:
    _print_checks(result.checks)
    rows = [_row(row, result) for row in result.rows()]
    columns = ("parameter", "before", "hidden truth", "estimate", "90 % interval", "unit")
    print_table(columns, rows, title="hidden values recovered from three logs")
    _print_steps([step.to_dict() for step in result.steps], result.seconds)
    say(f"report: {result.folder / 'report.html'}")


def _print_steps(steps: Sequence[Mapping[str, Any]], seconds: float) -> None:
    rows = [(step["name"], f"{step['seconds']:.1f}", step["kept"]) for step in steps]
    print_table(("step", "s", ""), [*rows, ("all", f"{seconds:.1f}", "")])


def _print_checks(checks: Sequence[Check]) -> None:
    failed = [check for check in checks if not check.passed]
    answer(f"{len(checks) - len(failed)} of {len(checks)} checks passed")
    for check in failed:
        answer(f"failed: {check.name}: {check.value:.4g} {check.unit}, limit {check.limit:.4g}")
