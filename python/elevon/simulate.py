"""Simulate one run, or many of them in lanes and threads, on the Rust core."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.errors import DivergedError, InputError, Interrupted, unknown
from elevon.faults import find_record
from elevon.memory import check_memory
from elevon.parameters import records
from elevon.record_plan import ClockPlan, record_plan
from elevon.recording import Channel, Clock, Recording
from elevon.scenario import Scenario, compile_scenario
from elevon.scenario.compile import signal_records

__all__ = ["Run", "batch_bytes", "simulate", "simulate_batch"]

Progress = Callable[[float], Any]
Record = str | Sequence[str] | None


@dataclass(frozen=True)
class Run:
    """One run of a batch.

    Attributes
    ----------
    actuator : Actuator
        What moves.
    scenario : Scenario
        What it is asked and what breaks.
    seed : int
        Of the random numbers.
    label : str
        A name for the reader, kept in the recording.
    number : int
        Second key of the random numbers: runs of one seed and different numbers have independent
        noise. A run gives the same result alone and in any batch.
    """

    actuator: Actuator
    scenario: Scenario
    seed: int = 0
    label: str = ""
    number: int = 0


def simulate(
    actuator: Actuator,
    scenario: Scenario,
    *,
    fidelity: str = "high",
    record: Record = None,
    seed: int = 0,
    number: int = 0,
    lanes: str = "auto",
    progress: Progress | None = None,
) -> Recording:
    """Simulate one run.

    Parameters
    ----------
    actuator : Actuator
        What moves.
    scenario : Scenario
        What it is asked, what acts on it, what breaks, for how long.
    fidelity : str
        ``high`` or ``low``.
    record : str or sequence of str, optional
        What is kept, such as ``"user_position,motor_speed@400 Hz"``; see `record_plan`.
    seed, number : int
        Keys of the random numbers.
    lanes : str
        Vector width: ``auto``, ``single``, ``portable``, ``avx2``, ``avx512``, ... as this
        processor has them; the result does not depend on it.
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
    DivergedError
        The run left the finite numbers; time and signal are named.
    Interrupted
        `progress` returned False.
    """
    run = Run(actuator, scenario, seed, number=number)
    recording = simulate_batch(
        [run], fidelity=fidelity, record=record, threads=1, lanes=lanes, progress=progress
    )[0]
    if recording.status == "diverged":
        raise DivergedError(
            f"the run diverged at {recording.meta['sim_s']:.9g} s: {recording.meta['message']}",
            time=recording.meta["sim_s"],
            signal=recording.meta.get("signal", ""),
        )
    return recording


def simulate_batch(
    runs: Sequence[Run],
    *,
    fidelity: str = "high",
    record: Record = None,
    threads: int | None = None,
    lanes: str = "auto",
    progress: Progress | None = None,
) -> list[Recording]:
    """Simulate many runs, one a lane, on several threads.

    The results are bit-identical to those of single runs, whatever the lanes and threads.

    Parameters
    ----------
    runs : sequence of Run
        Any mix of actuators and scenarios.
    fidelity, record, lanes, progress
        As for `simulate`.
    threads : int, optional
        Default: one a core.

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
    prepared = [_prepare(run, fidelity, record, len(runs) > 1) for run in runs]
    check_memory(sum(item.bytes for item in prepared), f"the recordings of {len(runs)} run(s)")
    results: list[Recording | None] = [None] * len(runs)
    done = 0
    for group in _groups(prepared):
        part = [prepared[index] for index in group]
        share = _share(progress, done, len(group), len(runs))
        for index, result in zip(group, _run_core(part, fidelity, threads, lanes, share), strict=True):
            results[index] = _recording(runs[index], prepared[index], fidelity, result)
        done += len(group)
    return [item for item in results if item is not None]


def batch_bytes(runs: Sequence[Run], *, fidelity: str = "high", record: Record = None) -> int:
    """Return the memory the recordings of a batch will take, in bytes; errors as for the batch."""
    return sum(_prepare(run, fidelity, record, len(runs) > 1).bytes for run in runs)


