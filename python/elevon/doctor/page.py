"""The page of a first look: the diagnosis, the model beside the logs, the data."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elevon.number_text import quantity_text
from elevon.report import Report, ReportTable
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from elevon.calibrate.validation import Validation
    from elevon.doctor.answer import Examination

_DRAWN = 6  # logs


def examination_page(result: Examination, date: str | None = None) -> Report:
    """Return the report of a first look."""
    report = Report("", date=date) if result.verdict is None else result.verdict.report(date=date)
    report.title = f"First look at {', '.join(result.logs)}: {result.actuator}"
    report.lead = result.headline
    seen = [check for check in result.checks if not check.ok]
    report.fact("Data", "sound" if not seen else f"{len(seen)} to look at", "clock, gaps, values")
    report.fact("Columns", {"guess": "guessed"}.get(result.columns_by, f"by {result.columns_by}"))
    report.fact("Model", _fit_word(result), "beside the logs")
    _fit(report, result)
    _data(report, result)
    return report


def _fit_word(result: Examination) -> str:
    if result.fit is None:
        return "not compared"
    return f"{max(error.of_range for error in result.fit.errors):.3g} % off at worst"


def _fit(report: Report, result: Examination) -> None:
    section = report.section("The model beside the logs")
    if result.fit is None:
        section.text(f"Not compared: {result.reasons.get('fit', '')}")
        _recorded(report, result)
        return
    section.table(
        ReportTable(
            ("log", "signal", "RMS error", "% of range", "threshold %", "passed"),
            [
                (e.log, e.signal, " ".join(quantity_text(e.rms, e.unit, 3)), e.of_range, e.limit,
                 e.passed)
                for e in result.fit.errors
            ],
            f"The same command on the model of the healthy unit, after {result.fit.transient:g} s. "
            "A fault of the unit is in these errors, too; those of a healthy log are the model's.",
            digits=3,
        )
    )  # fmt: skip
    _charts(report, result.fit)


def _charts(report: Report, fit: Validation) -> None:
    units = {error.signal: error.unit for error in fit.errors}
    for trace in fit.traces[:_DRAWN]:
        section = report.section(f"Signals of {trace.log}")
        for name, simulated in trace.simulated.items():
            unit = display_unit(units.get(name, "1"))
            lines = {
                "log": to_display(trace.measured[name], unit),
                "model": to_display(simulated, unit),
            }
            section.chart(name, trace.time, lines, y_label=f"[{unit}]", dashed=["model"])


def _recorded(report: Report, result: Examination) -> None:
    """Draw what was logged, where no model stands beside it."""
    from elevon.recording.plot import panels_of

    for name, recording in list(result.recordings.items())[:_DRAWN]:
        section = report.section(f"Signals of {name}")
        for panel in panels_of(recording):
            section.chart(
                panel.title or ", ".join(panel.lines),
                panel.time,
                panel.lines,
                y_label=f"[{panel.unit}]",
                breaks=panel.gaps,
            )


def _data(report: Report, result: Examination) -> None:
    rows = [(c.log, c.check, "ok" if c.ok else "look", c.text) for c in result.checks]
    marked = frozenset(k for k, check in enumerate(result.checks) if not check.ok)
    report.section("Data").table(
        ReportTable(("log", "question", "", "what was seen"), rows, marked=marked)
    )
    how = {
        "map": "By the map that was given.",
        "guess": "Guessed: correct map.toml where a column is not what it was taken for, and give "
        "it with --map.",
        "headers": "By the headers of the logs.",
    }[result.columns_by]
    report.section("Columns", how).table(
        ReportTable(
            ("log", "column", "taken for", "unit", "why"),
            [(c.log, c.name, c.role or "?", c.unit, c.why) for c in result.columns],
        )
    )
