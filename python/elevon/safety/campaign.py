"""Run the safety campaign: every row at low fidelity, what is unsafe again at high."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Annotated

from elevon.actuator import Actuator
from elevon.errors import InputError, SimulationError
from elevon.faults.catalogue import find_record
from elevon.option import Option
from elevon.plain import WORKING, Plain, fields_of, key
from elevon.progress import Progress, part
from elevon.report.checks import Check, CheckedResult
from elevon.safety.hazards import HAZARDS, RECORD, observe
from elevon.safety.reasons import reason
from elevon.safety.rows import Row, population, triples
from elevon.simulate.prepare import ActuatorLike, as_actuator

WIRING = "landing_gear"
CHUNK = 256
"""Runs of one batch: what is kept of them at a time."""
TRIPLES = 100


@dataclass(frozen=True)
class HazardRow:
    """A row that shows a hazard.

    Attributes
    ----------
    hazard : str
        Its name.
    row : Row
        Failures and situation.
    time : float
        When it begins, in s.
    fidelity : str
        At which it was judged last.
    reason : str
        Why no sensor could tell; empty: it is not listed.
    """

    hazard: str
    row: Row
    time: float
    fidelity: str
    reason: str

    def to_dict(self) -> dict[str, object]:
        """Return the row of the JSON object."""
        return fields_of(self, "hazard", "combination=row.combination", "situation=row.situation",
                         "time", "fidelity", "reason")  # fmt: skip


@dataclass(frozen=True)
class HazardResult(Plain):
    """One hazard: how many rows show it, how many of them are listed, how likely an hour is."""

    COMPUTED = ("rows", "listed", "single", "per_hour")

    name: str
    severe: Annotated[bool, WORKING]
    findings: Annotated[tuple[HazardRow, ...], WORKING]

    @property
    def rows(self) -> int:
        """Rows that show it."""
        return len(self.findings)

    @property
    def listed(self) -> int:
        """Rows for which it is stated why no sensor could tell."""
        return sum(bool(finding.reason) for finding in self.findings)

    @property
    def single(self) -> int:
        """Rows with at most one failure."""
        return sum(len(finding.row.faults) < 2 for finding in self.findings)

    @property
    def per_hour(self) -> float:
        """Sum over the different combinations of the product of their rates, one hour each."""
        combinations = {item.row.combination: item.row for item in self.findings}
        return sum(per_hour(row) for row in combinations.values())


@dataclass(frozen=True)
class SafetyResult(CheckedResult):
    """What the campaign showed.

    Attributes
    ----------
    runs : int
        Rows run at low fidelity.
    repeated : int
        Rows run again at high fidelity.
    groups : dict
        Rows of each part.
    hazards : tuple of HazardResult
        In the order of `HAZARDS`.
    checks : list of Check
        What was asked of it.
    seed : int
        Of surroundings and triples.
    """

    COMPUTED = ("rows", "unsafe")

    runs: int
    repeated: Annotated[int, key("repeated_at_high")]
    groups: dict[str, int]
    hazards: tuple[HazardResult, ...]
    checks: list[Check]
    seed: int

    @property
    def rows(self) -> list[HazardRow]:
        """What shows a hazard, hazard by hazard."""
        return [finding for item in self.hazards for finding in item.findings]

    @property
    def unsafe(self) -> int:
        """Situations that show a hazard, listed or not."""
        return len({id(finding.row) for finding in self.rows})


def safety(
    actuator: ActuatorLike,
    *,
    seed: int = 0,
    every: Annotated[int, Option(min=1)] = 1,
    progress: Progress | None = None,
) -> SafetyResult:
    """Run every row of the campaign and judge the hazards.

    Parameters
    ----------
    actuator : Actuator, str or path
        With a control unit that has states: the landing gear's.
    seed : int
        Of the surroundings' order and of the triples.
    every : int
        Only each N-th situation: a short form.
    progress : Progress, optional
        Called with the fraction done; returns False to stop.

    Raises
    ------
    InputError
        Another wiring.
    SimulationError
        A run diverged.
    """
    actuator = as_actuator(actuator)
    if actuator.wiring != WIRING:
        raise InputError(
            f"{actuator.name}: its wiring {actuator.wiring} has no control unit with states whose "
            f"indications could be false; the campaign runs actuators of the wiring {WIRING}, "
            "such as pisa-landing-gear"
        )
    rows = [
        *itertools.islice(population(WIRING, "low", seed), 0, None, every),
        *triples(WIRING, "low", seed, max(1, TRIPLES // every)),
    ]
    first = list(judged(actuator, rows, "low", part(progress, 0.0, 0.8)))
    repeated = list({id(row): row for _, row, _ in first}.values())
    again = list(judged(actuator, repeated, "high", part(progress, 0.8, 1.0)))
    # What shows at both fidelities is told as high judged it, what shows at one alone counts too.
    seen = {(hazard, id(row)): (row, "low", time) for hazard, row, time in first}
    seen |= {(hazard, id(row)): (row, "high", time) for hazard, row, time in again}
    findings = [
        HazardRow(hazard, row, time, fidelity, reason(hazard, row))
        for (hazard, _), (row, fidelity, time) in seen.items()
    ]
    hazards = tuple(
        HazardResult(item.name, item.severe,
                     tuple(one for one in findings if one.hazard == item.name))
        for item in HAZARDS
    )  # fmt: skip
    groups: dict[str, int] = {}
    for row in rows:
        groups[row.group] = groups.get(row.group, 0) + 1
    checks = _checks(hazards, rows)
    return SafetyResult(len(rows), len(repeated), groups, hazards, checks, seed)


def judged(
    actuator: Actuator,
    rows: Sequence[Row],
    fidelity: str,
    progress: Callable[[float], bool] | None = None,
) -> Iterator[tuple[str, Row, float]]:
    """Yield the hazards of each row and when they begin, in s.

    Parameters
    ----------
    actuator : Actuator
        What runs.
    rows : sequence of Row
        In batches of `CHUNK`.
    fidelity : str
        high or low; failures that it does not carry are left out of the catalogue's list, so a
        row of low runs at high.
    progress : callable, optional
        Called with the fraction done.

    Raises
    ------
    SimulationError
        A run diverged.
    """
    from elevon.simulate import Run, simulate_batch

    for begin in range(0, len(rows), CHUNK):
        chunk = rows[begin : begin + CHUNK]
        runs = [
            Run(actuator, row.scenario(), 0, row.combination, begin + number)
            for number, row in enumerate(chunk)
        ]
        recordings = simulate_batch(
            runs, fidelity=fidelity, record=RECORD,
            progress=part(progress, begin / len(rows), (begin + len(chunk)) / len(rows)),
        )  # fmt: skip
        for recording, row in zip(recordings, chunk, strict=True):
            if recording.status not in {"ok", "tripped"}:
                raise SimulationError(
                    f"{row.combination}, {row.situation}: {recording.meta['message']}",
                    recording.status,
                )
            yield from ((name, row, time) for name, time in observe(recording, row).items())


def per_hour(row: Row) -> float:
    """Return how often an hour the failures of a row come together, by the catalogue's rates.

    Parameters
    ----------
    row : Row
        An upper bound: a failure is taken to last the hour.
    """
    rates = [find_record(fault.kind, fault.place, WIRING).rate for fault in row.faults]
    return math.prod(rates)


def _checks(hazards: Iterable[HazardResult], rows: Sequence[Row]) -> list[Check]:
    """Nothing unlisted, and no single failure that leads to a severe hazard."""
    checks = []
    for item in hazards:
        checks.append(Check(f"{item.name}: rows not listed", len(item.findings) - item.listed, 0.0))
        if item.severe:
            checks.append(Check(f"{item.name}: single failures", item.single, 0.0))
    # At least one row, so that nothing passes by not having run.
    return [*checks, Check("rows run", len(rows), 1.0, at_least=True)]
