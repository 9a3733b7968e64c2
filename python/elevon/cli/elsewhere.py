"""`elevon export`, `safety`, `live` and `demo`: what else an actuator is for."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from elevon.cli import common, interrupt
from elevon.cli.groups import group
from elevon.cli.output import answer, print_json, print_table, progress_bar, say
from elevon.cli.shell import Answer, DoorCall, add_plain, command
from elevon.errors import InputError
from elevon.files import write_text
from elevon.option import Option

if TYPE_CHECKING:
    from elevon.demo.run import LifeDemo
    from elevon.deploy.document import RunDocument
    from elevon.deploy.fmu import FmuFile
    from elevon.live.bench import LiveBench
    from elevon.live.replay import LogReplay
    from elevon.report.checks import Check
    from elevon.safety.result import SafetyResult

export = group("Write an actuator for other tools (docs/how-to/deploy.md).")


@command(export, door="elevon.deploy:export_fmu")
def fmu(door: DoorCall) -> Answer:
    """Write an FMU for co-simulation: inputs, faults' severities, outputs, parameters."""
    made: FmuFile = door()
    version, fidelity = door.options["version"], door.options["fidelity"]
    counts = {f"{role}s": made.count(role) for role in ("input", "output", "parameter")}
    texts = ", ".join(f"{count} {name}" for name, count in counts.items())
    text = f"wrote {made.path}: FMI {version}, {fidelity} fidelity, {texts}"
    about = {"file": str(made.path), "bytes": made.bytes, "version": version, "fidelity": fidelity}
    return Answer({"status": "ok", **about, **counts}, lambda: answer(text))


@command(export, door="elevon.deploy:run_document")
def run(
    door: DoorCall,
    *,
    out: Annotated[Path, Option(("--out", "-o"))],
    fault: Annotated[list[str] | None, Option(metavar="KIND@PLACE")] = None,
    force: bool = False,
) -> Answer:
    """Write the document that the C interface makes a run from.

    Parameters
    ----------
    out : path
        The file to write.
    fault : list of str
        Held by the equations from the start; repeatable.
    """
    document: RunDocument = door()
    written = write_text(out, document.text(fault or ()), force=force)
    fidelity = door.options["fidelity"]
    names = {"outputs": list(document.signals), "inputs": list(document.units)}
    text = f"wrote {written}: {fidelity} fidelity, {len(document.signals)} outputs"
    data = {"status": "ok", "file": str(written), "fidelity": fidelity, **names}
    return Answer(data, lambda: answer(text))


@command(None, "date", door="elevon.safety:safety", working="safety campaign",
         without=("hazards", "folder"))  # fmt: skip
def safety(door: DoorCall, *, out: Path | None = None, force: bool = False) -> Answer:
    """Run failures alone and together in many situations; say which hazards, how likely.

    Parameters
    ----------
    out : path
        Folder for report.html, result.json, fmea.csv, cutsets.csv, rows/; the same command goes on
        after an interruption.
    """
    import json

    from elevon.safety.page import safety_report
    from elevon.safety.tables import write_tables

    names = ("report.html", "result.json", "fmea.csv", "cutsets.csv")
    pages = [] if out is None else [out / name for name in names]
    common.check_outputs(pages, force=force)
    model = common.read_actuator(door.options["actuator"], door.options["settings"])
    result: SafetyResult = door(actuator=model, folder=out)
    values = result.to_dict()
    if out is not None:
        page = safety_report(result, model, date=door.options["date"])
        say(f"report: {page.save(pages[0], force=force)}")
        write_text(pages[1], json.dumps(values, indent=1) + "\n", force=force)
        write_tables(result, model, out, force=force)
    code = 0 if values["status"] == "pass" else 1
    return Answer(values, lambda: _print_hazards(result), code)


def _print_hazards(result: SafetyResult) -> None:
    met = sum(item.met for item in result.hazards)
    status = str(result.to_dict()["status"]).upper()
    answer(
        f"{status}: {result.unsafe} of {result.runs} situations show a hazard; {met} of "
        f"{len(result.hazards)} hazards keep their target"
    )
    rows = [
        [item.name, item.severity, f"{item.mean:.1e}", f"{item.worst:.1e}", f"{item.target:.0e}",
         "yes" if item.met else "no", str(len(item.cut_sets)), str(item.single)]
        for item in result.hazards
    ]  # fmt: skip
    heads = ["hazard", "class", "mean 1/h", "worst 1/h", "target 1/h", "met", "cut sets", "single"]
    print_table(heads, rows, title="hazards")
    broken = [[check.name, f"{check.value:.3g}", f"{check.limit:.3g}"] for check in result.checks
              if not check.passed]  # fmt: skip
    if broken:
        print_table(["rule not kept", "value", "limit"], broken)


live_bench = typer.Typer(rich_markup_mode=None)


