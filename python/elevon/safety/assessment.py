"""How likely the hazards are: minimal cut sets of what the campaign showed, and the rules."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace

from elevon.report.checks import Check
from elevon.safety.hazards import LATENT_LEFT, LATENT_SUM, Hazard
from elevon.safety.outcomes import Detection, Outcomes, coverage, detections, is_evident
from elevon.safety.probability import Exposure, Frequency, Occurrence, frequency
from elevon.safety.rates import FailureRate, Service
from elevon.safety.reasons import reason
from elevon.safety.result import (
    CheckEffect,
    Coverage,
    CutSet,
    FailureResult,
    Fidelity,
    HazardResult,
    HazardRow,
    Importance,
    SafetyResult,
    ThirdOrder,
    TripleSample,
)
from elevon.safety.study import Study

TRIPLE = "three failures"
"""Group of the rows that give a bound, and no cut set."""
_SCALES = (0.5, 2.0)
"""By what the interval of a check is changed to see its effect."""


@dataclass(frozen=True)
class Assessment:
    """What the rows are judged with: the study, the service, targets by class, the seed."""

    study: Study
    service: Service
    targets: Mapping[str, float]
    seed: int

    def failures(self, outcomes: Outcomes) -> dict[str, FailureResult]:
        """Return each failure's rate and how it is revealed."""
        detected = detections(outcomes)
        return {
            name: self._failure(rate, detected.get(name, []))
            for name, rate in self.study.rates.items()
        }

    def _failure(self, rate: FailureRate, detected: Sequence[Detection]) -> FailureResult:
        evident = is_evident(detected, self.service, rate.stated)
        check = self.service.check_of(rate.name)
        usual = [d for d in detected if d.message and self.service.phase_of(d.phase).demand >= 1.0]
        revealed = usual[0].message if usual else "stated by the file of rates"
        return FailureResult(
            rate.name, rate.part, rate.rate, rate.rate_low, rate.rate_high, rate.alpha, rate.effect,
            evident, self.service.flight if evident else check.interval,
            revealed if evident else check.name, tuple(detected), rate.source,
        )  # fmt: skip

    def occurrences(
        self, failures: Mapping[str, FailureResult], end: str = "rate"
    ) -> dict[str, Occurrence]:
        """Return the failures as they enter sets.

        Parameters
        ----------
        failures : mapping
            As `failures` returns them.
        end : str
            ``rate``, or an end of its interval: ``rate_low``, ``rate_high``.
        """
        rates = self.study.rates
        return {
            name: Occurrence(
                name, getattr(item, end), item.evident, item.interval, item.check,
                rates[name].family, rates[name].beta,
            )
            for name, item in failures.items()
        }  # fmt: skip

    def exposures(
        self, places: Iterable[int], outcomes: Outcomes, failures: Mapping[str, FailureResult]
    ) -> Iterator[tuple[str, Exposure]]:
        """Yield for each phase in which a set leads to a hazard how the set is exposed there.

        Parameters
        ----------
        places : iterable of int
            Rows of the set that show the hazard.
        outcomes, failures
            Of the campaign.
        """
        phases: dict[str, list[int]] = {}
        for place in places:
            phases.setdefault(outcomes.rows[place].phase, []).append(place)
        for name, members in phases.items():
            rows, phase = [outcomes.rows[place] for place in members], self.service.phase_of(name)
            flight = self.service.flight
            lasting = min(phase.duration / 3600.0 / flight, 1.0)
            share = lasting if all(row.late for row in rows) else 1.0
            forced = any(
                item.phase == phase.follows and item.announced > 0
                for failure in rows[0].names
                for item in failures[failure].detections
            )
            last = frozenset(text for row in rows for text in row.last)
            yield name, Exposure(flight, share, 1.0 if forced else phase.demand, last)


@dataclass(frozen=True)
class FoundSet:
    """A minimal set: names, rows, the phase in which it is most frequent, its exposure there."""

    names: tuple[str, ...]
    rows: tuple[int, ...]
    phase: str
    exposure: Exposure

    def frequency(self, occurrences: Mapping[str, Occurrence]) -> Frequency:
        """Return how often it comes together."""
        return frequency([occurrences[name] for name in self.names], self.exposure)


