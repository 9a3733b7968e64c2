"""Every fault of the landing gear in every phase: what the unit indicates, and what is true.

Kinds, places and ranges of the faults are the core's own records; a fault that is added there is
a row here. A row is safe unless the unit shows `locked` or `retracted` while the leg is not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.errors import SimulationError
from elevon.faults.catalogue import FaultRecord, catalogue
from elevon.plain import WORKING, Plain
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.recording.plot import code_names
from elevon.report import Report, ReportTable
from elevon.report.checks import Check, CheckedResult
from elevon_cases.page import sentence, table_of, with_end
from elevon_cases.pisa.gear import ACTUATOR

RECORD = (
    "state,fault_code,warning_code,locked,output_position,output_speed,nut_position,"
    "brake_released@500 Hz"
)
EXTENDED = 0.267
RETRACTED_WITHIN = 3e-3
"""The switch at 0 %, its hysteresis and the way in which the brake stops the motor [m]."""
RESPONSE = 0.05
"""A false indication that lasts no longer is the response of switches and watches [s]."""


@dataclass(frozen=True, slots=True)
class Phase:
    """A phase in which a fault comes.

    Attributes
    ----------
    name : str
        As printed.
    start : float or None
        Nut position at power-up in m; None: retracted.
    action : str
        What is commanded at 0.1 s; empty: nothing.
    fault : float
        Time at which the fault comes, in s.
    duration : float
        Of the run, in s: at rest long enough to fall, in a move long enough for all retries.
    """

    name: str
    start: float | None
    action: str
    fault: float
    duration: float


PHASES = (
    Phase("extend, before the start", None, "extend", 0.05, 30.0),
    Phase("extend", None, "extend", 2.5, 30.0),
    Phase("extend, last quarter", None, "extend", 5.5, 30.0),
    Phase("retract, before the start", EXTENDED, "retract", 0.05, 20.0),
    Phase("retract", EXTENDED, "retract", 2.5, 20.0),
    Phase("retract, last quarter", EXTENDED, "retract", 5.5, 20.0),
    Phase("at rest, retracted", None, "", 2.0, 6.0),
    Phase("at rest, mid-stroke", 0.13, "", 2.0, 6.0),
    Phase("at rest, locked", EXTENDED, "", 2.0, 6.0),
    Phase("free fall, before the start", None, "free_fall", 0.05, 12.0),
    Phase("free fall", None, "free_fall", 1.5, 12.0),
    Phase("free fall, last quarter", None, "free_fall", 3.2, 12.0),
)

LISTED: Mapping[tuple[str, str, str], str] = {}
"""Unsafe rows that no sensor could prevent: kind, place and phase, with who could have seen it."""


@dataclass(frozen=True, slots=True)
class FailureRow(Plain):
    """One fault in one phase."""

    fault: str
    phase: str
    indicated: str
    true_state: str
    safe: bool
    detected_by: str
    time_s: float | None
    sensors: str
    listed: Annotated[bool, WORKING]
    position_mm: float


@dataclass(frozen=True)
class FailuresResult(CheckedResult):
    """Everything `elevon reproduce pisa-failures` reports."""

    rows: list[FailureRow]
    fidelity: str
    checks: list[Check]
    seed: int


@dataclass(frozen=True, slots=True)
class _Case:
    record: FaultRecord
    place: str
    severity: float
    phase: Phase

    @property
    def fault(self) -> str:
        from elevon.units import format_quantity

        return f"{self.record.kind}@{self.place}={format_quantity(self.severity, self.record.unit)}"

    @property
    def key(self) -> tuple[str, str, str]:
        return (self.record.kind, self.place, self.phase.name)


def reproduce_failures(
    *,
    fidelity: str = "high",
    seed: int = 0,
    faults: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> FailuresResult:
    """Run every fault of the catalogue in every phase and judge what the unit indicates.

    Parameters
    ----------
    fidelity : str
        ``high`` or ``low``; faults that the fidelity does not carry are left out.
    seed : int
        Of the random numbers.
    faults : sequence of str, optional
        Only these kinds; None: all. The listed rows are held against what was run.
    progress : Progress, optional
        Called with the fraction done.

    Raises
    ------
    SimulationError
        A run diverged or was interrupted.
    """
    from elevon.simulate import Run, simulate_batch

    actuator = Actuator.load(ACTUATOR)
    cases = list(_cases(actuator, fidelity, faults))
    runs = [
        Run(actuator, _scenario(case), seed, f"{case.fault}, {case.phase.name}", number)
        for number, case in enumerate(cases)
    ]
    recordings = simulate_batch(runs, fidelity=fidelity, record=RECORD, progress=progress)
    for recording in recordings:
        if recording.status not in {"ok", "tripped"}:
            raise SimulationError(
                f"{recording.meta['label']}: {recording.meta['message']}", recording.status
            )
    rows = [
        judge(recording, case.phase, case.fault, LISTED.get(case.key), actuator.wiring)
        for case, recording in zip(cases, recordings, strict=True)
    ]
    return FailuresResult(rows, fidelity, failure_checks(rows, len(cases)), seed)


def _cases(actuator: Actuator, fidelity: str, faults: Sequence[str] | None) -> Iterator[_Case]:
    for record in catalogue(actuator.wiring):
        if fidelity not in record.fidelities or (faults is not None and record.kind not in faults):
            continue
        for place in record.places:
            for severity in record.tried:
                for phase in PHASES:
                    yield _Case(record, place, severity, phase)


def _scenario(case: _Case) -> Any:
    from elevon.scenario import Scenario

    phase = case.phase
    steps = [{"time": 0.1, "action": phase.action}] if phase.action else []
    fault = {
        "kind": case.record.kind,
        "place": case.place,
        "severity": case.severity,
        "profile": {"kind": "step", "time": phase.fault},
        **{item["name"]: 0.0 for item in case.record.attributes if item["default"] is None},
    }
    data: dict[str, Any] = {
        "duration": phase.duration,
        "command": {"mode": "gear", "steps": steps},
        "fault": [fault],
    }
    if phase.start is not None:
        data["initial"] = {"nut_position": phase.start}
    return Scenario.from_dict(data)


def judge(
    recording: Recording, phase: Phase, fault: str, listed: str | None, wiring: str
) -> FailureRow:
    """Compare what the unit indicated with what was true, from the fault on.

    Parameters
    ----------
    recording : Recording
        With the signals of `RECORD`.
    phase : Phase
        When the fault came.
    fault : str
        As printed.
    listed : str or None
        Who could have seen it, for a row of the listed set.
    wiring : str
        Whose codes they are.
    """
    state, locked = recording["state"], recording["locked"].values > 0.5
    ram = recording["output_position"].values
    names = code_names(wiring, "state")
    code = {word: number for number, word in names.items()}
    false = ((state.values == code["locked"]) & ~locked) | (
        (state.values == code["retracted"]) & (ram > RETRACTED_WITHIN)
    )
    lasting = _lasting(false, state.time)
    at = int(lasting[0]) if lasting.size else -1
    detected, time = _detected(recording, phase, wiring)
    return FailureRow(
        fault,
        phase.name,
        names[int(state.values[at])],
        _true_state(bool(locked[at]), float(ram[at]), float(recording["output_speed"].values[at])),
        not lasting.size,
        detected,
        time,
        listed or "",
        listed is not None,
        1e3 * float(ram[at]),
    )


def _lasting(false: npt.NDArray[np.bool_], time: npt.NDArray[np.float64]) -> npt.NDArray[np.intp]:
    """Return the first sample of each false indication at which it outlasts the response."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], false.astype(int), [0]])))
    spans = [
        int(np.searchsorted(time, time[first] + RESPONSE))
        for first, last in zip(edges[::2], edges[1::2], strict=True)
        if time[last - 1] - time[first] > RESPONSE
    ]
    return np.array(spans, dtype=np.intp)


