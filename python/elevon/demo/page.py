"""The demonstration's page and its pictures."""

from __future__ import annotations

import base64
from typing import TYPE_CHECKING

import numpy as np

import elevon
from elevon.demo.unit import FACTORS, demo_mission, faults_at
from elevon.prognose.page import prognosis_page, severity_unit
from elevon.report import Report, ReportTable, provenance
from elevon.report.figures import COLOURS, new_figure
from elevon.report.mechanism import mechanism, moving_svg, trace
from elevon.units import to_display

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.demo.run import LifeDemo
    from elevon.demo.story import Story

_SWEEP = 5.0  # s of the mission's sine
_RATE = 20.0  # pictures a second


def lead(demo: LifeDemo) -> str:
    """Return the sentence to remember, from the inspection nearest to 70 % of life."""
    visit = min(demo.visits, key=lambda v: abs(v.usage - 0.7 * demo.life.end))
    return (
        f"At flight {visit.usage:,.0f} one 20-second test gave: {visit.rul:,.0f} flights remain "
        f"({visit.low:,.0f} to {visit.high:,.0f}). The unit failed {visit.truth:,.0f} flights "
        "later."
    )


def save_pages(demo: LifeDemo, *, force: bool) -> None:
    """Write the pages: those of the last inspection, then the demonstration's own."""
    last = demo.visits[-1]
    seen = [visit.inspection for visit in demo.visits]
    prognosis = prognosis_page(
        last.prognosis, seen, demo.response.laws, actuator=demo.calibration.actuator.name
    )
    prognosis.save(demo.folder / "prognosis.html", force=True, links=False)
    last.diagnosis.report().save(demo.folder / "diagnosis.html", force=True, links=False)
    life_report(demo).save(demo.folder / "report.html", force=force)


def life_report(demo: LifeDemo) -> Report:
    """Return the report."""
    report = Report("How long will it last?", lead(demo))
    report.open_with(
        cone_figure(demo),
        "The end of life as predicted at each inspection, and the true one. No inspection knew it: "
        "each saw one log of the bench, a model calibrated on the new unit, and the mission.",
    )
    passed = [check.passed for check in demo.checks]
    report.fact("True end of life", f"{demo.life.end:,.0f} flights", "known to no step")
    report.fact("Inspections", str(len(demo.visits)), "one 20 s log each")
    report.fact("Checks passed", f"{sum(passed)} of {len(passed)}")
    report.fact("All steps", f"{demo.story.seconds:.0f} s", "on this machine")
    _actuator(report, demo)
    _inspections(report, demo)
    _calibration(report, demo)
    times_section(report, demo.story)
    report.section("Checks").checks(demo.checks)
    sets = {"Seed": demo.seed, "Published set": demo.base.hash, "Hidden set": demo.hidden.hash}
    report.provenance(provenance("elevon demo", **sets))
    return report


def _actuator(report: Report, demo: LifeDemo) -> None:
    """Add the moving picture of the new and of the worn unit."""
    from markupsafe import Markup

    section = report.section(
        "The actuator at work",
        "A brushless motor drives a flap over a gear of 1:124. The gear wears: between what drives "
        "(blue) and what is driven the backlash grows. The load holds the flap on one flank; where "
        "the load turns round, the flap crosses the backlash at once.",
    )
    data = base64.b64encode(moving_picture(demo).encode()).decode()
    # Safe: base64 between texts of our own.
    picture = Markup(  # noqa: S704
        f'<img alt="the mechanism, new and worn" src="data:image/svg+xml;base64,{data}">'
    )
    section.markup(
        picture,
        f"One sweep of the mission by this very unit, new above, after {demo.visits[-1].usage:,.0f}"
        " flights below. The backlash is drawn larger than it is.",
    )


def moving_picture(demo: LifeDemo) -> str:
    """Return the mechanism of the new unit above that of the last inspection, both moving."""
    panels = [sweep(demo, usage) for usage in (0.0, demo.visits[-1].usage)]
    return moving_svg(panels, "One sweep of the mission: the unit new, and worn", height=280)


def sweep(demo: LifeDemo, usage: float) -> list[str]:
    """Run one sweep of the mission with the hidden unit as it is at a use; return its picture."""
    scenario = demo_mission().scenarios().replaced(duration=2.0 * _SWEEP)
    run = elevon.simulate(
        demo.hidden, scenario.with_faults(faults_at(demo.life, usage)),
        record=f"output_position,motor_position,command@{_RATE:g} Hz",
    )  # fmt: skip
    names = ("output_position", "motor_position", "command")
    drawn = {name: np.asarray(run[name].values[-int(_RATE * _SWEEP) :]) for name in names}
    ratio = demo.hidden.parameters.value("gear.ratio")
    gap = drawn["motor_position"] / ratio - drawn["output_position"]
    return [*mechanism(drawn, gap, ratio, _SWEEP), *trace(np.degrees(gap), _SWEEP)]


