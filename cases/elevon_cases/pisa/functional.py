"""Extension and retraction of the Pisa landing gear in all conditions of the thesis."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.plain import fields_of
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.recording.plot import code_names
from elevon.report.checks import Check, verdict
from elevon_cases.pisa.gear import (
    ACTUATOR,
    COMMANDED,
    CONDITIONS,
    FIGURES,
    TEMPERATURES,
    Condition,
    Stroke,
    run_strokes,
    stroke_time,
)

DEPARTURE = 5.0
"""Percent by which a stroke may last longer or shorter than its speed profile says, and by which
the mean speed of a part may miss its set point; ASSUMED, P prints no tolerance."""
_PARTS = {"high": (0.3, 0.7), "low": (0.85, 0.97)}
"""Shares of the stroke, in the direction of motion, in which the set point stands still."""


@dataclass(frozen=True, slots=True)
class FunctionalRow:
    """One condition: both strokes and what they needed."""

    condition: Condition
    extension_s: float
    retraction_s: float
    peak_current_a: float
    peak_speed_rad_s: float
    profile_s: Mapping[str, float]
    speeds_rad_s: Mapping[str, float]
    extension: Recording
    retraction: Recording

    @property
    def cycle_s(self) -> float:
        """One stroke in each direction."""
        return self.extension_s + self.retraction_s

    @property
    def passed(self) -> bool | None:
        """Whether the requirement is met; None where there is none."""
        required = self.condition.requirement
        return None if required is None else bool(self.cycle_s < required)

    def to_dict(self) -> dict[str, object]:
        """Return one row of the command's JSON object."""
        return fields_of(
            self, "condition=condition.name", "nz=condition.load_factor",
            "supply_v=condition.supply", "temperature_k=condition.temperature", "extension_s",
            "retraction_s", "cycle_s", "peak_current_a", "peak_speed_rad_s",
            "requirement_s=condition.requirement", "extension_profile_s=profile_s.extension",
            "retraction_profile_s=profile_s.retraction",
            *(f"{name}_rad_s=speeds_rad_s.{name}" for name in self.speeds_rad_s), "passed",
        )  # fmt: skip


@dataclass(frozen=True)
class FunctionalResult:
    """Everything `elevon reproduce pisa-functional` reports."""

    rows: list[FunctionalRow]
    fidelity: str
    checks: list[Check]

    def to_dict(self) -> dict[str, object]:
        """Return the JSON object of the command; the limit condition has no requirement."""
        runs = [run for row in self.rows for run in (row.extension, row.retraction)]
        return {
            **verdict(self.checks),
            "cycle": "one stroke in each direction, from the command to the switch at its end",
            "fidelity": self.fidelity,
            "rows": [row.to_dict() for row in self.rows],
            "sim_s": sum(float(run.meta["sim_s"]) for run in runs),
            "seed": runs[0].meta["seed"],
            "version": runs[0].meta["version"],
        }


def reproduce_functional(
    *, fidelity: str = "high", seed: int = 0, progress: Progress | None = None
) -> FunctionalResult:
    """Run both strokes in every condition and hold the cycle against its requirement.

    Raises
    ------
    SimulationError
        A run tripped or diverged.
    """
    conditions = (*CONDITIONS, FIGURES, *TEMPERATURES)
    strokes = [
        Stroke(action, condition.load_factor, condition.supply, condition.values)
        for condition in conditions
        for action in ("extend", "retract")
    ]
    runs = run_strokes(strokes, fidelity=fidelity, seed=seed, progress=progress)
    profile, points = profile_times(), set_points()
    rows = [
        _row(condition, extension, retraction, profile)
        for condition, extension, retraction in zip(conditions, runs[::2], runs[1::2], strict=True)
    ]
    checks = [
        check
        for row in rows
        if row.condition.requirement is not None
        for check in _checks(row, row.condition.requirement, points)
    ]
    return FunctionalResult(rows, fidelity, checks)


def set_points() -> dict[str, float]:
    """Return the commanded speeds of P Table 2.1 [rad/s] by part of the stroke."""
    value = Actuator.load(ACTUATOR).parameters.value
    return {"high": value("control.speed_high"), "low": value("control.speed_low")}


