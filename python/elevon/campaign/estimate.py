"""What a campaign will take: disk, memory and time, known before it starts."""

from __future__ import annotations

import shutil
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.campaign.check import Checked, borders, check_memory
from elevon.campaign.resolved import Resolved
from elevon.errors import InputError
from elevon.memory import format_bytes
from elevon.simulate.batch import checked_threads, simulate_prepared

if TYPE_CHECKING:
    from elevon.campaign.folder import CampaignWork

#: Of a run, beside its solver steps: preparing it and writing its table (measured, one core).
_RUN_SECONDS = 0.5e-3
#: The pilot: so many runs at once, so much of each.
_PILOT_RUNS, _PILOT_STEPS = 16, 20_000


@dataclass(frozen=True)
class Cost:
    """What a campaign will take.

    Attributes
    ----------
    runs, blocks : int
        That are still to be done.
    edges : list of int
        Where the blocks begin, and the end.
    disk, memory : int
        Bytes: all data before compression, and the largest block in memory.
    seconds : float
        By a pilot of a few runs.
    """

    runs: int
    blocks: int
    edges: list[int]
    disk: int
    memory: int
    seconds: float
    checked: Checked | None = None

    @classmethod
    def of(cls, work: CampaignWork) -> Cost:
        """Return what is still to be done of a campaign."""
        about, total = work.manifest.estimate, len(work.resolved)
        runs = sum(len(work.numbers(block)) for block in work.missing)
        part = runs / total
        disk, seconds = int(about["disk"] * part), about["seconds"] * part
        memory = int(about["memory"])
        return cls(runs, len(work.missing), work.edges, disk, memory, seconds)

    def to_dict(self) -> dict[str, float]:
        """Return the JSON form."""
        return {"disk": self.disk, "memory": self.memory, "seconds": self.seconds}

    def __str__(self) -> str:
        return (
            f"{self.runs} runs in {self.blocks} block(s); about {_duration(self.seconds)}, at "
            f"most {format_bytes(self.memory)} of memory at a time, {format_bytes(self.disk)} of "
            "data"
        )


def estimate(resolved: Resolved, checked: Checked, folder: Path, threads: int) -> Cost:
    """Return what all runs will take.

    Raises
    ------
    InputError
        Too little memory, or disk where the folder is to be; both amounts are named.
    """
    edges = borders(checked.sizes, resolved.runs_per_file)
    memory = check_memory(checked, edges)
    disk = int(checked.sizes.sum())
    check_disk(folder, disk)
    seconds = _seconds(resolved, checked, threads)
    return Cost(len(resolved), len(edges) - 1, edges, disk, memory, seconds, checked)


def check_disk(folder: Path, need: int) -> None:
    """Raise `InputError` when the disk has less than `need` bytes left."""
    there = next(path for path in (folder, *folder.absolute().parents) if path.is_dir())
    free = shutil.disk_usage(there).free
    if need > free:
        raise InputError(
            f"{folder}: the data would take up to {format_bytes(need)}, of the "
            f"{format_bytes(free)} free on the disk"
        )


def _seconds(resolved: Resolved, checked: Checked, threads: int) -> float:
    """Extrapolate from the first milliseconds of some runs, spread over the plan."""
    import time

    count = min(_PILOT_RUNS, len(resolved))
    chosen = np.linspace(0, len(resolved) - 1, count).astype(int)
    pilots = [_cut(resolved.prepared(int(number))) for number in chosen]
    start = time.perf_counter()
    results = simulate_prepared(pilots, fidelity=resolved.fidelity, threads=1)
    spent = time.perf_counter() - start
    steps = max(sum(int(result["steps"]) for result in results), 1)
    work = float(checked.steps.sum()) * spent / steps + _RUN_SECONDS * len(resolved)
    return work / min(threads, checked_threads(None))


def _cut(prepared: Any) -> Any:
    duration = min(prepared.core["duration"], _PILOT_STEPS * prepared.step)
    return replace(prepared, core={**prepared.core, "duration": duration})


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.2g} s"
    return f"{seconds / 60.0:.2g} min" if seconds < 5400.0 else f"{seconds / 3600.0:.3g} h"
