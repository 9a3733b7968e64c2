"""The works' table of failure modes: what each line does to a log, and what diagnosis says of it.

Each line is one or more faults of the catalogue at a plainly visible severity, in one log of the
virtual bench. Diagnosis is given the actuator file and one healthy log of another seed.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.bench.rig import Setup, setups
from elevon.errors import InputError
from elevon.logs.log import Log
from elevon.plain import Plain
from elevon.progress import Progress, part
from elevon.report import Report
from elevon.report.checks import Check, CheckedResult
from elevon_cases.page import Column, table_of, with_end
from elevon_cases.torino.bench_unit import ACTUATOR, logs_of

LEAST_CHANGE = 1.0
"""Percent of a channel's RMS by which a fault must change it. ASSUMED."""
LINK = {"inverter.link_capacitance": "470 uF"}
"""An open connector empties the capacitor of the link; a file without one has nothing to empty.
ASSUMED: of a drive of this size."""
BEARINGS, SENSOR, MOTOR, CONNECTOR = "bearings", "position sensor", "motor", "power connector"
RATES = {BEARINGS: 1.78e-5, SENSOR: 1.70e-5, MOTOR: 1.03e-5, CONNECTOR: 6.64e-7}
"""Printed: failures an hour."""
LINES = (
    (BEARINGS, "friction of wear and galling", "friction@transmission=0.5"),
    (BEARINGS, "friction of a worn cage", "bearing@bearing.cage=0.1 N m"),
    (SENSOR, "turn-to-turn short", "resolver_short@sensor.resolver.sine=0.2"),
    (SENSOR, "turn-to-ground short", "channel_offset@sensor.resolver.sine=0.1"),
    (SENSOR, "open circuit", "resolver_open@sensor.resolver.sine=1"),
    (SENSOR, "lost counts", "missing_counts@sensor.encoder=0.01"),
    (MOTOR, "turn-to-turn short", "short@motor.phase_a=0.2"),
    (MOTOR, "phase-to-phase short", "phase_short@motor.phases_ab=0.01 S"),
    (MOTOR, "turn-to-ground short", "ground_short@motor.phase_a=0.1 S"),
    (MOTOR, "open circuit", "open_phase@motor.phase_a=1"),
    (CONNECTOR, "open pin or lead wire", "connector_open@supply=1"),
)
"""Component, failure mode, fault: severities ASSUMED, plainly visible ones."""
HEALTHY, NAMED, ALIKE, REFUSED, UNEXPLAINED, OTHER = (
    "called healthy", "named", "named with those that look alike", "refused: nothing moves",
    "unknown fault", "another is named",
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class FmecaRow(Plain):
    """One fault of one line.

    ``change_percent``: largest change of a channel's RMS, or of its difference, over its healthy
    RMS; ``seen``: what diagnosis makes of the log, in one word; ``answer``: in its own.
    """

    component: str
    mode: str
    rate_per_h: float
    fault: str
    change_percent: float
    channel: str
    seen: str
    answer: str


@dataclass(frozen=True)
class FmecaResult(CheckedResult):
    """Everything `elevon reproduce torino-fmeca` reports."""

    rows: list[FmecaRow]
    healthy: str
    seed: int
    parameter_hash: str

    @property
    def checks(self) -> list[Check]:
        """Each line acts; none is passed as healthy, none named as another; the healthy log is."""
        count = {name: sum(row.seen == name for row in self.rows) for name in (HEALTHY, OTHER)}
        named = sum(row.seen in (NAMED, ALIKE) for row in self.rows)
        return [
            Check("least change of a line", min(row.change_percent for row in self.rows),
                  LEAST_CHANGE, "%", at_least=True),
            Check("faults called healthy", float(count[HEALTHY]), 0.0, "faults"),
            Check("faults named as another", float(count[OTHER]), 0.0, "faults"),
            Check("faults isolated", float(named), float(len(self.rows)), "faults", at_least=True),
            Check("healthy log called faulty", float(self.healthy != "healthy"), 0.0, "logs"),
        ]  # fmt: skip


def reproduce_fmeca(*, seed: int = 0, progress: Progress | None = None) -> FmecaResult:
    """Log each fault of the table on the virtual bench and diagnose it.

    Parameters
    ----------
    seed : int
        Of the bench.
    progress : callable, optional
        As for `simulate_batch`.
    """
    from elevon.diagnose.door import diagnose

    unit = Actuator.load(ACTUATOR).with_values(LINK, source="of a drive of this size")
    ready = [_setup(unit, "", seed + 1), _setup(unit, "", seed)]
    ready += [_setup(unit, fault, seed) for _, _, fault in LINES]
    logs = logs_of(ready, "high", part(progress, 0.0, 0.7), whole=False)
    baseline, good, *faulty = logs
    healthy = diagnose(good, unit, baseline).status
    rows = []
    for number, (line, log) in enumerate(zip(LINES, faulty, strict=True), 1):
        component, mode, fault = line
        change, channel = changed(good, log)
        seen, answer = _answer(log, unit, baseline, fault)
        rows.append(FmecaRow(component, mode, RATES[component], fault, change, channel, seen,
                             answer))  # fmt: skip
        if progress is not None:
            progress(0.7 + 0.3 * number / len(LINES))
    return FmecaResult(rows, healthy, seed, unit.hash)


def _setup(unit: Actuator, fault: str, seed: int) -> Setup:
    from elevon.bench.procedure import load_procedure
    from elevon.bench.traces import first_trace

    procedure = first_trace(load_procedure("loaded"))
    return setups(procedure, unit, faults=[fault] if fault else [], seed=seed)[0]


def changed(healthy: Log, faulty: Log) -> tuple[float, str]:
    """Return by how many percent of its RMS a channel changes at most, and which one."""
    sizes = {}
    for role in healthy:
        good, bad = healthy[role], faulty[role]
        if not faulty.has(role) or good.dtype.kind != "f":
            continue
        both = min(len(good), len(bad))
        scale = float(np.sqrt(np.mean(good**2)))
        if scale > 0.0:
            sizes[role] = 100.0 * float(np.sqrt(np.mean((bad[:both] - good[:both]) ** 2))) / scale
    worst = max(sizes, key=lambda role: sizes[role])
    return sizes[worst], worst


def _answer(log: Log, unit: Actuator, baseline: Log, fault: str) -> tuple[str, str]:
    """Return what diagnosis makes of a log: in one word, and in its own words."""
    from elevon.diagnose.door import diagnose

    try:
        answer = diagnose(log, unit, baseline)
    except InputError as error:
        return REFUSED, str(error).partition(": ")[2]
    if answer.status == "healthy":
        return HEALTHY, answer.headline
    if answer.status != "faulty":
        return UNEXPLAINED, answer.headline
    key = fault.partition("=")[0]
    causes = [cause for cause in answer.faults if f"{cause.kind}@{cause.place}" in answer.best]
    alike = [place.key for cause in causes for place in cause.ambiguous_with]
    text = answer.headline + (f"; alike: {', '.join(alike)}" if alike else "")
    if len(causes) != 1 or key not in (*answer.best, *alike):
        return OTHER, text
    # Places of one kind differ by a phase that no log without the angle's zero tells.
    return (ALIKE if any(not name.startswith(causes[0].kind) for name in alike) else NAMED), text


def fmeca_page(result: FmecaResult, date: str | None = None) -> Report:
    """Return the report of the failure modes."""
    named = sum(row.seen in (NAMED, ALIKE) for row in result.rows)
    report = Report(
        "Failure modes of an actuator, and what diagnosis sees of them",
        "Each line of the printed table as faults of the catalogue, one log of 20 s each. "
        f"{named} of {len(result.rows)} are named.",
        date=date,
    )
    columns: tuple[Column, ...] = (
        ("Component", "component"),
        ("Failure mode", "mode"),
        ("Rate [1/h]", lambda row: f"{row.rate_per_h:.3g}"),
        ("Fault", "fault"),
        ("Change [%]", "change_percent"),
        ("Channel", lambda row: row.channel.replace("_", " ")),
        ("Seen", "seen"),
        ("Answer", "answer"),
    )
    caption = (
        "Rates as printed, of a component; change: of a channel's RMS against the healthy log."
    )
    report.section("Failure modes").table(table_of(result.rows, columns, caption, digits=3))
    made = {"Parameter hash": result.parameter_hash}
    return with_end(report, result.checks, f"torino-fmeca --seed {result.seed}", made)
