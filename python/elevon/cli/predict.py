"""`elevon predict`: how long a unit will do what it must."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from elevon.cli.common import (
    ActuatorOption,
    DetailsOption,
    ForceOption,
    JsonOption,
    SeedOption,
    SetOption,
    StrictOption,
    check_outputs,
    read_actuator,
)
from elevon.cli.output import answer, listed, print_json, print_table, progress_bar, say

if TYPE_CHECKING:
    from elevon.prognose.answer import Prognosis

app = typer.Typer(rich_markup_mode=None)


@app.command()
def predict(
    history: Annotated[
        Path, typer.Argument(metavar="HISTORY", help="Folder of dated diagnoses or logs (JSON).")
    ],
    *,
    actuator: ActuatorOption,
    mission: Annotated[Path, typer.Option("--mission", metavar="FILE", help="Mission (TOML).")],
    survive: Annotated[
        list[float] | None,
        typer.Option("--survive", metavar="N", help="Probability of the next N; repeatable."),
    ] = None,
    particles: Annotated[
        int, typer.Option("--particles", min=100, max=100_000, help="Of the filter.")
    ] = 2000,
    snapshots: Annotated[
        bool, typer.Option("--snapshots", help="Correct the tables by runs at high fidelity.")
    ] = False,
    settings: SetOption = None,
    report: Annotated[Path | None, typer.Option("--report", help="HTML page to write.")] = None,
    seed: SeedOption = 0,
    strict: StrictOption = False,  # noqa: ARG001 - its callback does the work
    details: DetailsOption = False,  # noqa: ARG001 - its callback does the work
    json: JsonOption = False,
    force: ForceOption = False,
) -> int:
    """Predict the remaining useful life of the unit whose inspections are in HISTORY."""
    from elevon.prognose.door import predict as run

    check_outputs([report], force=force)
    model = read_actuator(actuator, settings)
    with progress_bar("model runs") as advance:
        result = run(
            history, model, mission, survive=survive or (), particles=particles,
            snapshots=snapshots, seed=seed, progress=advance,
        )  # fmt: skip
    if report is not None:
        say(f"report: {result.report().save(report, force=force)}")
    if json:
        print_json(result.to_dict(stored=False))
        return 0
    _print(result)
    return 0


def _print(result: Prognosis) -> None:
    from elevon.prognose.figures import severity_unit
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
