"""One run, or many in SIMD batches and threads, on the Rust core."""

from __future__ import annotations

import math
import os
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Annotated, Any

from elevon.errors import (
    ArgumentTypeError,
    BudgetError,
    DivergedError,
    InputError,
    Interrupted,
    RangeError,
    SimulationError,
)
from elevon.faults import Fault
from elevon.memory import check_memory
from elevon.option import Option, Quantity
from elevon.recording import Clock, Recording
from elevon.seam import CoreResult
from elevon.simulate.acting import report
from elevon.simulate.prepare import (
    ActuatorLike,
    Features,
    Prepared,
    Record,
    Run,
    ScenarioLike,
    changed,
    prepare,
    prepare_named,
)
from elevon.simulate.result import build_recording
from elevon.units import parse_quantity

Progress = Callable[[float], Any]

BUDGET = 600.0
"""Processor time that a run may take, in s, unless more is allowed; ASSUMED: somebody waits."""

SLOWEST_STEP = 1e-6
"""Processor time in s that no solver step takes; ASSUMED: every option at once takes 0.29 us."""

PILOT_STEPS = 200_000
"""Steps by which the time of the others is estimated: some 10 to 60 ms."""


def simulate(
    actuator: ActuatorLike,
    scenario: ScenarioLike = None,
    *,
    duration: str | float | None = None,
    faults: Annotated[Sequence[Fault | str], Option("--fault", reads="faults")] = (),
    fidelity: str = "high",
    record: Annotated[Record, Option(metavar="SIGNALS@RATE", complete="signals")] = None,
    features: Features = None,
    seed: int = 0,
    number: int = 0,
    lanes: str = "auto",
    strict: bool = False,
    budget: Quantity = BUDGET,
    progress: Progress | None = None,
) -> Recording:
    """Simulate one run.

    Parameters
    ----------
    actuator : Actuator, str or path
        What moves; a name or a path is loaded.
    scenario : Scenario, mapping, path or None
        Command, loads, faults and duration: a `Scenario`, a mapping of the
        same form as the file, or a file. None: the actuator's own default scenario.
    duration : str or float, optional
        In place of the scenario's: s, or a text with its unit.
    faults : sequence of Fault or str
        Beside the scenario's own, such as ``["backlash@transmission=1 deg"]``.
    fidelity : str
        ``high`` or ``low``.
    record : str or sequence of str, optional
        What is kept, such as ``"output_position,motor_speed@400 Hz"`` or ``"current_a@every"``; a
        list of several, too, see `record_plan`. Empty, with `features`: nothing.
    features : str or sequence of str, optional
        Features computed while simulating, such as ``"all@400 Hz"``; see `elevon.features`. They
        stand in ``meta["features"]`` (SI; None where the motion gives none) and their units in
        ``meta["feature_units"]``.
    seed, number : int
        Keys of the random numbers.
    lanes : str
        Vector width: ``auto``, ``single``, ``portable``, ``avx2``, ``avx512``, ... as this
        processor has them; the result does not depend on it.
    strict : bool
        What is set where it has no effect is an error, not a warning.
    budget : float or str
        Processor time that the run may take, in s, or such as ``"2 h"``.
    progress : callable, optional
        Called some ten times a second with the done fraction; returning False interrupts.

    Returns
    -------
    Recording
        Status ``ok`` or ``tripped``, named channels in SI, one or several clocks.

    Raises
    ------
    InputError
        Anything in actuator, scenario or record that cannot be; place, value, limit are named.
    NotActingError
        `strict`, and something set has no effect.
    BudgetError
        By a pilot of its first steps the run would take longer than `budget`.
    DivergedError
        The run left the finite numbers; time and signal are named.
    Interrupted
        `progress` returned False.

    Warns
    -----
    NotActingWarning
        A parameter or fault is set away from neutral where it has no effect.
    FindingWarning
        The core questions the values together.
    """
    run = Run(actuator, scenario, seed, number=number)
    if duration is not None or faults:
        run = replace(run, scenario=changed(run.scenario, duration, faults))
    prepared = [prepare(run, fidelity, record, features)]
    report([prepared[0].notices], strict=strict)
    recording = _simulated(
        [run], prepared, fidelity=fidelity, threads=1, lanes=lanes, budget=budget, progress=progress
    )[0]
    if recording.status == "diverged":
        raise DivergedError(
            f"the run stopped: {recording.meta['message']}",
            time=recording.meta["sim_s"],
            signal=recording.meta.get("signal", ""),
        )
    return recording


