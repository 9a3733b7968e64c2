"""A procedure carried out on the virtual bench, log by log."""

from __future__ import annotations

import hashlib
import json
import time as clock
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar

from elevon.actuator import Actuator
from elevon.bench.loaded import LoadedSetup, loaded_setups, run_loaded, write_loaded
from elevon.bench.procedure import Procedure, procedure_names
from elevon.bench.rig import Setup, setups
from elevon.bench.stand import stand_of
from elevon.bench.traces import claim_logs, ending_of, recorded, write_traces
from elevon.errors import InputError, Interrupted
from elevon.faults import Fault
from elevon.files import check_output, write_text
from elevon.logs.formats.drive import DriveFormat
from elevon.plain import WORKING, Plain, in_unit
from elevon.progress import Progress, part
from elevon.recording import Recording
from elevon.results import Result
from elevon.worklog import WorkLog, locked, sweep


@dataclass(frozen=True)
class BenchLogFiles(Plain):
    """One log: its files, how its run ended (and why), and whether it was there before."""

    name: str
    status: str
    files: tuple[Path, ...]
    resumed: bool
    message: str = ""


@dataclass(frozen=True)
class BenchResult(Result):
    """The logs of a procedure.

    Attributes
    ----------
    procedure : str
        Its name.
    logs : tuple of BenchLogFiles
        In order.
    truth : Path or None
        Where what is hidden was written.
    sim_s, wall_s : float
        Simulated time of the logs made now, and the time it took.
    hidden : mapping
        What the logs' reader does not know.
    """

    procedure: str
    logs: tuple[BenchLogFiles, ...]
    truth: Path | None
    sim_s: Annotated[float, in_unit("s")]
    wall_s: Annotated[float, in_unit("s")] = field(compare=False)
    hidden: Annotated[Mapping[str, Any], WORKING] = field(
        default_factory=dict, repr=False, compare=False
    )

    KIND: ClassVar = "bench"
    COMPUTED: ClassVar = ("status",)
    TABLE: ClassVar = "logs"

    @property
    def status(self) -> str:
        """``ok``, or ``tripped`` where a run ended before its time."""
        return "ok" if all(log.status == "ok" for log in self.logs) else "tripped"

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        made = sum(not log.resumed for log in self.logs)
        return (
            f"{self.procedure}: {made} of {len(self.logs)} logs made, {self.sim_s:g} s simulated."
        )

    @property
    def paths(self) -> list[Path]:
        """The logs' files, one each, without what stands beside them."""
        return [path for log in self.logs for path in log.files if path.name == f"{log.name}.csv"]


AnySetup = Setup | LoadedSetup


def stand_setups(
    procedure: Procedure,
    actuator: Actuator,
    *,
    faults: Sequence[Fault | str] = (),
    seed: int = 0,
) -> Sequence[AnySetup]:
    """Return the logs of a procedure on the stand that suits the actuator, ready to be run.

    Raises
    ------
    InputError
        No stand, a procedure of another stand, and what the stand refuses.
    """
    stand = stand_of(actuator.wiring)
    if procedure.stand not in (None, stand.name):
        raise InputError(
            f"{procedure.name}: is written for the stand {procedure.stand}; {actuator.name} stands "
            f"on {stand.name}: {', '.join(procedure_names(stand.name))}"
        )
    if stand.equipment == "rotary":
        return setups(procedure, actuator, faults=faults, seed=seed)
    return loaded_setups(procedure, actuator, stand, faults=faults, seed=seed)


def state_file(folder: Path, procedure: str) -> Path:
    """Return the file beside a procedure's logs that holds how each of them ended."""
    return folder / f"bench-{procedure}.log"


def claim_bench(
    procedure: Procedure,
    actuator: Actuator,
    out: str | Path,
    *,
    seed: int = 0,
    fidelity: str = "high",
    force: bool = False,
) -> None:
    """Make a folder a procedure's own before it is run; arguments and errors as `run_procedure`.

    With `force` whatever logs are there count as absent from then on: `run_procedure` without
    `force` makes them anew. Without it, finished logs of the very same work keep counting.
    """
    logs, layout = stand_setups(procedure, actuator, seed=seed), _layout(actuator)
    _claim(procedure, Path(out).expanduser(), logs, fidelity, layout, force=force)