def _inspections(report: Report, demo: LifeDemo) -> None:
    """Add what each inspection found, beside the truth."""
    section = report.section(
        "What each inspection said",
        "Each inspection narrows how fast the unit can wear. Two thousand units that may be this "
        "one then fly on until the model says that one of the requirements fails. The unit wears "
        "by a law that the prediction has not: its wear and friction feed back on themselves, "
        f"scatter half as much again, and go {FACTORS[0]:g} and {FACTORS[1]:g} times as fast as "
        "the law says. The pages beside this one are those of the last inspection.",
    )
    rows, laws = [], demo.response.laws
    for visit in demo.visits:
        cells = [f"{visit.usage:,.0f}", visit.status]
        for law, true in zip(laws, demo.life.at(visit.usage), strict=True):
            unit = severity_unit(law.unit)
            seen = visit.inspection.seen.get(law.key)
            value = None if seen is None else seen.severity
            cells += ["not seen" if value is None else f"{to_display(value, unit):.3g} {unit}",
                      f"{to_display(float(true), unit):.3g} {unit}"]  # fmt: skip
        cells += [f"{visit.rul:,.0f}", f"{visit.low:,.0f} to {visit.high:,.0f}",
                  f"{visit.truth:,.0f}"]  # fmt: skip
        rows.append(cells)
    heads = [name for law in laws for name in (law.kind, "truth")]
    section.table(
        ReportTable(["flights", "diagnosis", *heads, "flights remain", "90 %", "truth"], rows)
    )
    section.text("The same from the command line, with the files of this folder:")
    section.code(
        f"elevon predict {demo.folder}/history --actuator {demo.folder}/calibrated.toml "
        f"--mission {demo.folder}/mission.toml"
    )


def _calibration(report: Report, demo: LifeDemo) -> None:
    value = demo.hidden.parameters.value
    rows = [
        [e.path, demo.base.parameters.value(e.path), value(e.path), e.value, *e.interval, e.unit]
        for e in demo.calibration.estimates
        if e.path in demo.hidden.parameters and e.register == "plant"
    ]
    heads = ["parameter", "published", "hidden truth", "estimate", "low", "high", "unit"]
    report.section(
        "The model of this unit",
        "Calibrated on three logs of the new unit. The hidden values were drawn by a seed.",
    ).table(ReportTable(heads, rows, "Estimates with 90 % intervals.", digits=4))


def times_section(report: Report, story: Story) -> None:
    """Add the time of each step."""
    rows: list[list[object]] = [[step.name, step.seconds, step.reused] for step in story.steps]
    rows.append(["all", story.seconds, ""])
    text = "Wall time of this run; drawing and writing this page is not in it."
    table = ReportTable(["Step", "Time [s]", "Resumed"], rows, text, formats=["", ".1f", ""])
    report.section("Time of each step").table(table)


def cone_figure(demo: LifeDemo) -> Figure:
    """Draw the predicted end of life at each inspection: a cone that closes on the true one."""
    track = demo.track
    with new_figure(width=9.0, height=4.4) as (figure, axis):
        orange, grey, blue = COLOURS["orange"], COLOURS["grey"], COLOURS["blue"]
        low, middle, high = (track.usage + v for v in (track.low, track.median, track.high))
        axis.fill_between(track.usage, low, high, color=orange, alpha=0.25, lw=0,
                          label="predicted, 90 %")  # fmt: skip
        axis.plot(track.usage, middle, "o-", color=orange, label="predicted end of life")
        axis.axhline(track.end, color=blue, lw=2.0, label="true end of life")
        reach = np.array([0.0, track.end])
        axis.fill_between(reach, 0.0, reach, color=grey, alpha=0.12, lw=0)
        axis.text(0.97 * track.end, 0.45 * track.end, "flown", ha="right", color=grey)
        top = 1.15 * float(np.max(high[1:], initial=track.end))
        axis.set(xlim=(0.0, 1.03 * track.end), ylim=(0.0, top),
                 xlabel="flights at the inspection", ylabel="end of life [flights]")  # fmt: skip
        axis.plot([track.end], [track.end], "s", color=blue, ms=7)
        axis.legend(loc="lower left")
    return figure
