"""The published cases: the Torino bench, the NASA test stand, the Pisa thesis, Cranfield's data."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from elevon.cli.output import answer, print_table, say
from elevon.data import packaged_toml
from elevon_cases.case import Options, Values, check_file, print_columns, read_cases


def low_fidelity(actuator: str, seed: int, progress: Any = None) -> Any:
    """Return the three cases of one actuator."""
    from elevon.cli.common import read_actuator
    from elevon_cases.torino.low_fidelity import reproduce_low_fidelity

    return reproduce_low_fidelity(read_actuator(actuator), seed=seed, progress=progress)


def _check_picture(options: Options) -> None:
    check_file(options["picture"], options)


def _save_picture(result: Any, *, force: bool, picture: Path | None = None) -> None:
    """Draw the summary on its own.

    Parameters
    ----------
    picture : path
        File for the summary plot: .svg, .png, .pdf.
    """
    if picture is not None:
        from elevon.report.figures import save_figure
        from elevon_cases.torino.backlash import summary_figure

        figure = summary_figure(result.rows)
        say(f"picture: {save_figure(figure, picture, force=force)}")


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
    from elevon_cases.nasa.profiles import LOAD_KINDS

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
    from elevon_cases.pisa.failures import summary

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


_STEPS: Mapping[str, Mapping[str, Callable[..., None]]] = {
    "torino-backlash": {
        "prepare": _check_picture,
        "show": _show_backlash,
        "finish": _save_picture,
    },
    "torino-compliance": {"show": _show_compliance},
    "nasa-current": {"show": _show_current},
    "nasa-thermal": {"show": _show_thermal},
    "nasa-baseline": {"prepare": _check_load_kind, "show": _show_effects},
    "nasa-separation": {"prepare": _check_counts},
    "pisa-failures": {"show": _show_failures},
    "cranfield": {"show": _show_cranfield},
}
CASES = read_cases(packaged_toml("elevon_cases", "cases.toml"), _STEPS)
