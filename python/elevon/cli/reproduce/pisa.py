"""`elevon reproduce pisa-...`: the landing-gear actuator of the Pisa thesis."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import Advance, print_table
from elevon.cli.reproduce.case import Options, PublishedCase, Values, print_columns

if TYPE_CHECKING:
    from elevon.report import Report

__all__ = ["CASES"]

_FIDELITY = Annotated[str, typer.Option("--fidelity", help="high or low.")]


def _functional(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.pisa_functional import reproduce_functional

    return reproduce_functional(
        fidelity=options["fidelity"], seed=options["seed"], progress=progress
    )


def _functional_page(result: Any, options: Options) -> Report:
    from elevon.reproduce.pisa_pages import functional_report

    return functional_report(result, date=options["date"])


def _friction(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.pisa_friction import reproduce_friction

    return reproduce_friction(seed=options["seed"], progress=progress)


def _friction_page(result: Any, options: Options) -> Report:
    from elevon.reproduce.pisa_friction_page import friction_report

    return friction_report(result, date=options["date"])


def _hydraulic(_options: Options, progress: Advance) -> Any:
    from elevon.reproduce.hydraulic import reproduce_hydraulic

    return reproduce_hydraulic(progress=progress)


def _hydraulic_page(result: Any, options: Options) -> Report:
    from elevon.reproduce.pisa_pages import hydraulic_report

    return hydraulic_report(result, date=options["date"])


def _failures(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.pisa_failures import reproduce_failures

    return reproduce_failures(fidelity=options["fidelity"], seed=options["seed"], progress=progress)


def _failures_page(result: Any, options: Options) -> Report:
    from elevon.reproduce.pisa_failures_page import failures_report

    return failures_report(result, date=options["date"])


def _validation(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.pisa_validation import reproduce_validation

    return reproduce_validation(
        fidelity=options["fidelity"], seed=options["seed"], progress=progress
    )


def _validation_page(result: Any, options: Options) -> Report:
    from elevon.reproduce.pisa_validation_page import validation_page

    return validation_page(result, date=options["date"])


def _table(columns: tuple[str, ...], title: str) -> Callable[[Values, Any], None]:
    return lambda values, _result: print_columns(values["rows"], columns, title)


def _show_failures(values: Values, result: Any) -> None:
    from elevon.reproduce.pisa_failures_page import summary

    print_table(*summary(result), title="faults in each phase: indicated falsely, detected, silent")
    unsafe = [row for row in values["rows"] if not row["safe"]]
    if unsafe:
        columns = ("fault", "phase", "indicated", "true_state", "detected_by", "time_s", "sensors")
        print_columns(unsafe, columns, "unsafe rows")


CASES = (
    PublishedCase(
        "pisa-functional",
        "Extend and retract the landing gear in every condition of the thesis.",
        "simulating 12 strokes",
        _functional,
        _table(
            ("condition", "nz", "supply_v", "extension_s", "retraction_s", "cycle_s",
             "peak_current_a", "requirement_s", "passed"),
            "landing gear, one stroke in each direction",
        ),
        _functional_page,
        options={"fidelity": (_FIDELITY, "high")},
    ),
    PublishedCase(
        "pisa-friction",
        "Run the free-fall tests and recover weight, friction, harmonics and efficiency.",
        "simulating 32 tests and 8 strokes",
        _friction,
        _table(
            ("quantity", "direction", "speed_mm_s", "load_n", "put_in", "recovered", "unit"),
            "put in and recovered",
        ),
        _friction_page,
    ),
    PublishedCase(
        "pisa-hydraulic",
        "Compare open-loop hydraulics with controlled speed over load and temperature.",
        "simulating 48 strokes",
        _hydraulic,
        _table(
            ("temperature_c", "nz", "direction", "hydraulic_mm_s", "electric_mm_s",
             "electric_winding_mm_s", "electric_a", "electric_winding_a"),
            "ram speed in mid-stroke",
        ),
        _hydraulic_page,
        seeded=False,
    ),
    PublishedCase(
        "pisa-validation",
        "Predict position, speed and current of both strokes of a mismatched rig, percent errors.",
        "ten strokes on the virtual rig",
        _validation,
        _table(
            ("stroke", "signal", "rms", "unit", "percent_of_rms", "percent_of_range", "published"),
            "model less virtual rig; the thesis prints no error",
        ),
        _validation_page,
        options={"fidelity": (_FIDELITY, "high")},
    ),
    PublishedCase(
        "pisa-failures",
        "Every fault in every phase: what the control unit indicates, what is true, is it safe.",
        "every fault in every phase",
        _failures,
        _show_failures,
        _failures_page,
        options={"fidelity": (_FIDELITY, "high")},
    ),
)  # fmt: skip