@dataclass(frozen=True)
class _Prepared:
    """A run ready for the core."""

    actuator: Actuator
    core: dict[str, Any]
    plan: list[ClockPlan]
    step: float
    bytes: int
    command_unit: str


#: A recording's own objects, whatever it holds (measured: 15 to 20 kB).
_RUN_BYTES = 20_000


def _prepare(run: Run, fidelity: str, record: Record, named: bool) -> _Prepared:
    place = f"run {run.label or run.number}" if named else ""
    try:
        return _prepared(run, fidelity, record)
    except InputError as error:
        if not place:
            raise
        raise InputError(f"{place}: {error}") from error


def _prepared(run: Run, fidelity: str, record: Record) -> _Prepared:
    actuator = run.actuator
    check_fidelity(actuator.wiring, fidelity)
    actuator = actuator.with_values(
        run.scenario.parameters, source="scenario", place="scenario parameters"
    )
    findings = actuator.findings(fidelity)
    if findings:
        raise InputError("\n".join(str(finding["message"]) for finding in findings))
    step = solver_step(actuator, fidelity)
    compiled = compile_scenario(run.scenario, actuator.wiring, fidelity)
    known = signal_records(actuator.wiring, fidelity)
    plan = record_plan(record, {name: item["unit"] for name, item in known.items()}, step)
    if compiled.duration < step:
        raise InputError(f"duration = {compiled.duration:g} s is shorter than a step ({step:g} s)")
    core = {
        "parameters": actuator.parameters.vector(),
        "inputs": compiled.inputs,
        "command_mode": compiled.command_mode,
        "faults": compiled.faults,
        "initial": dict(compiled.initial),
        "duration": compiled.duration,
        "seed": _whole(run.seed, "seed"),
        "run": _whole(run.number, "number"),
    }
    extra = 1 + len(compiled.faults)
    rows = ((clock.samples(compiled.duration, step), len(clock.signals) + extra) for clock in plan)
    return _Prepared(actuator, core, plan, step, 8 * sum(n * m for n, m in rows) + _RUN_BYTES, compiled.command_unit)


def check_fidelity(wiring: str, fidelity: str) -> None:
    """Raise `UnknownNameError` when the wiring has no such fidelity."""
    from elevon import _core

    known = next(item["fidelities"] for item in _core.wirings() if item["name"] == wiring)
    if fidelity not in known:
        raise unknown("fidelity", fidelity, known)


def solver_step(actuator: Actuator, fidelity: str) -> float:
    """Return the step in s at which a fidelity is solved."""
    own = f"{fidelity}.step"
    path = own if own in records(actuator.wiring) else "solver.step"
    return actuator.parameters.value(path)


def _whole(number: int, name: str) -> int:
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)):
        raise InputError(f"{name}: {number!r} is not a whole number")
    if not 0 <= number < 2**63:
        raise InputError(f"{name}: {number} is outside 0 to 2^63 - 1")
    return int(number)


def _groups(prepared: Sequence[_Prepared]) -> list[list[int]]:
    """Indices of the runs that can go to the core together: one wiring, one recording plan."""
    groups: dict[Any, list[int]] = {}
    for index, item in enumerate(prepared):
        key = (item.actuator.wiring, item.step, tuple(item.plan))
        groups.setdefault(key, []).append(index)
    return list(groups.values())


def _share(progress: Progress | None, done: int, part: int, total: int) -> Callable[[float], bool]:
    """Return the callback of one part of a batch. There always is one: it lets Ctrl-C through."""

    def report(fraction: float) -> bool:
        if progress is None:
            return True
        return progress((done + part * fraction) / total) is not False

    return report


