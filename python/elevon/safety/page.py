"""The report of the safety campaign: by hazard, the worst row's timeline, messages to the crew."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import numpy as np

from elevon.actuator import Actuator
from elevon.recording import Recording
from elevon.recording.plot import code_names
from elevon.report import Report, ReportTable, Section, provenance
from elevon.report.figures import new_figure
from elevon.safety.campaign import HazardRow, SafetyResult, per_hour
from elevon.safety.hazards import HAZARDS, RECORD

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LISTED = (
    "Listed: no sensor could tell, with the reason below. Per hour: the sum over the combinations "
    "of the products of their failures' rates, an upper bound."
)


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
    report = Report(
        f"Safety of {actuator.name}",
        f"{result.runs} situations with up to three failures, {result.repeated} of them again at "
        f"high fidelity. {result.unsafe} show a hazard.",
        date=date,
    )
    alone = sum(item.single for item in result.hazards if item.severe)
    report.fact("Situations", str(result.runs), "at low fidelity")
    report.fact("With a hazard", str(result.unsafe), "listed or not")
    report.fact("Severe by one failure", str(alone), "must be none")
    report.section("Hazards").table(_hazards(result))
    for item in result.hazards:
        if item.findings:
            title = item.name[:1].upper() + item.name[1:]
            _hazard(report.section(title), item.findings, actuator)
    run = ReportTable(["Group", "Rows"], list(result.groups.items()))
    report.section("What was run").table(run)
    report.section("Checks").checks(result.checks)
    command = f"elevon safety {actuator.name} --seed {result.seed} --out DIR"
    report.provenance(provenance(command, Seed=result.seed))
    return report


def _hazards(result: SafetyResult) -> ReportTable:
    """Return the table of all hazards."""
    texts = {item.name: item.text for item in HAZARDS}
    rows = [
        [item.name, texts[item.name], len(item.findings), item.listed, item.single,
         item.per_hour or None]
        for item in result.hazards
    ]  # fmt: skip
    columns = ["Hazard", "What it is", "Rows", "Listed", "By one failure", "Per hour"]
    return ReportTable(columns, rows, _LISTED, formats=[""] * 5 + [".1e"])


def _hazard(section: Section, findings: tuple[HazardRow, ...], actuator: Actuator) -> None:
    """Add a hazard's combinations, its worst row's timeline, and what the crew sees of that."""
    counts = Counter(item.row.combination for item in findings)
    combinations = {item.row.combination: item for item in findings}
    rows = [
        [key, counts[key], per_hour(item.row), item.reason or "not listed"]
        for key, item in combinations.items()
    ]
    columns = ["Failures", "Rows", "Per hour", "Why no sensor could tell"]
    section.table(ReportTable(columns, rows, formats=["", "", ".1e", ""]))
    unlisted = [item for item in findings if not item.reason]
    worst = min(unlisted or findings, key=lambda item: len(item.row.faults))
    recording = _again(actuator, worst)
    section.figure(
        _timeline(recording, worst, actuator.wiring),
        f"{worst.row.combination}. {worst.row.situation}. {worst.fidelity.capitalize()} fidelity; "
        f"the hazard begins at the dotted line, {worst.time:.2f} s.",
    )
    section.text("What the crew sees:").points(_messages(recording, actuator.wiring))


def _again(actuator: Actuator, finding: HazardRow) -> Recording:
    from elevon.simulate import simulate

    return simulate(actuator, finding.row.scenario(), fidelity=finding.fidelity, record=[RECORD])


def _timeline(recording: Recording, finding: HazardRow, wiring: str) -> Figure:
    """Ram, state displayed and true lock over time; only states that occur have a line."""
    time, states = recording["state"].time, recording["state"].values
    occurring = sorted({int(value) for value in states})
    names = code_names(wiring, "state")
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
            axes.axvline(finding.time, linestyle=":")
    return figure


_SEEN = {
    "state": "", "warning_code": "warning: ", "fault_code": "fault: ",
    "command_refused": "refused: ",
}  # fmt: skip
"""What is displayed to the crew, and how a line of it begins."""


def _messages(recording: Recording, wiring: str) -> list[str]:
    """What the crew sees, in order."""
    lines: list[tuple[float, str]] = []
    for signal, kind in _SEEN.items():
        channel, names = recording[signal], code_names(wiring, signal)
        edges = np.flatnonzero(np.diff(channel.values)) + 1
        lines += [
            (float(channel.time[index]), f"{kind}{names.get(int(channel.values[index]), 'none')}")
            for index in (0, *edges)
            if signal == "state" or channel.values[index] > 0.0
        ]
    return [f"{time:.2f} s: {text}" for time, text in sorted(lines)]
