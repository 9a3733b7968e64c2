"""The page of a calibration by parts: what was determined, and what not and why."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from elevon.calibrate.estimate import LEVEL
from elevon.calibrate.forest import forest
from elevon.report import Report, ReportTable

if TYPE_CHECKING:
    from elevon.calibrate.by_parts import PartsCalibration
    from elevon.calibrate.closed_loop import LoopCalibration

__all__ = ["parts_report"]


def parts_report(
    result: PartsCalibration | LoopCalibration,
    *,
    provenance: Mapping[str, object] | None = None,
    date: str | None = None,
) -> Report:
    """Return the report of a calibration put together from parts, or in closed loop."""
    names = ", ".join(log.name for log in result.logs)
    report = Report(f"Calibration of {result.before.name}", f"From {names}.", date=date)
    report.fact("Parameters determined", str(len(result.estimates)))
    report.fact("Time", f"{result.wall_s:.1f} s")
    section = report.section("Parameters", f"Intervals hold {100 * LEVEL:.0f} % of the time.")
    rows: list[list[object]] = [
        [
            item.path,
            item.old,
            item.value,
            f"{item.interval[0]:.5g} to {item.interval[1]:.5g}",
            item.unit,
            item.register,
            ", ".join(item.given),
        ]
        for item in result.estimates
    ]
    columns = ["Parameter", "Before", "After", "Interval", "Unit", "Register", "Holds for"]
    figure = forest(result.estimates)
    if figure is not None:
        section.figure(figure, "Estimates over the old values, with their intervals.")
    section.table(ReportTable(columns, rows, digits=5))
    missing: list[list[object]] = [[path, why] for path, why in result.undetermined.items()]
    if missing:
        report.section("Not determined").table(ReportTable(["Parameter", "Reason"], missing))
    if provenance:
        report.provenance(provenance)
    return report
