"""The report of the safety campaign: hazards against targets, trees, failures, rules."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from markupsafe import Markup

from elevon.actuator import Actuator
from elevon.recording import Recording
from elevon.recording.plot import code_names
from elevon.report import Report, ReportTable, Section, provenance
from elevon.report.figures import new_figure
from elevon.safety.outcomes import Outcome
from elevon.safety.result import HazardResult, HazardRow, SafetyResult
from elevon.safety.tables import FMEA, fmea
from elevon.safety.tree import fault_tree

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MOST = 20
"""Cut sets and failures of a table on the page; the files have all of them."""


def safety_report(result: SafetyResult, actuator: Actuator, *, date: str | None = None) -> Report:
    """Return the report of a campaign.

    Parameters
    ----------
    result : SafetyResult
        What it showed.
    actuator : Actuator
        What was run: the worst rows are simulated again for their pictures.
    date : str, optional
        Printed instead of the day's.
    """
    met = sum(item.met for item in result.hazards)
    report = Report(
        f"Safety of {actuator.name}",
        f"{met} of {len(result.hazards)} hazards keep the target of their class. {result.runs} "
        f"situations with up to three failures, {result.fidelity.rerun_high} of them in the "
        f"switching model too; {result.unsafe} show a hazard.",
        date=date,
    )
    report.fact("Situations", str(result.runs), "with no, one, two, three failures")
    report.fact("With a hazard", str(result.unsafe), "listed or not")
    report.fact("Targets kept", f"{met} of {len(result.hazards)}", "mean of a flight hour")
    report.fact("Flight", f"{result.flight:g} h", "duration")
    report.section("Hazards").table(_hazards(result))
    for item in result.hazards:
        if item.findings:
            title = item.name[:1].upper() + item.name[1:]
            _hazard(report.section(title), item, result, actuator)
    report.section("Rules").checks(result.checks)
    _failures(report.section("Failures"), result, actuator)
    _fidelity(report.section("Fidelity"), result)
    run = ReportTable(["Group", "Rows"], list(result.groups.items()))
    report.section("What was run").table(run)
    command = f"elevon safety {actuator.name} --seed {result.seed} --out DIR"
    report.provenance(provenance(command, Seed=result.seed))
    return report


def _hazards(result: SafetyResult) -> ReportTable:
    """Return the table of all hazards."""
    rows: list[list[object]] = [
        [item.name, item.severity, item.text, item.mean, item.worst,
         f"{item.interval[0]:.1e} to {item.interval[1]:.1e}", item.target,
         "yes" if item.met else "no", len(item.cut_sets), item.single]
        for item in result.hazards
    ]  # fmt: skip
    columns = ["Hazard", "Class", "What it is", "Mean [1/h]", "Worst flight [1/h]",
               "Mean with the rates' interval", "Target [1/h]", "Met", "Cut sets",
               "Single"]  # fmt: skip
    caption = (
        "Mean: events a flight hour over all flights. Worst flight: the last one before the "
        "checks. Rates that are ASSUMED have an interval of a factor of ten."
    )
    return ReportTable(
        columns, rows, caption, formats=["", "", "", ".1e", ".1e", "", ".0e", "", "", ""]
    )


def _hazard(section: Section, item: HazardResult, result: SafetyResult, actuator: Actuator) -> None:
    """Add a hazard's tree, cut sets, importance, checks, and its worst row over time."""
    if item.cut_sets:
        # Safe: the drawing escapes its texts.
        section.markup(Markup(fault_tree(item)), "Dashed: dormant.")  # noqa: S704
        section.table(_cut_sets(item))
    bound = item.third_order
    section.text(
        f"Three failures: {bound.showing} of {bound.drawn} drawn situations show it though none of "
        f"their failures or pairs does; a bound of {bound.bound:.1e} an hour, not a cut set."
    )
    important: list[list[object]] = [
        [row.failure, row.fussell_vesely, row.birnbaum] for row in item.importance[:_MOST]
    ]
    columns = ["Failure", "Fussell-Vesely", "Birnbaum"]
    section.table(ReportTable(columns, important, "Importance.", formats=["", ".3f", ".2e"]))
    effects: list[list[object]] = [
        [row.check, row.interval, row.half, item.mean, row.twice] for row in item.check_effects
    ]
    columns = ["Check", "Interval [h]", "Half of it [1/h]", "As it is [1/h]", "Twice [1/h]"]
    section.table(ReportTable(columns, effects, "What the interval of each check does to the mean.",
                              formats=["", ".0f", ".1e", ".1e", ".1e"]))  # fmt: skip
    rows = result.outcomes.rows
    unlisted = [finding for finding in item.findings if not finding.reason]
    worst = min(unlisted or item.findings, key=lambda finding: len(rows[finding.row].faults))
    row = rows[worst.row]
    recording = _again(result, actuator, worst)
    draw = _gear_timeline if actuator.wiring == "landing_gear" else _servo_timeline
    section.figure(
        draw(recording, worst.time),
        f"{row.combination}. {row.situation}. {worst.fidelity.capitalize()} fidelity; "
        f"the hazard begins at the dotted line, {worst.time:.2f} s. rows/{worst.row}.toml.",
    )
    messages = dict(result.outcomes.both(worst.row))[worst.fidelity].messages
    lines = [f"{message.time:.2f} s: {message.text}" for message in messages]
    section.text("What the crew sees:").points(lines or ["nothing"])


