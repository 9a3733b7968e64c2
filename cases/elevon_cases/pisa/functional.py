"""Extension and retraction of the Pisa landing gear in all conditions of the thesis."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elevon.actuator import Actuator
from elevon.plain import fields_of
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.recording.plot import code_names
from elevon.report import Report
from elevon.report.checks import Check, verdict
from elevon.report.figures import new_figure
from elevon_cases.page import BLUE, ORANGE, Column, sentence, table_of, with_end
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

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


def functional_page(result: FunctionalResult, date: str | None = None) -> Report:
    """Return the report: times and speeds of each condition, its strokes."""
    required = [row.passed for row in result.rows if row.passed is not None]
    met = sum(row.passed is True for row in result.rows)
    report = Report(
        "Functional runs of the Pisa landing gear",
        f"Extension and retraction in {len(result.rows)} conditions, {result.fidelity} fidelity. "
        f"The cycle, one stroke in each direction, meets its requirement in {met} of "
        f"{len(required)} conditions; the limit condition has none.",
        date=date,
    )
    report.section("Times, currents and speeds").table(
        table_of(result.rows, _COLUMNS, "From the command to the end switch.")
    ).text(
        "In extension the leg drives the actuator: the current stays near zero, and below a demand "
        "of 0.8 V the software brake shorts the windings, which holds the overrun. At 14 V the "
        "supply cannot reach the EMF of the high speed: retraction saturates.",
        "P asks for a constant speed: 590.6 rad/s over three quarters of the stroke, 280.3 rad/s "
        "over the last. The mean speeds of both parts stand beside it. In the critical condition P "
        "doubles the cycle and the set points are not held to it: at 20.5 V the retraction's high "
        "speed is what the supply gives.",
    )
    for row in result.rows:
        condition = row.condition
        title = f"{condition.name}: {condition.load_factor:g} g, {condition.supply:g} V"
        section = report.section(sentence(title))
        section.figure(
            _stroke_figure(row),
            f"Position, speeds, current and state over the stroke, {title}.",
        )
        section.figure(_load_figure(row), f"Load on the ram over the stroke, {title}.")
    answer = result.to_dict()
    made = {"Seed": answer["seed"], "Core": answer["version"], "Fidelity": result.fidelity}
    return with_end(report, result.checks, "pisa-functional", made)


def _speeds(stroke: str) -> Callable[[FunctionalRow], str]:
    """Return what a row's cell has of the mean speeds of a stroke."""
    return lambda row: ", ".join(f"{row.speeds_rad_s[f'{stroke}_{part}']:.0f}" for part in _PARTS)


_COLUMNS: tuple[Column, ...] = (
    ("Condition", "condition.name"),
    ("Load factor", "condition.load_factor", ".1f"),
    ("Supply [V]", "condition.supply", ".1f"),
    ("Extension [s]", "extension_s", ".2f"),
    ("Retraction [s]", "retraction_s", ".2f"),
    ("Cycle [s]", "cycle_s", ".2f"),
    ("Required [s]", "condition.requirement", ".0f"),
    ("Peak current [A]", "peak_current_a", ".1f"),
    ("Peak speed [rad/s]", "peak_speed_rad_s", ".0f"),
    ("Extension, high, low [rad/s]", _speeds("extension")),
    ("Retraction, high, low [rad/s]", _speeds("retraction")),
)


def _moves(row: FunctionalRow) -> tuple[tuple[str, Recording, str, str], ...]:
    """Return both strokes: name, run, colour, line."""
    return (("extension", row.extension, BLUE, "-"), ("retraction", row.retraction, ORANGE, "--"))


def _stroke_figure(row: FunctionalRow) -> Figure:
    longest = max(row.extension_s, row.retraction_s)
    states = code_names("landing_gear", "state")
    with new_figure(4, 1, height=7.6, sharex=True) as (figure, (ram, speed, current, state)):
        for name, run, colour, _ in _moves(row):
            time = run["output_position"].time - COMMANDED
            thin = np.flatnonzero((time >= 0.0) & (time <= longest + 0.4))[::5]
            time = time[thin]
            values = {signal: run[signal].values[thin] for signal in _DRAWN}
            ram.plot(time, 1e3 * values["output_position"], color=colour, label=name)
            speed.plot(time, values["motor_speed"], color=colour)
            speed.plot(time, values["speed_ref"], ":", color=colour, lw=1.0)
            current.plot(time, values["current_mean"], color=colour)
            state.step(time, values["state"], color=colour, where="post")
        ram.set(ylabel="Ram [mm]")
        ram.legend(loc="center right")
        speed.set(ylabel="Motor [rad/s],\nreference dotted")
        current.set(ylabel="Current [A]")
        state.set_yticks(range(4), [states[code] for code in range(4)])
        state.set(ylabel="State", xlabel="Time from the command [s]", xlim=(0.0, longest + 0.4))
    return figure


_DRAWN = ("output_position", "motor_speed", "speed_ref", "current_mean", "state")


def _load_figure(row: FunctionalRow) -> Figure:
    with new_figure(height=2.6) as (figure, axes):
        for name, run, colour, line in _moves(row):
            ram, load = run["output_position"].values, run["load_force"].values
            # Beyond the stroke the housing or the lock carries the load.
            moving = (ram > 1e-4) & (ram < ram.max() - 1e-4)
            axes.plot(1e3 * ram[moving][::5], load[moving][::5], line, color=colour, label=name)
        axes.set(xlabel="Ram [mm]", ylabel="Load [N]", ylim=(0, None))
        axes.legend()
    return figure
