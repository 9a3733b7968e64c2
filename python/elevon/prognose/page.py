"""The page of a prognosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from elevon.number_text import count_text
from elevon.prognose.figures import course_figure, severity_unit, survival_figure
from elevon.prognose.observation import Inspection
from elevon.report import Report, ReportTable
from elevon.units import to_display

if TYPE_CHECKING:
    from elevon.prognose.answer import Prognosis
    from elevon.prognose.assumptions import Assumed
    from elevon.prognose.law import Law


def sentence(result: Prognosis) -> str:
    """Return the answer in one sentence, and where the history contradicts the law, that."""
    if not result.off_law:
        return _remaining(result)
    worst = max(result.off_law, key=lambda item: abs(item.deviations))
    return f"{_remaining(result)} The history contradicts the law: {worst.text}."


def _remaining(result: Prognosis) -> str:
    low, high = result.interval
    if not np.isfinite(result.median):
        if not np.isfinite(low):
            return f"No end of life is in sight ({result.level:.0%} of the futures and more)."
        return (
            f"No end of life is in sight in more than half of the futures; the shortest "
            f"{0.5 * (1.0 - result.level):.0%} end within {count_text(low)} {result.unit}."
        )
    name, share = next(iter(result.first.items()))
    upper = count_text(high) if np.isfinite(high) else "no end in sight"
    median, lower = count_text(result.median), count_text(low)
    return (
        f"{median} {result.unit} remain ({result.level:.0%}: {lower} to {upper}); "
        f"{name} fails first in {share:.0%} of the futures."
    )


def prognosis_page(
    result: Prognosis,
    inspections: Sequence[Inspection],
    laws: Sequence[Law],
    *,
    actuator: str,
    assumed: Sequence[Assumed] = (),
    date: str | None = None,
) -> Report:
    """Return the report of a prognosis."""
    name = f"{actuator} {result.serial or ''}".strip()
    report = Report(f"Remaining life of {name}", sentence(result), date=date)
    report.judge(*_badge(result))
    future = report.section("What is to come")
    future.figure(
        course_figure(result, inspections, laws),
        "Severities that the inspections saw, and those to come: median and 90 % of the futures; a "
        "future stays where it is once it has failed.",
    )
    future.figure(
        survival_figure(result),
        "Probability of surviving the next N; lines: median and interval of the remaining life.",
    )
    rows = [(f"{n:g}", p) for n, p in result.p_survive]
    future.table(ReportTable((f"next N {result.unit}", "probability"), rows, digits=3))
    _requirements(report, result)
    _faults(report, result)
    if result.findings:
        report.section("Findings").points(result.findings)
    _assumed(report, assumed, result.unit)
    _laws(report, laws)
    return report


def _badge(result: Prognosis) -> tuple[str, Literal["pass", "fail", "open"]]:
    """Return the verdict in a few words."""
    if result.off_law:
        return "The history contradicts the law", "open"
    if not np.isfinite(result.median):
        return "No end in sight", "pass"
    if result.median <= 0.0:
        return "Life has ended", "fail"
    return f"{count_text(result.median, 3)} {result.unit} remain", "open"


def _assumed(report: Report, assumed: Sequence[Assumed], unit: str) -> None:
    if not assumed:
        return
    rows = [
        (
            a.name,
            *("no end in sight" if v is None else count_text(v) for v in (a.median, a.low, a.high)),
        )
        for a in assumed
    ]
    report.section(
        "What each assumption costs", "The prediction again, with one thing taken for certain."
    ).table(ReportTable(("taken for certain", f"{unit} remain", "low", "high"), rows))


def _requirements(report: Report, result: Prognosis) -> None:
    rows = []
    for item in result.reserve:
        unit = severity_unit(item.unit)
        rows.append(
            (
                item.name,
                to_display(item.value, unit),
                to_display(item.threshold, unit),
                unit,
                100.0 * result.first[item.name],
            )
        )
    report.section("What must hold").table(
        ReportTable(
            ("requirement", "now", "life ends at", "unit", "fails first [%]"),
            rows,
            "Evaluated with the model at the median severities; the limit includes its margin.",
            digits=4,
        )
    )


def _faults(report: Report, result: Prognosis) -> None:
    rows = []
    for item in result.known:
        unit = severity_unit(item.unit)
        low, high = (f"{to_display(v, unit):.3g}" for v in item.interval)
        slow, fast = (f"{v:.3g}" for v in item.factor_interval)
        rows.append(
            (
                f"{item.kind}@{item.place}",
                f"{to_display(item.severity, unit):.3g} ({low} to {high}) {unit}",
                f"{item.factor:.3g} ({slow} to {fast})",
                ", ".join(f"{n} {p:.0%}" for n, p in _likeliest(item.growth)),
                item.inspections,
            )
        )
    report.section("Faults now").table(
        ReportTable(
            ("fault", "severity", "growth over the law's", "grows by", "inspections that saw it"),
            rows,
            f"Median and {result.level:.0%} interval.",
        )
    )


def _likeliest(growth: Mapping[str, float]) -> list[tuple[str, float]]:
    ranked = sorted(growth.items(), key=lambda item: -item[1])
    return [item for item in ranked if item[1] >= _RARE]


_RARE = 0.02  # families less likely are left out


def _laws(report: Report, laws: Sequence[Law]) -> None:
    rows = [
        (law.name, law.key, name, f"{c.value:.4g} {c.unit}", c.source)
        for law in laws
        for name, c in law.coefficients.items()
    ]
    section = report.section("Laws of growth")
    section.points([f"{law.name}: {law.text}. {law.source}." for law in laws])
    section.table(
        ReportTable(("law", "fault", "coefficient", "value", "source"), rows, folded="Numbers")
    )
