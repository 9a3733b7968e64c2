"""Logs of the bench: many at once in batches, written by the bench, read as a user reads them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from studies.diagnosis_limits.unit import BenchUnit, of_the_day

if TYPE_CHECKING:
    from elevon.bench.procedure import Procedure
    from elevon.bench.rig import Setup
    from elevon.logs.log import Log
    from elevon.progress import Progress

__all__ = ["STREAM", "TESTS", "Trial", "bench_logs"]

_SINE = {"kind": "sine", "amplitude": "7 deg", "bias": "10 deg", "frequency": "0.2 Hz"}
_SLOW = {"kind": "sine", "amplitude": "45 deg", "bias": "60 deg", "frequency": "0.05 Hz"}
_CHIRP = {
    "kind": "chirp",
    "amplitude": "3 deg",
    "bias": "10 deg",
    "start_frequency": "0.1 Hz",
    "end_frequency": "1.1 Hz",
    "sweep_time": "20 s",
}
_RAMP = {"kind": "ramp", "initial": "0.2 N m", "slope": "0.09 N m/s", "start": "0 s", "end": "20 s"}
_BRAKE = {"kind": "brake", "terms": [_RAMP]}

#: The bench's own no-load, chirp and loaded tests, each unit with its own backlash.
TESTS: dict[str, tuple[dict[str, Any], ...]] = {
    "noload": ({"kind": "trace", "command": {"terms": [_SINE]}},),
    "chirp": ({"kind": "trace", "command": {"terms": [_CHIRP]}},),
    "loaded": (_BRAKE, {"kind": "trace", "command": {"terms": [_SLOW]}}),
}

STREAM = "stream"  # the no-load test for 100 s: what a monitor watches
_STEPS = {**TESTS, STREAM: TESTS["noload"]}
_DURATION = {STREAM: "100 s"}


@dataclass(frozen=True)
class Trial:
    """One log about to be made.

    Attributes
    ----------
    name : str
        Of the log, and its key in what is finished.
    test : str
        Key of `TESTS`, or `STREAM`.
    faults : tuple of str
        As in ``--fault``.
    seed : int
        Of the command's start, noise, and the day.
    day : int, optional
        Seed of the day, for logs of one day; default: `seed`.
    """

    name: str
    test: str
    faults: tuple[str, ...]
    seed: int
    day: int | None = None


def bench_logs(
    unit: BenchUnit, trials: Sequence[Trial], folder: Path, progress: Progress | None = None
) -> list[Log]:
    """Run trials in one batch and return the logs as they are read from their files."""
    from elevon.bench.run import stand_setups
    from elevon.bench.traces import recorded, write_traces
    from elevon.logs.formats.drive import DriveFormat
    from elevon.logs.read import read_drive_logs
    from elevon.scenario.compile import signal_records
    from elevon.simulate import Run, simulate_batch

    setups: list[Setup] = []
    for trial in trials:
        ready = of_the_day(unit, trial.seed if trial.day is None else trial.day)
        setups += stand_setups(_procedure(trial.test), ready, faults=trial.faults, seed=trial.seed)  # type: ignore[arg-type]
    record = recorded(list(signal_records("rotary", "high")))
    runs = [Run(s.actuator, s.scenario, s.conditions.seed) for s in setups]
    recordings = simulate_batch(runs, fidelity="high", record=record, progress=progress)
    layout = DriveFormat(gear_ratio=unit.actuator.parameters.value("gear.ratio"))
    logs = []
    for trial, setup, recording in zip(trials, setups, recordings, strict=True):
        place = folder / trial.name
        place.mkdir(parents=True, exist_ok=True)
        files = write_traces(place, setup, recording, layout, force=True)
        logs += read_drive_logs([files[-1]])
    return logs


@lru_cache(maxsize=8)
def _procedure(test: str) -> Procedure:
    from elevon.bench.procedure import Procedure

    steps = [dict(step) for step in _STEPS[test]]
    steps[-1] |= {"name": test, "duration": _DURATION.get(test, "20 s")}
    return Procedure.model_validate({"name": test, "step": steps})
