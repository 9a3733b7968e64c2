"""The virtual bench set up for one log: scenario, brake, and what no one at the bench knows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.bench import steps
from elevon.bench.brake_rig import BrakeRig, BrakeRun, CellState, brake_loop
from elevon.bench.load_module import Springs, Weights, springs_of, weights_of
from elevon.bench.procedure import Procedure
from elevon.errors import InputError
from elevon.faults import Fault
from elevon.scenario import Scenario
from elevon.scenario.scenario import Term
from elevon.units import parse_quantity

RATE = 400.0  # Hz of the drive's trace (T1)
_LONGEST_WAIT = 1.0  # s from the trace's start to the trigger, and from there to the command


@dataclass(frozen=True, slots=True)
class Conditions:
    """What chance sets for one log.

    Attributes
    ----------
    trigger, start : float
        Instants of the trigger and of the command's start, on the drive's clock [s].
    zero : float
        Where in the backlash the motor stands at first: -0.5 to 0.5 of it.
    cell : CellState
        The load cell.
    seed : int
        For the noise of the actuator's sensors and of the cell.
    """

    trigger: float
    start: float
    zero: float
    cell: CellState
    seed: int


@dataclass(frozen=True)
class Rig:
    """The bench as it stands: what the steps so far have made of it."""

    backlash: float | None = None
    brake: tuple[Term, ...] = ()
    springs: Springs | None = None
    weights: Weights | None = None
    settings: Mapping[str, str | float] = field(default_factory=dict)
    equipment: BrakeRig = field(default_factory=BrakeRig)


@dataclass(frozen=True)
class BenchSetup:
    """One log about to be recorded.

    Attributes
    ----------
    trace : TraceStep
        The step.
    actuator : Actuator
        With the settings of the stand and of the operator.
    scenario : Scenario
        Command, loads as far as they are known, faults.
    conditions : Conditions
        What chance set.
    """

    trace: steps.TraceStep
    actuator: Actuator
    scenario: Scenario
    conditions: Conditions

    def truth(self) -> dict[str, object]:
        """Return what the log does not state."""
        parameters = self.actuator.parameters
        return {
            "name": self.trace.name,
            "parameter_hash": self.actuator.hash,
            "parameters": {path: entry.value for path, entry in parameters.items()},
            "conditions": asdict(self.conditions),
            "faults": [fault.to_dict() for fault in self.scenario.fault],
        }


@dataclass(frozen=True)
class Setup(BenchSetup):
    """One log of the rotary bench about to be recorded.

    Attributes
    ----------
    rig : Rig
        The bench as it stands.
    brake : BrakeRun or None
        What its brake does.
    """

    rig: Rig
    brake: BrakeRun | None

    def truth(self) -> dict[str, object]:
        """Return what the log does not state."""
        springs = self.rig.springs
        return super().truth() | {
            "brake": asdict(self.rig.equipment),
            "radial_force_n": springs.radial_force if springs else 0.0,
        }


def draw_conditions(seed: int, number: int) -> Conditions:
    """Draw what chance sets for the `number`-th log of a procedure.

    ASSUMED, as none of it is printed: waits of up to 1 s each; a cell tared to 0.3 N, drifting by
    0.01 N/s, with 0.05 N of noise (a 50 kg cell on an HX711); a microcontroller's ceramic clock
    good to 1e-3; pads within 8 % of their nominal friction.
    """
    rng = np.random.default_rng([seed, number])
    wait = rng.uniform(0.1, _LONGEST_WAIT, 2)
    cell = CellState(
        offset=float(rng.normal(0.0, 0.3)),
        drift=float(rng.normal(0.0, 0.01)),
        noise=0.05,
        clock_drift=float(rng.normal(0.0, 1e-3)),
        pad=float(np.clip(rng.normal(1.0, 0.08), 0.7, 1.3)),
    )
    zero = float(rng.uniform(-0.45, 0.45))
    return Conditions(float(wait[0]), float(wait.sum()), zero, cell, int(rng.integers(0, 2**31)))


def setups(
    procedure: Procedure,
    actuator: Actuator,
    *,
    faults: Sequence[Fault | str] = (),
    seed: int = 0,
) -> list[Setup]:
    """Go through a procedure's steps and return its logs, ready to be run.

    Raises
    ------
    InputError
        An actuator that does not fit the bench, a set point the brake cannot hold, a setting that
        does not exist.
    """
    _check(actuator)
    rig = Rig()
    setups: list[Setup] = []
    for step in procedure.step:
        if isinstance(step, steps.TraceStep):
            conditions = draw_conditions(seed, len(setups))
            setups.append(_setup(step, rig, actuator, conditions, faults))
        elif isinstance(step, steps.ForceStep | steps.RigStep | steps.SensorStep):
            raise InputError(f"{procedure.name}: the rotary bench has no {step.kind!r}")
        else:
            rig = _changed(rig, step)
    return setups


def _check(actuator: Actuator) -> None:
    if actuator.wiring != "rotary":
        raise InputError(
            f"{actuator.name}: the bench takes actuators of the wiring 'rotary', "
            f"not {actuator.wiring!r}"
        )


def _changed(
    rig: Rig,
    step: steps.BacklashStep
    | steps.BrakeStep
    | steps.SpringStep
    | steps.WeightsStep
    | steps.SettingsStep,
) -> Rig:
    if isinstance(step, steps.BacklashStep):
        return replace(rig, backlash=step.value())
    if isinstance(step, steps.BrakeStep):
        return replace(rig, brake=step.terms)
    if isinstance(step, steps.SpringStep):
        return replace(rig, springs=springs_of(step))
    if isinstance(step, steps.WeightsStep):
        return replace(rig, weights=weights_of(step))
    return replace(rig, settings={**rig.settings, **step.parameters})


def _setup(
    step: steps.TraceStep,
    rig: Rig,
    actuator: Actuator,
    conditions: Conditions,
    faults: Sequence[Fault | str],
) -> Setup:
    values: dict[str, str | float] = dict(rig.settings)
    if rig.backlash is not None:
        values["backlash.total"] = rig.backlash
    if rig.springs is not None:
        values["load.stiffness"] = rig.springs.torsional
    ready = actuator.with_values(values, source="set on the bench", place=f"trace {step.name}")
    duration = parse_quantity(step.duration, "s", "duration")
    brake = _brake(rig, conditions, duration)
    scenario = Scenario.from_dict(
        {
            "duration": duration,
            "command": moved_command(step, conditions.start),
            "load": _loads(rig, brake, conditions, ready),
            "initial": _initial(ready, conditions),
        },
        f"trace {step.name}",
    )
    if faults:
        scenario = scenario.with_faults(list(faults))
    return Setup(step, ready, scenario, conditions, rig, brake)


def _initial(actuator: Actuator, conditions: Conditions) -> dict[str, float]:
    value = actuator.parameters.value
    motor = conditions.zero * value("backlash.total") * value("gear.ratio")
    return {"motor_position": motor, "output_position": 0.0}


def _brake(rig: Rig, conditions: Conditions, duration: float) -> BrakeRun | None:
    if not rig.brake:
        return None
    cell = conditions.cell
    seconds = (duration - conditions.trigger) / (1.0 + cell.clock_drift)
    rng = np.random.default_rng([conditions.seed, 1])
    return brake_loop(rig.equipment, cell, rig.brake, seconds, rng)


def _loads(
    rig: Rig, brake: BrakeRun | None, conditions: Conditions, actuator: Actuator
) -> dict[str, Any]:
    """Loads on the drive's clock."""
    resist: list[dict[str, Any]] = []
    output: list[dict[str, Any]] = []
    if brake is not None:
        times = conditions.trigger + brake.time * (1.0 + conditions.cell.clock_drift)
        resist.append({"kind": "table", "times": times.tolist(), "values": brake.torque.tolist()})
    if rig.springs is not None:
        output.append({"kind": "constant", "value": rig.springs.preload})
        bearing = rig.springs.bearing_torque / actuator.parameters.value("gear.ratio")
        resist.append({"kind": "constant", "value": bearing})
    if rig.weights is not None:
        output.append(rig.weights.table(conditions.trigger))
    return {"brake": {"terms": resist}, "output": {"terms": output}}


def moved_command(step: steps.TraceStep, start: float) -> dict[str, Any]:
    """Return a step's command, its waveforms and actions later by `start` [s]."""
    data: dict[str, Any] = step.command.model_dump(exclude_unset=True, mode="json")
    if "terms" in data:
        data["terms"] = [moved(term, start) for term in data["terms"]]
    for action in data.get("steps", []):
        action["time"] = parse_quantity(action["time"], "s", "time") + start
    return data


def moved(term: dict[str, Any], start: float) -> dict[str, Any]:
    """Return a term of a command with its instants moved to the command's start."""
    from elevon.waveforms import wave_records

    known = {p.name: p.default for p in wave_records()[term["kind"]].parameters}
    moved = dict(term)
    for name in ("start", "time", "end"):
        given = term.get(name, known.get(name))
        if name not in known or given is None:
            continue
        seconds = parse_quantity(given, "s", name) if isinstance(given, str) else float(given)
        if math.isfinite(seconds):
            moved[name] = seconds + start
    return moved
