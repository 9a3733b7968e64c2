"""`elevon predict`: how long a unit will do what it must."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from elevon.cli.common import (
    ActuatorOption,
    ForceOption,
    JsonOption,
    SeedOption,
    SetOption,
    StrictOption,
    check_outputs,
    read_actuator,
)
from elevon.cli.output import print_json, print_table, progress_bar, say
from elevon.errors import InputError

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
    json: JsonOption = False,
    force: ForceOption = False,
) -> int:
    """Predict the remaining useful life of the unit whose inspections are in HISTORY."""
    from elevon.prognose.history import diagnosed, read_history
    from elevon.prognose.mission import Mission
    from elevon.prognose.predict import predict as run
    from elevon.prognose.respond import respond

    check_outputs([report], force=force)
    if any(not n >= 0.0 for n in survive or ()):
        raise InputError("--survive: N must be 0 or more")
    model = read_actuator(actuator, settings)
    flown = Mission.load(mission)
    entries = read_history(history, unit=flown.unit)
    with progress_bar("model runs") as advance:
        tables = respond(model, flown, snapshots=snapshots, progress=advance)
    if any(entry.diagnosis is None for entry in entries.entries):
        with progress_bar("diagnoses") as advance:
            entries = diagnosed(entries, model, progress=advance)
    seen = entries.inspections(tables.laws, tables.units_by_name)
    result = run(
        seen, model, flown, response=tables, particles=particles, seed=seed, serial=entries.serial
    )
    if report is not None:
        from elevon.prognose.page import prognosis_page

        page = prognosis_page(result, seen, tables.laws, actuator=model.name)
        say(f"report: {page.save(report, force=force)}")
    if json:
        print_json(result.to_dict(survive or ()))
        return 0
    _print(result, survive or ())
    return 0


def _print(result: Prognosis, horizons: list[float] | tuple[float, ...]) -> None:
    from elevon.prognose.answer import survival
    from elevon.prognose.figures import severity_unit
    from elevon.prognose.page import sentence
    from elevon.units import to_display

    say(sentence(result))
    print_table(
        (f"next N {result.unit}", "probability of surviving"),
        [(f"{n:g}", f"{p:.3f}") for n, p in survival(result, horizons)],
    )
    rows = []
    for item in result.reserve:
        unit = severity_unit(item["unit"])
        now, end = (f"{to_display(item[key], unit):.4g}" for key in ("value", "threshold"))
        rows.append((item["name"], now, end, unit, f"{result.first[item['name']]:.3f}"))
    print_table(("requirement", "now", "life ends at", "unit", "fails first"), rows)
    for text in result.findings:
        say(text)
