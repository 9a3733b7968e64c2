"""A procedure carried out on the virtual bench, log by log."""

from __future__ import annotations

import hashlib
import json
import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.bench.logs.drive import DriveFormat
from elevon.bench.rig import Setup, setups
from elevon.bench.traces import recorded, trace_files, write_traces
from elevon.errors import InputError, OutputExistsError
from elevon.files import check_output, write_text
from elevon.progress import Progress, part

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.bench.procedure import Procedure
    from elevon.faults import Fault

__all__ = ["BenchLogFiles", "BenchResult", "run_procedure"]


@dataclass(frozen=True, slots=True)
class BenchLogFiles:
    """One log: its files, whether the run ended as it should, and whether it was there before."""

    name: str
    status: str
    files: tuple[Path, ...]
    resumed: bool

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        return {
            "name": self.name,
            "status": self.status,
            "files": [str(path) for path in self.files],
            "resumed": self.resumed,
        }


@dataclass(frozen=True, slots=True)
class BenchResult:
    """The logs of a procedure."""

    procedure: str
    logs: tuple[BenchLogFiles, ...]
    truth: Path | None
    sim_s: float
    wall_s: float

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "status": "ok" if all(log.status == "ok" for log in self.logs) else "tripped",
            "procedure": self.procedure,
            "logs": [log.to_dict() for log in self.logs],
            "truth": None if self.truth is None else str(self.truth),
            "sim_s": self.sim_s,
            "wall_s": self.wall_s,
        }


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
        On the bench; its wiring must be ``rotary``.
    out : path
        Folder. For each log NAME.csv, NAME_command.json, and NAME_loadcell.csv where a load cell
        has something to measure.
    faults : sequence of Fault or str
        In every log.
    seed : int
        Of chance: command start, zero in the play, load cell, noise.
    fidelity : str
        ``high`` or ``low``; the low model has no d current, so its column is left out.
    layout : DriveFormat, optional
        How the trace is written; default: degrees, encoder on the fast shaft, rms.
    truth : path, optional
        File (JSON) for what the logs' reader is not told.
    force : bool
        Whether logs that are there may be replaced. Without it, logs of the very same work are
        kept and the missing ones are made; logs of other work are refused.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        Actuator, procedure, faults or outputs that cannot be.
    OutputExistsError
        The folder holds logs of other work.
    DivergedError, Interrupted
        As `elevon.simulate`. Logs that were complete stay.
    """
    begin = clock.perf_counter()
    layout = layout or DriveFormat(gear_ratio=actuator.parameters.value("gear.ratio"))
    found = setups(procedure, actuator, faults=faults, seed=seed)
    folder = Path(out).expanduser()
    if truth is not None:
        check_output(truth, force=force)
    state = folder / f"bench-{procedure.name}.json"
    resume = _claim(state, found, _key(found, fidelity, layout), force=force)
    logs, simulated = [], 0.0
    for number, setup in enumerate(found):
        share = part(progress, number / len(found), (number + 1) / len(found))
        log, seconds = _one(setup, folder, layout, fidelity, share, resume=resume, force=force)
        logs.append(log)
        simulated += seconds
    written = _truth(truth, procedure, actuator, found, fidelity, force=force)
    wall = clock.perf_counter() - begin
    return BenchResult(procedure.name, tuple(logs), written, simulated, wall)


def _key(found: Sequence[Setup], fidelity: str, layout: DriveFormat) -> str:
    """Digits that tell this work from any other, and nothing about it."""
    from elevon import __version__

    work = [[setup.truth(), setup.scenario.to_dict()] for setup in found]
    text = json.dumps([__version__, fidelity, repr(layout), work], sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def _claim(state: Path, found: Sequence[Setup], key: str, *, force: bool) -> bool:
    """Check the folder and leave the key in it; True when there is work to resume."""
    folder = state.parent
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is not a folder")
    old = _old_key(state)
    if old == key and not force:
        return True
    if not force:
        if old is not None:
            raise OutputExistsError(
                f"{state}: belongs to other work; use force (--force) to replace them"
            )
        for setup in found:
            for path in trace_files(folder, setup.trace.name, cell=True):
                check_output(path)
    write_text(state, json.dumps({"bench": key}) + "\n", force=True)
    return False


def _old_key(state: Path) -> str | None:
    try:
        found = json.loads(state.read_text("utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise OutputExistsError(f"{state}: cannot be read ({error}); use force") from error
    return str(found.get("bench", "")) if isinstance(found, dict) else ""


def _one(
    setup: Setup,
    folder: Path,
    layout: DriveFormat,
    fidelity: str,
    progress: Progress | None,
    *,
    resume: bool,
    force: bool,
) -> tuple[BenchLogFiles, float]:
    from elevon.scenario.compile import signal_records
    from elevon.simulate import simulate

    name = setup.trace.name
    kept = [path for path in trace_files(folder, name, cell=True) if path.exists()]
    if resume and (folder / f"{name}.csv") in kept:
        return BenchLogFiles(name, "ok", tuple(kept), True), 0.0
    known = list(signal_records(setup.actuator.wiring, fidelity))
    recording = simulate(
        setup.actuator,
        setup.scenario,
        fidelity=fidelity,
        record=recorded(known),
        seed=setup.conditions.seed,
        progress=progress,
    )
    files = write_traces(folder, setup, recording, layout, force=force or resume)
    status = str(recording.meta["status"])
    return BenchLogFiles(name, status, tuple(files), False), float(recording.meta["sim_s"])


def _truth(
    path: str | Path | None,
    procedure: Procedure,
    actuator: Actuator,
    found: Sequence[Setup],
    fidelity: str,
    *,
    force: bool,
) -> Path | None:
    if path is None:
        return None
    content = {
        "procedure": procedure.name,
        "actuator": actuator.name,
        "fidelity": fidelity,
        "logs": [setup.truth() for setup in found],
    }
    return write_text(path, json.dumps(content, indent=1, default=str) + "\n", force=force)