def run_procedure(
    procedure: Procedure,
    actuator: Actuator,
    out: str | Path,
    *,
    faults: Sequence[Fault | str] = (),
    seed: int = 0,
    fidelity: str = "high",
    layout: DriveFormat | None = None,
    truth: str | Path | None = None,
    force: bool = False,
    progress: Progress | None = None,
) -> BenchResult:
    """Carry out a procedure and write what the bench writes.

    Parameters
    ----------
    procedure : Procedure
        From `elevon.bench.procedure.load_procedure`.
    actuator : Actuator
        On the stand that its wiring's ports choose.
    out : path
        Folder. For each log NAME.csv, on a loaded stand NAME.csv.json beside it; on the rotary
        bench NAME_command.json, and NAME_loadcell.csv where a load cell has something to measure.
    faults : sequence of Fault or str
        In every log.
    seed : int
        Of chance: command start, zero in the backlash, load cell, noise.
    fidelity : str
        ``high`` or ``low``; the reduced-order model has no d current, so its column is left out.
    layout : DriveFormat, optional
        How the trace is written; default: degrees, encoder on the motor shaft, rms.
    truth : path, optional
        File (JSON) for what the logs' reader does not know.
    force : bool
        Whether logs that are there may be replaced. Without it, logs of the very same work are
        kept, with the status of their runs, and the missing ones are made; logs of other work are
        refused.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        Actuator, procedure, faults or outputs that cannot be.
    OutputExistsError
        The folder holds logs of other work.
    BusyError
        Another process works in the folder.
    DivergedError, Interrupted
        As `elevon.simulate`. Logs that were complete stay.
    """
    begin = clock.perf_counter()
    layout = layout or _layout(actuator)
    logs_asked = stand_setups(procedure, actuator, faults=faults, seed=seed)
    folder = Path(out).expanduser()
    hidden = _hidden(procedure, actuator, logs_asked, fidelity)
    text = json.dumps(hidden, indent=1, default=str) + "\n"
    same = truth is not None and _holds(Path(truth).expanduser(), text)
    if truth is not None and not same:
        check_output(truth, force=force)
    logs, simulated = [], 0.0
    with locked(folder):
        sweep(folder)
        state, resumed = _claim(procedure, folder, logs_asked, fidelity, layout, force=force)
        for number, setup in enumerate(logs_asked):
            share = part(progress, number / len(logs_asked), (number + 1) / len(logs_asked))
            if share is not None and share(0.0) is False:
                raise Interrupted(f"stopped before the log {setup.trace.name}")
            log, seconds = _one(setup, state, layout, fidelity, share, force=force or resumed)
            logs.append(log)
            simulated += seconds
    written = None if truth is None else write_text(truth, text, force=force or same)
    wall = clock.perf_counter() - begin
    return BenchResult(procedure.name, tuple(logs), written, simulated, wall, hidden)


def _layout(actuator: Actuator) -> DriveFormat:
    parameters = actuator.parameters
    return DriveFormat(
        gear_ratio=parameters.value("gear.ratio") if "gear.ratio" in parameters else 1.0
    )


def _claim(
    procedure: Procedure,
    folder: Path,
    logs: Sequence[AnySetup],
    fidelity: str,
    layout: DriveFormat,
    *,
    force: bool,
) -> tuple[WorkLog, bool]:
    names = [setup.trace.name for setup in logs]
    key = _key(logs, fidelity, layout)
    return claim_logs(state_file(folder, procedure.name), key, names, force=force)


def _key(logs: Sequence[AnySetup], fidelity: str, layout: DriveFormat) -> str:
    """Digits that tell this work from any other, and nothing about it."""
    from elevon import __version__

    work = [[setup.truth(), setup.scenario.to_dict()] for setup in logs]
    text = json.dumps([__version__, fidelity, repr(layout), work], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _one(
    setup: AnySetup,
    state: WorkLog,
    layout: DriveFormat,
    fidelity: str,
    progress: Progress | None,
    *,
    force: bool,
) -> tuple[BenchLogFiles, float]:
    name, folder = setup.trace.name, state.path.parent
    item = state.intact(name)
    known = None if item is None else ending_of(item)
    if item is not None and known is not None:
        files = tuple(folder / file for file in item.files)
        return BenchLogFiles(name, known[0], files, True, known[1]), 0.0
    if isinstance(setup, LoadedSetup):
        log, recording = run_loaded(setup, fidelity, progress)
        written = write_loaded(folder, name, log, force=force)
    else:
        recording = _drive_run(setup, fidelity, progress)
        written = write_traces(folder, setup, recording, layout, force=force)
    status, message = str(recording.meta["status"]), str(recording.meta["message"])
    if isinstance(setup, LoadedSetup):
        message = "; ".join(filter(None, (message, setup.message)))
    files = tuple(written)
    state.note(name, files, status=status, message=message)
    return BenchLogFiles(name, status, files, False, message), float(recording.meta["sim_s"])


def _drive_run(setup: Setup, fidelity: str, progress: Progress | None) -> Recording:
    from elevon.scenario.compile import signal_records
    from elevon.simulate import simulate

    record = recorded(list(signal_records(setup.actuator.wiring, fidelity)))
    return simulate(
        setup.actuator, setup.scenario, fidelity=fidelity, record=record,
        seed=setup.conditions.seed, progress=progress,
    )  # fmt: skip


def _hidden(
    procedure: Procedure, actuator: Actuator, logs: Sequence[AnySetup], fidelity: str
) -> dict[str, Any]:
    return {
        "procedure": procedure.name,
        "actuator": actuator.name,
        "fidelity": fidelity,
        "logs": [setup.truth() for setup in logs],
    }


def _holds(path: Path, text: str) -> bool:
    """Whether a file holds just this text: then it comes from the very same work."""
    try:
        return path.read_text("utf-8") == text
    except (OSError, ValueError):
        return False
