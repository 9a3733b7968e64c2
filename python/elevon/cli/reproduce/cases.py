"""The published cases: the Torino bench, the NASA test stand, the Pisa thesis, Cranfield's data."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from elevon.cli.output import answer, print_table, say
from elevon.cli.reproduce.case import Options, PublishedCase, Values, check_file, print_columns

_PICTURE = Annotated[
    Path | None, typer.Option("--picture", help="File for the summary plot: .svg, .png, .pdf.")
]
_ACTUATOR = Annotated[str, typer.Option(help="A rotary actuator.")]
_ACTUATORS = Annotated[
    list[str] | None,
    typer.Option("--actuator", metavar="ACTUATOR", help="Only this one; repeatable."),
]
_FIDELITY = Annotated[str, typer.Option("--fidelity", help="high or low.")]
_STAND = Annotated[str, typer.Option("--fidelity", help="Of the virtual stand: high or low.")]
_LOAD_KIND = Annotated[
    str, typer.Option("--load-kind", help="How the load acts: constant, step or spring.")
]
_REPLICATES = Annotated[
    int, typer.Option("--replicates", min=2, help="Blocks, each with its own reassembly.")
]
_REASSEMBLIES = Annotated[int, typer.Option("--reassemblies", min=4, help="Units of each fault.")]
_HEALTHY = Annotated[int, typer.Option("--healthy", min=8, help="Healthy units.")]
_DATA = Annotated[
    Path,
    typer.Option(
        "--data",
        metavar="DIR",
        help="Folder with one CSV or CSV.gz a condition; not in this package.",
    ),
]


def low_fidelity(actuator: str, seed: int, progress: Any = None) -> Any:
    """Return the three cases of one actuator."""
    from elevon.cli.common import read_actuator
    from elevon.reproduce.low_fidelity import reproduce_low_fidelity

    return reproduce_low_fidelity(read_actuator(actuator), seed=seed, progress=progress)


def _check_picture(options: Options) -> None:
    check_file(options["picture"], options)


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


def _show_current(values: Values, _result: Any) -> None:
    rows = [
        [
            state,
            source.replace("_", " "),
            *(f"{item[source][key]:.2f}" for key in ("average", "maximum", "minimum")),
        ]
        for state, item in values["summary"].items()
        for source in ("published", "here", "here_between_corners")
    ]
    print_table(["runs", "source", "average %", "maximum %", "minimum %"], rows)


def _show_thermal(values: Values, _result: Any) -> None:
    kelvin = ("winding_k", "surface_k")
    rows = [
        [f"{row['time_s'] / 60:.0f}", *(f"{row[k] - 273.15:.1f}" for k in kelvin),
         f"{row['heat_w']:.1f}"]
        for row in values["rows"][::5]
    ]  # fmt: skip
    print_table(["minute", "winding [degC]", "surface [degC]", "heat [W]"], rows)


def _check_load_kind(options: Options) -> None:
    from elevon.errors import unknown
    from elevon.reproduce.nasa.profiles import LOAD_KINDS

    if options["load_kind"] not in LOAD_KINDS:
        raise unknown("load kind", options["load_kind"], LOAD_KINDS, "--load-kind")


def _show_effects(values: Values, _result: Any) -> None:
    effects = [effect for effect in values["effects"] if " x " not in effect["term"]]
    if effects:
        print_columns(effects, ("response", "unit", "term", "effect", "p"))


def _check_counts(options: Options) -> None:
    from elevon.errors import RangeError

    healthy, least = options["healthy"], 2 * options["reassemblies"]
    if healthy < least:
        raise RangeError(
            f"--healthy {healthy}: at least twice --reassemblies, {least}, are needed "
            "to compare healthy with healthy"
        )


def _show_failures(values: Values, result: Any) -> None:
    from elevon.reproduce.pisa_failures_page import summary

    print_table(*summary(result), title="faults in each phase: indicated falsely, detected, silent")
    unsafe = [row for row in values["rows"] if not row["safe"]]
    if unsafe:
        columns = ("fault", "phase", "indicated", "true_state", "detected_by", "time_s", "sensors")
        print_columns(unsafe, columns, "unsafe rows")


def _show_cranfield(values: Values, result: Any) -> None:
    answer(*values["skipped"], *(f"{name}: not possible here" for name in values["missing"]))
    rows = [
        [f.figure, f.protocol, f.load, f"{f.value:.3f}", f"{f.low:.3f} to {f.high:.3f}"]
        for f in result.figures
        if f.load in {"mean", "worst"}
    ]
    print_table(["figure", "protocol", "loads", "score", "95 % interval"], rows)
    columns = ("condition", "rate", "interval", "rate_between_sessions")
    print_columns(values["detection"], columns, "called faulty; with sessions allowed for")


_R = "elevon.reproduce."
_NASA_PAGE = _R + "nasa.page:nasa_report"
CASES = (
    PublishedCase(
        "torino-backlash",
        "Simulate the no-load campaign at all fifteen measured backlashes and recover each.",
        "simulating 16 runs",
        _R + "backlash:reproduce_backlash",
        page=_R + "backlash.page:backlash_report",
        options={"picture": (_PICTURE, None)},
        prepare=_check_picture,
        show=_show_backlash,
        finish=_save_picture,
    ),
    PublishedCase(
        "torino-compliance",
        "Estimate the transmission's stiffness from the forty printed drops of a weight.",
        "forty drops",
        _R + "compliance:reproduce_compliance",
        page=_R + "compliance.page:compliance_report",
        show=_show_compliance,
    ),
    PublishedCase(
        "torino-drops",
        "Drop weights on a bench with hidden stiffness and damping, estimate both, run the model.",
        "forty drops on the bench, and the model",
        _R + "torino_bench.drops:reproduce_drops",
        page=_R + "torino_bench.drops_page:drops_page",
    ),
    PublishedCase(
        "torino-fmeca",
        "Log each failure mode of the printed table on the bench, and diagnose it.",
        "thirteen logs, twelve diagnoses",
        _R + "torino_bench.fmeca:reproduce_fmeca",
        ("component", "mode", "fault", "change_percent", "channel", "seen", "answer"),
        page=_R + "torino_bench.fmeca_page:fmeca_page",
    ),
    PublishedCase(
        "torino-control",
        "Draw the root locus of the derivative branch; hold the no-load speed to what is required.",
        "one run",
        _R + "torino_bench.control:reproduce_control",
        ("requirement", "required_deg_s", "speed_deg_s", "met"),
        page=_R + "torino_bench.control_page:control_page",
    ),
    PublishedCase(
        "low-fidelity",
        "Compare the reduced-order model with the switching one in the three cases it must pass.",
        "seven runs",
        "elevon.cli.reproduce.cases:low_fidelity",
        ("name", "position_nrmse", "speed_nrmse", "q_current_nrmse", "q_current_rms_a",
         "q_current_error_a", "floor_a"),
        page=_R + "low_fidelity_page:low_fidelity_page",
        options={"actuator": (_ACTUATOR, "torino-rotary")},
    ),
    PublishedCase(
        "torino-validation",
        "Calibrate on a bench with hidden values, then predict it at three backlashes.",
        "six logs of the bench, three of the model",
        _R + "torino_bench.validation:reproduce_torino_validation",
        ("micrometer_mm", "signal", "rms", "percent_of_range", "ratio", "unit"),
        "model less virtual bench; the works print no error",
        page=_R + "torino_bench.validation_page:torino_validation_page",
        options={"fidelity": (_FIDELITY, "high")},
    ),
    PublishedCase(
        "torino-loaded",
        "Run the loaded campaign, a constant brake torque a test, and predict each test.",
        "thirty logs of the bench",
        _R + "torino_bench.loaded:reproduce_loaded",
        ("net_backlash_rad", "set_nm", "cell_nm", "current_a", "bench_lost_deg", "model_lost_deg",
         "position_percent"),
        "each test after its first period",
        page=_R + "torino_bench.loaded_page:loaded_page",
        options={"fidelity": (_STAND, "high")},
    ),
    PublishedCase(
        "nasa-current",
        "Predict the motor current of 32 nominal and ten jammed runs of a mismatched stand.",
        "running and predicting 42 experiments",
        _R + "nasa.current:reproduce_current",
        page=_R + "nasa.page_current:current_report",
        options={"fidelity": (_STAND, "high")},
        show=_show_current,
    ),
    PublishedCase(
        "nasa-faults",
        "Dynamic eccentricity and winding shorts as printed, and both ways to seed a short.",
        "simulating 36 runs",
        _R + "nasa.figures:reproduce_faults",
        ("level", "resistance_ohm", "speed_rad_s", "turns_a", "resistor_a"),
        "current that a winding short adds to the leg, by shorted turns and by a resistor",
        page=_R + "nasa.page_figures:faults_report",
    ),
    PublishedCase(
        "nasa-flight",
        "Fly the planned stand: a nominal and a faulty actuator, the load switched between them.",
        "flying four pairs of actuators",
        _R + "nasa.flight:reproduce_flight",
        ("unit", "begin_s", "load_n", "current_a", "tracking_mm", "current_per_load_a"),
        "stretches between two switchings of the load",
        page=_R + "nasa.page_flight:flight_report",
        options={"fidelity": (_STAND, "low")},
    ),
    PublishedCase(
        "nasa-thermal",
        "Heat the ballscrew actuator's motor for an hour, held to closed forms.",
        "simulating nine hours at low fidelity",
        _R + "nasa:reproduce_thermal",
        page=_NASA_PAGE,
        show=_show_thermal,
    ),
    PublishedCase(
        "nasa-baseline",
        "Run every profile of the test stand under every load; the effects of rate, load and more.",
        "simulating the matrix",
        _R + "nasa:reproduce_baseline",
        ("profile", "amplitude_mm", "rate_mm_s", "load_n", "direction", "rms_current_a",
         "peak_current_a", "tracking_rms_mm", "winding_rise_k", "status"),
        page=_NASA_PAGE,
        options={"load_kind": (_LOAD_KIND, "constant"), "replicates": (_REPLICATES, 4)},
        prepare=_check_load_kind,
        show=_show_effects,
    ),
    PublishedCase(
        "nasa-separation",
        "Determine which profile shows which fault best, over a population of units.",
        "simulating faults and profiles",
        _R + "nasa:reproduce_separation",
        ("fault", "profile", "load_n", "effect_size", "interval", "winner", "draws_needed"),
        page=_NASA_PAGE,
        options={"reassemblies": (_REASSEMBLIES, 16), "healthy": (_HEALTHY, 240)},
        prepare=_check_counts,
    ),
    PublishedCase(
        "pisa-functional",
        "Extend and retract the landing gear in every condition of the thesis.",
        "simulating 18 strokes",
        _R + "pisa_functional:reproduce_functional",
        ("condition", "nz", "supply_v", "extension_s", "retraction_s", "cycle_s",
         "extension_high_rad_s", "extension_low_rad_s", "retraction_high_rad_s",
         "retraction_low_rad_s", "requirement_s", "passed"),
        "landing gear, one stroke in each direction",
        page=_R + "pisa_pages:functional_report",
        options={"fidelity": (_FIDELITY, "high")},
    ),
    PublishedCase(
        "pisa-friction",
        "Run the free-fall tests and recover weight, friction, harmonics and efficiency.",
        "simulating 32 tests and 8 strokes",
        _R + "pisa_friction:reproduce_friction",
        ("quantity", "direction", "speed_mm_s", "load_n", "put_in", "recovered", "unit"),
        "put in and recovered",
        page=_R + "pisa_friction_page:friction_report",
    ),
    PublishedCase(
        "pisa-hydraulic",
        "Compare open-loop hydraulics with controlled speed over load and temperature.",
        "simulating 48 strokes",
        _R + "hydraulic:reproduce_hydraulic",
        ("temperature_c", "nz", "direction", "hydraulic_mm_s", "electric_mm_s",
         "electric_winding_mm_s", "electric_a", "electric_winding_a"),
        "ram speed in mid-stroke",
        page=_R + "pisa_pages:hydraulic_report",
        seeded=False,
    ),
    PublishedCase(
        "pisa-validation",
        "Predict position, speed and current of both strokes of a mismatched rig, percent errors.",
        "ten strokes on the virtual rig",
        _R + "pisa_validation:reproduce_validation",
        ("stroke", "signal", "held_out", "percent_of_rms", "judged_percent", "before_percent",
         "floor_percent", "limit_percent"),
        "model less virtual rig; the thesis prints no error",
        page=_R + "pisa_validation_page:validation_page",
        options={"fidelity": (_FIDELITY, "high")},
    ),
    PublishedCase(
        "pisa-commutation",
        "Commutate and modulate as the thesis draws it, and short the motor in an extension.",
        "simulating two strokes",
        _R + "pisa_currents:reproduce_commutation",
        ("begin_deg", "hall", "high", "low", "wrong_percent", "duty_percent", "on_percent"),
        "sectors of one electrical turn, in retraction",
        page=_R + "pisa_currents_page:commutation_report",
    ),
    PublishedCase(
        "pisa-monitoring",
        "Monitor the gear by the simplified model: its cost and errors beside the switching one.",
        "four models, one retraction",
        _R + "pisa_monitoring:reproduce_monitoring",
        ("model", "step_us", "processor_s", "faster", "position_percent", "speed_percent",
         "current_percent"),
        "one retraction of ten seconds",
        page=_R + "pisa_monitoring_page:monitoring_report",
    ),
    PublishedCase(
        "pisa-failures",
        "Every fault in every phase: what the control unit indicates, what is true, is it safe.",
        "every fault in every phase",
        _R + "pisa_failures:reproduce_failures",
        page=_R + "pisa_failures_page:failures_report",
        options={"fidelity": (_FIDELITY, "high")},
        show=_show_failures,
    ),
    PublishedCase(
        "cranfield",
        "Diagnose the Cranfield linear actuator from its recordings, loads and runs held out.",
        "reading and classifying",
        _R + "cranfield:reproduce_cranfield",
        page=_R + "cranfield.page:cranfield_report",
        options={"data": (_DATA, ...)},
        names={"folder": "data"},
        show=_show_cranfield,
    ),
    PublishedCase(
        "signatures",
        "Show what each fault looks like: healthy beside faulty, in time and spectrum.",
        "running every fault",
        _R + "signatures:reproduce_signatures",
        ("actuator", "kind", "place", "severity", "unit", "status", "signal"),
        page=_R + "signatures_page:signatures_page",
        options={"actuators": (_ACTUATORS, None)},
    ),
)  # fmt: skip
