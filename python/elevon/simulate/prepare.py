"""A run made ready for the core: everything checked, in SI, in the core's order."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Annotated, Any

import numpy as np

from elevon.actuator import Actuator
from elevon.errors import ArgumentTypeError, InputError, RangeError, unknown
from elevon.faults import Fault
from elevon.features import FeaturePlan, feature_plans
from elevon.option import Option
from elevon.parameters import records
from elevon.parameters.records import wirings
from elevon.record_plan import MOST_STEPS, ClockPlan, record_plan
from elevon.scenario import Scenario, compile_scenario
from elevon.scenario.compile import CompiledScenario, signal_units
from elevon.simulate.acting import Notice, check_values, not_acting
from elevon.waveforms import TABLE, wave_records

ActuatorLike = Annotated[Actuator | str | os.PathLike[str], Option(reads="actuator")]
ScenarioLike = Scenario | Mapping[str, Any] | str | os.PathLike[str] | None


def as_actuator(given: ActuatorLike, place: str = "actuator") -> Actuator:
    """Return an actuator: as given, or loaded by its name or from its file.

    Raises
    ------
    ArgumentTypeError
        Something else was given; the message says what is expected.
    InputError
        No such actuator, or a wrong file.
    """
    if isinstance(given, Actuator):
        return given
    if isinstance(given, (str, os.PathLike)):
        return Actuator.load(given)
    raise ArgumentTypeError(
        f"{place}: {_kind(given)} is no actuator; expected an Actuator, a name "
        "('torino-rotary') or the path of a TOML file"
    )


def changed(
    scenario: Scenario, duration: str | float | None, faults: Sequence[Fault | str]
) -> Scenario:
    """Return a scenario of another duration, if any is given, and with further faults.

    Raises
    ------
    ArgumentTypeError
        The faults are one text, not a list of them.
    InputError
        A duration or a fault that cannot be.
    """
    if isinstance(faults, (str, Fault)):
        raise ArgumentTypeError(f"faults: {faults!r} is one fault; expected a list: [{faults!r}]")
    if duration is not None:
        scenario = scenario.replaced(duration=duration)
    return scenario.with_faults(faults) if faults else scenario


def as_scenario(given: ScenarioLike, actuator: Actuator, place: str = "scenario") -> Scenario:
    """Return a scenario: as given, of a mapping, from a file; None means the actuator's own.

    Raises
    ------
    ArgumentTypeError
        Something else was given; the message says what is expected.
    InputError
        The mapping or the file is wrong, or the actuator has no scenario of its own.
    """
    if isinstance(given, Scenario):
        return given
    if given is None:
        return _default(actuator)
    if isinstance(given, Mapping):
        return Scenario.from_dict(given, place)
    if isinstance(given, (str, os.PathLike)):
        return Scenario.load(given)
    raise ArgumentTypeError(
        f"{place}: {_kind(given)} is no scenario; expected a Scenario, a dict of a scenario file's "
        "form, the path of a TOML file, or None for the actuator's own"
    )


def _default(actuator: Actuator) -> Scenario:
    if actuator.default_scenario is None:
        raise InputError(
            f"{actuator.name} has no scenario of its own; give one (command line: --scenario FILE)"
        )
    return Scenario.from_dict(actuator.default_scenario, f"{actuator.name}: scenario")


def _kind(given: object) -> str:
    name = type(given).__name__
    return f"{'an' if name[0].lower() in 'aeiou' else 'a'} {name}"


def check_stroke(compiled: CompiledScenario, actuator: Actuator) -> None:
    """Check the position command of an actuator that travels against its stroke.

    Only a command of one waveform has a range that is known without running it; a sum is left to
    the stops. A turning output may be driven into its stops on purpose: that is a test.

    Raises
    ------
    RangeError
        The message names the command's range and the stop.
    """
    terms = [term for term in compiled.inputs["command"] if term["enabled"]]
    if compiled.command_mode != "position" or compiled.command_unit != "m" or len(terms) != 1:
        return
    low, high = _range(terms[0])
    for path, value, beyond in (
        ("stop.lower", low, low < actuator.parameters.value("stop.lower")),
        ("stop.upper", high, high > actuator.parameters.value("stop.upper")),
    ):
        if beyond:
            limit = actuator.parameters.value(path)
            raise RangeError(
                f"command: reaches {1e3 * value:.6g} mm, beyond {path}, {1e3 * limit:.6g} mm"
            )


def _range(term: Mapping[str, Any]) -> tuple[float, float]:
    """Return the lowest and the highest value of a waveform."""
    kind = term["kind"]
    values = dict(zip(wave_records()[kind].names, term["parameters"], strict=True))
    if kind == TABLE:
        points = [values["gain"] * float(value) for value in term["values"]]
        return min(points), max(points)
    if "amplitude" in values:
        size, bias = abs(values["amplitude"]), values["bias"]
        return bias - size, bias + size
    # A ramp without an end has no range; its end is the solver's business.
    levels = [values[n] for n in ("value", "initial", "final", "low", "high") if n in values]
    return min(levels), max(levels)


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
