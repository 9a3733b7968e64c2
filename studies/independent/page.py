"""The page of diagnosis judged on logs of another program."""

from __future__ import annotations

from elevon.report import Report, ReportTable, provenance
from studies.independent.result import IndependentResult

COLUMNS = ("what", "hits", "logs", "share", "interval")
_CAUSE = ("name", "test", "unit", "rate", "moved", "status", "best", "p_other", "most")


def independent_report(result: IndependentResult, *, seed: int, date: str | None = None) -> Report:
    """Return the report."""
    report = Report(
        "Diagnosis on logs of another program",
        "False alarms, unknown causes and single faults on a bench that shares nothing with the "
        "package; the screw and the gear by its own switching model.",
        date=date,
    )
    report.section("Checks").checks(result.checks)
    rows = [[row[name] for name in COLUMNS] for row in result.rows]
    report.section("Shares").table(ReportTable(COLUMNS, rows, "Intervals of 95 %.", digits=3))
    causes = [[str(row[name]) for name in _CAUSE] for row in result.causes]
    report.section("Causes that are no candidates").table(ReportTable(_CAUSE, causes))
    plan = result.plan
    text = (
        f"python -m studies independent --units {plan.units} --healthy {plan.healthy} "
        f"--switching {plan.switching} --learned {plan.learned} --seed {plan.seed}"
    )
    report.provenance(provenance(text, Seed=seed))
    return report
