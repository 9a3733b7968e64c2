"""High against low fidelity in the three cases in which the reduced-order model must hold."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

import numpy as np

from elevon.actuator import Actuator
from elevon.compare import Comparison, compare, comparison_figures, default_scenario, filtered
from elevon.plain import WORKING, Plain
from elevon.progress import Progress, part
from elevon.report import Check, Report
from elevon.report.checks import CheckedResult
from elevon.scenario import Scenario
from elevon_cases.page import Column, sentence, table_of, with_end

POSITION_LIMIT = 0.005
CURRENT_LIMIT = 0.05

CASES = {
    "hysteresis, 1 N m of brake": ("hysteresis", True, False),
    "carrier PWM, no load": ("pwm", False, False),
    "hysteresis, no load": ("hysteresis", False, True),
}
"""Drive, whether braked, and whether the current is below the relay band: there the current is
held beside the ripple floor, not against a limit."""


@dataclass(frozen=True, slots=True)
class CaseRow(Plain):
    """One case.

    Attributes
    ----------
    name : str
        Drive and load.
    position_nrmse, speed_nrmse, q_current_nrmse : float
        As in `Comparison`.
    q_current_rms_a, q_current_error_a : float
        RMS of the switching model's filtered current and of the difference [A].
    floor_a : float or None
        RMS difference of two high runs that differ only in step [A]; where it is needed.
    """

    name: str
    position_nrmse: float
    speed_nrmse: float
    q_current_nrmse: float
    q_current_rms_a: float
    q_current_error_a: float
    floor_a: float | None

    def checks(self) -> list[Check]:
        """Return what this case is held to."""
        checks = [Check(f"{self.name}: position", self.position_nrmse, POSITION_LIMIT, "")]
        if self.floor_a is None:
            limit = CURRENT_LIMIT
            checks.append(Check(f"{self.name}: q current", self.q_current_nrmse, limit, ""))
        return checks


@dataclass(frozen=True, slots=True)
class LowFidelityResult(CheckedResult):
    """All three cases."""

    actuator: str
    rows: tuple[CaseRow, ...]
    comparisons: Annotated[tuple[Comparison, ...], WORKING] = ()

    @property
    def checks(self) -> list[Check]:
        """Position everywhere, current where it exceeds the relay band."""
        return [check for row in self.rows for check in row.checks()]


def reproduce_low_fidelity(
    actuator: Actuator, *, seed: int = 0, progress: Progress | None = None
) -> LowFidelityResult:
    """Run the three cases: the campaign's 45 deg at 0.05 Hz, compared after 10 s.

    Parameters
    ----------
    actuator : Actuator
        Of wiring ``rotary``; its drive kind is replaced by the case's.
    seed : int
        Of every run.
    progress : callable, optional
        As for `simulate`.

    Returns
    -------
    LowFidelityResult

    Raises
    ------
    SimulationError
        A run did not reach its end.
    """
    rows, comparisons = [], []
    for number, (name, (drive, braked, floored)) in enumerate(CASES.items()):
        start, stop = number / 4.0, (number + 1) / 4.0
        model = actuator.with_values({"drive.kind": drive})
        scenario = _scenario(actuator, braked)
        comparison = compare(model, scenario, seed=seed, progress=part(progress, start, stop))
        span = part(progress, stop, 1.0)
        floor = _floor(model, scenario, comparison, seed, span) if floored else None
        rows.append(_row(name, comparison, floor))
        comparisons.append(comparison)
    return LowFidelityResult(actuator.name, tuple(rows), tuple(comparisons))


def _scenario(actuator: Actuator, braked: bool) -> Scenario:
    whole = default_scenario(actuator)
    if braked:
        return whole
    data = whole.to_dict()
    return Scenario.from_dict({key: data[key] for key in ("duration", "command")})


def _floor(
    model: Actuator,
    scenario: Scenario,
    comparison: Comparison,
    seed: int,
    progress: Progress | None,
) -> float:
    """RMS difference of the q current of two high runs, one with four fifths of the step."""
    from elevon.simulate import simulate

    step = 0.8 * float(model.parameters.value("solver.step"))
    other = simulate(
        model.with_values({"solver.step": step}),
        scenario,
        record="current_q@10 kHz",
        seed=seed,
        progress=progress,
    )
    again = filtered(other, "current_q", comparison.time, comparison.cutoff)
    return float(np.sqrt(np.mean((again - comparison.high["current_q"]) ** 2)))


def _row(name: str, comparison: Comparison, floor: float | None) -> CaseRow:
    values = comparison.to_dict()
    return CaseRow(
        name,
        comparison.position_nrmse,
        comparison.speed_nrmse,
        comparison.q_current_nrmse,
        values["q_current_rms_a"],
        values["q_current_rms_error_a"],
        floor,
    )


def low_fidelity_page(result: LowFidelityResult, seed: int = 0, date: str | None = None) -> Report:
    """Return the report of the three cases."""
    report = Report(
        f"Reduced-order and switching model of {result.actuator}",
        "Both models on the loaded campaign's sine, position and speed as the paper draws them "
        "(Figures 6 and 7). The paper prints no error.",
        date=date,
    )
    columns: tuple[Column, ...] = (
        ("Case", "name"),
        ("Position", lambda row: 100.0 * row.position_nrmse),
        ("Speed", lambda row: 100.0 * row.speed_nrmse),
        ("Torque current", lambda row: 100.0 * row.q_current_nrmse),
    )
    caption = "Percent: RMS difference over the amplitude (position) or the RMS."
    report.section("Differences").table(table_of(result.rows, columns, caption, digits=3))
    for row, comparison in zip(result.rows, result.comparisons, strict=True):
        section = report.section(sentence(row.name))
        for figure, caption in comparison_figures(comparison):
            section.figure(figure, caption)
    return with_end(report, result.checks, f"low-fidelity --seed {seed}", {"Seed": seed})
