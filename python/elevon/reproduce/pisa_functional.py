"""Extension and retraction of the Pisa landing gear in all conditions of the thesis."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from elevon.progress import Progress
from elevon.recording import Recording
from elevon.report.checks import Check, verdict
from elevon.reproduce.pisa_gear import CONDITIONS, Condition, Stroke, run_strokes, stroke_time


@dataclass(frozen=True, slots=True)
class FunctionalRow:
    """One condition: both strokes and what they needed."""

    condition: Condition
    extension_s: float
    retraction_s: float
    peak_current_a: float
    peak_speed_rad_s: float
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
        return {
            "condition": self.condition.name,
            "nz": self.condition.load_factor,
            "supply_v": self.condition.supply,
            "extension_s": self.extension_s,
            "retraction_s": self.retraction_s,
            "cycle_s": self.cycle_s,
            "peak_current_a": self.peak_current_a,
            "peak_speed_rad_s": self.peak_speed_rad_s,
            "requirement_s": self.condition.requirement,
            "passed": self.passed,
        }


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
    strokes = [
        Stroke(action, condition.load_factor, condition.supply)
        for condition in CONDITIONS
        for action in ("extend", "retract")
    ]
    runs = run_strokes(strokes, fidelity=fidelity, seed=seed, progress=progress)
    rows = [
        _row(condition, extension, retraction)
        for condition, extension, retraction in zip(CONDITIONS, runs[::2], runs[1::2], strict=True)
    ]
    checks = [
        Check(
            f"cycle, {row.condition.name} ({row.condition.load_factor:g} g, "
            f"{row.condition.supply:g} V)",
            row.cycle_s,
            row.condition.requirement,
            "s",
        )
        for row in rows
        if row.condition.requirement is not None
    ]
    return FunctionalResult(rows, fidelity, checks)


def _row(condition: Condition, extension: Recording, retraction: Recording) -> FunctionalRow:
    both = (extension, retraction)

    def peak(name: str) -> float:
        return max(float(np.max(np.abs(run[name].values))) for run in both)

    return FunctionalRow(
        condition,
        stroke_time(extension, "extend"),
        stroke_time(retraction, "retract"),
        peak("current_peak"),
        peak("motor_speed"),
        extension,
        retraction,
    )
