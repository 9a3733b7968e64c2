"""`elevon next-inspection`: when to look at a unit again, and with which test."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from elevon.cli import common
from elevon.cli.output import answer, listed, print_table, progress_bar
from elevon.cli.shell import Answer, command
from elevon.number_text import count_text

if TYPE_CHECKING:
    from elevon.prognose.next_inspection import NextInspection

app = typer.Typer(rich_markup_mode=None)


@command(app, "strict", "details", "report", "force")
def next_inspection(
    history: Path,
    *,
    actuator: str,
    mission: Path,
    risk: float = 0.01,
    particles: int = 2000,
    settings: list[str] | None = None,
    seed: int = 0,
) -> Answer:
    """Say until when the unit in HISTORY can go unseen at a risk, and with which test to look."""
    from elevon.prognose.door import next_inspection as run

    model = common.read_actuator(actuator, settings)
    with progress_bar("model runs") as advance:
        result = run(
            history, model, mission, risk=risk, particles=particles, seed=seed, progress=advance
        )
    return Answer(result, lambda: _print(result), page=result.report)


def _print(result: NextInspection) -> None:
    answer(result.headline)
    rows = [
        (item.name, *(_use(v) for v in (item.median, item.low, item.high)))
        for item in result.assumptions
    ]
    print_table(("assumed", "median", "low", "high"), rows, title=f"remaining {result.unit}")
    listed(result.findings)


def _use(value: float | None) -> str:
    return "no end in sight" if value is None else count_text(value)
