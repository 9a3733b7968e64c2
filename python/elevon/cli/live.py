"""`elevon live`: an actuator at real time in the browser."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from elevon.cli import common, interrupt
from elevon.cli.shell import add_plain
from elevon.errors import InputError
from elevon.option import Option

if TYPE_CHECKING:
    from elevon.live.bench import LiveBench
    from elevon.live.replay import LogReplay

app = typer.Typer(rich_markup_mode=None)


@add_plain(app)
def live(
    actuator: Annotated[
        str, Option(metavar="ACTUATOR|FILE", complete="actuators")
    ] = "torino-rotary",
    *,
    fidelity: str = "high",
    calibrated: Path | None = None,
    baseline: list[Path] | None = None,
    mission: Path | None = None,
    port: Annotated[int, Option(min=0, max=65535)] = 8484,
    host: str = "127.0.0.1",
    no_browser: bool = False,
    factor: Annotated[float, Option(min=0.1, max=100.0)] = 1.0,
    out: Annotated[Path, Option(metavar="DIR")] = Path(),
    hide_truth: bool = False,
    map_: Annotated[Path | None, Option("--map")] = None,
    model: Annotated[str, Option(metavar="ACTUATOR")] = "torino-rotary",
    static: Annotated[Path | None, Option(metavar="DIR")] = None,
    picture: Path | None = None,
    force: bool = False,
    seed: int = 0,
    settings: list[str] | None = None,
) -> None:
    """Show an actuator at real time in the browser: move it, break it, watch it being found out.

    Parameters
    ----------
    actuator : str
        Actuator by name or file, or a log or recording to replay.
    calibrated : path
        Actuator file, as elevon calibrate writes it.
    mission : path
        Mission, for the remaining life.
    port : int
        0: a free one.
    host : str
        Address to listen on; not loopback: a token is needed.
    no_browser : bool
        Open no page.
    factor : float
        Simulated over wall time.
    out : path
        Where recordings go.
    hide_truth : bool
        Tell nobody which faults were set.
    map_ : path
        Column map (TOML).
    model : str
        Model beside the log that is replayed.
    static : path
        Write the page with a recorded session instead.
    picture : path
        Write that session as an animated SVG instead.
    """
    common.check_outputs([static / "index.html" if static else None, picture], force=force)
    bench: LiveBench | LogReplay
    if map_ is not None or _is_log(actuator):
        bench = _replay(Path(actuator), model, settings, map_, factor)
    else:
        bench = _bench(
            str(calibrated or actuator), settings, fidelity=fidelity, seed=seed, factor=factor,
            out=out, baselines=baseline or [], mission=mission, hide_truth=hide_truth,
        )  # fmt: skip
    if static is not None:
        _page(bench, static, force=force)
    elif picture is not None:
        _picture(bench, picture, force=force)
    else:
        _serve(bench, port, host, browser=not no_browser)


def _replay(
    log: Path, model: str, settings: list[str] | None, column_map: Path | None, factor: float
) -> LogReplay:
    from elevon.live.replay import LogReplay

    actuator = common.read_actuator(model, settings)
    return LogReplay.of_file(log, actuator, column_map=column_map, factor=factor)


def _page(bench: LiveBench | LogReplay, folder: Path, *, force: bool) -> None:
    from elevon.live.picture import write_static

    paths = write_static(bench, folder, force=force)
    sys.stdout.write(f"{len(paths)} files in {folder}\n")


def _serve(bench: LiveBench | LogReplay, port: int, host: str, *, browser: bool) -> None:
    from elevon.live.server import serve

    with interrupt.telling(lambda: _story(bench)):
        serve(bench, port=port, host=host, browser=browser, ready=_ready)


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
    unit = LiveUnit(common.read_actuator(reference, settings), fidelity=fidelity, seed=seed)
    return LiveBench(
        unit, factor=factor, folder=out, baselines=baselines, mission=mission,
        hide_truth=hide_truth,
    )  # fmt: skip