def _cut_sets(item: HazardResult) -> ReportTable:
    reasons = {finding.row: finding.reason for finding in item.findings}
    rows: list[list[object]] = [
        [" + ".join(cut.failures), ", ".join(cut.dormant) or "none",
         "any" if len(cut.last) == cut.order else f"{cut.last[0]} last", cut.phase, cut.mean,
         cut.worst, cut.common or None, len(cut.rows), reasons.get(cut.rows[0]) or ""]
        for cut in item.cut_sets[:_MOST]
    ]  # fmt: skip
    left = len(item.cut_sets) - len(rows)
    caption = "Minimal cut sets, the most frequent first." + (
        f" {left} more stand in cutsets.csv." if left else ""
    )
    columns = ["Failures", "Dormant", "Order", "Phase", "Mean [1/h]", "Worst [1/h]",
               "Common cause [1/h]", "Rows", "Why no sensor could tell"]  # fmt: skip
    return ReportTable(columns, rows, caption,
                       formats=["", "", "", "", ".1e", ".1e", ".1e", "", ""])  # fmt: skip


def _failures(section: Section, result: SafetyResult, actuator: Actuator) -> None:
    """Add rates and how each failure is revealed, what the monitors cover, and the FMEA."""
    rows: list[list[object]] = [
        [f.name, f.part, f.rate, f"{f.rate_low:.1e} to {f.rate_high:.1e}", f.alpha, f.effect,
         "evident" if f.evident else "dormant", f.check, f.interval, f.source]
        for f in result.failures
    ]  # fmt: skip
    columns = ["Failure", "Part", "Rate [1/h]", "Interval", "Share of the part", "Effect", "Seen",
               "Revealed by", "Within [h]", "Source"]  # fmt: skip
    formats = ["", "", ".2e", "", ".3f", ".2f", "", "", ".0f", ""]
    caption = "Rates and how failures are revealed."
    section.table(ReportTable(columns, rows, caption, formats=formats))
    monitors: list[list[object]] = [[c.monitor, c.failures, c.share] for c in result.coverage]
    section.table(ReportTable(["Message", "Failures", "Share of all rates"], monitors,
                              "Coverage of each monitor in phases that every flight has.",
                              formats=["", "", ".1%"]))  # fmt: skip
    heads = [name.replace("_", " ") for name in FMEA]
    section.table(ReportTable(heads, fmea(result, actuator.wiring), "fmea.csv has the same rows.",
                              folded="FMEA"))  # fmt: skip


def _fidelity(section: Section, result: SafetyResult) -> None:
    about, known = result.fidelity, result.outcomes
    low, high = about.rate_interval
    section.text(
        f"{about.near_limit} situations lie near a limit that could change them. "
        f"{about.rerun_high} ran in the switching model too, {about.not_rerun} did not. "
        f"{about.changed_outcome} changed their outcome. Of those drawn at random far from every "
        f"limit {about.rate:.1%} did (95 % interval {low:.1%} to {high:.1%}). A hazard counts at "
        "whichever fidelity it shows."
    )
    rows = [
        [place, known.rows[place].combination, known.rows[place].situation,
         _ending(known.low[place]), _ending(known.high[place])]
        for place in about.changed[:_MOST]
    ]  # fmt: skip
    columns = ["Row", "Failures", "Situation", "Reduced model", "Switching model"]
    section.table(ReportTable(columns, rows, "Situations whose outcome the two do not share."))


def _ending(outcome: Outcome) -> str:
    """What a run came to: hazards, messages, state at the end."""
    texts = dict.fromkeys([*outcome.hazards, *(item.text for item in outcome.messages)])
    return ", ".join([*texts, f"ends {outcome.end}"])


def _again(result: SafetyResult, actuator: Actuator, finding: HazardRow) -> Recording:
    from elevon.simulate import simulate

    scenario = result.outcomes.rows[finding.row].scenario()
    return simulate(actuator, scenario, fidelity=finding.fidelity, record=[result.record])


def _gear_timeline(recording: Recording, begin: float) -> Figure:
    """Ram, state displayed and true lock over time; only states that occur have a line."""
    time, states = recording["state"].time, recording["state"].values
    occurring = sorted({int(value) for value in states})
    names = code_names("landing_gear", "state")
    with new_figure(3, sharex=True) as (figure, (ram, state, lock)):
        ram.plot(time, 1e3 * recording["output_position"].values)
        ram.set_ylim(-10.0, 280.0)
        ram.set_ylabel("ram [mm]")
        state.step(time, [occurring.index(int(value)) for value in states], where="post")
        state.set_yticks(range(len(occurring)), [names[code] for code in occurring])
        state.set_ylabel("displayed")
        lock.step(time, recording["locked"].values, where="post")
        lock.set_yticks((0, 1), ("open", "engaged"))
        lock.set_ylabel("lock")
        lock.set_xlabel("time [s]")
        for axes in (ram, state, lock):
            axes.axvline(begin, linestyle=":")
    return figure


def _servo_timeline(recording: Recording, begin: float) -> Figure:
    """Command and output, reported position, current over time."""
    unit = "mm" if recording["output_position"].unit == "m" else "deg"
    scale = 1e3 if unit == "mm" else float(np.degrees(1.0))
    time = recording["output_position"].time
    with new_figure(2, sharex=True) as (figure, (position, current)):
        for name in ("command", "output_position", "encoder_position"):
            label = name.replace("_", " ")
            position.plot(time, scale * recording[name].values, label=label)
        position.set_ylabel(f"position [{unit}]")
        position.legend()
        current.plot(time, recording["current_q"].values)
        current.set_ylabel("current [A]")
        current.set_xlabel("time [s]")
        for axes in (position, current):
            axes.axvline(begin, linestyle=":")
    return figure
