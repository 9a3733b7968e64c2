"""`elevon reproduce pisa-...`: the landing-gear actuator of the Pisa thesis."""

from __future__ import annotations

from typing import Annotated, Any

import typer

from elevon.cli.output import print_json, print_table
from elevon.cli.reproduce import (
    Date,
    Force,
    Json,
    Out,
    Seed,
    app,
    check_folder,
    exit_code,
    print_checks,
    write,
)

__all__ = ["pisa_failures", "pisa_friction", "pisa_functional", "pisa_hydraulic"]


@app.command("pisa-functional")
def pisa_functional(
    *,
    as_json: Json = False,
    out: Out = None,
    force: Force = False,
    seed: Seed = 0,
    date: Date = None,
    fidelity: Annotated[str, typer.Option("--fidelity", help="high or low.")] = "high",
) -> int:
    """Extend and retract the landing gear in every condition of the thesis."""
    from elevon.cli.output import progress_bar
    from elevon.reproduce.pisa_functional import reproduce_functional
    from elevon.reproduce.pisa_pages import functional_report

    check_folder(out, force)
    with progress_bar("simulating 12 strokes") as advance:
        result = reproduce_functional(fidelity=fidelity, seed=seed, progress=advance)
    values = result.to_dict()
    if out is not None:
        write(out, functional_report(result, date=date), values["rows"], force)
    columns = ("condition", "nz", "supply_v", "extension_s", "retraction_s", "cycle_s",
               "peak_current_a", "requirement_s", "passed")  # fmt: skip
    return _answer(values, columns, as_json, "landing gear, one stroke in each direction")


@app.command("pisa-friction")
def pisa_friction(
    *,
    as_json: Json = False,
    out: Out = None,
    force: Force = False,
    seed: Seed = 0,
    date: Date = None,
) -> int:
    """Run the free-fall tests and recover weight, friction, harmonics and efficiency."""
    from elevon.cli.output import progress_bar
    from elevon.reproduce.pisa_friction import reproduce_friction
    from elevon.reproduce.pisa_friction_page import friction_report

    check_folder(out, force)
    with progress_bar("simulating 32 tests and 8 strokes") as advance:
        result = reproduce_friction(seed=seed, progress=advance)
    values = result.to_dict()
    if out is not None:
        write(out, friction_report(result, date=date), values["rows"], force)
    columns = ("quantity", "direction", "speed_mm_s", "load_n", "put_in", "recovered", "unit")
    return _answer(values, columns, as_json, "put in and recovered")


@app.command("pisa-hydraulic")
def pisa_hydraulic(
    *,
    as_json: Json = False,
    out: Out = None,
    force: Force = False,
    date: Date = None,
) -> int:
    """Compare open-loop hydraulics with controlled speed over load and temperature."""
    from elevon.cli.output import progress_bar
    from elevon.reproduce.hydraulic import reproduce_hydraulic
    from elevon.reproduce.pisa_pages import hydraulic_report

    check_folder(out, force)
    with progress_bar("simulating 48 strokes") as advance:
        result = reproduce_hydraulic(progress=advance)
    values = result.to_dict()
    if out is not None:
        write(out, hydraulic_report(result, date=date), values["rows"], force)
    columns = ("temperature_c", "nz", "direction", "hydraulic_mm_s", "electric_mm_s",
               "electric_winding_mm_s", "electric_a", "electric_winding_a")  # fmt: skip
    return _answer(values, columns, as_json, "ram speed in mid-stroke")


@app.command("pisa-failures")
def pisa_failures(
    *,
    as_json: Json = False,
    out: Out = None,
    force: Force = False,
    seed: Seed = 0,
    date: Date = None,
    fidelity: Annotated[str, typer.Option("--fidelity", help="high or low.")] = "high",
) -> int:
    """Every fault in every phase: what the control unit indicates, what is true, is it safe."""
    from elevon.cli.output import progress_bar
    from elevon.reproduce.pisa_failures import reproduce_failures
    from elevon.reproduce.pisa_failures_page import failures_report, summary

    check_folder(out, force)
    with progress_bar("every fault in every phase") as advance:
        result = reproduce_failures(fidelity=fidelity, seed=seed, progress=advance)
    values = result.to_dict()
    if out is not None:
        write(out, failures_report(result, date=date), values["rows"], force)
    if as_json:
        print_json(values)
        return exit_code(values)
    print_table(*summary(result), title="faults in each phase: indicated falsely, detected, silent")
    unsafe = [row for row in values["rows"] if not row["safe"]]
    columns = ("fault", "phase", "indicated", "true_state", "detected_by", "time_s", "sensors")
    rows = [[_cell(row[name]) for name in columns] for row in unsafe]
    if rows:
        print_table([name.replace("_", " ") for name in columns], rows, title="unsafe rows")
    print_checks(values)
    return exit_code(values)


def _answer(values: dict[str, Any], columns: tuple[str, ...], as_json: bool, title: str) -> int:
    """Print a result as one JSON object, or its rows and checks as tables."""
    if as_json:
        print_json(values)
    else:
        rows = [[_cell(row[name]) for name in columns] for row in values["rows"]]
        print_table([name.replace("_", " ") for name in columns], rows, title=title)
        print_checks(values)
    return exit_code(values)


def _cell(value: object) -> str:
    if isinstance(value, bool):
        return "yes" if value else "NO"
    if isinstance(value, float):
        return f"{value:.5g}"
    return "-" if value is None else str(value)
