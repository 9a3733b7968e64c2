"""`elevon live`: an actuator at real time in the browser."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from elevon.cli import completion, interrupt
from elevon.cli.common import SeedOption, SetOption, check_outputs, read_actuator
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.live.bench import LiveBench
    from elevon.live.replay import LogReplay

app = typer.Typer(rich_markup_mode=None)


@app.command()
def live(
    actuator: Annotated[
        str,
        typer.Argument(
            metavar="[ACTUATOR|FILE]",
            help="Actuator by name or file, or a log or recording to replay.",
            autocompletion=completion.actuators,
        ),
    ] = "torino-rotary",
    *,
    fidelity: Annotated[
        str, typer.Option(help="high or low.", autocompletion=completion.fidelities)
    ] = "high",
    calibrated: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Actuator file, as elevon calibrate writes it."),
    ] = None,
    baseline: Annotated[
        list[Path] | None,
        typer.Option("--baseline", metavar="LOG", help="Healthy log; repeatable."),
    ] = None,
    mission: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Mission, for the remaining life.")
    ] = None,
    port: Annotated[int, typer.Option(min=0, max=65535, help="0: a free one.")] = 8484,
    host: Annotated[
        str, typer.Option(help="Address to listen on; not loopback: a token is needed.")
    ] = "127.0.0.1",
    no_browser: Annotated[bool, typer.Option("--no-browser", help="Open no page.")] = False,
    factor: Annotated[
        float, typer.Option(min=0.1, max=100.0, help="Simulated over wall time.")
    ] = 1.0,
    out: Annotated[Path, typer.Option(metavar="DIR", help="Where recordings go.")] = Path(),
    hide_truth: Annotated[
        bool, typer.Option("--hide-truth", help="Tell nobody which faults were set.")
    ] = False,
    map_: Annotated[
        Path | None,
        typer.Option("--map", metavar="FILE", help="Column map of the log that is replayed."),
    ] = None,
    model: Annotated[
        str,
        typer.Option(metavar="ACTUATOR", help="Model beside the log that is replayed."),
    ] = "torino-rotary",
    static: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Write the page with a recorded session instead."),
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="Write that session as an animated SVG instead."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace existing files.")] = False,
    seed: SeedOption = 0,
    settings: SetOption = None,
) -> None:
    """Show an actuator at real time in the browser: move it, break it, watch it being found out."""
    from elevon.live.server import serve

    check_outputs([static / "index.html" if static else None, picture], force=force)
    bench: LiveBench | LogReplay
    if map_ is not None or _is_log(actuator):
        from elevon.live.replay import LogReplay

        bench = LogReplay.of_file(
            Path(actuator), read_actuator(model, settings), column_map=map_, factor=factor
        )
    else:
        bench = _bench(
            str(calibrated or actuator), settings, fidelity=fidelity, seed=seed, factor=factor,
            out=out, baselines=baseline or [], mission=mission, hide_truth=hide_truth,
        )  # fmt: skip
    if static is not None:
        from elevon.live.static import write_static

        paths = write_static(bench, static, force=force)
        sys.stdout.write(f"{len(paths)} files in {static}\n")
        return
    if picture is not None:
        _picture(bench, picture, force=force)
        return
    with interrupt.telling(lambda: _story(bench)):
        serve(bench, port=port, host=host, browser=not no_browser, ready=_ready)


def _picture(bench: LiveBench | LogReplay, path: Path, *, force: bool) -> None:
    from elevon.files import write_text
    from elevon.live.bench import LiveBench
    from elevon.live.picture import animated_picture

    if not isinstance(bench, LiveBench):
        raise InputError("--picture: draws a session of an actuator, not of a log")
    write_text(path, animated_picture(bench), force=force)
    sys.stdout.write(f"{path}: a session of the live bench\n")


def _story(bench: LiveBench | LogReplay) -> str:
    names = ", ".join(str(path) for path in bench.files)
    return f"the bench is closed; recorded: {names or 'nothing'}"


def _ready(address: str) -> None:
    sys.stdout.write(f"live at {address}\n")
    sys.stdout.flush()


def _is_log(given: str) -> bool:
    return Path(given).suffix.lower() not in ("", ".toml") and Path(given).exists()


def _bench(
    reference: str, settings: list[str] | None, *, fidelity: str, seed: int, factor: float,
    out: Path, baselines: list[Path], mission: Path | None, hide_truth: bool,
) -> LiveBench:  # fmt: skip
    from elevon.live.bench import LiveBench
    from elevon.live.unit import LiveUnit

    for path in [*baselines, *([mission] if mission else [])]:
        if not path.expanduser().is_file():
            raise InputError(f"{path}: no such file")
    if fidelity not in ("high", "low"):
        raise InputError(f"--fidelity {fidelity!r}: high or low")
    unit = LiveUnit(read_actuator(reference, settings), fidelity=fidelity, seed=seed)
    return LiveBench(
        unit, factor=factor, folder=out, baselines=baselines, mission=mission,
        hide_truth=hide_truth,
    )  # fmt: skip