def _true_state(locked: bool, ram: float, speed: float) -> str:
    if locked:
        return "locked"
    if ram <= RETRACTED_WITHIN:
        return "retracted"
    return "between, moving" if abs(speed) > 1e-6 else "between, at rest"


def _detected(recording: Recording, phase: Phase, wiring: str) -> tuple[str, float | None]:
    """Return what the unit reported first, and how long after the fault."""
    for signal, word in (("fault_code", "fault"), ("warning_code", "warning")):
        channel = recording[signal]
        after = np.flatnonzero((channel.values > 0.0) & (channel.time >= phase.fault))
        if after.size:
            code = int(channel.values[after[0]])
            name = code_names(wiring, signal).get(code, str(code))
            return f"{word}: {name}", float(channel.time[after[0]]) - phase.fault
    return "-", None


def failure_checks(rows: Sequence[FailureRow], expected: int) -> list[Check]:
    """Return the checks: nothing unsafe but what is listed, nothing listed that is safe, all run.

    Parameters
    ----------
    rows : sequence of FailureRow
        All cases.
    expected : int
        How many there must be.
    """
    unlisted = sum(not row.safe and not row.listed for row in rows)
    stale = sum(row.safe and row.listed for row in rows)
    return [
        Check("unsafe rows outside the listed set", unlisted, 0.0, "rows"),
        Check("listed rows that are safe", stale, 0.0, "rows"),
        Check("rows, one a fault, place, severity and phase", len(rows), expected, "rows", True),
    ]