def simulate_batch(
    runs: Sequence[Run],
    *,
    fidelity: str = "high",
    record: Record = None,
    features: Features = None,
    threads: int | None = None,
    lanes: str = "auto",
    strict: bool = False,
    budget: Quantity = BUDGET,
    progress: Progress | None = None,
) -> list[Recording]:
    """Simulate many runs, in SIMD batches on several threads.

    The results are bit-identical to those of single runs, whatever the batches and threads.

    Parameters
    ----------
    runs : sequence of Run
        Any mix of actuators and scenarios.
    fidelity, record, features, lanes, strict, progress
        As for `simulate`; what has no effect is reported once, however many runs set it.
    threads : int, optional
        Default, and most: one a core.
    budget : float or str
        Processor time that each run may take, in s, or such as ``"2 h"``.

    Returns
    -------
    list of Recording
        In the order of `runs`. A run that diverged is marked in its status and keeps what was
        recorded until then.

    Raises
    ------
    InputError
        No runs; or wrong input, with the run named; or more memory needed than there is.
    BudgetError
        By a pilot a run would take longer than `budget`.
    Interrupted
        `progress` returned False.
    """
    if not runs:
        raise InputError("a batch needs at least one run")
    for index, run in enumerate(runs):
        if not isinstance(run, Run):
            raise ArgumentTypeError(
                f"runs[{index}]: a {type(run).__name__} is no run; expected elevon.Run(actuator, "
                "scenario)"
            )
    checked_threads(threads)
    prepared = [prepare_named(run, fidelity, record, len(runs) > 1, features) for run in runs]
    report([item.notices for item in prepared], strict=strict)
    return _simulated(
        runs,
        prepared,
        fidelity=fidelity,
        threads=threads,
        lanes=lanes,
        budget=budget,
        progress=progress,
    )


def _simulated(
    runs: Sequence[Run],
    prepared: Sequence[Prepared],
    *,
    fidelity: str,
    threads: int | None,
    lanes: str,
    budget: float | str,
    progress: Progress | None,
) -> list[Recording]:
    check_memory(sum(item.bytes for item in prepared), f"the recordings of {len(runs)} run(s)")
    check_budget(prepared, fidelity, budget)
    results: list[Recording | None] = [None] * len(runs)
    done = 0
    for group in _groups(prepared):
        part = [prepared[index] for index in group]
        share = _share(progress, done, len(group), len(runs))
        clocks: dict[tuple[str, float, int], Clock] = {}
        for index, result in zip(
            group, run_core(part, fidelity, threads, lanes, share), strict=True
        ):
            results[index] = build_recording(runs[index], prepared[index], fidelity, result, clocks)
        done += len(group)
    return [item for item in results if item is not None]


def simulate_prepared(
    prepared: Sequence[Prepared],
    *,
    fidelity: str,
    threads: int | None = None,
    lanes: str = "auto",
    progress: Progress | None = None,
) -> list[CoreResult]:
    """Simulate runs that are ready for the core; return what it says of each, in their order.

    Errors as `simulate_batch`. Each result has ``status``, ``message``, ``time``, ``steps`` and
    ``clocks``: name to ``time``, shape (n,), and ``values``, shape (n, signals + faults).
    """
    results: dict[int, CoreResult] = {}
    done = 0
    for group in _groups(prepared):
        share = _share(progress, done, len(group), len(prepared))
        part = [prepared[index] for index in group]
        for index, result in zip(
            group, run_core(part, fidelity, threads, lanes, share), strict=True
        ):
            results[index] = result
        done += len(group)
    return [results[index] for index in range(len(prepared))]


def check_budget(prepared: Sequence[Prepared], fidelity: str, budget: float | str) -> None:
    """Raise `BudgetError` where the longest of some runs would take longer than it may.

    Parameters
    ----------
    prepared : sequence of Prepared
        The runs.
    fidelity : str
        Of all of them.
    budget : float or str
        Processor time of a run, in s, or such as ``"2 h"``.
    """
    allowed = parse_quantity(budget, "s", "budget")
    if not allowed > 0.0:
        raise RangeError(f"budget = {budget}: must be above 0 s")
    longest = max(prepared, key=lambda item: item.core["duration"] / item.step)
    steps = longest.core["duration"] / longest.step
    if steps * SLOWEST_STEP <= allowed:
        return
    seconds = steps * pilot_seconds(longest, fidelity)
    if seconds > allowed:
        raise BudgetError(
            f"{steps:.3g} solver steps of {longest.step:g} s would take {duration_text(seconds)} "
            f"of one core, and a run may take {duration_text(allowed)}: take a longer step "
            f"({fidelity}.step, solver.step), simulate less time, or allow more "
            f"(--budget '{math.ceil(1.2 * seconds / 3600.0)} h', in Python budget=)",
            seconds,
            longest.bytes,
        )


