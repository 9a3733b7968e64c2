"""`elevon reproduce`: recompute a published table or figure, with checks."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import print_json, print_table, say

if TYPE_CHECKING:
    from elevon.report import Report

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,
    help="Recompute a published table or figure; exit code 1 when a check fails.",
)

Json = Annotated[bool, typer.Option("--json", help="Print one JSON object.")]
Out = Annotated[
    Path | None, typer.Option("--out", help="Folder for report.html and the rows as CSV.")
]
Force = Annotated[bool, typer.Option("--force", help="Replace existing files.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of every random number.")]
Date = Annotated[str | None, typer.Option("--date", help="Date printed in the report.")]


@app.callback()
def _group() -> None:
    """Recompute a published table or figure; exit code 1 when a check fails."""


@app.command("torino-backlash")
def torino_backlash(
    *,
    as_json: Json = False,
    out: Out = None,
    force: Force = False,
    seed: Seed = 0,
    date: Date = None,
    picture: Annotated[
        Path | None, typer.Option("--picture", help="File for the summary plot: .svg, .png, .pdf.")
    ] = None,
) -> int:
    """Simulate the no-load campaign at all fifteen measured plays and recover each play."""
    from elevon.cli.output import progress_bar
    from elevon.reproduce.backlash import reproduce_backlash
    from elevon.reproduce.backlash.page import backlash_report, summary_figure

    check_folder(out, force)
    if picture is not None:
        from elevon.files import check_output

        check_output(picture, force=force)
    with progress_bar("simulating 16 runs") as advance:
        result = reproduce_backlash(seed=seed, progress=advance)
    values = result.to_dict()
    if out is not None:
        write(out, backlash_report(result, date=date), values["rows"], force)
    if picture is not None:
        from elevon.report.figures import save_figure

        say(f"picture: {save_figure(summary_figure(result.rows), picture, force=force)}")
    if as_json:
        print_json(values)
    else:
        columns = ("row", "measured_total_deg", "formula_deg", "play_in_deg", "play_out_deg",
                   "error_deg", "limit_deg", "lost_motion_deg")  # fmt: skip
        rows = [[f"{row[key]:.4f}" for key in columns[1:]] for row in values["rows"]]
        print_table(
            [name.removesuffix("_deg").replace("_", " ") for name in columns],
            [[str(number), *row] for number, row in enumerate(rows, 1)],
            title="total play at the user side [deg]",
        )
        print_checks(values)
    return exit_code(values)


@app.command("torino-compliance")
def torino_compliance(
    *,
    as_json: Json = False,
    out: Out = None,
    force: Force = False,
    seed: Seed = 0,
    date: Date = None,
) -> int:
    """Estimate the transmission's stiffness from the forty printed drops of a weight."""
    from elevon.reproduce.compliance import reproduce_compliance
    from elevon.reproduce.compliance.page import compliance_report

    check_folder(out, force)
    result = reproduce_compliance(seed=seed)
    values = result.to_dict()
    if out is not None:
        write(out, compliance_report(result, date=date, seed=seed), values["rows"], force)
    if as_json:
        print_json(values)
    else:
        columns = ("load_on_loss_n_per_deg", "loss_on_load_n_per_deg", "theil_sen_n_per_deg")
        rows = [[v["name"], *(f"{v[key]:.2f}" for key in columns)] for v in values["variants"]]
        print_table(["rows used [N/deg]", "load on loss", "loss on load", "Theil-Sen"], rows)
        low, high = values["interval_nm_per_rad"]
        print_table(
            ["answer", ""],
            [
                ["robust fit", f"{values['robust_n_per_deg']:.1f} N/deg"],
                ["stiffness", f"{values['stiffness_nm_per_rad']:.0f} N m/rad"],
                ["95 % interval", f"{low:.0f} to {high:.0f} N m/rad"],
                ["rows wrong", ", ".join(map(str, values["rows_inconsistent"]))],
                ["rows swapped", ", ".join(map(str, values["rows_swapped"]))],
            ],
        )
        print_checks(values)
    return exit_code(values)


@app.command("low-fidelity")
def low_fidelity(
    *,
    actuator: Annotated[str, typer.Option(help="A rotary actuator.")] = "torino-rotary",
    as_json: Json = False,
    seed: Seed = 0,
) -> int:
    """Compare the low model with the high one in the three cases in which it must hold."""
    from elevon.cli.common import read_actuator
    from elevon.cli.output import progress_bar
    from elevon.reproduce.low_fidelity import reproduce_low_fidelity

    model = read_actuator(actuator)
    with progress_bar("seven runs") as advance:
        values = reproduce_low_fidelity(model, seed=seed, progress=advance).to_dict()
    if as_json:
        print_json(values)
    else:
        columns = ("position_nrmse", "speed_nrmse", "q_current_nrmse", "q_current_rms_a",
                   "q_current_error_a", "floor_a")  # fmt: skip
        rows = [
            [row["name"], *("" if row[key] is None else f"{row[key]:.4g}" for key in columns)]
            for row in values["rows"]
        ]
        print_table(["case", *(name.replace("_", " ") for name in columns)], rows)
        print_checks(values)
    return exit_code(values)


def check_folder(out: Path | None, force: bool) -> None:
    """Refuse an output that cannot be written before the work, not after it."""
    if out is not None:
        from elevon.files import check_output

        for name in ("report.html", "rows.csv"):
            check_output(out / name, force=force)


def write(out: Path, report: Report, rows: list[dict[str, Any]], force: bool) -> None:
    """Write the report and the rows."""
    import csv
    import io

    from elevon.files import write_text

    stream = io.StringIO()
    writer = csv.DictWriter(stream, list(rows[0]), lineterminator="\n")
    writer.writeheader()
    writer.writerows(rows)
    write_text(out / "rows.csv", stream.getvalue(), force=force)
    say(f"report: {report.save(out / 'report.html', force=force)}")


def print_checks(values: dict[str, Any]) -> None:
    """Print the checks as a table."""
    rows = [
        [
            check["name"],
            f"{check['value']:.5g}",
            f"{'>=' if check['at_least'] else '<='} {check['limit']:.5g} {check['unit']}",
            "pass" if check["passed"] else "FAIL",
        ]
        for check in values["checks"]
    ]
    print_table(["check", "found", "limit", ""], rows)


def exit_code(values: dict[str, Any]) -> int:
    """Return 0 when every check passed, else 1."""
    return 0 if values["status"] == "pass" else 1


# Commands in modules of their own; they need what stands above.
from elevon.cli import reproduce_nasa as _nasa  # noqa: E402, F401
from elevon.cli import reproduce_pisa as _pisa  # noqa: E402, F401
