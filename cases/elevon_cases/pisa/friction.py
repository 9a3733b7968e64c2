"""Friction tests of the Pisa landing gear, and what their logs alone tell.

Free fall (FF): the stages are apart and the rig moves screw, nut and ram. Modified free fall
(FFM): everything is connected, the bench holds the brake open and the rig drives the motor back.
The ram hangs from the load cell. At constant speed the friction is ``-(F_LC + m g)`` (P 4.1).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.plain import WORKING, Plain
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.report.checks import Check, CheckedResult
from elevon_cases.pisa.gear import ACTUATOR, Stroke, run_strokes

GRAVITY = 9.80665
SPEEDS = (1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0, 10.0)
"""Speeds of the tests [mm/s]."""
FACTORS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5)
"""Load factors of the loaded retractions; the first gives the friction at working speed."""
TURNS = 10
"""Whole turns of the screw that are evaluated."""
HARMONICS = 5
LIMIT = 0.03
"""Of the largest value of a kind."""
SUPPLY = 30.3


@dataclass(frozen=True, slots=True)
class FrictionRow(Plain):
    """A quantity put into the model and recovered from the logs."""

    quantity: str
    direction: str
    speed_mm_s: float | None
    load_n: float | None
    put_in: float
    recovered: float
    unit: str


@dataclass(frozen=True)
class FrictionTrace:
    """One test as the paper shows it: friction, position and speed over time."""

    released: bool
    direction: int
    speed_mm_s: float
    time: Floats
    position_mm: Floats
    ram_mm_s: Floats
    motor_rad_s: Floats
    friction_n: Floats
    order: Floats
    """Of the spectrum: periods a turn of the screw."""
    amplitude_n: Floats

    @property
    def name(self) -> str:
        """Such as ``FF, extension, 1 mm/s``."""
        way = "extension" if self.direction > 0 else "retraction"
        return f"{'FF' if self.released else 'FFM'}, {way}, {self.speed_mm_s:g} mm/s"


@dataclass(frozen=True)
class FrictionResult(CheckedResult):
    """Everything `elevon reproduce pisa-friction` reports; the rows of functional runs first."""

    rows: list[FrictionRow]
    checks: list[Check]
    seed: int
    traces: Annotated[list[FrictionTrace], WORKING]
    tables: Annotated[dict[str, list[tuple[float, float]]], WORKING]
    """The set's own friction: kind and direction to pairs of mm/s and N."""


@dataclass(frozen=True, slots=True)
class _Test:
    """One pull or push of the rig."""

    released: bool
    speed: float
    direction: int

    @property
    def way(self) -> str:
        return "extension" if self.direction > 0 else "retraction"


def reproduce_friction(*, seed: int = 0, progress: Progress | None = None) -> FrictionResult:
    """Run the tests, recover weight, friction, harmonics and efficiency from their logs.

    Raises
    ------
    SimulationError
        A run tripped or diverged.
    """
    actuator = Actuator.load(ACTUATOR)
    lead = 2.0 * math.pi * actuator.parameters.value("screw.lead")
    tests = [
        _Test(released, 1e-3 * speed, direction)
        for released in (False, True)
        for speed in SPEEDS
        for direction in (1, -1)
    ]
    logs = _run_rig(actuator, tests, lead, seed, progress)
    forces = [_settled(log, lead) for log in logs]
    mass = float(
        np.mean(
            [
                -(ahead.mean() + back.mean()) / (2.0 * GRAVITY)
                for (_, ahead), (_, back) in zip(forces[::2], forces[1::2], strict=True)
            ]
        )
    )
    put_mass = actuator.parameters.value("screw.moving_mass")
    rows = [FrictionRow("mass", "both", None, None, put_mass, mass, "kg")]
    for test, log in zip(tests, forces, strict=True):
        rows += _friction_rows(actuator, test, log, mass, lead)
    rows = _efficiency_rows(actuator, seed, progress) + rows
    traces = [_trace(test, log, mass, lead) for test, log in zip(tests, logs, strict=True)]
    return FrictionResult(rows, _checks(rows), seed, traces, _tables(actuator))


