"""Check every run of a plan before the first one starts: by column and by kind of run."""

from __future__ import annotations

import itertools
import shutil
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.campaign.draw import Column
from elevon.campaign.resolved import Resolved, record_of_fault
from elevon.errors import (
    FindingWarning,
    InputError,
    Interrupted,
    NotActingError,
    NotActingWarning,
)
from elevon.memory import available_bytes, format_bytes
from elevon.parameters.records import record_of
from elevon.scenario import compile_scenario
from elevon.simulate.acting import Notice, not_acting, report
from elevon.simulate.batch import checked_threads, duration_text, simulate_prepared

if TYPE_CHECKING:
    from elevon.campaign.folder import CampaignWork


#: A file of signals is about this large, and holds at most so many runs (whole SIMD batches).
_FILE_BYTES, _FILE_RUNS = 16_000_000, 256


@dataclass
class Checked:
    """What is known of the runs before they start.

    Attributes
    ----------
    sizes, steps : ndarray, shape (runs,)
        Bytes in memory and solver steps of each run.
    clocks : dict
        Name of each clock to its plan.
    idle : list of str
        What is set where it has no effect, with the reasons.
    """

    sizes: npt.NDArray[np.int64]
    steps: npt.NDArray[np.int64]
    clocks: dict[str, Any] = field(default_factory=dict)
    idle: list[str] = field(default_factory=list)


def check(resolved: Resolved, progress: Callable[[float], object] | None = None) -> Checked:
    """Check all runs: every value against its range, every run's values together.

    What decides how a run is prepared (which faults, which scenario) is worked out once for all
    runs alike; numbers are compared with their limits column by column.

    Raises
    ------
    InputError
        A run that cannot be; it is named, with place, value and limit.
    NotActingError
        Something set that has no effect, unless the plan allows it.
    """
    for column in resolved.columns:
        _check_range(resolved, column)
    count = len(resolved)
    checked = Checked(np.zeros(count, np.int64), np.zeros(count, np.int64))
    findings: dict[str, tuple[int, Notice]] = {}
    idle: dict[Notice, int] = {}
    seen: set[Any] = set()
    for number in range(count):
        prepared = resolved.prepared(number)
        checked.sizes[number] = prepared.bytes
        checked.steps[number] = round(prepared.core["duration"] / prepared.step)
        checked.clocks.update({clock.name: clock for clock in prepared.plan})
        for path, notice in _core_findings(resolved, number, prepared.core["parameters"]):
            findings.setdefault(path, (number, notice))
        if (
            sign := (resolved.structure(number), _resting_parameters(resolved, number))
        ) not in seen:
            seen.add(sign)
            for notice in _settings_without_effect(resolved, number):
                idle.setdefault(notice, number)
        if progress is not None and number % 256 == 0 and progress(number / count) is False:
            raise Interrupted(f"interrupted while run {number} of {count} was checked")
    report(
        [[Notice(FindingWarning, f"run {n}: {d.text}") for n, d in findings.values()]], strict=False
    )
    return replace(checked, idle=_report_without_effect(resolved, idle))


def borders(sizes: npt.NDArray[np.int64], most: int | None) -> list[int]:
    """Return the first run of each block, and one past the last run: the runs alone decide it.

    Parameters
    ----------
    sizes : ndarray, shape (runs,)
        Bytes of each run.
    most : int or None
        Runs in a block; default: some 16 MB, at most 256 runs.
    """
    edges, total = [0], 0
    for index, size in enumerate(int(s) for s in sizes):
        count = index - edges[-1]
        full = count >= most if most else count >= _FILE_RUNS or total + size > _FILE_BYTES
        if count and full:
            edges.append(index)
            total = 0
        total += size
    return [*edges, len(sizes)]


def check_memory(checked: Checked, edges: list[int]) -> int:
    """Return the memory in bytes that the largest block takes.

    Raises
    ------
    InputError
        More than there is; both amounts are named.
    """
    blocks = [int(checked.sizes[a:b].sum()) for a, b in itertools.pairwise(edges)]
    free, need = available_bytes(), max(blocks)
    if free is not None and need > 0.8 * free:
        first = edges[int(np.argmax(blocks))]
        raise InputError(
            f"the block from run {first} on would take {format_bytes(need)} of memory, of the "
            f"{format_bytes(free)} available (all {len(checked.sizes)} runs: "
            f"{format_bytes(int(checked.sizes.sum()))}); record fewer signals, at a lower rate, "
            "for less time, or write fewer 'runs_per_file'"
        )
    return need


def _check_range(resolved: Resolved, column: Column) -> None:
    """Compare the smallest and the largest value of a column with its limits."""
    if not column.numeric or column.kind == "scenario":
        return
    values = column.values
    for index in dict.fromkeys((int(np.argmin(values)), int(np.argmax(values)))):
        value, place = float(values[index]), f"run {index}: {column.name}"
        if column.kind == "parameter":
            record_of(resolved.wiring, column.name).check(value, place)
        elif value != 0.0:
            record_of_fault(column.name, resolved.wiring).read_severity(value, place)


