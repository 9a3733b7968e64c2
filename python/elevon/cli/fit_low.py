"""`elevon fit-low`: tune the reduced-order model against the switching one."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from elevon.cli import common
from elevon.cli.output import answer, print_table, progress_bar, say
from elevon.cli.shell import Answer, command
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.calibrate.low_fit import FitCase, LowFit

app = typer.Typer(rich_markup_mode=None)


@command(app, "strict", "report", "date")
def fit_low(
    actuator: str,
    *,
    settings: list[str] | None = None,
    scenario: list[Path] | None = None,
    fault: list[str] | None = None,
    out: Path | None = None,
    seed: int = 0,
    force: bool = False,
) -> Answer:
    """Fit the reduced-order model's free numbers to the switching model over scenarios, faults."""
    from elevon.calibrate.low_fit import fit_low as run
    from elevon.calibrate.low_fit import lowfit_report, write_fit

    common.check_outputs([out], force=force)
    model = common.read_actuator(actuator, settings)
    cases = _cases(model, scenario, fault)
    with progress_bar("switching model, then the fit") as advance:
        fit = run(model, cases, seed=seed, progress=advance)
    if out is not None:
        say(f"set: {write_fit(out, fit, force=force)}")
    data = fit.to_dict() | {"out": None if out is None else str(out)}
    return Answer(data, lambda: _print(fit), page=partial(lowfit_report, fit, actuator))


def _cases(model: Actuator, files: list[Path] | None, faults: list[str] | None) -> list[FitCase]:
    from elevon.calibrate.low_fit import default_cases, named_cases
    from elevon.scenario import Scenario

    if not files:
        if faults:
            raise InputError("fit-low: --fault needs the --scenario it is to be added to")
        return default_cases(model)
    return named_cases([(path.stem, Scenario.load(path)) for path in files], faults or [])


def _print(fit: LowFit) -> None:
    values = fit.to_dict()
    fitted = [
        [row["path"], f"{row['old']:.4g}", f"{row['new']:.4g}", f"{row['deviation']:.2g}"]
        for row in values["fitted"]
    ]
    fitted += [[row["path"], "", "kept", row["reason"]] for row in values["kept"]]
    answer(
        f"{len(values['fitted'])} numbers fitted over {len(values['cases'])} cases, "
        f"{len(values['kept'])} kept"
    )
    print_table(["number", "old", "new", "deviation"], fitted)
    rows = [
        [row["name"], *(f"{100 * row[when][n]:.2f}" for n in row["before"]
                        for when in ("before", "after"))]
        for row in values["cases"]
    ]  # fmt: skip
    head = [f"{n.replace('_', ' ')} {when}" for n in values["rms_before"]
            for when in ("before", "after")]  # fmt: skip
    print_table(["case", *head], rows, title="RMS of low less high, % of high's")
