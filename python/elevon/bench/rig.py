"""The virtual bench set up for one log: scenario, brake, and what no one at the bench knows."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.bench.procedure import (
    BacklashStep,
    BrakeStep,
    ForceStep,
    Procedure,
    RigStep,
    SensorStep,
    SettingsStep,
    SpringStep,
    TraceStep,
    WeightsStep,
)
from elevon.errors import InputError, RangeError
from elevon.faults import Fault
from elevon.scenario import Scenario
from elevon.scenario.scenario import Term
from elevon.units import parse_quantity
from elevon.waveforms import TABLE, evaluate, unit_of, wave_records


@dataclass(frozen=True, slots=True)
class Hx711:
    """The load cells' 24-bit converter (HX711).

    Attributes
    ----------
    full_scale : float
        Force at full scale [N]. ASSUMED 490 N (a 50 kg cell): the cells are not printed.
    bits : int
        Width of the converter.
    rate : float
        Samples a second: 10 or 80 by a pin of the chip; 80 ASSUMED.
    """

    full_scale: float = 490.0
    bits: int = 24
    rate: float = 80.0

    @property
    def step(self) -> float:
        """Force of one count [N]."""
        return 2.0 * self.full_scale / float(2**self.bits)

    def convert(self, force: npt.ArrayLike) -> Floats:
        """Return forces [N] as the converter reports them: in whole counts, clipped at its ends."""
        top = 2 ** (self.bits - 1)
        counts = np.clip(np.rint(np.asarray(force, dtype=np.float64) / self.step), -top, top - 1)
        return np.asarray(counts * self.step, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class BrakeRig:
    """The parts of the brake rig and their numbers.

    Attributes
    ----------
    chain_ratio : float
        Turns of the motor for one of the disk. ASSUMED 4.5: 20 to 30 N m at the disk must reach
        the motor's 6 N m.
    arm : float
        From the disk's axis to the load cell [m]. ASSUMED 0.1: the disk's torque then loads a
        50 kg cell to one half.
    disk_torque : float
        Torque of the closed brake at the disk [N m]: the middle of the printed 20 to 30.
    proportional : float
        Commanded opening, over the disk's torque, for an error of that size. ASSUMED.
    integral : float
        1/s, likewise. ASSUMED: its zero cancels the servo's lag.
    servo_lag : float
        s. ASSUMED: a hobby servo under load.
    servo_rate : float
        Full strokes a second. ASSUMED: 60 degrees in 0.2 s, stroke 90 degrees.
    """

    chain_ratio: float = 4.5
    arm: float = 0.1
    disk_torque: float = 25.0
    proportional: float = 0.5
    integral: float = 5.0
    servo_lag: float = 0.1
    servo_rate: float = 3.3

    @property
    def limit(self) -> float:
        """Greatest torque on the motor shaft [N m]."""
        return self.disk_torque / self.chain_ratio


@dataclass(frozen=True, slots=True)
class CellState:
    """Quantities of the load cell that nobody knows during the measurement.

    Attributes
    ----------
    offset : float
        N, after taring.
    drift : float
        N/s.
    noise : float
        Standard deviation of a sample [N].
    clock_drift : float
        Its clock's error: one of its seconds lasts (1 + clock_drift) of the drive's.
    pad : float
        Friction of the pads over its nominal value.
    """

    offset: float
    drift: float
    noise: float
    clock_drift: float
    pad: float


@dataclass(frozen=True, slots=True)
class BrakeRun:
    """One run of the brake's loop.

    Attributes
    ----------
    time : ndarray, shape (n,)
        Seconds of the load cell's clock, from the trigger.
    target, torque : ndarray, shape (n,)
        Set point, and what the brake can oppose, on the motor shaft [N m].
    noise : ndarray, shape (n,)
        Disturbance of each sample of the cell [N], offset and drift included.
    """

    time: Floats
    target: Floats
    torque: Floats
    noise: Floats


def set_point(terms: Sequence[Term], time: Floats) -> Floats:
    """Return the sum of the brake's terms [N m, motor shaft] at instants [s] after the trigger.

    Raises
    ------
    InputError
        A waveform the brake's controller does not know.
    """
    total = np.zeros_like(time)
    for index, term in enumerate(terms):
        if term.enabled:
            total += _term(term, time, f"brake: terms[{index}]")
    return total


def _term(term: Term, time: Floats, place: str) -> Floats:
    units = {p.name: unit_of(p, "N m") for p in wave_records()[term.kind].parameters}
    given = {n: _number(v, units[n], f"{place}: {n}") for n, v in term.arguments.items()}
    if term.kind == TABLE:
        if given.get("repeat") or given.get("hold"):
            raise InputError(f"{place}: a table of the brake neither repeats nor holds")
        times, values = (np.asarray(a, dtype=np.float64) for a in term.points())
        seconds = times * parse_quantity(f"1 {term.time_unit}", "s", place)
        scale = parse_quantity(f"1 {term.unit or 'N m'}", "N m", place) * given.get("gain", 1.0)
        at = time - given.get("start", 0.0)
        return np.asarray(np.interp(at, seconds, values * scale), dtype=np.float64)
    return evaluate(term.kind, given, time)


def _number(value: bool | float | str, unit: str, place: str) -> float:
    return float(value) if isinstance(value, bool) else parse_quantity(value, unit, place)


def brake_loop(
    rig: BrakeRig,
    cell: CellState,
    terms: Sequence[Term],
    duration: float,
    rng: np.random.Generator,
) -> BrakeRun:
    """Run the torque loop at the load cell's rate.

    Parameters
    ----------
    rig : BrakeRig
        The brake.
    cell : CellState
        Its load cell.
    terms : sequence of Term
        Set point on the motor shaft [N m].
    duration : float
        Seconds of the load cell's clock, from the trigger.
    rng : Generator
        For the cell's noise.

    Raises
    ------
    RangeError
        A set point below zero or above what the brake can hold.
    """
    converter = Hx711()
    time = np.arange(int(duration * converter.rate) + 1) / converter.rate
    target = set_point(terms, time)
    if target.min(initial=0.0) < 0.0 or target.max(initial=0.0) > rig.limit:
        raise RangeError(
            f"brake: set point from {target.min():.4g} to {target.max():.4g} N m is outside 0 to "
            f"{rig.limit:.4g} N m ({rig.disk_torque:g} N m at the disk over {rig.chain_ratio:g})"
        )
    noise = cell.offset + cell.drift * time + cell.noise * rng.standard_normal(len(time))
    torque = _loop(rig, cell, target, noise, converter)
    return BrakeRun(time, target, torque, noise)


def _loop(
    rig: BrakeRig, cell: CellState, target: Floats, noise: Floats, converter: Hx711
) -> Floats:
    """Return the torque on the motor shaft, sample by sample; as fractions of the disk's torque."""
    period = 1.0 / converter.rate
    newtons = rig.disk_torque / rig.arm
    torque = np.empty_like(target)
    position = integral = 0.0
    targets = (target / rig.limit).tolist()
    for k, (goal, disturbance) in enumerate(zip(targets, noise.tolist(), strict=True)):
        fraction = cell.pad * position
        torque[k] = fraction * rig.limit
        seen = float(converter.convert(fraction * newtons + disturbance)) / newtons
        error = goal - seen
        wish = rig.proportional * error + integral
        opening = min(max(wish, 0.0), 1.0)
        if opening == wish or (wish - opening) * error < 0.0:  # no windup against the end stops
            integral += rig.integral * error * period
        step = (opening - position) * -np.expm1(-period / rig.servo_lag)
        reach = rig.servo_rate * period
        position += min(max(float(step), -reach), reach)
    return torque