def profile_times() -> dict[str, float]:
    """Return what each stroke lasts if the speed is the one commanded, ramps included [s].

    Three quarters of the stroke at the high speed, the last at the low one, each change of the set
    point at the rate limit (P 1.2.2, Table 2.1). What the brake takes to open and the lock's travel
    come on top.
    """
    value = Actuator.load(ACTUATOR).parameters.value
    metre = value("screw.lead") / (value("gear.ratio_first") * value("gear.ratio_second"))
    high, low, rate = (
        value(f"control.{name}") for name in ("speed_high", "speed_low", "acceleration_limit")
    )
    turns = value("lever.stroke") / metre
    start = 0.5 * high / rate
    early = 0.5 * (high - low) ** 2 / rate / low
    time = 0.75 * turns / high + 0.25 * turns / low + start - early
    opens = value("brake.release_delay")
    locks = value("lock.engage_travel") / metre / low
    return {"extension": time + opens + locks, "retraction": time + opens}


def _checks(row: FunctionalRow, cycle: float, points: Mapping[str, float]) -> list[Check]:
    """The required cycle; the profile's times and the set points where they are to be held."""
    where = f"{row.condition.name} ({row.condition.load_factor:g} g, {row.condition.supply:g} V)"
    checks = [Check(f"cycle, {where}", row.cycle_s, cycle, "s")]
    if not row.condition.constant_speed:
        return checks
    shares = {
        f"{stroke} against its speed profile": took / row.profile_s[stroke]
        for stroke, took in (("extension", row.extension_s), ("retraction", row.retraction_s))
    } | {
        f"{stroke}, {part} speed against its set point": row.speeds_rad_s[f"{stroke}_{part}"]
        / point
        for stroke in ("extension", "retraction")
        for part, point in points.items()
    }
    return checks + [
        Check(f"{name}, {where}", 100.0 * abs(share - 1.0), DEPARTURE, "%")
        for name, share in shares.items()
    ]


def part_speeds(run: Recording, stroke: str) -> dict[str, float]:
    """Return the mean motor speed of the parts of a stroke [rad/s], by ``STROKE_PART``."""
    ram, speed = run["output_position"].values, np.abs(run["motor_speed"].values)
    share = ram / float(ram.max())
    if stroke == "retraction":
        share = 1.0 - share
    return {
        f"{stroke}_{part}": float(np.mean(speed[(share > low) & (share < high) & (speed > 1.0)]))
        for part, (low, high) in _PARTS.items()
    }


def _row(
    condition: Condition, extension: Recording, retraction: Recording, profile: Mapping[str, float]
) -> FunctionalRow:
    both = (extension, retraction)

    def peak(name: str) -> float:
        return max(float(np.max(np.abs(run[name].values))) for run in both)

    return FunctionalRow(
        condition,
        stroke_time(extension, "extend"),
        stroke_time(retraction, "retract"),
        peak("current_peak"),
        peak("motor_speed"),
        profile,
        part_speeds(extension, "extension") | part_speeds(retraction, "retraction"),
        extension,
        retraction,
    )


def page_values(result: FunctionalResult) -> dict[str, object]:
    """Return what the page draws: each condition's strokes, the names of the states."""
    states = code_names("landing_gear", "state")
    return {
        "strokes": [_drawn(row) for row in result.rows],
        "states": [states[k] for k in range(4)],
    }


def _drawn(row: FunctionalRow) -> dict[str, object]:
    condition, longest = row.condition, max(row.extension_s, row.retraction_s)
    moves = [
        {"name": name, "colour": colour, "line": line, **_thinned(run, longest)}
        for run, name, colour, line in (
            (row.extension, "extension", "blue", "-"),
            (row.retraction, "retraction", "orange", "--"),
        )
    ]
    title = f"{condition.name}: {condition.load_factor:g} g, {condition.supply:g} V"
    return {"title": title, "longest": longest, "moves": moves}


def _thinned(run: Recording, longest: float) -> dict[str, object]:
    time = run["output_position"].time - COMMANDED
    thin = np.flatnonzero((time >= 0.0) & (time <= longest + 0.4))[::5]
    signals = {"ram": "output_position", "speed": "motor_speed", "reference": "speed_ref",
               "current": "current_mean", "state": "state"}  # fmt: skip
    ram, load = run["output_position"].values, run["load_force"].values
    # Beyond the stroke the housing or the lock carries the load.
    moving = (ram > 1e-4) & (ram < ram.max() - 1e-4)
    return {
        "time": time[thin],
        "loaded": {"ram": ram[moving][::5], "force": load[moving][::5]},
        **{name: run[signal].values[thin] for name, signal in signals.items()},
    }
