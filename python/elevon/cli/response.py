"""``elevon response``: frequency response of an actuator, Bode plot, linear model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from elevon.cli.common import (
    ActuatorArgument,
    FidelityOption,
    ForceOption,
    JsonOption,
    SeedOption,
    SetOption,
    StrictOption,
    check_outputs,
    read_actuator,
)
from elevon.cli.output import print_json, print_table, progress_bar, say

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.response import FrequencyResponse, LinearModel, LoopResponse

app = typer.Typer(rich_markup_mode=None)


@app.command()
def response(
    actuator: ActuatorArgument,
    *,
    low: Annotated[
        str | None, typer.Option("--from", help="Lowest frequency; by default 0.5 Hz.")
    ] = None,
    high: Annotated[
        str | None,
        typer.Option("--to", help="Highest frequency; by default 20 Hz, of a loop 2 kHz."),
    ] = None,
    loop: Annotated[
        str | None,
        typer.Option(help="Measure an open loop and its margins: position, speed or current."),
    ] = None,
    amplitude: Annotated[
        str | None, typer.Option(help="Greatest command about its mean; by default 1 deg or 1 mm.")
    ] = None,
    output: Annotated[
        str | None, typer.Option(help="Signal that answers; by default output_position.")
    ] = None,
    mode: Annotated[
        str | None, typer.Option(help="Commanded: position (default), speed or torque.")
    ] = None,
    bias: Annotated[str, typer.Option(help="Mean of the command.")] = "0",
    load: Annotated[str, typer.Option(help="Constant load on the output side.")] = "0",
    method: Annotated[str | None, typer.Option(help="multisine (default) or sweep.")] = None,
    realisations: Annotated[int, typer.Option(min=1, help="Independent inputs.")] = 6,
    fidelity: FidelityOption = "high",
    linear: Annotated[
        bool, typer.Option("--linear", help="Add the linear model of the low fidelity.")
    ] = False,
    settings: SetOption = None,
    plot: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Bode plot: .png, .svg or .pdf.")
    ] = None,
    seed: SeedOption = 0,
    strict: StrictOption = False,  # noqa: ARG001 - its callback does the work
    force: ForceOption = False,
    json: JsonOption = False,
) -> None:
    """Measure gain, phase and coherence from the command to a signal by simulation.

    With ``--loop`` the open loop instead: gain, phase and disk margin with intervals.
    """
    _check_plot(plot, force=force)
    loaded = read_actuator(actuator, settings)
    common: dict[str, Any] = {
        "bias": bias, "load": load, "realisations": realisations, "fidelity": fidelity, "seed": seed
    }  # fmt: skip
    if loop is not None:
        _refuse({"--output": output, "--mode": mode, "--method": method, "--linear": linear})
        margins = _loop(loaded, loop, (low, high, amplitude), common)
        _finish(loaded, margins, plot, {}, force=force, as_json=json)
        return
    mode, output = mode or "position", output or "output_position"
    measured = _response(
        loaded, (low or "0.5 Hz", high or "20 Hz", amplitude or _usual(loaded, mode)),
        {**common, "output": output, "mode": mode, "method": method or "multisine"},
    )  # fmt: skip
    model = _linear(loaded, mode, bias, load, output) if linear else None
    extra = {} if model is None else {"linear": model}
    _finish(loaded, measured, plot, extra, force=force, as_json=json)


def _refuse(options: dict[str, str | bool | None]) -> None:
    from elevon.errors import InputError

    given = [name for name, value in options.items() if value]
    if given:
        raise InputError(f"{', '.join(given)}: not with --loop, which measures its own signals")


def _response(
    loaded: Actuator, span: tuple[str, str, str], options: dict[str, Any]
) -> FrequencyResponse:
    from elevon.response import frequency_response

    with progress_bar(f"response of {loaded.name}") as advance:
        return frequency_response(loaded, *span, **options, progress=advance)


def _loop(
    loaded: Actuator, loop: str, span: tuple[str | None, ...], options: dict[str, Any]
) -> LoopResponse:
    from elevon.response import loop_response

    with progress_bar(f"{loop} loop of {loaded.name}") as advance:
        return loop_response(loaded, loop, *span, **options, progress=advance)


def _finish(
    loaded: Actuator,
    measured: FrequencyResponse | LoopResponse,
    plot: Path | None,
    extra: dict[str, LinearModel],
    *,
    force: bool,
    as_json: bool,
) -> None:
    """Write the plot, print the figures."""
    from elevon.response import LoopResponse

    if plot is not None:
        _save(measured, plot, force=force)
    if as_json:
        more = {name: model.to_dict() for name, model in extra.items()}
        print_json({"status": "ok", "actuator": loaded.name, **measured.to_dict(), **more})
    elif isinstance(measured, LoopResponse):
        _print_loop(measured)
    else:
        _print(measured, extra.get("linear"))


def _print_loop(measured: LoopResponse) -> None:
    """Print the margins with their intervals, and what to think of them."""
    margins = measured.margins
    rows = []
    for name, unit, margin in (
        ("crossover", "Hz", margins.crossover),
        ("phase margin", "deg", margins.phase),
        ("gain margin", "dB", margins.gain),
        ("disk margin", "1", margins.disk),
    ):
        ends = ["", ""] if margin.interval is None else [f"{x:.4g}" for x in margin.interval]
        value = "not reached" if margin.value is None else f"{margin.value:.4g}"
        at = "" if margin.frequency is None else f"{margin.frequency:.3g}"
        rows.append([name, value, *ends, unit, at])
    print_table(("margin", "value", "low", "high", "unit", "at [Hz]"), rows)
    if measured.hint:
        say(measured.hint)


def _check_plot(plot: Path | None, *, force: bool) -> None:
    from elevon.errors import unknown
    from elevon.recording.plot import PICTURES

    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise unknown("ending of a plot", plot.suffix, PICTURES, str(plot))
    check_outputs([plot], force=force)


def _usual(actuator: Actuator, mode: str) -> str:
    """Return a command small against the stroke: one that backlash and friction still shape."""
    from elevon.scenario.compile import signal_units

    if mode != "position":
        return {"speed": "60 rpm", "torque": "0.5 N m"}.get(mode, "1")
    linear = signal_units(actuator.wiring, "high")["output_position"] == "m"
    return "1 mm" if linear else "1 deg"


def _linear(actuator: Actuator, mode: str, bias: str, load: str, output: str) -> LinearModel:
    from elevon.response import linearise

    return linearise(actuator, outputs=[output], mode=mode, command=bias, load=load)


def _save(measured: FrequencyResponse | LoopResponse, path: Path, *, force: bool) -> None:
    from elevon.files import atomic_path

    with atomic_path(path, force=force) as temporary:
        measured.plot().savefig(temporary, format=path.suffix[1:].lower(), dpi=150)
    say(f"wrote {path}")


def _print(measured: FrequencyResponse, model: LinearModel | None) -> None:
    data: dict[str, Any] = measured.to_dict()
    columns = ("frequency [Hz]", "gain [dB]", "phase [deg]", "coherence", "gain +- [%]")
    numbers = zip(
        data["frequency_hz"],
        data["gain_db"],
        data["phase_deg"],
        data["coherence"],
        100.0 * 1.645 * measured.std,
        strict=True,
    )
    formats = ("{:.4g}", "{:.2f}", "{:.1f}", "{:.3f}", "{:.1f}")
    rows = [[f.format(x) for f, x in zip(formats, row, strict=True)] for row in numbers]
    print_table(columns, rows)
    for name, text in (("bandwidth_hz", "gain -3 dB"), ("lag_90_hz", "phase -90 deg")):
        value = data[name]
        typer.echo(f"{text}: " + ("not reached" if value is None else f"{value:.3g} Hz"))
    if model is not None:
        poles = [f"{x.real:.4g}{f'{x.imag:+.4g}j' if x.imag else ''}" for x in model.poles]
        typer.echo(f"linear model: {model.order} states, error {model.error:.2g}")
        typer.echo(f"poles [1/s]: {', '.join(poles)}")
