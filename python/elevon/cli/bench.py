"""``elevon bench``: the virtual test bench."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from elevon.cli import common, interrupt
from elevon.cli.groups import group
from elevon.cli.output import answer, print_table, progress_bar
from elevon.cli.shell import Answer, DoorCall, command
from elevon.option import Option

if TYPE_CHECKING:
    from elevon.bench.procedure import Procedure
    from elevon.bench.run import BenchResult

app = group("Run the virtual test bench's procedures.")


@command(app, name="list")
def list_procedures() -> Answer:
    """List the procedures that come with the package."""
    from elevon.bench.procedure import load_procedure, procedure_names

    procedures = [load_procedure(name) for name in procedure_names()]
    rows = [
        {"name": p.name, "text": p.text, "logs": [t.name for t in p.traces]} for p in procedures
    ]

    def show() -> None:
        cells = [(p.name, len(p.traces), p.text) for p in procedures]
        print_table(("procedure", "logs", "what for"), cells)

    return Answer({"procedures": rows}, show)


@command(app, "strict", door="elevon.doors:bench", working="bench", without=("layout",))
def run(door: DoorCall, *, current: str = "rms", shaft: str = "fast") -> Answer:
    """Carry out a procedure and write what the bench writes: traces, load cell, command notes.

    Parameters
    ----------
    current : str
        Convention of the currents: rms or peak.
    shaft : str
        Shaft of the encoder column: fast or slow.
    """
    from elevon.bench.procedure import load_procedure
    from elevon.logs.formats.drive import DriveFormat

    options = door.options
    out, procedure = options["out"], load_procedure(str(options["procedure"]))
    loaded = common.read_actuator(options["actuator"], options["settings"])
    ratio = loaded.parameters.value("gear.ratio") if "gear.ratio" in loaded.parameters else 1.0
    layout = DriveFormat(encoder_shaft=shaft, current_convention=current, gear_ratio=ratio)
    with interrupt.telling(lambda: _story(out, procedure, force=options["force"])):
        result: BenchResult = door(procedure=procedure, actuator=loaded, layout=layout)
    return Answer(result, lambda: _print(result, out))


@command(app)
def fly(
    flight: Annotated[Path, Option(metavar="FLIGHT")],
    *,
    actuator: str,
    out: Annotated[Path, Option(metavar="DIR")],
    fault: list[str] | None = None,
    settings: list[str] | None = None,
    load_factor: float = 0.0,
    vibration: Annotated[str, Option(metavar="QUANTITY")] = "0 m/s2",
    switch: Annotated[str, Option(metavar="QUANTITY")] = "10 s",
    seed: int = 0,
    fidelity: str = "high",
    force: bool = False,
) -> Answer:
    """Fly a nominal and a faulty actuator under one load, switched between them in flight.

    Parameters
    ----------
    flight : path
        A scenario that elevon loads has written.
    out : path
        Folder for nominal.csv and faulty.csv.
    fault : list of str
        Of the second actuator: 'KIND@PLACE=VALUE[unit]...'; repeatable.
    load_factor : float
        Along the rams, in g.
    vibration : quantity
        RMS along the rams.
    switch : quantity
        Time for which the load stays on one actuator.
    """
    from elevon.bench.flyable import FlightConditions, claim_flight, write_flight
    from elevon.bench.flyable import fly as flown
    from elevon.scenario import Scenario
    from elevon.units import parse_quantity

    unit = common.read_actuator(actuator, settings)
    aircraft = FlightConditions(load_factor, parse_quantity(vibration, "m/s2", "--vibration"))
    claim_flight(out, force=force)
    with progress_bar("flying") as advance:
        logs = flown(
            unit, Scenario.load(flight), common.read_faults(fault, unit.wiring), aircraft,
            switch=parse_quantity(switch, "s", "--switch"), seed=seed, fidelity=fidelity,
            progress=advance,
        )  # fmt: skip
    files = write_flight(out, logs, force=force)
    rows = [{"unit": log.unit, "share_loaded": log.loaded} for log in logs]

    def show() -> None:
        answer(f"{len(logs)} logs, {len(files)} files in {out}")
        cells = [(log.unit, f"{100.0 * log.loaded:.0f} %", f"{log.unit}.csv") for log in logs]
        print_table(("unit", "bears the load", "log"), cells)

    return Answer({"status": "ok", "logs": rows, "files": [str(path) for path in files]}, show)


def _print(result: BenchResult, out: Path) -> None:
    rows = [
        (
            log.name,
            f"{log.status}: {log.message}" if log.message else log.status,
            "kept" if log.resumed else "made",
            ", ".join(p.name for p in log.files),
        )
        for log in result.logs
    ]
    answer(result.headline)
    print_table(("log", "status", "", f"files in {out}"), rows)


def _story(out: Path, procedure: Procedure, *, force: bool) -> str:
    from elevon.bench.run import state_file
    from elevon.bench.traces import finished_logs

    names = [trace.name for trace in procedure.traces]
    done = [n for n in finished_logs(state_file(out.expanduser(), procedure.name)) if n in names]
    again = "give the same command again" + (", without --force," if force else "")
    if not done:
        return f"no log is finished; {again} to start over"
    return f"{len(done)} of {len(names)} logs are kept in {out}; {again} to go on"
