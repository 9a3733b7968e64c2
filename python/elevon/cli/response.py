"""``elevon response``: frequency response of an actuator, Bode plot, linear model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from elevon.cli import common
from elevon.cli.output import answer, print_table, progress_bar, say
from elevon.cli.shell import Answer, command

if TYPE_CHECKING:
    from elevon.response import FrequencyResponse, LoopResponse, Margin

app = typer.Typer(rich_markup_mode=None)


@command(app, "strict")
def response(
    actuator: str,
    *,
    low: str | None = None,
    high: str | None = None,
    loop: str | None = None,
    amplitude: str | None = None,
    output: str | None = None,
    mode: str | None = None,
    bias: str = "0",
    load: str = "0",
    method: str | None = None,
    realisations: int = 6,
    fidelity: str = "high",
    linear: bool = False,
    settings: list[str] | None = None,
    plot: Path | None = None,
    seed: int = 0,
    force: bool = False,
) -> Answer:
    """Measure gain, phase and coherence from the command to a signal by simulation.

    With ``--loop`` the open loop instead: gain, phase and disk margin with intervals.
    """
    from elevon.doors import response as run

    _check_plot(plot, force=force)
    loaded = common.read_actuator(actuator, settings)
    if loop is not None:
        _refuse({"--output": output, "--mode": mode, "--method": method, "--linear": linear})
    with progress_bar(f"response of {loaded.name}") as advance:
        measured = run(
            loaded, low, high, amplitude, loop=loop, output=output or "output_position",
            mode=mode or "position", method=method or "multisine", linear=linear, bias=bias,
            load=load, realisations=realisations, fidelity=fidelity, seed=seed, progress=advance,
        )  # fmt: skip
    if plot is not None:
        _save(measured, plot, force=force)
    data = measured.to_dict(stored=False)
    data = {k: v for k, v in data.items() if k not in _OPTIONAL or v is not None}
    return Answer(data, lambda: _print(measured))


def _print(measured: FrequencyResponse | LoopResponse) -> None:
    from elevon.response import LoopResponse

    answer(measured.headline)
    if isinstance(measured, LoopResponse):
        _print_loop(measured)
    else:
        _print_points(measured)


_OPTIONAL = ("linear", "band")


def _refuse(options: dict[str, str | bool | None]) -> None:
    from elevon.errors import InputError

    given = [name for name, value in options.items() if value]
    if given:
        raise InputError(f"{', '.join(given)}: not with --loop, which measures its own signals")


def _margin_value(margin: Margin) -> str:
    unknown = "not known" if margin.interval else "not reached"
    return unknown if margin.value is None else f"{margin.value:.4g}"


def _print_loop(measured: LoopResponse) -> None:
    """Print the margins with their intervals, and what to think of them."""
    margins, linear = measured.margins, measured.linear
    head, rows = ["margin", "value", "low", "high", "unit", "at [Hz]"], []
    for name, field, unit in (
        ("crossover", "crossover", "Hz"),
        ("phase margin", "phase", "deg"),
        ("gain margin", "gain", "dB"),
        ("disk margin", "disk", "1"),
    ):
        margin = getattr(margins, field)
        ends = ["", ""] if margin.interval is None else [f"{x:.4g}" for x in margin.interval]
        at = "" if margin.frequency is None else f"{margin.frequency:.3g}"
        linear_value = [] if linear is None else [_margin_value(getattr(linear, field))]
        rows.append([name, _margin_value(margin), *ends, unit, at, *linear_value])
    print_table((*head, *([] if linear is None else ["linear loop"])), rows)
    if measured.hint:
        answer(measured.hint)


def _check_plot(plot: Path | None, *, force: bool) -> None:
    from elevon.errors import unknown
    from elevon.recording.plot import PICTURES

    if plot is not None and plot.suffix.lower() not in PICTURES:
        raise unknown("ending of a plot", plot.suffix, PICTURES, str(plot))
    common.check_outputs([plot], force=force)


def _save(measured: FrequencyResponse | LoopResponse, path: Path, *, force: bool) -> None:
    from elevon.files import atomic_path

    with atomic_path(path, force=force) as temporary:
        measured.plot().savefig(temporary, format=path.suffix[1:].lower(), dpi=150)
    say(f"wrote {path}")


def _print_points(measured: FrequencyResponse) -> None:
    model = measured.linear
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
    if model is not None:
        poles = [f"{x.real:.4g}{f'{x.imag:+.4g}j' if x.imag else ''}" for x in model.poles]
        answer(f"linear model: {model.order} states, error {model.error:.2g}")
        answer(f"poles [1/s]: {', '.join(poles)}")
    if measured.band is not None:
        answer(measured.band.text)
