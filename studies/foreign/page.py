"""The page of the lives whose growth is no law's."""

from __future__ import annotations

from elevon.report import Report, ReportTable, provenance
from studies.foreign.result import ForeignResult

_COLUMNS = ("density", "form", "method", "lives", "accuracy", "alpha_lambda", "coverage", "width",
            "crps", "late", "early", "off_law")  # fmt: skip


def foreign_report(result: ForeignResult, *, seed: int, date: str | None = None) -> Report:
    """Return the report."""
    report = Report(
        "Lives whose growth is no law's",
        "Remaining lives predicted at 50 to 90 % of lives whose growth no law of the filter "
        "describes, by it and by methods without a law.",
        date=date,
    )
    report.section("Checks").checks(result.checks)
    rows = [[row[name] for name in _COLUMNS] for row in result.summary()]
    report.section("Every method").table(
        ReportTable(
            _COLUMNS, rows,
            "Means over lives and shares; accuracy 0 at least; widths, scores and biases in lives.",
            digits=3,
        )
    )  # fmt: skip
    report.provenance(provenance("python -m studies foreign", Seed=seed))
    return report
