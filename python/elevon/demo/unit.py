"""The unit that nobody knows: its values, how it grows worse, and when it fails."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from importlib.resources import files
from pathlib import Path

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.bench.hidden import hidden_actuator
from elevon.faults import Fault
from elevon.prognose import Law, Mission, Process, respond
from elevon.prognose.future import Life, run_to_failure
from elevon.progress import Progress

INSPECTED = 330.0
"""Flights between inspections, about."""
FACTORS = (1.35, 0.7)
"""Of wear and friction on the laws the prediction starts from: this unit wears faster."""
_GRAIN = 1.5  # of the truth's scatter over the law's
_FEEDBACK = 0.5  # greatest relative rise of a truth's growth up to the greatest severity, linear


def demo_file(name: str) -> Path:
    """Return a file of the demonstration: its bench procedure or its mission."""
    return Path(str(files("elevon.demo") / name))


def demo_mission() -> Mission:
    """Return the demonstration's mission."""
    return Mission.load(demo_file("mission.toml"))


def hidden_unit(base: Actuator, seed: int) -> Actuator:
    """Draw the unit: as on the bench with hidden values, with a gear of ordinary backlash."""
    rng = np.random.default_rng([seed, 8])
    backlash = base.parameters.value("backlash.total") + math.radians(rng.uniform(0.0, 0.1))
    values: dict[str, str | float] = {"backlash.total": backlash}
    return hidden_actuator(base, seed).with_values(values, source="hidden from everybody")


def of_day(unit: Actuator, rng: np.random.Generator) -> Actuator:
    """Return the unit as it is on one day: warmer or colder, freer or stiffer (ASSUMED)."""
    value = unit.parameters.value
    dry = float(np.exp(0.03 * rng.standard_normal()))
    values: dict[str, str | float] = {
        "motor.winding_temperature": value("motor.winding_temperature") + 8.0 * rng.normal(),
        "friction.dynamic": dry * value("friction.dynamic"),
        "friction.static": dry * value("friction.static"),
        "friction.viscous": value("friction.viscous") * float(np.exp(0.05 * rng.standard_normal())),
    }
    return unit.with_values(values, source="of the day")


def live(unit: Actuator, seed: int, progress: Progress | None = None) -> Life:
    """Let the unit fly until it fails, on tables corrected by the switching model.

    Its laws feed back on themselves and scatter more than those of the prediction.
    """
    mission = demo_mission()
    rng = np.random.default_rng([seed, 9])
    laws = [other_law(law, rng) for law in mission.laws()]
    process = Process(
        respond(unit, mission, laws=laws, snapshots=True, progress=progress), wander=False
    )
    new = process.start(10, rng).picked(np.array([0]))
    growth = np.log(np.array([FACTORS])) + 0.05 * rng.standard_normal((1, 2))
    every = np.ones((1, 2), dtype=np.bool_)
    return run_to_failure(process, replace(new, growth=growth, row=0 * new.row, active=every), rng)


def other_law(law: Law, rng: np.random.Generator) -> Law:
    """Return the law as it truly is in one unit: another form, another scatter."""
    believed, feedback = law.rate, rng.uniform(0.0, _FEEDBACK)

    def rate(damage: Floats, drivers: Mapping[str, Floats], c: Mapping[str, float]) -> Floats:
        return believed(damage, drivers, c) * (1.0 + feedback * damage / law.highest)

    return replace(law, rate=rate, grain=_GRAIN * law.grain)


def faults_at(life: Life, usage: float) -> list[Fault]:
    """Return the faults of the unit at a use."""
    keys = [law.key for law in demo_mission().laws()]
    return [
        Fault.parse(f"{key}={float(value)!r}")
        for key, value in zip(keys, life.at(usage), strict=True)
        if value > 0.0
    ]
