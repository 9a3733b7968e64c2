"""``elevon demo``: a unit's life and its end as predicted."""

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
    from elevon.demo.run import LifeDemo
    from elevon.report.checks import Check

app = typer.Typer(rich_markup_mode=None)


@command(app)
def demo(
    *,
    out: Annotated[Path, Option(metavar="DIR")] = Path("out/demo"),
    seed: int = 0,
    force: bool = False,
) -> Answer:
    """Let a unit live and predict its end from bench logs; one page tells the story.

    Interrupted, it goes on where it was when the same command is given again.

    Parameters
    ----------
    out : path
        Folder for reports and logs.
    """
    from elevon.demo.run import run_life
    from elevon.report.checks import all_passed

    with interrupt.telling(lambda: _story(out)), progress_bar("demo") as advance:
        result = run_life(out, seed=seed, force=force, progress=advance)
    code = 0 if all_passed(result.checks) else 1
    return Answer(result.to_dict(), lambda: _print_life(result), code)


def _print_life(result: LifeDemo) -> None:
    from elevon.demo.page import lead

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


def _story(out: Path) -> str:
    from elevon.demo.story import finished_steps

    done = finished_steps(out.expanduser())
    if not done:
        return "no step is finished; give the same command again to start over"
    return f"kept in {out}: {', '.join(done)}; give the same command again to go on"


def _print_steps(steps: Sequence[Mapping[str, Any]], seconds: float) -> None:
    rows = [(step["name"], f"{step['seconds']:.1f}", step["kept"]) for step in steps]
    print_table(("step", "s", ""), [*rows, ("all", f"{seconds:.1f}", "")])


def _print_checks(checks: Sequence[Check]) -> None:
    failed = [check for check in checks if not check.passed]
    answer(f"{len(checks) - len(failed)} of {len(checks)} checks passed")
    for check in failed:
        answer(f"failed: {check.name}: {check.value:.4g} {check.unit}, limit {check.limit:.4g}")
