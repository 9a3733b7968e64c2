"""The page of a prognosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Literal

import numpy as np

from elevon.number_text import count_text
from elevon.prognose.observation import Inspection
from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.prognose.answer import Branch, Prognosis
    from elevon.prognose.law import Law
    from elevon.prognose.next_inspection import Assumed


def severity_unit(unit: str) -> str:
    """Return the unit severities are displayed in: shares in percent, lengths in millimetres."""
    return {"1": "%", "m": "mm"}.get(unit, display_unit(unit))


def course_figure(
    result: Prognosis, inspections: Sequence[Inspection], laws: Sequence[Law]
) -> Figure:
    """Draw the severities that inspections saw and those to come."""
    with new_figure(len(laws), 1, height=1.2 + 2.2 * len(laws), sharex=True) as (figure, axes):
        far = _far(result)
        for k, (law, axis) in enumerate(zip(laws, np.atleast_1d(axes), strict=True)):
            unit = severity_unit(law.unit)
            course = to_display(result.future.course[:, k, :], unit)
            at = result.future.at
            near = at <= far
            band = axis.fill_between(
                at[near], course[near, 0], course[near, 2], color=COLOURS["orange"], alpha=0.25
            )
            band.set_label("to come, 90 %")
            axis.plot(at[near], course[near, 1], color=COLOURS["orange"], label="median")
            _draw_seen(axis, inspections, law, unit)
            axis.axvline(result.usage, color=COLOURS["grey"], lw=0.8)
            axis.set(ylabel=f"{law.kind} [{unit}]")
            axis.margins(y=0.15)
            axis.legend(loc="upper left")
        np.atleast_1d(axes)[-1].set_xlim(0.0, far)
        np.atleast_1d(axes)[-1].set(xlabel=f"use [{result.unit}]")
    return figure


def _far(result: Prognosis) -> float:
    """Return where the axis of use ends: the history keeps a quarter of it at least."""
    ends = [value for value in (*result.interval, result.median) if np.isfinite(value)]
    ahead = 1.15 * max(ends, default=np.inf)
    most = 3.0 * result.usage or np.inf
    return result.usage + max(min(ahead, most, float(result.future.at[-1] - result.usage)), 1.0)


def _draw_seen(axis: object, inspections: Sequence[Inspection], law: Law, unit: str) -> None:
    rows = [
        (item.usage, s.severity, s.low, s.high)
        for item in inspections
        if (s := item.seen.get(law.key)) is not None and s.severity is not None
    ]
    if not rows:
        return
    usage, severity, low, high = np.array(rows).T
    spread = 1.6449 * np.vstack((to_display(low, unit), to_display(high, unit)))
    axis.errorbar(  # type: ignore[attr-defined]
        usage, to_display(severity, unit), spread, fmt="o", ms=3.5, lw=1.0,
        color=COLOURS["blue"], label="inspections, 90 %",
    )  # fmt: skip


def survival_figure(result: Prognosis) -> Figure:
    """Draw the probability of surviving the next N."""
    ranked = np.sort(result.future.remaining)
    share = 1.0 - np.arange(1, len(ranked) + 1) / len(ranked)
    finite = np.isfinite(ranked)
    with new_figure(width=8.0, height=3.0) as (figure, axis):
        axis.step(np.append(0.0, ranked[finite]), np.append(1.0, share[finite]), where="post")
        axis.set(
            xlabel=f"next N {result.unit}", ylabel="probability of surviving", ylim=(0.0, 1.03)
        )
        if finite.any():  # the few futures that go on for long would press the others together
            axis.set_xlim(0.0, 1.15 * float(np.quantile(ranked[finite], 0.98)))
        for value, style in ((result.median, "-"), *((v, ":") for v in result.interval)):
            if np.isfinite(value):
                axis.axvline(value, color=COLOURS["grey"], ls=style, lw=0.9)
    return figure


def sentence(result: Prognosis) -> str:
    """Return the answer in one sentence: what to do, then the remaining life of each branch."""
    text = f"{result.action.text} {_remaining(result)}"
    if not result.off_law:
        return text
    worst = max(result.off_law, key=lambda item: abs(item.deviations))
    return f"{text} The history contradicts the law: {worst.text}."


def _remaining(result: Prognosis) -> str:
    if len(result.branches) > 1:
        return _branched(result.branches)
    if np.isfinite(result.median):
        name, share = next(iter(result.first.items()))
        median, ends = _life(result)
        return (
            f"{median} {result.unit} remain ({result.level:.0%}: {ends}); "
            f"{name} fails first in {share:.0%} of the futures."
        )
    low = result.interval[0]
    if not np.isfinite(low):
        return f"No end of life is in sight ({result.level:.0%} of the futures and more)."
    return (
        f"No end of life is in sight in more than half of the futures; the shortest "
        f"{0.5 * (1.0 - result.level):.0%} end within {count_text(low)} {result.unit}."
    )


def _life(item: Prognosis | Branch) -> tuple[str, str]:
    """Return a median and an interval in words."""
    low, high = (
        count_text(end) if np.isfinite(end) else "no end in sight" for end in item.interval
    )
    return count_text(item.median), f"{low} to {high}"


def _branched(branches: Sequence[Branch]) -> str:
    """Return the branches in words."""
    out = []
    for number, item in enumerate(branches):
        start = f"If {item.what} (p = {item.probability:.2f}): " if number == 0 else "if not, "
        if np.isfinite(item.median):
            median, ends = _life(item)
            out.append(f"{start}{median} {item.unit} ({ends})")
        elif number:
            out.append(f"{start}no end is known")
        else:
            low = item.interval[0]
            near = f" before {count_text(low)} {item.unit}" if np.isfinite(low) else ""
            out.append(f"{start}no end is known{near}")
    return "; ".join(out) + "."


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
