"""``elevon demo``: a published table, then a bench with hidden values recovered from its logs."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli import interrupt
from elevon.cli.common import ForceOption, JsonOption, SeedOption
from elevon.cli.output import print_json, print_table, progress_bar, say

if TYPE_CHECKING:
    from elevon.demo.run import Demo

app = typer.Typer(rich_markup_mode=None)


@app.command()
def demo(
    *,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for reports and logs.")] = Path(
        "out/demo"
    ),
    seed: SeedOption = 0,
    force: ForceOption = False,
    json: JsonOption = False,
) -> int:
    """Recompute a published table, then find a bench's hidden values from its logs.

    An interrupted demonstration goes on where it was when the same command is given again.
    """
    from elevon.demo.run import run_demo
    from elevon.report.checks import all_passed

    with interrupt.telling(lambda: _story(out)), progress_bar("demo") as advance:
        result = run_demo(out, seed=seed, force=force, progress=advance)
    if json:
        print_json(result.to_dict())
    else:
        _print(result)
    return 0 if all_passed(result.checks) else 1


def _story(out: Path) -> str:
    from elevon.demo.finished import finished_steps

    done = finished_steps(out.expanduser())
    if not done:
        return "no step is finished; give the same command again to start over"
    return f"kept in {out}: {', '.join(done)}; give the same command again to go on"


def _row(row: dict[str, Any], result: Demo) -> tuple[str, ...]:
    """Return a row of the table, in the unit of the set and with the digits of the interval."""
    from elevon.cli.numbers import estimate_texts, written_unit
    from elevon.units import to_display

    unit = written_unit(result.base, row["path"])
    interval = (row["low"], row["high"])
    value, low, high, shown = estimate_texts(row["value"], interval, row["unit"], unit)
    before, truth = (
        "" if row[name] is None else f"{float(to_display(row[name], shown or '1')):.5g}"
        for name in ("before", "truth")
    )
    return row["path"], before, truth, value, f"{low} to {high}", shown


def _print(result: Demo) -> None:
    rows = [_row(row, result) for row in result.rows()]
    columns = ("parameter", "before", "hidden truth", "estimate", "90 % interval", "unit")
    print_table(columns, rows, title="hidden values recovered from three logs")
    steps = [(step.name, f"{step.seconds:.1f}", step.reused) for step in result.steps]
    print_table(("step", "s", ""), [*steps, ("all", f"{result.seconds:.1f}", "")])
    checks = result.checks
    failed = [check for check in checks if not check.passed]
    for check in failed:
        say(f"failed: {check.name}: {check.value:.4g} {check.unit}, limit {check.limit:.4g}")
    say(f"{len(checks) - len(failed)} of {len(checks)} checks passed")
    say(f"report: {result.folder / 'report.html'}")
