"""The report of the reduced-order model's three cases: position and speed of both models."""

from __future__ import annotations

from elevon.report import Report, ReportTable
from elevon.reproduce.compare_page import draw_comparison
from elevon.reproduce.low_fidelity import LowFidelityResult
from elevon.reproduce.provenance import closed


def low_fidelity_page(result: LowFidelityResult, seed: int, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce low-fidelity`."""
    report = Report(
        f"Reduced-order and switching model of {result.actuator}",
        "Both models on the loaded campaign's sine, position and speed as the paper draws them "
        "(Figures 6 and 7). The paper prints no error.",
        date=date,
    )
    columns = ["Case", "Position", "Speed", "Torque current"]
    rows = [[r.name, *(100.0 * value for value in
                       (r.position_nrmse, r.speed_nrmse, r.q_current_nrmse))]
            for r in result.rows]  # fmt: skip
    caption = "Percent: RMS difference over the amplitude (position) or the RMS."
    report.section("Differences").table(ReportTable(columns, rows, caption, digits=3))
    for row, comparison in zip(result.rows, result.comparisons, strict=True):
        draw_comparison(report.section(row.name[0].upper() + row.name[1:]), comparison)
    return closed(report, result.checks, f"low-fidelity --seed {seed}", Seed=seed)