def summary(result: FailuresResult) -> tuple[list[str], list[list[str]]]:
    """Return headings and rows: a phase a row, how many faults were found, silent, unsafe."""
    rows = []
    for phase in PHASES:
        mine = [row for row in result.rows if row.phase == phase.name]
        detected = sum(row.detected_by.startswith("fault") for row in mine)
        warned = sum(row.detected_by.startswith("warning") for row in mine)
        unsafe = sum(not row.safe for row in mine)
        silent = len(mine) - detected - warned
        rows.append([phase.name, *map(str, (len(mine), detected, warned, silent, unsafe))])
    return ["phase", "faults", "fault shown", "warning shown", "silent", "unsafe"], rows


def failures_page(result: FailuresResult, date: str | None = None) -> Report:
    """Return the report: what the unit found, what is unsafe, every case."""
    unsafe = [row for row in result.rows if not row.safe]
    listed = sum(row.listed for row in unsafe)
    count = str(len(result.rows))
    report = Report(
        "Failure cases of the Pisa landing gear",
        f"{count} cases at {result.fidelity} fidelity: every fault of the catalogue in every "
        f"phase. The unit shows locked or retracted falsely in {len(unsafe)} of them, {listed} of "
        "which no sensor could prevent.",
        date=date,
    )
    report.fact("Cases", count, "fault, place and phase")
    report.fact("Unsafe", str(len(unsafe)), "locked or retracted shown, and not true")
    report.fact("of these listed", str(listed), "every sensor that could see it failed or agreed")
    report.section("What the unit found").table(
        ReportTable(
            [sentence(heading) for heading in summary(result)[0]],
            [[row[0], *map(int, row[1:])] for row in summary(result)[1]],
            "Silent: no fault and no warning, because the move arrived or nothing moved.",
        )
    )
    section = report.section("Unsafe cases")
    if unsafe:
        named = [f"{row.fault}, {row.phase}: {row.sensors or 'not listed'}" for row in unsafe]
        section.table(table_of(unsafe, _COLUMNS)).points(named)
    else:
        section.text("None.")
    section = report.section("All cases")
    for phase in PHASES:
        rows = [row for row in result.rows if row.phase == phase.name]
        if rows:
            folded = f"{sentence(phase.name)}: {len(rows)} faults"
            section.table(table_of(rows, _COLUMNS, folded=folded, marked=lambda row: not row.safe))
    made = {"Seed": result.seed, "Fidelity": result.fidelity}
    return with_end(report, result.checks, f"pisa-failures --fidelity {result.fidelity}", made)


_COLUMNS = (
    ("Fault", "fault"),
    ("Phase", "phase"),
    ("Indicated", "indicated"),
    ("True", "true_state"),
    ("Safe", "safe"),
    ("Found by", "detected_by"),
    ("after [s]", "time_s", ".3f"),
    ("Ram [mm]", "position_mm", ".1f"),
)