@add_plain(live_bench)
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
    no_token: bool = False,
    factor: Annotated[float, Option(min=0.1, max=100.0)] = 1.0,
    out: Annotated[Path, Option(metavar="DIR")] = Path(),
    hide_truth: bool = False,
    map_: Annotated[Path | None, Option("--map")] = None,
    drive: str | None = None,
    role: list[str] | None = None,
    model: Annotated[str, Option(metavar="ACTUATOR")] = "torino-rotary",
    static: Annotated[Path | None, Option(metavar="DIR")] = None,
    picture: Path | None = None,
    force: bool = False,
    seed: int = 0,
    settings: list[str] | None = None,
    as_json: bool = False,
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
        Address to listen on.
    no_browser : bool
        Open no page.
    no_token : bool
        Let everybody who reaches the address act and record.
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
    if map_ is not None or drive or role or _is_log(actuator):
        from elevon.live.replay import LogReplay

        bench = LogReplay.of_file(
            Path(actuator), common.read_actuator(model, settings), column_map=map_, factor=factor,
            drive=drive, roles=common.roles_said(role),
        )  # fmt: skip
    else:
        bench = _bench(
            str(calibrated or actuator), settings, fidelity=fidelity, seed=seed, factor=factor,
            out=out, baselines=baseline or [], mission=mission, hide_truth=hide_truth,
        )  # fmt: skip
    if static is not None or picture is not None:
        paths = _written(bench, static, picture, force=force)
        if as_json:
            print_json({"status": "ok", "files": [str(path) for path in paths]})
        else:
            answer("\n".join(f"{path}: a session of the live bench" for path in paths))
    else:
        from elevon.live.server import serve

        ready = _ready_json if as_json else _ready
        with interrupt.telling(lambda: _recorded_files(bench)):
            serve(
                bench, port=port, host=host, browser=not no_browser, token=not no_token, ready=ready
            )


def _written(
    bench: LiveBench | LogReplay, folder: Path | None, picture: Path | None, *, force: bool
) -> list[Path]:
    from elevon.live.bench import LiveBench
    from elevon.live.picture import animated_picture, write_static

    if folder is not None:
        write_static(bench, folder, force=force)
        return [folder / "index.html"]
    if not isinstance(bench, LiveBench):
        raise InputError("--picture: draws a session of an actuator, not of a log")
    path = cast(Path, picture)
    write_text(path, animated_picture(bench), force=force)
    return [path]


def _recorded_files(bench: LiveBench | LogReplay) -> str:
    names = ", ".join(str(path) for path in bench.files)
    return f"the bench is closed; recorded: {names or 'nothing'}"


def _ready(address: str, _token: str) -> None:
    sys.stdout.write(f"live at {address}\n")
    sys.stdout.flush()


def _ready_json(address: str, token: str) -> None:
    sys.stdout.write(json.dumps({"status": "ok", "url": address, "token": token}) + "\n")
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


@command(None)
def demo(
    *,
    out: Annotated[Path, Option(metavar="DIR")] = Path("out/demo"),
    seed: int = 0,
    force: bool = False,
) -> Answer:
    """Let a unit live and predict its end from bench logs; one page tells the story.

    Interrupted, it goes on where it was when the same command is given again.

    Parameters
    ----------
    out : path
        Folder for reports and logs.
    """
    from elevon.demo.run import run_life
    from elevon.report.checks import all_passed

    with interrupt.telling(lambda: _finished_text(out)), progress_bar("demo") as advance:
        result = run_life(out, seed=seed, force=force, progress=advance)
    code = 0 if all_passed(result.checks) else 1
    return Answer(result.to_dict(), lambda: _print_life(result), code)


def _print_life(result: LifeDemo) -> None:
    from elevon.demo.page import lead

    answer(lead(result))
    values = result.to_dict()
    rows = [
        (f"{r['usage']:.0f}", " + ".join(r["faults"]) or r["status"], f"{r['rul']:.0f}",
         f"{r['low']:.0f} to {r['high']:.0f}", f"{r['truth']:.0f}")
        for r in values["rows"]
    ]  # fmt: skip
    print_table(("flights", "diagnosis", "remain", "90 %", "truth"), rows)
    _print_steps(values["steps"], values["wall_s"])
    _print_checks(result.checks)
    say(f"report: {result.folder / 'report.html'}")


def _finished_text(out: Path) -> str:
    from elevon.demo.story import finished_steps

    done = finished_steps(out.expanduser())
    if not done:
        return "no step is finished; give the same command again to start over"
    return f"kept in {out}: {', '.join(done)}; give the same command again to go on"


def _print_steps(steps: Sequence[Mapping[str, Any]], seconds: float) -> None:
    rows = [(step["name"], f"{step['seconds']:.1f}", step["kept"]) for step in steps]
    print_table(("step", "s", ""), [*rows, ("all", f"{seconds:.1f}", "")])


def _print_checks(checks: Sequence[Check]) -> None:
    failed = [check for check in checks if not check.passed]
    answer(f"{len(checks) - len(failed)} of {len(checks)} checks passed")
    for check in failed:
        answer(f"failed: {check.name}: {check.value:.4g} {check.unit}, limit {check.limit:.4g}")
