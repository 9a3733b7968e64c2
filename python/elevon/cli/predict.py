"""`elevon predict`: how long a unit will do what it must."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import typer

from elevon.cli import common
from elevon.cli.output import answer, listed, print_table, progress_bar
from elevon.cli.shell import Answer, command

if TYPE_CHECKING:
    from elevon.prognose.answer import Prognosis

app = typer.Typer(rich_markup_mode=None)


@command(app, "strict", "details", "report", "force")
def predict(
    history: Path,
    *,
    actuator: str,
    mission: Path,
    survive: list[float] | None = None,
    particles: int = 2000,
    snapshots: bool = False,
    settings: list[str] | None = None,
    seed: int = 0,
) -> Answer:
    """Predict the remaining useful life of the unit whose inspections are in HISTORY."""
    from elevon.prognose.door import predict as run

    model = common.read_actuator(actuator, settings)
    with progress_bar("model runs") as advance:
        result = run(
            history, model, mission, survive=survive or (), particles=particles,
            snapshots=snapshots, seed=seed, progress=advance,
        )  # fmt: skip
    return Answer(result, lambda: _print(result), page=result.report)


def _print(result: Prognosis) -> None:
    from elevon.prognose.page import severity_unit
    from elevon.units import to_display

    answer(result.headline)
    print_table(
        (f"next N {result.unit}", "probability of surviving"),
        [(f"{n:g}", f"{p:.3f}") for n, p in result.p_survive],
    )
    rows = []
    for item in result.reserve:
        unit = severity_unit(item.unit)
        now, end = (f"{to_display(getattr(item, key), unit):.4g}" for key in ("value", "threshold"))
        rows.append((item.name, now, end, unit, f"{result.first[item.name]:.3f}"))
    print_table(("requirement", "now", "life ends at", "unit", "fails first"), rows)
    listed(result.findings)