def pilot_seconds(prepared: Prepared, fidelity: str) -> float:
    """Return the processor time of a solver step, by a run's first steps."""
    duration = min(prepared.core["duration"], PILOT_STEPS * prepared.step)
    pilot = replace(prepared, core={**prepared.core, "duration": duration})
    start = time.process_time()
    (result,) = run_core([pilot], fidelity, 1, "auto", lambda _: True)
    return (time.process_time() - start) / max(int(result["steps"]), 1)


def duration_text(seconds: float) -> str:
    """Return a time for the reader: ``3.2 min``."""
    for unit, size in (("s", 1.0), ("min", 60.0), ("h", 3600.0), ("days", 86400.0)):
        if seconds < 90.0 * size:
            return f"{seconds / size:.2g} {unit}"
    return f"{seconds / 3.15576e7:.3g} years"


#: More threads than this are no wish but a slip.
_MOST_THREADS = 1024


def checked_threads(threads: int | None) -> int:
    """Return how many threads are started: as many as given, at most one a core.

    Raises
    ------
    InputError
        Not a whole number, or outside 1 to 1024.
    """
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    if threads is None:
        return cores or 1
    if isinstance(threads, bool) or not isinstance(threads, int):
        raise InputError(f"threads = {threads!r} is not a whole number")
    if not 1 <= threads <= _MOST_THREADS:
        raise InputError(f"threads = {threads} is outside 1 to {_MOST_THREADS}")
    return min(threads, cores or 1)


def batch_bytes(
    runs: Sequence[Run], *, fidelity: str = "high", record: Record = None, strict: bool = False
) -> int:
    """Return the memory the recordings of a batch will take, in bytes.

    Errors as for the batch; it does not warn.
    """
    prepared = [prepare_named(run, fidelity, record, len(runs) > 1) for run in runs]
    if strict:
        report([item.notices for item in prepared], strict=True)
    return sum(item.bytes for item in prepared)


def _groups(prepared: Sequence[Prepared]) -> list[list[int]]:
    """Indices of the runs that can go to the core together: one wiring, one recording plan."""
    groups: dict[Any, list[int]] = {}
    for index, item in enumerate(prepared):
        key = (item.actuator.wiring, item.step, tuple(item.plan), item.features)
        groups.setdefault(key, []).append(index)
    return list(groups.values())


def _share(progress: Progress | None, done: int, part: int, total: int) -> Callable[[float], bool]:
    """Return the callback of one part of a batch. There always is one: it lets Ctrl-C through."""

    def report(fraction: float) -> bool:
        if progress is None:
            return True
        return progress((done + part * fraction) / total) is not False

    return report


def run_core(
    part: Sequence[Prepared],
    fidelity: str,
    threads: int | None,
    lanes: str,
    progress: Callable[[float], bool],
) -> list[CoreResult]:
    """Run what is ready for the core, of one wiring and plan; errors as `simulate_batch`."""
    from elevon import _core

    first = part[0]
    try:
        results = _core.simulate(
            first.actuator.wiring,
            fidelity,
            [item.core for item in part],
            [
                *(clock.to_core() for clock in first.plan),
                *(clock.to_core() for clock in first.features),
            ],
            checked_threads(threads),
            lanes,
            progress,
        )
    except ValueError as error:
        raise InputError(str(error)) from error
    stopped = next((item for item in results if item["status"] == "interrupted"), None)
    if stopped is not None:
        raise Interrupted(f"interrupted at {stopped['time']:.6g} s of simulated time")
    return results


def completed(recordings: Iterable[Recording], what: str = "") -> list[Recording]:
    """Return runs that all reached their end.

    Parameters
    ----------
    recordings : iterable of Recording
        The runs.
    what : str
        Named in the error; empty: each run's label.

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    whole = []
    for run in recordings:
        if run.status != "ok":
            raise SimulationError(f"{what or run.meta['label']}: {run.meta['message']}", run.status)
        whole.append(run)
    return whole