GRAVITY = 9.80665  # m/s2
_EDGE = 0.01  # s a weight takes to come onto its cable. ASSUMED: lowered by hand on a stiff cable
_BEARING = 0.015 * 0.020  # m, friction radius of the guide's bearing. ASSUMED: 0.015 at 20 mm


@dataclass(frozen=True, slots=True)
class Springs:
    """Two traction springs that pull in the same direction.

    Attributes
    ----------
    stiffness : float
        Of each [N/m].
    radius, extension, mover : float
        m; see `SpringStep`.
    """

    stiffness: float
    radius: float
    extension: float
    mover: float

    @property
    def torsional(self) -> float:
        """Stiffness at the output: 2 K r^2 [N m/rad]."""
        return 2.0 * self.stiffness * self.radius**2

    @property
    def preload(self) -> float:
        """Torque at the output's zero [N m]."""
        return 2.0 * self.stiffness * self.radius * self.extension

    @property
    def radial_force(self) -> float:
        """Force of the displaced mover across the guide: K dx [N]."""
        return self.stiffness * self.mover

    @property
    def bearing_torque(self) -> float:
        """Dry friction that force causes, at the output [N m]."""
        return self.radial_force * _BEARING

    def forces(self, output: Floats) -> Floats:
        """Sum of the two cables' forces [N] at output positions [rad].

        Raises
        ------
        InputError
            A cable would go slack: a cable cannot push, and a run with a slack one is not the run
            that was computed.
        """
        reach = self.extension + self.radius * output
        if reach.min() < 0.0:
            raise InputError(
                "spring: the cables go slack at an output position of "
                f"{float(output.min()):.4g} rad; "
                f"give an extension of {self.extension - float(reach.min()):.3g} m or more"
            )
        return 2.0 * self.stiffness * reach


