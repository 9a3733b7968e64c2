"""The demonstration's page and its pictures."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.demo.mechanism import mechanism, motion
from elevon.demo.unit import FACTORS
from elevon.logs.read import read_drive_logs
from elevon.prognose.page import severity_unit
from elevon.report import Report, ReportTable, provenance
from elevon.report.figures import COLOURS, new_figure
from elevon.units import to_display

if TYPE_CHECKING:
    from markupsafe import Markup
    from matplotlib.figure import Figure

    from elevon.demo.run import InspectionVisit, LifeDemo
    from elevon.demo.story import Story
    from elevon.logs.log import Log
    from elevon.report.checks import Check


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
    _times_section(report, demo)
    return _closed(report, demo, demo.checks)


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


def _closed(report: Report, demo: Story, checks: Sequence[Check]) -> Report:
    """Return a demonstration's page with what each ends with: checks, and what it was made from."""
    report.section("Checks").checks(checks)
    sets = {"Seed": demo.seed, "Published set": demo.base.hash, "Hidden set": demo.hidden.hash}
    report.provenance(provenance("elevon demo", **sets))
    return report


def _times_section(report: Report, demo: Story) -> None:
    """Add the time of each step."""
    rows: list[list[object]] = [[step.name, step.seconds, step.reused] for step in demo.steps]
    rows.append(["all", demo.seconds, ""])
    resumed = any(step.reused for step in demo.steps)
    columns = ["Step", "Time [s]", "Resumed"] if resumed else ["Step", "Time [s]"]
    table = ReportTable(
        columns,
        rows if resumed else [row[:2] for row in rows],
        "Wall time of this run; drawing and writing this page is not in it."
        + (" Steps kept from an interrupted run took only the time to read them." * resumed),
        formats=["", ".1f", ""],
    )
    report.section("Time of each step").table(table)


def cone_figure(demo: LifeDemo) -> Figure:
    """Draw the predicted end of life at each inspection: a cone that closes on the true one."""
    track = demo.track
    with new_figure(width=9.0, height=4.4) as (figure, axis):
        axis.fill_between(
            track.usage, track.usage + track.low, track.usage + track.high,
            color=COLOURS["orange"], alpha=0.25, lw=0, label="predicted, 90 %",
        )  # fmt: skip
        axis.plot(
            track.usage, track.usage + track.median, "o-", color=COLOURS["orange"],
            label="predicted end of life",
        )  # fmt: skip
        axis.axhline(track.end, color=COLOURS["blue"], lw=2.0, label="true end of life")
        reach = np.array([0.0, track.end])
        axis.fill_between(reach, 0.0, reach, color=COLOURS["grey"], alpha=0.12, lw=0)
        axis.text(0.97 * track.end, 0.45 * track.end, "flown", ha="right", color=COLOURS["grey"])
        highest = float(np.max((track.usage + track.high)[1:], initial=track.end))
        axis.set(
            xlim=(0.0, 1.03 * track.end),
            ylim=(0.0, 1.15 * max(highest, track.end)),
            xlabel="flights at the inspection",
            ylabel="end of life [flights]",
        )
        axis.plot([track.end], [track.end], "s", color=COLOURS["blue"], ms=7)
        axis.legend(loc="lower left")
    return figure


def remaining_figure(demo: LifeDemo) -> Figure:
    """Draw remaining life, predicted and true, with the 20 % wedge."""
    track = demo.track
    with new_figure(width=8.5, height=3.4) as (figure, axis):
        use = np.array([0.0, track.end])
        true = track.end - use
        axis.fill_between(
            use, 0.8 * true, 1.2 * true, color=COLOURS["green"], alpha=0.2, lw=0,
            label="20 % about the truth",
        )  # fmt: skip
        axis.plot(use, true, color=COLOURS["green"], label="truth")
        spread = np.vstack((track.median - track.low, track.high - track.median))
        axis.errorbar(
            track.usage, track.median, spread, fmt="o", ms=4, color=COLOURS["orange"],
            label="predicted, 90 %",
        )  # fmt: skip
        axis.set(xlabel="flights at the inspection", ylabel="remaining [flights]", ylim=(0.0, None))
        axis.legend()
    return figure


def diagnoses_figure(demo: LifeDemo) -> Figure:
    """Draw what each inspection's diagnosis said, and the truth."""
    laws = demo.response.laws
    with new_figure(1, len(laws), width=9.0, height=3.4) as (figure, axes):
        for k, (law, axis) in enumerate(zip(laws, np.atleast_1d(axes), strict=True)):
            unit = severity_unit(law.unit)
            truth = to_display(demo.life.severity[:, k], unit)
            axis.plot(demo.life.usage, truth, color=COLOURS["green"], label="truth")
            rows = [
                (v.usage, s.severity, 1.6449 * s.low, 1.6449 * s.high)
                for v in demo.visits
                if (s := v.inspection.seen.get(law.key)) is not None and s.severity is not None
            ]
            if rows:
                usage, value, low, high = np.array(rows).T
                axis.errorbar(
                    usage, to_display(value, unit),
                    np.vstack((to_display(low, unit), to_display(high, unit))),
                    fmt="o", ms=4, color=COLOURS["blue"], label="diagnosis, 90 %",
                )  # fmt: skip
            missed = [
                v.usage for v in demo.visits
                if (s := v.inspection.seen.get(law.key)) is not None and s.severity is None
            ]  # fmt: skip
            axis.plot(missed, np.zeros(len(missed)), "x", color=COLOURS["grey"], label="not seen")
            axis.set(xlabel="flights", ylabel=f"{law.kind} [{unit}]", title=law.kind)
            axis.legend(loc="upper left")
    return figure


def signals_figure(healthy: Log, worn: Log, ratio: float, usage: float) -> Figure:
    """Draw two logs of the same test: the two positions' difference, and the current."""
    with new_figure(2, 1, width=9.0, height=4.8, sharex=True) as (figure, axes):
        for data, colour, name in (
            (healthy, "blue", "new"),
            (worn, "orange", f"at flight {usage:.0f}"),
        ):
            keep = (data.time > 5.0) & (data.time < 15.0)
            time = data.time[keep] - 5.0
            gap = np.degrees(data.motor / ratio - data.output)[keep]
            axes[0].plot(time, gap - 0.5 * (gap.max() + gap.min()), color=COLOURS[colour], lw=1.2,
                         label=name)  # fmt: skip
            current = _smooth(data.current[keep], 9)
            axes[1].plot(time, current, color=COLOURS[colour], lw=0.9, label=name)
        axes[0].set(
            ylabel="motor less output [deg]", title="Lost motion: both positions of the log"
        )
        axes[1].set(ylabel="torque current [A]", xlabel="time [s]",
                    title="Current, smoothed over 20 ms")  # fmt: skip
        axes[0].margins(y=0.25)
        axes[0].legend(loc="upper right", ncols=2)
    return figure


def _smooth(values: Floats, width: int) -> Floats:
    return np.convolve(values, np.full(width, 1.0 / width), mode="same")