def _core_findings(
    resolved: Resolved, number: int, vector: npt.NDArray[np.float64]
) -> Iterator[tuple[str, Notice]]:
    """Yield the core's findings about a run's values together; what it refuses is an error."""
    from elevon import _core

    for finding in _core.check(resolved.wiring, resolved.fidelity, vector):
        if finding.get("severity", "error") == "error":
            raise InputError(f"run {number}: {finding['message']}")
        yield str(finding["path"]), Notice(FindingWarning, str(finding["message"]))


def _resting_parameters(resolved: Resolved, number: int) -> tuple[int, ...]:
    """Return which varied parameters are zero or unchanged: what acts depends on no others."""
    known = resolved.actuator.parameters
    signs = []
    for column in resolved.columns:
        if column.kind == "parameter" and column.numeric:
            value = column.values[number]
            signs.append(int(value == 0.0) + 2 * int(value == known.value(column.name)))
    return tuple(signs)


def _settings_without_effect(resolved: Resolved, number: int) -> Iterator[Notice]:
    """Yield what is set in a run where it has no effect."""
    run = resolved.run(number)
    actuator = run.actuator.with_values(run.scenario.parameters, source="scenario")
    compiled = compile_scenario(run.scenario, resolved.wiring, resolved.fidelity)
    yield from not_acting(actuator, compiled, resolved.fidelity)


def _report_without_effect(resolved: Resolved, idle: dict[Notice, int]) -> list[str]:
    """Refuse what has no effect, or report it where the plan allows it; return the list."""
    if idle and not resolved.allow_not_acting:
        notice, number = next(iter(idle.items()))
        raise NotActingError(f"run {number}: {notice.text} (allow_not_acting = true allows it)")
    not_modelled = [
        Notice(NotActingWarning, _not_modelled(name, resolved.fidelity, reason))
        for name, reason in resolved.not_carried().items()
    ]
    report([[*not_modelled, *idle]], strict=False)
    return [notice.text for notice in (*not_modelled, *idle)]


def _not_modelled(name: str, fidelity: str, reason: str) -> str:
    why = f": {reason}" if reason else ""
    return f"fault {name} is not simulated, fidelity {fidelity} does not carry it{why}"


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
    def of(cls, work: CampaignWork, threads: int) -> Cost:
        """Return what is still to be done of a campaign, on so many threads or workers."""
        runs = [number for block in work.missing for number in work.numbers(block)]
        disk, memory = work.missing_bytes, int(work.manifest.estimate["memory"])
        seconds = _pilot_seconds(work.resolved, runs, threads)
        return cls(len(runs), len(work.missing), work.edges, disk, memory, seconds)

    def to_dict(self) -> dict[str, float]:
        """Return the JSON form."""
        return {"disk": self.disk, "memory": self.memory, "seconds": self.seconds}

    def __str__(self) -> str:
        return (
            f"{self.runs} runs in {self.blocks} block(s); about {duration_text(self.seconds)}, at "
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
    seconds = _pilot_seconds(resolved, range(len(resolved)), threads, checked.steps)
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


def _pilot_seconds(
    resolved: Resolved,
    numbers: Sequence[int],
    threads: int,
    steps: npt.ArrayLike | None = None,
) -> float:
    """Extrapolate the seconds of some runs from the first milliseconds of a few of them.

    Parameters
    ----------
    resolved : Resolved
        The plan.
    numbers : sequence of int
        The runs.
    threads : int
        That carry them out.
    steps : ndarray, shape (runs,), optional
        Solver steps of each; without, those of the few stand for all.
    """
    import time

    if not len(numbers):
        return 0.0
    chosen = np.linspace(0, len(numbers) - 1, min(_PILOT_RUNS, len(numbers))).astype(int)
    prepared = [resolved.prepared(int(numbers[at])) for at in chosen]
    pilots = [_pilot_run(item) for item in prepared]
    start = time.perf_counter()
    results = simulate_prepared(pilots, fidelity=resolved.fidelity, threads=1)
    spent = time.perf_counter() - start
    if steps is None:
        steps = len(numbers) * np.mean([item.core["duration"] / item.step for item in prepared])
    march = float(np.sum(steps)) * spent / max(sum(int(item["steps"]) for item in results), 1)
    return (march + _RUN_SECONDS * len(numbers)) / min(threads, checked_threads(None))


def _pilot_run(prepared: Any) -> Any:
    duration = min(prepared.core["duration"], _PILOT_STEPS * prepared.step)
    return replace(prepared, core={**prepared.core, "duration": duration})
