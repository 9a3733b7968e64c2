"""The report of the safety campaign: by hazard, the worst row's timeline, messages to the crew."""

from __future__ import annotations

from collections import Counter
from functools import partial
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.data import packaged_toml
from elevon.recording import Recording
from elevon.recording.plot import code_names
from elevon.report import Report, provenance
from elevon.report.described import described
from elevon.report.figures import new_figure
from elevon.safety.campaign import HazardRow, SafetyResult, per_hour
from elevon.safety.hazards import HAZARDS, RECORD


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
    names = {
        "result": result,
        "actuator": actuator,
        "texts": {item.name: item.text for item in HAZARDS},
        "combinations": _combinations,
        "worst": partial(_worst, actuator),
    }
    report = described(packaged_toml("elevon.safety", "page.toml"), names, date=date)
    report.section("Checks").checks(result.checks)
    command = f"elevon safety {actuator.name} --seed {result.seed} --out DIR"
    report.provenance(provenance(command, Seed=result.seed))
    return report


def _combinations(findings: tuple[HazardRow, ...]) -> list[list[object]]:
    """Return a hazard's combinations: rows, probability an hour, why no sensor could tell."""
    rows = Counter(item.row.combination for item in findings)
    combinations = {item.row.combination: item for item in findings}
    return [
        [key, rows[key], per_hour(item.row), item.reason or "not listed"]
        for key, item in combinations.items()
    ]


def _worst(actuator: Actuator, findings: tuple[HazardRow, ...]) -> dict[str, object]:
    """Return a hazard's worst row: its timeline, and what the crew sees."""
    unlisted = [item for item in findings if not item.reason]
    chosen = min(unlisted or findings, key=lambda item: len(item.row.faults))
    recording = _again(actuator, chosen)
    return {
        "row": chosen.row,
        "fidelity": chosen.fidelity,
        "time": chosen.time,
        "figure": _timeline(recording, chosen, actuator.wiring),
        "messages": _messages(recording, actuator.wiring),
    }


def _again(actuator: Actuator, finding: HazardRow) -> Recording:
    from elevon.simulate import simulate

    return simulate(actuator, finding.row.scenario(), fidelity=finding.fidelity, record=[RECORD])


def _timeline(recording: Recording, finding: HazardRow, wiring: str) -> Any:
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
