"""Run the rows of a safety campaign: all at low fidelity, those near a limit at high."""

from __future__ import annotations

import hashlib
import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from elevon.actuator import Actuator
from elevon.errors import InputError, SimulationError
from elevon.option import Option, Quantity
from elevon.progress import Progress, part
from elevon.safety.assessment import Assessment, assess
from elevon.safety.hazards import Hazard, observe, read_targets, watched
from elevon.safety.outcomes import Outcome, Outcomes
from elevon.safety.probability import Exposure, frequency
from elevon.safety.rates import Service, read_service
from elevon.safety.result import SafetyResult, TripleSample
from elevon.safety.rows import Row, together
from elevon.safety.study import NEIGHBOUR, Study, study_of
from elevon.simulate.prepare import ActuatorLike, as_actuator
from elevon.worklog import WorkLog, finished

WIRINGS = ("landing_gear", "rotary", "ballscrew")
CHUNK = 256
"""Runs of one batch: what is kept of them at a time."""
TRIPLES = 100
"""Situations with three failures."""
OTHERS = 0.02
"""Share of the rows far from every limit that run at high fidelity, too."""
EDGE = 0.2
"""Share of the budget of high fidelity that the neighbours of rows at its edge decide on."""


@dataclass
class Runner:
    """Runs rows in batches; what is finished is kept in the log.

    Attributes
    ----------
    study : Study
        Whose rows.
    service : Service
        With the monitors.
    log : WorkLog or None
        Finished batches; those that are there are not run again.
    progress : callable, optional
        Called with the fraction done.
    """

    study: Study
    service: Service
    log: WorkLog | None = None
    progress: Progress | None = None

    def run(
        self,
        rows: Sequence[Row],
        fidelity: str,
        share: tuple[float, float],
        actuators: Sequence[Actuator] = (),
    ) -> list[Outcome]:
        """Return what each row showed.

        Parameters
        ----------
        rows : sequence of Row
            In batches of `CHUNK`.
        fidelity : str
            high or low.
        share : tuple of float
            Of the progress, where it begins and ends.
        actuators : sequence of Actuator, optional
            One a row, in place of the study's.

        Raises
        ------
        SimulationError
            A run diverged.
        """
        out: list[Outcome] = []
        low, high = share
        for begin in range(0, len(rows), CHUNK):
            chunk = rows[begin : begin + CHUNK]
            span = [low + (high - low) * place / len(rows) for place in (begin, begin + len(chunk))]
            models = actuators[begin : begin + CHUNK] or [self.study.actuator] * len(chunk)
            name = _name(fidelity, chunk, models)
            item = self.log.items.get(name) if self.log else None
            if item is not None:
                out += [Outcome.from_dict(data) for data in item.data["outcomes"]]
                continue
            results = self._batch(chunk, models, fidelity, part(self.progress, span[0], span[1]))
            if self.log is not None:
                self.log.note(name, (), outcomes=[outcome.to_dict() for outcome in results])
            out += results
        return out

    def _batch(
        self,
        rows: Sequence[Row],
        models: Sequence[Actuator],
        fidelity: str,
        progress: Callable[[float], bool] | None,
    ) -> list[Outcome]:
        from elevon.simulate import Run, simulate_batch

        runs = [
            Run(model, row.scenario(), 0, row.combination)
            for model, row in zip(models, rows, strict=True)
        ]
        recordings = simulate_batch(
            runs, fidelity=fidelity, record=self.study.record, progress=progress
        )
        return [self._outcome(*pair) for pair in zip(recordings, rows, strict=True)]

    def _outcome(self, recording: Any, row: Row) -> Outcome:
        if recording.status not in {"ok", "tripped"}:
            raise SimulationError(
                f"{row.combination}, {row.situation}: {recording.meta['message']}",
                recording.status,
            )
        seen = watched(recording, row, self.study.limits)
        distance, nearest = self.study.distance(seen)
        messages = self.study.displayed(seen, self.service.monitors)
        return Outcome(
            observe(seen, self.study.hazards), tuple(messages), self.study.end(seen), distance,
            nearest,
        )  # fmt: skip