def _trace(test: _Test, log: Recording, mass: float, lead: float) -> FrictionTrace:
    force, position = log["load_cell"].values, log["nut_position"].values
    over, resisting = _settled(log, lead)
    ripple = test.direction * (resisting - resisting.mean())
    order: Floats = np.arange(1, 16, dtype=np.float64) * np.float64(0.5)
    waves = np.exp(2j * math.pi * np.outer(order, over) / lead)
    return FrictionTrace(
        test.released,
        test.direction,
        1e3 * test.speed,
        log["load_cell"].time,
        1e3 * position,
        1e3 * log["output_speed"].values,
        log["motor_speed"].values,
        np.asarray(-(force + mass * GRAVITY), dtype=np.float64),
        order,
        np.asarray(np.abs(2.0 * (waves @ ripple) / over.size), dtype=np.float64),
    )


def _tables(actuator: Actuator) -> dict[str, list[tuple[float, float]]]:
    value = actuator.parameters.value
    knots = [1e3 * value(f"friction.speed_{k}") for k in range(1, 9)]
    return {
        f"{kind}_{way}": [
            (knot, value(f"friction.{kind}_{way}_{k}")) for k, knot in enumerate(knots, 1)
        ]
        for kind in ("ff", "ffm")
        for way in ("extension", "retraction")
    }


def _run_rig(
    actuator: Actuator,
    tests: Sequence[_Test],
    lead: float,
    seed: int,
    progress: Progress | None,
) -> list[Recording]:
    from elevon.scenario import Scenario
    from elevon.simulate import Run, completed, simulate_batch

    runs = []
    for number, test in enumerate(tests):
        travel = (TURNS + 1) * lead
        start = 0.02 if test.direction > 0 else 0.02 + travel
        values: dict[str, Any] = {"low.step": 1e-4}
        values["release.open" if test.released else "brake.powered"] = (
            "yes" if test.released else "always"
        )
        speed = {"kind": "constant", "value": test.direction * test.speed}
        scenario = Scenario.from_dict(
            {
                "duration": round(travel / test.speed, 2),
                "load": {"rig_speed": {"terms": [speed]}},
                "initial": {"nut_position": start},
                "parameters": values,
            }
        )
        label = f"{'FF' if test.released else 'FFM'}, {test.way}, {1e3 * test.speed:g} mm/s"
        runs.append(Run(actuator, scenario, seed, label, number))
    logs = simulate_batch(
        runs,
        fidelity="low",
        record="nut_position,load_cell,output_speed,motor_speed@500 Hz",
        progress=progress,
    )
    return completed(logs)


def _settled(log: Recording, lead: float) -> tuple[Floats, Floats]:
    """Return position and force over whole turns, the first turn left out."""
    position, force = log["nut_position"].values, log["load_cell"].values
    travel = np.abs(position - position[0])
    settled = (travel >= lead) & (travel < (TURNS + 1) * lead * (1.0 - 1e-9))
    return position[settled], force[settled]


def _friction_rows(
    actuator: Actuator, test: _Test, log: tuple[Floats, Floats], mass: float, lead: float
) -> list[FrictionRow]:
    position, force = log
    resisting = test.direction * (force + mass * GRAVITY)
    kind = "ff" if test.released else "ffm"
    speed = 1e3 * test.speed
    put = _table(actuator, f"{kind}_{test.way}", test.speed)
    rows = [
        FrictionRow(f"friction_{kind}", test.way, speed, None, put, float(resisting.mean()), "N")
    ]
    ripple = resisting - resisting.mean()
    # P 4.1.1 takes the amplitudes from FF; Fig. 3.50 shows those of FFM, in which the detent of the
    # motor is too, at other orders.
    name = "harmonic" if test.released else "harmonic_ffm"
    for order in range(1, HARMONICS + 1):
        wave = np.exp(2j * math.pi * order * position / lead)
        recovered = float(np.abs(2.0 * np.mean(ripple * wave)))
        put = _table(actuator, f"harmonic_{order}", test.speed)
        rows.append(FrictionRow(f"{name}_{order}", test.way, speed, None, put, recovered, "N"))
    if not test.released:
        return rows
    preload = 2.0 * actuator.parameters.value("screw.preload")
    put = _table(actuator, f"ff_{test.way}", test.speed)
    apparent = 1.0 / (1.0 + float(resisting.mean()) / preload)
    rows.append(
        FrictionRow(
            "preload_efficiency", test.way, speed, None, 1.0 / (1.0 + put / preload), apparent, "1"
        )
    )
    return rows


