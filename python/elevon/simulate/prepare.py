"""A run made ready for the core: everything checked, in SI, in the core's order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.errors import InputError, unknown
from elevon.features import FeaturePlan, feature_plans
from elevon.parameters import records
from elevon.parameters.records import wirings
from elevon.record_plan import MOST_STEPS, ClockPlan, record_plan
from elevon.scenario import Scenario, compile_scenario
from elevon.scenario.compile import CompiledScenario, signal_units
from elevon.simulate.acting import Notice, check_values, not_acting
from elevon.simulate.arguments import ActuatorLike, ScenarioLike, as_actuator, as_scenario
from elevon.simulate.stroke import check_stroke

Record = str | Sequence[str] | None
Features = str | Sequence[str] | None


@dataclass(frozen=True, init=False)
class Run:
    """One run of a batch.

    Attributes
    ----------
    actuator : Actuator
        What moves; a name or a path is loaded.
    scenario : Scenario
        What is commanded and what breaks; a dict or a path is read, None is the actuator's own.
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

    def __init__(
        self,
        actuator: ActuatorLike,
        scenario: ScenarioLike = None,
        seed: int = 0,
        label: str = "",
        number: int = 0,
    ) -> None:
        loaded = as_actuator(actuator)
        given = as_scenario(scenario, loaded)
        pairs = {"actuator": loaded, "scenario": given, "seed": seed, "label": label}
        for name, value in {**pairs, "number": number}.items():
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class Prepared:
    """A run ready for the core."""

    actuator: Actuator
    core: dict[str, Any]
    plan: tuple[ClockPlan, ...]
    step: float
    bytes: int
    command_unit: str
    notices: tuple[Notice, ...] = ()
    features: tuple[FeaturePlan, ...] = ()


#: A recording's own objects, whatever it holds (measured: 15 to 20 kB).
_RUN_BYTES = 20_000


def prepare_named(
    run: Run, fidelity: str, record: Record, named: bool, features: Features = None
) -> Prepared:
    """Prepare a run of a batch; its errors name it."""
    place = f"run {run.label or run.number}" if named else ""
    try:
        return prepare(run, fidelity, record, features)
    except InputError as error:
        if not place:
            raise
        raise InputError(f"{place}: {error}") from error


def prepare(
    run: Run,
    fidelity: str,
    record: Record,
    features: Features = None,
    *,
    notices: bool = True,
) -> Prepared:
    """Check a run and bring it into the form the core takes.

    With `features`, `record` may be empty: no raw signals are kept. Without `notices` it is not
    checked what has no effect: whoever prepares many runs alike checks that once.

    Raises
    ------
    InputError
        Anything that cannot be; place, value, limit and nearest names are in the message.
    """
    actuator = run.actuator
    check_fidelity(actuator.wiring, fidelity)
    actuator = actuator.with_values(
        run.scenario.parameters, source="scenario", place="scenario parameters"
    )
    findings = check_values(actuator, fidelity)
    step = solver_step(actuator, fidelity)
    compiled = compile_scenario(run.scenario, actuator.wiring, fidelity)
    check_stroke(compiled, actuator)
    bare = features is not None and record is not None and not len(record)
    plan = () if bare else _clocks(record, actuator.wiring, fidelity, step)
    summed = feature_plans(
        features,
        actuator.wiring,
        fidelity,
        command_unit=compiled.command_unit,
        step=step,
        pole_pairs=actuator.parameters.value("motor.pole_pairs"),
    )
    _check_duration(compiled.duration, step)
    extra = 1 + len(compiled.faults)
    rows = ((clock.samples(compiled.duration, step), len(clock.signals) + extra) for clock in plan)
    return Prepared(
        actuator,
        _core_run(run, actuator, compiled),
        plan,
        step,
        8 * sum(n * m for n, m in rows) + _RUN_BYTES,
        compiled.command_unit,
        (*findings, *(not_acting(actuator, compiled, fidelity) if notices else ())),
        summed,
    )


def _check_duration(duration: float, step: float) -> None:
    if duration < step:
        raise InputError(f"duration = {duration:g} s is shorter than a step ({step:g} s)")
    if duration / step >= MOST_STEPS:
        raise InputError(
            f"duration = {duration:g} s is {duration / step:.3g} solver steps of {step:g} s; "
            f"at most {MOST_STEPS:g}"
        )


def _core_run(run: Run, actuator: Actuator, compiled: CompiledScenario) -> dict[str, Any]:
    """Return one run as the core takes it."""
    return {
        "parameters": actuator.parameters.vector(),
        "inputs": compiled.inputs,
        "command_mode": compiled.command_mode,
        "faults": compiled.faults,
        "initial": dict(compiled.initial),
        "duration": compiled.duration,
        "seed": _whole(run.seed, "seed"),
        "run": _whole(run.number, "number"),
    }


def _clocks(record: Record, wiring: str, fidelity: str, step: float) -> tuple[ClockPlan, ...]:
    """Return what is kept, of runs of one model and step."""
    texts = record if isinstance(record, str) or record is None else tuple(record)
    return _planned(texts, wiring, fidelity, step)


@lru_cache(maxsize=256)
def _planned(
    record: str | tuple[str, ...] | None, wiring: str, fidelity: str, step: float
) -> tuple[ClockPlan, ...]:
    return tuple(record_plan(record, signal_units(wiring, fidelity), step))


def check_fidelity(wiring: str, fidelity: str) -> None:
    """Raise `UnknownNameError` when the wiring has no such fidelity."""
    known = wirings()[wiring]["fidelities"]
    if fidelity not in known:
        raise unknown("fidelity", fidelity, known)


def solver_step(actuator: Actuator, fidelity: str) -> float:
    """Return the step in s at which a fidelity is solved."""
    path_of_fidelity = f"{fidelity}.step"
    path = path_of_fidelity if path_of_fidelity in records(actuator.wiring) else "solver.step"
    return actuator.parameters.value(path)


def _whole(number: int, name: str) -> int:
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)):
        raise InputError(f"{name}: {number!r} is not a whole number")
    if not 0 <= number < 2**63:
        raise InputError(f"{name}: {number} is outside 0 to 2^63 - 1")
    return int(number)
