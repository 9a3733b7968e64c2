"""``elevon loads``: a recorded flight becomes the load of one control surface's actuator."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from elevon.cli.output import answer, print_table, progress_bar, say
from elevon.cli.shell import Answer, command

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.loads import FlightData, LoadTable

app = typer.Typer(
    rich_markup_mode=None,
    help="Turn a recorded flight into an actuator's load (docs/how-to/loads.md).",
)

KINDS = (".csv", ".toml")


@command(app)
def loads(
    flight: Path,
    *,
    actuator: str,
    out: Path,
    area: str,
    chord: str,
    c_0: float = 0.0,
    c_alpha: float = 0.0,
    c_delta: float = 0.0,
    arm: str | None = None,
    limit: str | None = None,
    travel: str | None = None,
    unscaled: bool = False,
    temperature_offset: float = 0.0,
    force: bool = False,
) -> Answer:
    """Turn a recorded flight into the load of one actuator: a table or a scenario."""
    from elevon.actuator import Actuator
    from elevon.errors import InputError
    from elevon.files import check_output, write_text
    from elevon.loads import HingeMoment, read_flight
    from elevon.units import parse_quantity

    if out.suffix not in KINDS:
        raise InputError(f"--out {out}: must end in {' or '.join(KINDS)}")
    check_output(out, force=force)
    model = Actuator.load(actuator)
    surface = HingeMoment(
        parse_quantity(area, "m2", "--area"), parse_quantity(chord, "m", "--chord"),
        c_0, c_alpha, c_delta,
    )  # fmt: skip
    with progress_bar("reading the flight") as advance:
        data = read_flight(flight, progress=advance)
    table = _table(
        model, data, surface, arm=arm, limit=limit, travel=travel, unscaled=unscaled,
        offset=temperature_offset,
    )  # fmt: skip
    linear = _linear(model)
    text = _csv(table, linear) if out.suffix == ".csv" else _scenario(table)
    say(f"{out.suffix[1:]}: {write_text(out, text, force=force)}")
    return _answer(table, linear)


def _linear(model: Actuator) -> bool:
    from elevon import _core

    command = next(p for p in _core.ports(model.wiring) if p["name"] == "command")
    return bool(command["unit"] == "m")


def _table(
    model: Actuator,
    data: FlightData,
    surface: Any,
    *,
    arm: str | None,
    limit: str | None,
    travel: str | None,
    unscaled: bool,
    offset: float,
) -> LoadTable:
    """Scale to the actuator's rating unless told otherwise; the stroke must lie in its stops."""
    from elevon.errors import InputError
    from elevon.loads import flight_load
    from elevon.units import parse_quantity

    linear = _linear(model)
    if linear and arm is None:
        raise InputError(f"{model.name}: travels; give the lever between hinge and ram with --arm")
    if not linear and arm is not None:
        raise InputError(f"{model.name}: turns on the hinge line; --arm is for one that travels")
    if unscaled and limit is not None:
        raise InputError("--unscaled and --limit exclude each other")
    force, length = ("N", "m") if linear else ("N m", "rad")
    peak = None if limit is None else parse_quantity(limit, force, "--limit")
    if peak is None and not unscaled:
        if "rating.load" not in model.parameters:
            raise InputError(f"{model.name}: has no rating.load; give --limit or --unscaled")
        peak = model.parameters.value("rating.load")
    table = flight_load(
        data,
        surface,
        arm=None if arm is None else parse_quantity(arm, "m", "--arm"),
        limit=peak,
        travel=None if travel is None else parse_quantity(travel, length, "--travel"),
        temperature_offset=offset,
    )
    _check_stroke(model, table, length)
    return table


def _check_stroke(model: Actuator, table: LoadTable, unit: str) -> None:
    from elevon.errors import RangeError

    low, high = float(table.position.min()), float(table.position.max())
    for path, reached, sign in (("stop.lower", low, -1.0), ("stop.upper", high, 1.0)):
        stop = model.parameters.value(path) if path in model.parameters else sign * math.inf
        if sign * reached > sign * stop:
            raise RangeError(
                f"{model.name}: the flight reaches {reached:.4g} {unit}, beyond {path}, "
                f"{stop:.4g} {unit}; give --travel"
            )


def _columns(linear: bool) -> list[tuple[str, str]]:
    force, length = ("N", "m") if linear else ("N m", "rad")
    return [("time", "s"), ("load", force), ("position", length),
            ("dynamic_pressure", "Pa"), ("mach", "1")]  # fmt: skip


def _csv(table: LoadTable, linear: bool) -> str:
    columns = _columns(linear)
    values = [getattr(table, name) for name, _ in columns]
    rows = (",".join(f"{value:.9g}" for value in row) for row in zip(*values, strict=True))
    head = ",".join(f"{name} [{unit}]" for name, unit in columns)
    return "\n".join([head, *rows]) + "\n"


def _scenario(table: LoadTable) -> str:
    def term(place: str, values: Any, unit: str) -> str:
        times = ", ".join(f"{t:.9g}" for t in table.time)
        numbers = ", ".join(f"{v:.9g}" for v in values)
        head = f'[[{place}]]\nkind = "table"\nunit = "{unit}"\n'
        return f"{head}times = [{times}]\nvalues = [{numbers}]\n"

    return (
        f"# A flight: load scale {table.load_scale:.6g}, "
        f"position scale {table.position_scale:.6g}\n"
        f'duration = {table.time[-1]:.9g}\n[command]\nmode = "position"\n'
        + term("command.terms", table.position, "m" if table.linear else "rad")
        + term("load.output.terms", table.load, "N" if table.linear else "N m")
    )


def _answer(table: LoadTable, linear: bool) -> Answer:
    force, length = ("N", "m") if linear else ("N m", "rad")
    low, high = float(table.load.min()), float(table.load.max())
    left, right = float(table.position.min()), float(table.position.max())
    mach, pressure = float(table.mach.max()), float(table.dynamic_pressure.max())
    data = {
        "samples": int(table.time.size),
        "duration_s": float(table.time[-1]),
        "load": [low, high],
        "load_unit": force,
        "position": [left, right],
        "position_unit": length,
        "load_scale": table.load_scale,
        "position_scale": table.position_scale,
        "mach": mach,
        "dynamic_pressure_pa": pressure,
    }

    def show() -> None:
        answer(f"load {low:.5g} to {high:.5g} {force} over {table.time[-1]:g} s")
        print_table(
            ["what", "value"],
            [
                ["samples", f"{table.time.size} over {table.time[-1]:g} s"],
                ["load", f"{low:.5g} to {high:.5g} {force}, scale {table.load_scale:.4g}"],
                [
                    "position",
                    f"{left:.4g} to {right:.4g} {length}, scale {table.position_scale:.4g}",
                ],
                ["largest Mach number", f"{mach:.3f}"],
                ["largest dynamic pressure", f"{pressure / 1e3:.3g} kPa"],
            ],
        )

    return Answer(data, show)