def _run_core(
    part: Sequence[_Prepared],
    fidelity: str,
    threads: int | None,
    lanes: str,
    progress: Callable[[float], bool],
) -> list[dict[str, Any]]:
    from elevon import _core

    first = part[0]
    try:
        results = _core.simulate(
            first.actuator.wiring,
            fidelity,
            [item.core for item in part],
            [clock.to_core() for clock in first.plan],
            threads or 0,
            lanes,
            progress,
        )
    except ValueError as error:
        raise InputError(str(error)) from error
    stopped = next((item for item in results if item["status"] == "interrupted"), None)
    if stopped is not None:
        raise Interrupted(f"interrupted at {stopped['time']:.6g} s of simulated time")
    return results


def _recording(
    run: Run, prepared: _Prepared, fidelity: str, result: Mapping[str, Any]
) -> Recording:
    channels: list[Channel] = []
    clocks: list[Clock] = []
    for index, plan in enumerate(prepared.plan):
        kept = result["clocks"][plan.name]
        clock = Clock(plan.name, kept["time"], plan.rate)
        clocks.append(clock)
        channels.extend(_channels(prepared, fidelity, plan, clock, kept["values"]))
        if index == 0:
            channels.extend(_severities(prepared, clock, kept["values"][:, len(plan.signals) :]))
    return Recording(
        channels,
        clocks=clocks,
        meta=_meta(run, prepared, fidelity, result),
        labels=_labels(prepared),
        final=_final(prepared, result["final"]),
    )


def _channels(
    prepared: _Prepared,
    fidelity: str,
    plan: ClockPlan,
    clock: Clock,
    values: npt.NDArray[np.float64],
) -> Iterator[Channel]:
    known = signal_records(prepared.actuator.wiring, fidelity)
    for column, name in enumerate(plan.signals):
        item = known[name]
        unit = prepared.command_unit if name == "command" else item["unit"] or "1"
        yield Channel(name, unit, values[:, column], clock, item["text"])


def _severities(
    prepared: _Prepared, clock: Clock, values: npt.NDArray[np.float64]
) -> Iterator[Channel]:
    """The severity of each fault as it was applied, on the first clock."""
    for column, label in enumerate(_labels(prepared)):
        text = f"severity of {label['kind']}@{label['place']}"
        yield Channel(label["channel"], label["unit"], values[:, column], clock, text)


def _final(prepared: _Prepared, values: Mapping[str, float]) -> dict[str, float]:
    """Last values; the core sums energies only where they are recorded, so others are left out."""
    recorded = {name for plan in prepared.plan for name in plan.signals}
    return {
        name: value
        for name, value in values.items()
        if name in recorded or not name.startswith("energy_")
    }


def _labels(prepared: _Prepared) -> list[dict[str, Any]]:
    wiring = prepared.actuator.wiring
    return [
        {
            "channel": f"fault_{index + 1}",
            "kind": fault["kind"],
            "place": fault["place"],
            "severity": fault["severity"],
            "unit": find_record(fault["kind"], fault["place"], wiring).unit or "1",
            "attributes": fault["attributes"],
            "profile": fault["profile"]["kind"],
        }
        for index, fault in enumerate(prepared.core["faults"])
    ]


def _meta(
    run: Run, prepared: _Prepared, fidelity: str, result: Mapping[str, Any]
) -> dict[str, Any]:
    from elevon import _core

    steps = int(result["steps"])
    return {
        "status": result["status"],
        "message": result["message"],
        "signal": result.get("diverged_signal", ""),
        "label": run.label,
        "actuator": prepared.actuator.name,
        "wiring": prepared.actuator.wiring,
        "fidelity": fidelity,
        "seed": int(run.seed),
        "number": int(run.number),
        "parameter_hash": prepared.actuator.hash,
        "version": _core.version(),
        "step_s": prepared.step,
        "steps": steps,
        "sim_s": float(result["time"]),
        "wall_s": float(result["wall_s"]),
        "ns_per_step": 1e9 * float(result["wall_s"]) / steps if steps else 0.0,
        "faults": [str(fault) for fault in run.scenario.fault],
        "scenario": run.scenario.to_dict(),
    }
