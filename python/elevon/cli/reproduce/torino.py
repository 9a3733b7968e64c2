"""The rotary actuator of the Torino bench, and the two models compared."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import Advance, print_table, say
from elevon.cli.reproduce.case import Options, PublishedCase, Values

if TYPE_CHECKING:
    from elevon.report import Report

__all__ = ["CASES"]

_PICTURE = Annotated[
    Path | None, typer.Option("--picture", help="File for the summary plot: .svg, .png, .pdf.")
]
_ACTUATOR = Annotated[str, typer.Option(help="A rotary actuator.")]


def _backlash(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.backlash import reproduce_backlash

    return reproduce_backlash(seed=options["seed"], progress=progress)


def _backlash_page(result: Any, options: Options) -> Report:
    from elevon.reproduce.backlash.page import backlash_report

    return backlash_report(result, date=options["date"])


def _check_picture(options: Options) -> None:
    if options["picture"] is not None:
        from elevon.files import check_output

        check_output(options["picture"], force=options["force"])


def _save_picture(result: Any, options: Options) -> None:
    if options["picture"] is not None:
        from elevon.report.figures import save_figure
        from elevon.reproduce.backlash.page import summary_figure

        figure = summary_figure(result.rows)
        say(f"picture: {save_figure(figure, options['picture'], force=options['force'])}")


def _show_backlash(values: Values, _result: Any) -> None:
    columns = ("row", "measured_total_deg", "formula_deg", "backlash_in_deg", "backlash_out_deg",
               "error_deg", "limit_deg", "lost_motion_deg")  # fmt: skip
    rows = [[f"{row[key]:.4f}" for key in columns[1:]] for row in values["rows"]]
    print_table(
        [name.removesuffix("_deg").replace("_", " ") for name in columns],
        [[str(number), *row] for number, row in enumerate(rows, 1)],
        title="total backlash at the output side [deg]",
    )


def _compliance(options: Options, _progress: Advance) -> Any:
    from elevon.reproduce.compliance import reproduce_compliance

    return reproduce_compliance(seed=options["seed"])


def _compliance_page(result: Any, options: Options) -> Report:
    from elevon.reproduce.compliance.page import compliance_report

    return compliance_report(result, date=options["date"], seed=options["seed"])


def _show_compliance(values: Values, _result: Any) -> None:
    columns = ("load_on_loss_n_per_deg", "loss_on_load_n_per_deg", "theil_sen_n_per_deg")
    rows = [[v["name"], *(f"{v[key]:.2f}" for key in columns)] for v in values["variants"]]
    print_table(["rows used [N/deg]", "load on loss", "loss on load", "Theil-Sen"], rows)
    low, high = values["interval_nm_per_rad"]
    answers = [
        ["robust fit", f"{values['robust_n_per_deg']:.1f} N/deg"],
        ["stiffness", f"{values['stiffness_nm_per_rad']:.0f} N m/rad"],
        ["95 % interval", f"{low:.0f} to {high:.0f} N m/rad"],
        ["rows wrong", ", ".join(map(str, values["rows_inconsistent"]))],
        ["rows swapped", ", ".join(map(str, values["rows_swapped"]))],
    ]
    print_table(["answer", ""], answers)


def _low_fidelity(options: Options, progress: Advance) -> Any:
    from elevon.cli.common import read_actuator
    from elevon.reproduce.low_fidelity import reproduce_low_fidelity

    model = read_actuator(options["actuator"])
    return reproduce_low_fidelity(model, seed=options["seed"], progress=progress)


def _show_low_fidelity(values: Values, _result: Any) -> None:
    columns = ("position_nrmse", "speed_nrmse", "q_current_nrmse", "q_current_rms_a",
               "q_current_error_a", "floor_a")  # fmt: skip
    rows = [
        [row["name"], *("" if row[key] is None else f"{row[key]:.4g}" for key in columns)]
        for row in values["rows"]
    ]
    print_table(["case", *(name.replace("_", " ") for name in columns)], rows)


CASES = (
    PublishedCase(
        "torino-backlash",
        "Simulate the no-load campaign at all fifteen measured backlashes and recover each.",
        "simulating 16 runs",
        _backlash,
        _show_backlash,
        _backlash_page,
        options={"picture": (_PICTURE, None)},
        prepare=_check_picture,
        finish=_save_picture,
    ),
    PublishedCase(
        "torino-compliance",
        "Estimate the transmission's stiffness from the forty printed drops of a weight.",
        "forty drops",
        _compliance,
        _show_compliance,
        _compliance_page,
    ),
    PublishedCase(
        "low-fidelity",
        "Compare the reduced-order model with the switching one in the three cases it must pass.",
        "seven runs",
        _low_fidelity,
        _show_low_fidelity,
        options={"actuator": (_ACTUATOR, "torino-rotary")},
    ),
)
