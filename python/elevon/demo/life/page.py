"""The demonstration's page."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elevon.demo.life.figures import (
    cone_figure,
    diagnoses_figure,
    remaining_figure,
    signals_figure,
)
from elevon.demo.life.mechanism import mechanism, motion
from elevon.demo.life.unit import FACTORS
from elevon.demo.page import closed, times_section
from elevon.logs.read import read_drive_logs
from elevon.prognose.page import severity_unit
from elevon.report import Report, ReportTable
from elevon.units import to_display

if TYPE_CHECKING:
    from markupsafe import Markup

    from elevon.demo.life.results import InspectionVisit, LifeDemo


def lead(demo: LifeDemo) -> str:
    """Return the sentence to remember, from the inspection nearest to 70 % of life."""
    visit = _late_visit(demo)
    low, high = visit.prognosis.interval
    left = demo.life.end - visit.usage
    return (
        f"At flight {_n(visit.usage)} one 20-second test gave: "
        f"{_n(visit.prognosis.median)} flights remain ({_n(low)} to {_n(high)}). "
        f"The unit failed {_n(left)} flights later."
    )


def _late_visit(demo: LifeDemo) -> InspectionVisit:
    return min(demo.visits, key=lambda v: abs(v.usage - 0.7 * demo.life.end))


def _n(value: float) -> str:
    return f"{value:,.0f}"


def life_report(demo: LifeDemo) -> Report:
    """Return the report."""
    report = Report("How long will it last?", lead(demo))
    report.open_with(
        cone_figure(demo),
        "The end of life as predicted at each inspection, and the true one. No inspection knew it: "
        "each saw one log of the bench, a model calibrated on the new unit, and the mission.",
    )
    passed = [check.passed for check in demo.checks]
    report.fact("True end of life", f"{_n(demo.life.end)} flights", "known to no step")
    report.fact("Inspections", str(len(demo.visits)), "one 20 s log each")
    report.fact("Checks passed", f"{sum(passed)} of {len(passed)}")
    report.fact("All steps", f"{demo.seconds:.0f} s", "on this machine")
    _actuator(report, demo)
    _signals(report, demo)
    _diagnoses(report, demo)
    _prediction(report, demo)
    _calibration(report, demo)
    times_section(report, demo)
    return closed(report, demo, demo.checks)


def _actuator(report: Report, demo: LifeDemo) -> None:
    section = report.section(
        "The actuator at work",
        "A brushless motor drives a flap over a gear of 1:124. The gear wears: between the pin "
        "that drives (orange) and the fork that is driven (blue) the backlash grows. The load "
        "holds the flap on one flank; where the load turns round, the flap crosses the backlash at "
        "once, and the tracking error jumps.",
    )
    section.markup(
        moving_picture(demo),
        "One sweep of the mission, from the simulation of this very unit. The flap's angle is "
        "drawn three times, the backlash 26 times as large; the motor turns ten times slower "
        "than it does.",
    )


def moving_picture(demo: LifeDemo) -> Markup:
    """Return the mechanism of the new unit beside that of the last inspection."""
    last = demo.visits[-1].usage
    return mechanism(
        [("new", motion(demo, 0.0)), (f"after {_n(last)} flights", motion(demo, last))]
    )


def _signals(report: Report, demo: LifeDemo) -> None:
    last = demo.visits[-1]
    healthy, worn = read_drive_logs([demo.healthy[0], last.log], one_rate=False)
    ratio = demo.base.parameters.value("gear.ratio")
    section = report.section(
        "What the logs show",
        "The bench writes what a drive writes: positions, speeds, currents at 400 Hz, with noise, "
        "counts and offsets; no truth. This is the same test of the new unit and at the last "
        "inspection.",
    )
    section.figure(
        signals_figure(healthy, worn, ratio, last.usage),
        "Two logs of the no-load test. Above: the motor's position over the gear ratio less the "
        "output's; its jump at each turn of the motion is the backlash. Below: the current, whose "
        "steps "
        "are the friction.",
    )


def _diagnoses(report: Report, demo: LifeDemo) -> None:
    section = report.section("What the diagnoses say", demo.visits[-1].diagnosis.text)
    section.figure(
        diagnoses_figure(demo),
        "Severities by the diagnosis of each log, with 90 % intervals, and the truth that no "
        "diagnosis was given.",
    )
    laws = demo.response.laws
    rows = []
    for visit in demo.visits:
        cells: list[object] = [_n(visit.usage), visit.diagnosis.status]
        for law, true in zip(laws, demo.life.at(visit.usage), strict=True):
            unit = severity_unit(law.unit)
            seen = visit.inspection.seen.get(law.key)
            value = None if seen is None else seen.severity
            text = "not seen" if value is None else f"{to_display(value, unit):.3g}"
            cells += [f"{text} {unit}" if value is not None else text,
                      f"{to_display(float(true), unit):.3g} {unit}"]  # fmt: skip
        rows.append(cells)
    columns = ["flights", "diagnosis"]
    for law in laws:
        columns += [law.kind, "truth"]
    section.table(ReportTable(columns, rows))


def _prediction(report: Report, demo: LifeDemo) -> None:
    section = report.section(
        "What is left",
        "Ways of growth, the law's and those of no physics, are compared by each inspection. Two "
        "thousand units that may be this one then fly on until the model "
        "says that one of the requirements fails. The unit wears by a law that the prediction has "
        "not: its wear and friction feed back on themselves, scatter half as much again, and go "
        f"{FACTORS[0]:g} and {FACTORS[1]:g} times as fast as the law says.",
    )
    section.figure(remaining_figure(demo), "Remaining flights, predicted and true.")
    rows = [
        (
            _n(v.usage),
            _n(v.prognosis.median),
            f"{_n(v.prognosis.interval[0])} to {_n(v.prognosis.interval[1])}",
            _n(demo.life.end - v.usage),
            f"{v.prognosis.survives(500.0):.2f}",
            next(iter(v.prognosis.first)),
        )
        for v in demo.visits
    ]
    columns = ("flights", "remain", "90 %", "truth", "survives 500 more", "fails first")
    section.table(ReportTable(columns, rows))
    lines = []
    for item in demo.visits[-1].prognosis.reserve:
        unit = severity_unit(item.unit)
        now, end = to_display(item.value, unit), to_display(item.threshold, unit)
        lines.append((item.name, f"{now:.3g} {unit}", f"{end:.3g} {unit}"))
    section.table(
        ReportTable(
            ("requirement", "at the last inspection", "life ends at"),
            lines,
            "By the calibrated model, at the severities diagnosed.",
        )
    )
    section.text("The same from the command line, with the files of this folder:")
    section.code(
        f"elevon predict {demo.folder}/history --actuator {demo.folder}/calibrated.toml "
        f"--mission {demo.folder}/mission.toml"
    )


def _calibration(report: Report, demo: LifeDemo) -> None:
    value = demo.hidden.parameters.value
    rows = [
        (e.path, demo.base.parameters.value(e.path), value(e.path), e.value, *e.interval, e.unit)
        for e in demo.calibration.estimates
        if e.path in demo.hidden.parameters and e.register == "plant"
    ]
    report.section(
        "The model of this unit",
        "Calibrated on three logs of the new unit. The hidden values were drawn by a seed.",
    ).table(
        ReportTable(
            ("parameter", "published", "hidden truth", "estimate", "low", "high", "unit"),
            rows,
            "Estimates with 90 % intervals.",
            digits=4,
        )
    )
