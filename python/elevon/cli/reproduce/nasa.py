"""`elevon reproduce nasa-...`: the ballscrew actuator of the NASA test stand."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.output import Advance, print_table
from elevon.cli.reproduce.case import Options, PublishedCase, Values, print_columns

if TYPE_CHECKING:
    from elevon.report import Report

__all__ = ["CASES"]

_LOAD_KIND = Annotated[
    str, typer.Option("--load-kind", help="How the load acts: constant, step or spring.")
]
_REPLICATES = Annotated[
    int, typer.Option("--replicates", min=2, help="Blocks, each with its own reassembly.")
]
_REASSEMBLIES = Annotated[int, typer.Option("--reassemblies", min=4, help="Units of each fault.")]
_HEALTHY = Annotated[int, typer.Option("--healthy", min=8, help="Healthy units.")]


def _page(result: Any, options: Options) -> Report:
    from elevon.reproduce.nasa.page import nasa_report

    return nasa_report(result, date=options["date"])


def _thermal(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.nasa import reproduce_thermal

    return reproduce_thermal(seed=options["seed"], progress=progress)


def _show_thermal(values: Values, _result: Any) -> None:
    rows = [
        [
            f"{row['time_s'] / 60:.0f}",
            f"{row['winding_k'] - 273.15:.1f}",
            f"{row['surface_k'] - 273.15:.1f}",
            f"{row['heat_w']:.1f}",
        ]
        for row in values["rows"][::5]
    ]
    print_table(["minute", "winding [degC]", "surface [degC]", "heat [W]"], rows)


def _check_load_kind(options: Options) -> None:
    from elevon.errors import unknown
    from elevon.reproduce.nasa.profiles import LOAD_KINDS

    if options["load_kind"] not in LOAD_KINDS:
        raise unknown("load kind", options["load_kind"], LOAD_KINDS, "--load-kind")


def _baseline(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.nasa import reproduce_baseline

    return reproduce_baseline(
        load_kind=options["load_kind"],
        replicates=options["replicates"],
        seed=options["seed"],
        folder=options["out"],
        progress=progress,
    )


def _show_baseline(values: Values, _result: Any) -> None:
    columns = ("profile", "amplitude_mm", "rate_mm_s", "load_n", "direction", "rms_current_a",
               "peak_current_a", "tracking_rms_mm", "winding_rise_k", "status")  # fmt: skip
    print_columns(values["rows"], columns)
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


def _separation(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.nasa import reproduce_separation

    return reproduce_separation(
        reassemblies=options["reassemblies"],
        healthy=options["healthy"],
        seed=options["seed"],
        folder=options["out"],
        progress=progress,
    )


def _current(options: Options, progress: Advance) -> Any:
    from elevon.reproduce.nasa.current import reproduce_current

    return reproduce_current(fidelity=options["fidelity"], seed=options["seed"], progress=progress)


def _current_page(result: Any, options: Options) -> Report:
    from elevon.reproduce.nasa.page_current import current_report

    return current_report(result, date=options["date"])


def _show_current(values: Values, _result: Any) -> None:
    rows = [
        [state, source, *(f"{item[source][key]:.2f}" for key in ("average", "maximum", "minimum"))]
        for state, item in values["summary"].items()
        for source in ("published", "here")
    ]
    print_table(["runs", "source", "average %", "maximum %", "minimum %"], rows)


def _show_separation(values: Values, _result: Any) -> None:
    columns = ("fault", "profile", "load_n", "effect_size", "interval", "winner",
               "draws_needed")  # fmt: skip
    print_columns(values["rows"], columns)


_FIDELITY = Annotated[str, typer.Option("--fidelity", help="Of the virtual stand: high or low.")]

CASES = (
    PublishedCase(
        "nasa-current",
        "Predict the motor current of 32 nominal and ten jammed runs of a mismatched stand.",
        "running and predicting 42 experiments",
        _current,
        _show_current,
        _current_page,
        options={"fidelity": (_FIDELITY, "high")},
    ),
    PublishedCase(
        "nasa-thermal",
        "Heat the ballscrew actuator's motor for an hour, held to closed forms.",
        "simulating nine hours at low fidelity",
        _thermal,
        _show_thermal,
        _page,
    ),
    PublishedCase(
        "nasa-baseline",
        "Run every profile of the test stand under every load; the effects of rate, load and more.",
        "simulating the matrix",
        _baseline,
        _show_baseline,
        _page,
        options={"load_kind": (_LOAD_KIND, "constant"), "replicates": (_REPLICATES, 4)},
        prepare=_check_load_kind,
    ),
    PublishedCase(
        "nasa-separation",
        "Determine which profile shows which fault best, over a population of units.",
        "simulating faults and profiles",
        _separation,
        _show_separation,
        _page,
        options={"reassemblies": (_REASSEMBLIES, 16), "healthy": (_HEALTHY, 240)},
        prepare=_check_counts,
    ),
)