def assess(assessment: Assessment, outcomes: Outcomes, triples: TripleSample) -> SafetyResult:
    """Return what a campaign showed: failures, hazards with their cut sets, the rules.

    Parameters
    ----------
    assessment : Assessment
        What the rows are judged with.
    outcomes : Outcomes
        What they showed.
    triples : TripleSample
        Rows with three failures.
    """
    failures = assessment.failures(outcomes)
    hazards = tuple(
        _hazard(assessment, item, outcomes, triples, failures) for item in assessment.study.hazards
    )
    groups: dict[str, int] = {}
    for row in outcomes.rows:
        groups[row.group] = groups.get(row.group, 0) + 1
    rates = {name: item.rate for name, item in failures.items()}
    detected = {name: item.detections for name, item in failures.items()}
    monitors = coverage(detected, rates, assessment.service)
    listing = assessment.study.gear
    checks = [check for item in hazards for check in _rules(item, failures, listing=listing)]
    rows = {finding.row for item in hazards for finding in item.findings}
    # At least one row, so that nothing passes by not having run.
    checks.append(Check("rows run", len(outcomes.rows), 1.0, at_least=True))
    return SafetyResult(
        assessment.study.actuator.name, len(outcomes.rows), len(rows), groups,
        tuple(failures.values()), hazards, _fidelity(outcomes),
        tuple(Coverage(*row) for row in monitors), checks, assessment.service.flight,
        assessment.seed, assessment.study.record, outcomes,
    )  # fmt: skip


def _hazard(
    assessment: Assessment,
    hazard: Hazard,
    outcomes: Outcomes,
    triples: TripleSample,
    failures: Mapping[str, FailureResult],
) -> HazardResult:
    findings = list(_findings(hazard, outcomes))
    sets = list(_minimal(assessment, findings, outcomes, failures))
    means, low, high = (
        {item.names: item.frequency(assessment.occurrences(failures, end)) for item in sets}
        for end in ("rate", "rate_low", "rate_high")
    )
    cuts = [_cut(item, means[item.names], failures, low[item.names].mean, high[item.names].mean)
            for item in sets]  # fmt: skip
    cuts.sort(key=lambda cut: (-cut.mean, cut.failures))
    mean = sum(cut.mean for cut in cuts)
    return HazardResult(
        hazard.name, hazard.text, hazard.severity, mean, sum(cut.worst for cut in cuts),
        (sum(cut.low for cut in cuts), sum(cut.high for cut in cuts)),
        assessment.targets[hazard.severity], tuple(cuts),
        _third_order(hazard, outcomes, triples, sets), _importance(cuts, mean, failures),
        _check_effects(assessment, sets, failures),
        tuple(item for item in findings if outcomes.rows[item.row].faults),
        len({item.row for item in findings if not outcomes.rows[item.row].faults}),
    )  # fmt: skip


def _findings(hazard: Hazard, outcomes: Outcomes) -> Iterator[HazardRow]:
    """Yield the rows that show a hazard, as the switching model judged it where both ran."""
    for place, row in enumerate(outcomes.rows):
        times = [
            (outcome.hazards[hazard.name], fidelity)
            for fidelity, outcome in outcomes.both(place)
            if hazard.name in outcome.hazards
        ]
        if times:
            yield HazardRow(place, *times[-1], reason(hazard, row))


def _minimal(
    assessment: Assessment,
    findings: Iterable[HazardRow],
    outcomes: Outcomes,
    failures: Mapping[str, FailureResult],
) -> Iterator[FoundSet]:
    """Yield the sets that lead to a hazard and contain no smaller one that does."""
    by_names: dict[frozenset[str], list[int]] = {}
    for item in findings:
        row = outcomes.rows[item.row]
        if row.faults and row.group != TRIPLE:
            by_names.setdefault(frozenset(row.names), []).append(item.row)
    smaller: list[frozenset[str]] = []
    occurrences = assessment.occurrences(failures)
    for names in sorted(by_names, key=len):
        if any(other < names for other in smaller):
            continue
        smaller.append(names)
        ways = [
            FoundSet(tuple(sorted(names)), tuple(by_names[names]), phase, exposure)
            for phase, exposure in assessment.exposures(by_names[names], outcomes, failures)
        ]
        yield max(ways, key=lambda way: way.frequency(occurrences).mean)


def _cut(
    item: FoundSet,
    result: Frequency,
    failures: Mapping[str, FailureResult],
    low: float,
    high: float,
) -> CutSet:
    last = item.exposure.last or item.names
    return CutSet(
        item.names, len(item.names), tuple(n for n in item.names if not failures[n].evident),
        tuple(sorted(last)), item.phase, result.mean, result.worst, low, high, result.common,
        item.rows,
    )  # fmt: skip