@dataclass(frozen=True, slots=True)
class Weights:
    """Masses on the cables: torque at the output over time [s after the trigger]."""

    times: tuple[float, ...]
    forces: tuple[float, ...]
    radius: float

    def table(self, start: float) -> dict[str, object]:
        """Return the load term [N m at the output], `start` s into the log."""
        return {
            "kind": "table",
            "times": [0.0, *(start + t for t in self.times)],
            "values": [0.0, *(f * self.radius for f in self.forces)],
        }

    def at(self, time: Floats) -> Floats:
        """Sum of the cables' forces [N]."""
        return np.asarray(np.interp(time, self.times, self.forces), dtype=np.float64)


def springs_of(step: SpringStep) -> Springs | None:
    """Return the springs of a step, None when they are taken off."""
    if not step.fitted:
        return None
    return Springs(
        parse_quantity(step.stiffness, "N/m", "spring: stiffness"),
        *(parse_quantity(getattr(step, n), "m", n) for n in ("radius", "extension", "mover")),
    )


def weights_of(step: WeightsStep) -> Weights | None:
    """Return the weights of a step, None when there are none."""
    if not step.drops:
        return None
    times, forces = [0.0], [0.0]
    for drop in step.drops:
        force = step.cables * GRAVITY * parse_quantity(drop.mass, "kg", "mass")
        start, stop = parse_quantity(drop.at, "s", "at"), parse_quantity(drop.until, "s", "until")
        for instant, value in ((start, 0.0), (start + _EDGE, force), (stop, force)):
            if instant > times[-1]:
                times.append(instant)
                forces.append(value)
        times.append(stop + _EDGE)
        forces.append(0.0)
    return Weights(tuple(times), tuple(forces), parse_quantity(step.radius, "m", "radius"))


RATE = 400.0  # Hz of the drive's trace (T1)
_LONGEST_WAIT = 1.0  # s from the trace's start to the trigger, and from there to the command


@dataclass(frozen=True, slots=True)
class Conditions:
    """The random conditions of one log.

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
    """The present state of the bench after the steps so far."""

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

    trace: TraceStep
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
    """Draw the random conditions of the `number`-th log of a procedure.

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
        if isinstance(step, TraceStep):
            conditions = draw_conditions(seed, len(setups))
            setups.append(_setup(step, rig, actuator, conditions, faults))
        elif isinstance(step, ForceStep | RigStep | SensorStep):
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
    step: BacklashStep | BrakeStep | SpringStep | WeightsStep | SettingsStep,
) -> Rig:
    if isinstance(step, BacklashStep):
        return replace(rig, backlash=step.value())
    if isinstance(step, BrakeStep):
        return replace(rig, brake=step.terms)
    if isinstance(step, SpringStep):
        return replace(rig, springs=springs_of(step))
    if isinstance(step, WeightsStep):
        return replace(rig, weights=weights_of(step))
    return replace(rig, settings={**rig.settings, **step.parameters})


def _setup(
    step: TraceStep,
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


def moved_command(step: TraceStep, start: float) -> dict[str, Any]:
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