def _table(actuator: Actuator, name: str, speed: float) -> float:
    """Return what the actuator file's own table says at a speed in m/s."""
    value = actuator.parameters.value
    knots = [value(f"friction.speed_{k}") for k in range(1, 9)]
    return float(np.interp(speed, knots, [value(f"friction.{name}_{k}") for k in range(1, 9)]))


def _efficiency_rows(actuator: Actuator, seed: int, progress: Progress | None) -> list[FrictionRow]:
    """Efficiency of the screw from retractions under load, less the friction of the unloaded one.

    Current, speed and the known load curve are all that is used of a run.
    """
    strokes = [Stroke("retract", factor, SUPPLY) for factor in FACTORS]
    runs = run_strokes(strokes, fidelity="low", duration=8.0, seed=seed, progress=progress)
    value = actuator.parameters.value
    gear = value("gear.efficiency_first") * value("gear.efficiency_second")
    ratio = value("gear.ratio_first") * value("gear.ratio_second")
    travel = value("screw.lead") / ratio
    means = [_steady(run) for run in runs]
    torques = [-2.0 * value("motor.emf_constant") * current for current, _, _ in means]
    free = torques[0]
    knot, loaded, scale = (
        value("screw.efficiency_unloaded"),
        value("screw.efficiency_loaded"),
        value("screw.efficiency_force"),
    )
    rows = []
    for torque, (_, speed, load) in zip(torques[1:], means[1:], strict=True):
        recovered = load * travel / (torque - free) / gear
        put = loaded + (knot - loaded) * math.exp(-load / scale)
        working = 1e3 * abs(speed) * travel
        rows.append(FrictionRow("efficiency", "retraction", working, load, put, recovered, "1"))
    return rows


def _steady(run: Recording) -> tuple[float, float, float]:
    """Mean current, motor speed and load of the steady part of a retraction."""
    ram, speed = run["output_position"].values, run["motor_speed"].values
    steady = (speed < -560.0) & (ram > 0.075) & (ram < 0.16)
    return (
        float(run["current_mean"].values[steady].mean()),
        float(speed[steady].mean()),
        float(run["load_force"].values[steady].mean()),
    )


def _checks(rows: Sequence[FrictionRow]) -> list[Check]:
    kinds = {
        "mass": ("mass",),
        "mean friction, FFM": ("friction_ffm",),
        "mean friction, FF": ("friction_ff",),
        "harmonics, FF": tuple(f"harmonic_{order}" for order in range(1, HARMONICS + 1)),
        "harmonics, FFM": tuple(f"harmonic_ffm_{order}" for order in range(1, HARMONICS + 1)),
        "efficiency at the preload": ("preload_efficiency",),
        "efficiency over load": ("efficiency",),
    }
    checks = []
    for name, quantities in kinds.items():
        mine = [row for row in rows if row.quantity in quantities]
        largest = max(abs(row.put_in) for row in mine)
        worst = max(abs(row.recovered - row.put_in) for row in mine) / largest
        checks.append(Check(f"{name}: worst error over the largest", 100.0 * worst, 3.0, "%"))
    return checks


def page_values(result: FrictionResult) -> dict[str, object]:
    """Return what the page draws beside the rows: both directions of a test, each way's preload."""

    def both(released: bool, speed: float) -> list[FrictionTrace]:
        mine = [t for t in result.traces if t.released == released]
        return [t for t in mine if abs(t.speed_mm_s - speed) < 1e-9]

    return {
        "efficiency": [row for row in result.rows if row.quantity == "efficiency"],
        "both": both,
        "thin": lambda trace: slice(10, None, max(1, trace.time.size // 1500)),
        "preload": [_preload(result.rows, *way) for way in _WAYS],
    }


_WAYS = (("extension", "blue", 1.0), ("retraction", "orange", -1.0))


def _preload(rows: Sequence[FrictionRow], way: str, colour: str, sign: float) -> dict[str, object]:
    """Return the apparent efficiency over the speed, and over the friction force."""
    eta, force = (
        {r.speed_mm_s: r.recovered for r in rows if (r.quantity, r.direction) == (quantity, way)}
        for quantity in ("preload_efficiency", "friction_ff")
    )
    speeds = sorted(speed for speed in eta if speed is not None)
    return {
        "way": way,
        "colour": colour,
        "speed": [sign * speed for speed in speeds],
        "efficiency": [eta[speed] for speed in speeds],
        "by_friction": sorted((force[speed], eta[speed]) for speed in speeds),
    }
