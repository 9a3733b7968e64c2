"""The page of the run-to-failure histories."""

from __future__ import annotations

from elevon.prognose.metrics import metrics_figure
from elevon.report import Report, ReportTable, provenance
from studies.prognosis.result import SHARES, PrognosisResult

__all__ = ["prognosis_report"]


def prognosis_report(result: PrognosisResult, *, seed: int, date: str | None = None) -> Report:
    """Return the report."""
    report = Report(
        "Run-to-failure histories, predicted",
        f"{len(result.units)} units live on the switching model with growth laws other than "
        f"the filter's; over 50 to 90 % of life the median prediction is right to "
        f"{100 * (1 - result.accuracy()):.0f} % of what truly remained.",
        date=date,
    )
    report.fact("Mean relative accuracy", f"{result.accuracy():.3f}", "50 to 90 % of life")
    report.fact("Coverage", f"{result.covered():.3f}", "of 90 % intervals")
    report.fact("Laws alone", f"{result.accuracy(track='unaided'):.3f}", "without a diagnosis")
    section = report.section("By law of growth")
    rows = [
        [r["law"], r["histories"], r["accuracy"], *(r[_key(s)] for s in SHARES), r["coverage"],
         r["horizon"], r["unaided_accuracy"]]
        for r in result.summary()
    ]  # fmt: skip
    columns = ["law", "histories", "mean", *(f"{s:.0%}" for s in SHARES)]
    columns += ["coverage", "horizon (20 %)", "laws alone"]
    section.table(
        ReportTable(columns, rows, "Relative accuracy by share of life; horizon: median, strict.",
              digits=3)
    )  # fmt: skip
    for law in dict.fromkeys(u.law for u in result.units):
        tracks = [u.track for u in result.units if u.law == law]
        section.figure(
            metrics_figure(tracks, shares=SHARES),
            f"{law}. Left: predicted remaining life of each unit, the wedge is 20 % about the "
            "truth. Middle: its error; a dot where the last stretch within 20 % of the life begins "
            "(strict horizon). Right: relative accuracy, median and 80 % of the units, and how "
            "many 90 % intervals hold the truth.",
        )
    report.section("Checks").checks(result.checks)
    report.provenance(provenance("python -m studies prognosis", Seed=seed))
    return report


def _key(share: float) -> str:
    return f"ra_{share:.0%}".replace("%", "")
