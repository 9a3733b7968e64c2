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
    from elevon.response import FrequencyResponse, LinearModel

app = typer.Typer(rich_markup_mode=None)


@app.command()
def response(
    actuator: ActuatorArgument,
    *,
    low: Annotated[str, typer.Option("--from", help="Lowest frequency.")] = "0.5 Hz",
    high: Annotated[str, typer.Option("--to", help="Highest frequency.")] = "20 Hz",
    amplitude: Annotated[
        str | None, typer.Option(help="Greatest command about its mean; by default 1 deg or 1 mm.")
    ] = None,
    output: Annotated[str, typer.Option(help="Signal that answers.")] = "output_position",
    mode: Annotated[str, typer.Option(help="Commanded: position, speed or torque.")] = "position",
    bias: Annotated[str, typer.Option(help="Mean of the command.")] = "0",
    load: Annotated[str, typer.Option(help="Constant load on the output side.")] = "0",
    method: Annotated[str, typer.Option(help="multisine or sweep.")] = "multisine",
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
    """Measure gain, phase and coherence from the command to a signal by simulation."""
    from elevon.response import frequency_response

    _check_plot(plot, force=force)
    loaded = read_actuator(actuator, settings)
    with progress_bar(f"response of {loaded.name}") as advance:
        measured = frequency_response(
            loaded,
            low,
            high,
            amplitude or _usual(loaded, mode),
            output=output,
            mode=mode,
            bias=bias,
            load=load,
            method=method,
            realisations=realisations,
            fidelity=fidelity,
            seed=seed,
            progress=advance,
        )
    model = _linear(loaded, mode, bias, load, output) if linear else None
    if plot is not None:
        _save(measured, plot, force=force)
    if json:
        extra = {} if model is None else {"linear": model.to_dict()}
        print_json({"status": "ok", "actuator": loaded.name, **measured.to_dict(), **extra})
    else:
        _print(measured, model)


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


def _save(measured: FrequencyResponse, path: Path, *, force: bool) -> None:
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
