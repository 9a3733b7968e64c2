"""The works' table of failure modes: what each line does to a log, and what diagnosis says of it.

Each line is one or more faults of the catalogue at a plainly visible severity, in one log of the
virtual bench. Diagnosis is given the actuator file and one healthy log of another seed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.bench.rig import Setup, setups
from elevon.errors import InputError
from elevon.logs.log import Log
from elevon.plain import Plain
from elevon.progress import Progress, part
from elevon.report import Report
from elevon.report.checks import Check, CheckedResult
from elevon_cases.page import Column, table_of, with_end
from elevon_cases.torino.bench_unit import ACTUATOR, logs_of

HEALTHY_LOGS = 8
"""Of other seeds, which give each channel's mean and standard deviation. ASSUMED: enough for a
standard deviation within a quarter of the true one in two of three draws."""
STANDS_OUT = 1.5
"""Times the largest deviation that a healthy log has from the other ones, which a line must reach:
of white noise in 10 to 30 statistics a ninth log does in one of a hundred draws."""
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

    ``deviations``: largest deviation of a channel's mean or RMS from the healthy logs, in their
    standard deviations; ``seen``: what diagnosis makes of the log, in one word; ``answer``: in its
    own.
    """

    component: str
    mode: str
    rate_per_h: float
    fault: str
    deviations: float
    channel: str
    seen: str
    answer: str


@dataclass(frozen=True)
class FmecaResult(CheckedResult):
    """Everything `elevon reproduce torino-fmeca` reports."""

    rows: list[FmecaRow]
    healthy: str
    healthy_deviations: list[float]
    """Of each healthy log from the other ones, as of a line: what noise alone gives."""
    seed: int
    parameter_hash: str

    @property
    def checks(self) -> list[Check]:
        """Each line acts; none is passed as healthy, none named as another; the healthy log is."""
        count = {name: sum(row.seen == name for row in self.rows) for name in (HEALTHY, OTHER)}
        named = sum(row.seen in (NAMED, ALIKE) for row in self.rows)
        return [
            Check("least deviation of a line over the largest of a healthy log",
                  min(row.deviations for row in self.rows) / max(self.healthy_deviations),
                  STANDS_OUT, "1", at_least=True),
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
    ready += [_setup(unit, "", seed + 1 + number) for number in range(1, HEALTHY_LOGS)]
    logs = logs_of(ready, "high", part(progress, 0.0, 0.7), whole=False)
    baseline, good, *others = logs
    faulty, healthy_logs = others[: len(LINES)], [baseline, *others[len(LINES) :]]
    healthy = diagnose(good, unit, baseline).status
    rows = []
    for number, (line, log) in enumerate(zip(LINES, faulty, strict=True), 1):
        component, mode, fault = line
        deviations, channel = deviation(healthy_logs, log)
        seen, answer = _answer(log, unit, baseline, fault)
        rows.append(FmecaRow(component, mode, RATES[component], fault, deviations, channel, seen,
                             answer))  # fmt: skip
        if progress is not None:
            progress(0.7 + 0.3 * number / len(LINES))
    alike = [
        deviation([other for other in healthy_logs if other is not log], log)[0]
        for log in healthy_logs
    ]
    return FmecaResult(rows, healthy, alike, seed, unit.hash)


def _setup(unit: Actuator, fault: str, seed: int) -> Setup:
    from elevon.bench.procedure import load_procedure
    from elevon.bench.traces import first_trace

    procedure = first_trace(load_procedure("loaded"))
    return setups(procedure, unit, faults=[fault] if fault else [], seed=seed)[0]


def deviation(healthy: Sequence[Log], log: Log) -> tuple[float, str]:
    """Return a log's largest deviation from healthy ones, and the channel that has it.

    Of each channel the mean and the RMS about it are compared, over the samples that both have, in
    standard deviations between the healthy logs.
    """
    found = {}
    for role in healthy[0]:
        if not log.has(role) or log[role].dtype.kind != "f":
            continue
        count = min(len(log[role]), *(len(item[role]) for item in healthy))
        known = np.array([_statistics(item[role][:count]) for item in healthy])
        spread = known.std(axis=0, ddof=1)
        distance = np.abs(_statistics(log[role][:count]) - known.mean(axis=0))
        moved = distance[spread > 0.0] / spread[spread > 0.0]
        if moved.size:
            found[role] = float(moved.max())
    worst = max(found, key=lambda role: found[role])
    return found[worst], worst


def _statistics(values: Floats) -> Floats:
    return np.array([values.mean(), values.std()])


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
        ("Deviations", "deviations"),
        ("Channel", lambda row: row.channel.replace("_", " ")),
        ("Seen", "seen"),
        ("Answer", "answer"),
    )
    caption = (
        "Rates as printed, of a component; deviations: of a channel's mean or RMS from healthy "
        "logs, in their standard deviations: a healthy log reaches "
        f"{max(result.healthy_deviations):.2g}."
    )
    report.section("Failure modes").table(table_of(result.rows, columns, caption, digits=3))
    made = {"Parameter hash": result.parameter_hash}
    return with_end(report, result.checks, f"torino-fmeca --seed {result.seed}", made)