def safety(
    actuator: ActuatorLike,
    *,
    hazards: Sequence[Hazard] | None = None,
    rates: Path | None = None,
    checks: Path | None = None,
    flight_time: Quantity | None = None,
    target: Annotated[Sequence[str], Option(metavar="CLASS=P")] = (),
    high: Annotated[int, Option(min=0)] = 1000,
    all_high: bool = False,
    seed: int = 0,
    every: Annotated[int, Option(min=1)] = 1,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> SafetyResult:
    """Run every row of the campaign, judge the hazards, and find how likely they are.

    Parameters
    ----------
    actuator : Actuator, str or path
        A landing gear or a servo.
    hazards : sequence of Hazard, optional
        In place of the wiring's own: ``[*HAZARDS, mine]``.
    rates : path, optional
        Rates of parts, shares of their modes (TOML); they take the place of packaged ones.
    checks : path, optional
        Phases of flight, checks with intervals, monitors (TOML); as the rates.
    flight_time : str or float, optional
        Duration of a flight, such as '2 h'.
    target : sequence of str
        Largest probability of a class a flight hour; repeatable.
    high : int
        Rows nearest to a limit that run at high fidelity.
    all_high : bool
        Every row runs at high fidelity.
    seed : int
        Of the surroundings' order, of the triples, of the rows drawn for high fidelity.
    every : int
        Only each N-th situation: a short form.
    folder : path, optional
        Where finished batches are kept: an interrupted campaign goes on there.
    progress : Progress, optional
        Called with the fraction done; returns False to stop.

    Raises
    ------
    InputError
        Another wiring; a wrong file; no rate for a failure.
    SimulationError
        A run diverged.
    """
    actuator = as_actuator(actuator)
    if actuator.wiring not in WIRINGS:
        raise InputError(
            f"{actuator.name}: the campaign has no situations for its wiring {actuator.wiring}; "
            f"it runs actuators of the wirings {', '.join(WIRINGS)}"
        )
    targets = read_targets(target)
    service = read_service(actuator.wiring, checks, flight_time)
    study = study_of(actuator, hazards, rates, service.monitors)
    work = _work(study, service, private=hazards is not None)
    with finished(folder, work) as log:
        runner = Runner(study, service, log, progress)
        outcomes = _low(runner, seed, every)
        assessment = Assessment(study, service, targets, seed)
        triples = _triples(runner, assessment, outcomes, seed, max(1, TRIPLES // every))
        chosen = _chosen(runner, outcomes, high // every, seed) if not all_high else None
        _high(runner, outcomes, chosen)
    return assess(assessment, outcomes, triples)


def _work(study: Study, service: Service, *, private: bool) -> str:
    """Name of the work: what an outcome depends on beside its row.

    A user's function is known to this process alone: its outcomes are not read back.
    """
    about = [study.record, service.monitors, [item.name for item in study.hazards]]
    return f"safety {_digest(about)}{f' {id(study):x}' if private else ''}"


def _name(fidelity: str, rows: Sequence[Row], models: Sequence[Actuator]) -> str:
    """Name of a batch: its rows and what they run on."""
    return f"{fidelity} {_digest([rows, [model.hash for model in models]])}"


def _digest(value: object) -> str:
    return hashlib.sha256(repr(value).encode()).hexdigest()[:24]


def _low(runner: Runner, seed: int, every: int) -> Outcomes:
    """Run all rows at low fidelity, their situations without a failure first."""
    study = runner.study
    rows = list(itertools.islice(study.rows(seed), 0, None, every))
    tested = [row for row in rows if len(row.faults) == 1 and row.lasting]
    switching = list(itertools.islice(study.switching_rows(), 0, None, max(1, every // 10)))
    healthy = list(dict.fromkeys(row.healthy() for row in [*tested, *switching]))
    known = set(rows)
    rows += [row for row in healthy if row not in known]
    outcomes = Outcomes(rows)
    outcomes.add("low", range(len(rows)), runner.run(rows, "low", (0.0, 0.7)))
    places = outcomes.append(switching)
    outcomes.add("high", places, runner.run(switching, "high", (0.7, 0.75)))
    return outcomes


def _triples(
    runner: Runner, assessment: Assessment, outcomes: Outcomes, seed: int, number: int
) -> TripleSample:
    """Draw situations with three failures, each set as often as its share of their frequency."""
    every = runner.study.failures["low"]
    draw = np.random.default_rng(seed)
    occurrences = assessment.occurrences(assessment.failures(outcomes))
    exposure = Exposure(runner.service.flight)
    sets = [chosen for chosen in itertools.combinations(every, 3) if together(*chosen)]
    weights = np.array([
        frequency([occurrences[failure.name] for failure in chosen], exposure).mean
        for chosen in sets
    ])  # fmt: skip
    total = float(weights.sum())
    if total == 0.0:
        return TripleSample((), 0.0)
    picked = draw.choice(len(sets), number, p=weights / total)
    rows = [runner.study.drawn(sets[index], draw) for index in picked]
    places = outcomes.append(rows)
    outcomes.add("low", places, runner.run(rows, "low", (0.75, 0.78)))
    return TripleSample(tuple(places), total)


def _chosen(
    runner: Runner, outcomes: Outcomes, budget: int, seed: int
) -> tuple[list[int], list[int]]:
    """Return the rows that run at high fidelity: those near a limit, and some of the others.

    A row of each minimal set that leads to a hazard comes first, then the rows by their distance
    from a limit. At the edge of the budget those come first whose neighbours have other outcomes.
    """
    low = outcomes.low
    first = _representatives(outcomes)
    ranked = sorted(low, key=lambda place: (place not in first, low[place].distance))
    edge = round(EDGE * max(0, budget - len(first)))
    certain, doubtful = ranked[: budget - edge], ranked[budget - edge : budget + edge]
    moved = _moved(runner, outcomes, doubtful)
    near = certain + sorted(doubtful, key=lambda place: place not in moved)[:edge]
    outcomes.near = {place for place in low if low[place].distance < NEIGHBOUR} | moved
    others = sorted(low.keys() - set(near) - outcomes.near)
    count = round(OTHERS * len(others)) if budget else 0
    drawn = np.random.default_rng(seed + 1).choice(len(others), count, replace=False)
    return near, sorted(others[int(index)] for index in drawn)


def _representatives(outcomes: Outcomes) -> set[int]:
    """Return a row of each set of failures that leads to a hazard and has no smaller one in it."""
    by_hazard: dict[str, dict[frozenset[str], int]] = {}
    for place in sorted(outcomes.low, key=lambda place: len(outcomes.rows[place].faults)):
        names = frozenset(outcomes.rows[place].names)
        for hazard in outcomes.low[place].hazards:
            known = by_hazard.setdefault(hazard, {})
            if not any(smaller <= names for smaller in known):
                known[names] = place
    return {place for known in by_hazard.values() for place in known.values()}


def _moved(runner: Runner, outcomes: Outcomes, places: Sequence[int]) -> set[int]:
    """Return the rows whose outcome changes where load, supply or friction move by a tenth."""
    near = [
        (place, *pair) for place in places for pair in runner.study.neighbours(outcomes.rows[place])
    ]
    rows, models = [row for _, _, row in near], [model for _, model, _ in near]
    results = runner.run(rows, "low", (0.78, 0.82), models)
    return {
        place
        for (place, _, _), outcome in zip(near, results, strict=True)
        if outcome.differs(outcomes.low[place])
    }


def _high(runner: Runner, outcomes: Outcomes, chosen: tuple[list[int], list[int]] | None) -> None:
    """Run the chosen rows at high fidelity, or all of them."""
    near, drawn = chosen or (sorted(outcomes.low), [])
    outcomes.drawn = tuple(drawn)
    for places, share in ((near, (0.82, 0.95)), (drawn, (0.95, 1.0))):
        rows = [outcomes.rows[place] for place in places]
        outcomes.add("high", places, runner.run(rows, "high", share))
