"""One run, or many in SIMD batches and threads, on the Rust core."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import Annotated, Any

from elevon.errors import ArgumentTypeError, DivergedError, InputError, Interrupted, SimulationError
from elevon.faults import Fault
from elevon.memory import check_memory
from elevon.option import Option
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

Progress = Callable[[float], Any]


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
        [run], prepared, fidelity=fidelity, threads=1, lanes=lanes, progress=progress
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

    Returns
    -------
    list of Recording
        In the order of `runs`. A run that diverged is marked in its status and keeps what was
        recorded until then.

    Raises
    ------
    InputError
        No runs; or wrong input, with the run named; or more memory needed than there is.
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
        runs, prepared, fidelity=fidelity, threads=threads, lanes=lanes, progress=progress
    )


def _simulated(
    runs: Sequence[Run],
    prepared: Sequence[Prepared],
    *,
    fidelity: str,
    threads: int | None,
    lanes: str,
    progress: Progress | None,
) -> list[Recording]:
    check_memory(sum(item.bytes for item in prepared), f"the recordings of {len(runs)} run(s)")
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