def _third_order(
    hazard: Hazard, outcomes: Outcomes, triples: TripleSample, sets: Sequence[FoundSet]
) -> ThirdOrder:
    """Bound what sets of three add: of those drawn by their frequency, which show the hazard."""
    from elevon.prognose.metrics import wilson

    known = [frozenset(item.names) for item in sets]
    hits = sum(
        any(hazard.name in outcome.hazards for _, outcome in outcomes.both(place))
        and not any(names <= set(outcomes.rows[place].names) for names in known)
        for place in triples.rows
    )
    count = len(triples.rows)
    share = wilson(hits / count, count)[1] if count else 1.0
    return ThirdOrder(count, hits, triples.total, share * triples.total)


def _importance(
    cuts: Sequence[CutSet], mean: float, failures: Mapping[str, FailureResult]
) -> tuple[Importance, ...]:
    shares: dict[str, float] = {}
    for cut in cuts:
        for name in cut.failures:
            shares[name] = shares.get(name, 0.0) + cut.mean
    rows = [
        Importance(name, part / mean, part / failures[name].rate)
        for name, part in shares.items()
        if mean > 0.0 and failures[name].rate > 0.0
    ]
    return tuple(sorted(rows, key=lambda row: (-row.fussell_vesely, row.failure)))


def _check_effects(
    assessment: Assessment, sets: Sequence[FoundSet], failures: Mapping[str, FailureResult]
) -> tuple[CheckEffect, ...]:
    """What half and twice the interval of each check make of a hazard's mean."""
    dormant = {item.check for item in failures.values() if not item.evident}
    effects = []
    for check in assessment.service.checks:
        if check.name not in dormant:
            continue
        half, twice = (
            sum(item.frequency(_stretched(assessment, failures, check.name, scale)).mean
                for item in sets)
            for scale in _SCALES
        )  # fmt: skip
        effects.append(CheckEffect(check.name, check.interval, half, twice))
    return tuple(effects)


def _stretched(
    assessment: Assessment, failures: Mapping[str, FailureResult], check: str, scale: float
) -> dict[str, Occurrence]:
    return {
        name: replace(item, interval=item.interval * scale)
        if item.check == check and not item.evident
        else item
        for name, item in assessment.occurrences(failures).items()
    }


def _rules(
    hazard: HazardResult, failures: Mapping[str, FailureResult], *, listing: bool
) -> Iterator[Check]:
    """Yield the rules of CS/FAR 25.1309 that a hazard has to keep, by name."""
    name = hazard.name
    yield Check(f"{name}: rows without a failure", hazard.healthy, 0.0)
    if listing:
        yield Check(f"{name}: rows not listed", hazard.rows - hazard.listed, 0.0)
    yield Check(f"25.1309(b) {name}: {hazard.severity}, mean of a flight hour", hazard.mean,
                hazard.target, "1/h")  # fmt: skip
    if hazard.severity != "catastrophic":
        return
    yield Check(f"25.1309(b)(1)(ii) {name}: single failures", hazard.single, 0.0)
    latent = [cut for cut in hazard.cut_sets if cut.order == 2 and len(cut.dormant) == 1]
    sums: dict[str, float] = {}
    left: dict[str, float] = {}
    for cut in latent:
        hidden = cut.dormant[0]
        other = next(text for text in cut.failures if text != hidden)
        item = failures[hidden]
        sums[other] = sums.get(other, 0.0) + item.rate * item.interval
        left[hidden] = left.get(hidden, 0.0) + failures[other].rate
    yield Check(f"25.1309(b)(5)(ii) {name}: what one latent failure leaves",
                max(left.values(), default=0.0), LATENT_LEFT, "1/h")  # fmt: skip
    yield Check(f"25.1309(b)(5)(iii) {name}: latent failures beside one evident",
                max(sums.values(), default=0.0), LATENT_SUM)  # fmt: skip


def _fidelity(outcomes: Outcomes) -> Fidelity:
    """How often the switching model changes an outcome; the rate by the rows drawn at random."""
    from elevon.prognose.metrics import wilson

    twice, changed = outcomes.low.keys() & outcomes.high.keys(), outcomes.changed()
    drawn = len(outcomes.drawn)
    hits = len(set(outcomes.drawn) & set(changed))
    interval = wilson(hits / drawn, drawn) if drawn else (0.0, 1.0)
    return Fidelity(
        len(outcomes.near), len(twice), len(outcomes.low) - len(twice), len(changed),
        hits / drawn if drawn else 0.0, interval, tuple(changed),
    )  # fmt: skip
