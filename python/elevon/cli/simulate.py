"""``elevon simulate``: one run from the command line."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from elevon.cli import common
from elevon.cli.output import print_table, progress_bar, say
from elevon.cli.shell import Answer, command

if TYPE_CHECKING:
    from elevon.recording import Recording
    from elevon.simulate import Run

app = typer.Typer(rich_markup_mode=None)

_PLOTS = (".png", ".svg", ".pdf", ".html")


@command(app, "strict")
def simulate(
    actuator: str,
    *,
    scenario: Path | None = None,
    duration: str | None = None,
    settings: list[str] | None = None,
    fault: list[str] | None = None,
    fidelity: str = "high",
    record: list[str] | None = None,
    out: Path | None = None,
    plot: Path | None = None,
    seed: int = 0,
    compare: Path | None = None,
    spectra: bool = False,
    force: bool = False,
) -> Answer:
    """Simulate one actuator and keep what it did."""
    from elevon.recording.formats import files_of
    from elevon.simulate import Run
    from elevon.simulate import simulate as run

    _check_files(out, plot, force=force)
    other = _read_other(compare, plot)
    loaded = common.read_actuator(actuator, settings)
    wanted = common.read_scenario(loaded, scenario, duration, fault)
    if out is not None:
        _check_clocks(out, Run(loaded, wanted, seed), fidelity, record, force=force)
    with progress_bar(f"simulating {loaded.name}") as advance:
        recording = run(
            loaded, wanted, fidelity=fidelity, record=record, seed=seed, progress=advance
        )
    if out is not None:
        recording.save(out, force=force)
        say(f"wrote {', '.join(str(file) for file in files_of(out))}")
    if plot is not None:
        recording.plot(path=plot, compare=other, spectra=spectra, force=force)
        say(f"wrote {plot}")
    return Answer(
        _result(recording, loaded.wiring, out, plot),
        lambda: _print_result(recording, loaded.wiring),
    )


def _check_files(out: Path | None, plot: Path | None, *, force: bool) -> None:
    from elevon.errors import InputError, unknown

    if out is not None:
        from elevon.recording.formats import check_ending

        check_ending(out)
    if plot is not None and plot.suffix.lower() not in _PLOTS:
        raise unknown("ending of a plot", plot.suffix, _PLOTS, str(plot))
    if out is not None and plot is not None and out.absolute() == plot.absolute():
        raise InputError(f"{out}: --out and --plot name the same file")
    common.check_outputs([out, plot], force=force)


def _read_other(compare: Path | None, plot: Path | None) -> Recording | None:
    """Read the recording to compare with before simulating."""
    from elevon.errors import InputError
    from elevon.recording import Recording

    if compare is None:
        return None
    if plot is None:
        raise InputError("--compare draws over a plot: give its file with --plot")
    other = Recording.load(compare)
    return other if other.meta.get("label") else other.with_meta(label=compare.name)


def _check_clocks(
    out: Path, run: Run, fidelity: str, record: list[str] | None, *, force: bool
) -> None:
    """Check before simulating that what will be recorded can be saved: a CSV has a file a clock."""
    from elevon.recording.formats import check_target
    from elevon.simulate.prepare import prepare

    plan = prepare(run, fidelity, record, notices=False).plan
    check_target(out, [clock.name for clock in plan], force=force)


def _result(recording: Any, wiring: str, out: Path | None, plot: Path | None) -> dict[str, Any]:
    meta = recording.meta
    keys = ("status", "message", "actuator", "fidelity", "seed", "parameter_hash", "version")
    return {
        **{key: meta[key] for key in keys},
        "sim_s": meta["sim_s"],
        "wall_s": meta["wall_s"],
        "ns_per_step": meta["ns_per_step"],
        "steps": meta["steps"],
        "final": recording.final,
        "labels": recording.labels,
        **_events(recording, wiring),
        "out": out,
        "plot": plot,
    }


def _events(recording: Any, wiring: str) -> dict[str, Any]:
    """Return the timeline of an actuator with a control unit; of any other nothing."""
    from elevon.simulate.timeline import has_states, timeline

    if not has_states(wiring):
        return {}
    events = [
        {"time_s": event.time, "signal": event.signal, "text": event.text}
        for event in timeline(recording, wiring)
    ]
    return {"events": events}


def _print_result(recording: Any, wiring: str) -> None:
    meta = recording.meta
    speed = meta["sim_s"] / meta["wall_s"] if meta["wall_s"] > 0.0 else float("inf")
    message = f" ({meta['message']})" if meta["message"] else ""
    typer.echo(
        f"{meta['actuator']}, {meta['fidelity']} fidelity: {meta['status']}{message}\n"
        f"{meta['sim_s']:g} s simulated in {meta['wall_s']:.3g} s "
        f"({speed:.3g} times real time, {meta['ns_per_step']:.3g} ns a step)\n"
    )
    from elevon.recording.plot import code_names

    events = _events(recording, wiring).get("events")
    if events is not None:
        lines = [[f"{event['time_s']:.3f}", event["text"]] for event in events]
        print_table(("time [s]", "event"), lines or [["", "nothing changed"]])
        typer.echo("")
    from elevon.units import display_unit, to_display

    rows = []
    for channel in recording.channels:
        name, values = channel.name, channel.values
        words = code_names(wiring, name) if events is not None and name in _WORDS else {}
        unit = display_unit(channel.unit or "1")
        if not len(channel):
            rows.append([name, unit, "", "", ""])
        elif words:
            rows.append([name, "", "", "", words.get(round(float(values[-1])), f"{values[-1]:g}")])
        else:
            displayed = to_display([values.min(), values.max(), values[-1]], unit)
            rows.append([name, unit, *(f"{x:.6g}" for x in displayed)])
    print_table(("signal", "unit", "least", "greatest", "last"), rows)


_WORDS = ("command", "state", "fault_code", "warning_code", "command_refused")
"""Signals of a control unit that are shown by name."""
