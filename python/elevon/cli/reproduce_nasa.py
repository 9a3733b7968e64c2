"""`elevon reproduce nasa-...`: the ballscrew actuator of the NASA test stand."""

from __future__ import annotations

from pathlib import Path
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

__all__ = ["nasa_baseline", "nasa_separation", "nasa_thermal"]


def _finish(
    values: dict[str, Any], result: Any, out: Path | None, force: bool, date: str | None
) -> None:
    if out is not None:
        from elevon.reproduce.nasa.page import nasa_report

        write(out, nasa_report(result, date=date), values["rows"], force)


@app.command("nasa-thermal")
def nasa_thermal(
    *,
    as_json: Json = False,
    out: Out = None,
    force: Force = False,
    seed: Seed = 0,
    date: Date = None,
) -> int:
    """Heat the ballscrew actuator's motor for an hour, held to closed forms."""
    from elevon.cli.output import progress_bar
    from elevon.reproduce.nasa import reproduce_thermal

    check_folder(out, force)
    with progress_bar("simulating nine hours at low fidelity") as advance:
        result = reproduce_thermal(seed=seed, progress=advance)
    values = result.to_dict()
    _finish(values, result, out, force, date)
    if as_json:
        print_json(values)
    else:
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
        print_checks(values)
    return exit_code(values)


@app.command("nasa-baseline")
def nasa_baseline(
    *,
    as_json: Json = False,
    out: Out = None,
    force: Force = False,
    seed: Seed = 0,
    date: Date = None,
    load_kind: Annotated[
        str, typer.Option("--load-kind", help="How the load acts: constant, step or spring.")
    ] = "constant",
    replicates: Annotated[
        int, typer.Option("--replicates", min=2, help="Blocks, each with its own reassembly.")
    ] = 4,
) -> int:
    """Run every profile of the test stand under every load; the effects of rate, load and more."""
    from elevon.cli.output import progress_bar
    from elevon.errors import unknown
    from elevon.reproduce.nasa import reproduce_baseline
    from elevon.reproduce.nasa.profiles import LOAD_KINDS

    check_folder(out, force)
    kind = next((item for item in LOAD_KINDS if item == load_kind), None)
    if kind is None:
        raise unknown("load kind", load_kind, LOAD_KINDS, "--load-kind")
    with progress_bar("simulating the matrix") as advance:
        result = reproduce_baseline(
            load_kind=kind, replicates=replicates, seed=seed, folder=out, progress=advance
        )
    values = result.to_dict()
    _finish(values, result, out, force, date)
    if as_json:
        print_json(values)
    else:
        columns = ("profile", "amplitude_mm", "rate_mm_s", "load_n", "direction", "rms_current_a",
                   "peak_current_a", "tracking_rms_mm", "winding_rise_k", "status")  # fmt: skip
        rows = [[_shown(row[name]) for name in columns] for row in values["rows"]]
        print_table([name.replace("_", " ") for name in columns], rows)
        terms = ("response", "unit", "term", "effect", "p")
        chosen = [e for e in values["effects"] if " x " not in e["term"]]
        if chosen:
            effects = [[_shown(e[name]) for name in terms] for e in chosen]
            print_table(list(terms), effects)
        print_checks(values)
    return exit_code(values)


@app.command("nasa-separation")
def nasa_separation(
    *,
    as_json: Json = False,
    out: Out = None,
    force: Force = False,
    seed: Seed = 0,
    date: Date = None,
    reassemblies: Annotated[
        int, typer.Option("--reassemblies", min=4, help="Units of each fault.")
    ] = 24,
    healthy: Annotated[int, typer.Option("--healthy", min=8, help="Healthy units.")] = 160,
) -> int:
    """Find out which profile shows which fault best, over a population of units."""
    from elevon.cli.output import progress_bar
    from elevon.errors import RangeError
    from elevon.reproduce.nasa import reproduce_separation

    check_folder(out, force)
    if healthy < 2 * reassemblies:
        raise RangeError(
            f"--healthy {healthy}: at least twice --reassemblies, {2 * reassemblies}, are needed "
            "to compare healthy with healthy"
        )
    with progress_bar("simulating faults and profiles") as advance:
        result = reproduce_separation(
            reassemblies=reassemblies, healthy=healthy, seed=seed, folder=out, progress=advance
        )
    values = result.to_dict()
    _finish(values, result, out, force, date)
    if as_json:
        print_json(values)
    else:
        columns = ("fault", "profile", "load_n", "effect_size", "interval", "winner",
                   "draws_needed")  # fmt: skip
        rows = [[_shown(row[name]) for name in columns] for row in values["rows"]]
        print_table([name.replace("_", " ") for name in columns], rows)
        print_checks(values)
    return exit_code(values)


def _shown(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, list):
        return " to ".join(_shown(item) for item in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)
