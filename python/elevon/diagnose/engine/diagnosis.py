"""The answer to logs of one unit that stand against their healthy unit."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from typing import Literal

import numpy as np

from elevon.diagnose.engine.answer import SEEN, Diagnosis, Reason
from elevon.diagnose.engine.candidates import CandidateFault
from elevon.diagnose.engine.case import (
    DRAWS,
    Detector,
    Faults,
    JoinedLogs,
    LogCase,
    allowed,
    farthest,
)
from elevon.diagnose.engine.explain import (
    NO_CANDIDATE,
    alternatives,
    causes,
    changes_seen,
    explanations,
    limits,
    moved,
    refuting,
    unexplained,
    would_be_seen,
)
from elevon.diagnose.engine.likelihood import Hypothesis
from elevon.diagnose.engine.lookalikes import lookalike_findings, share_lookalikes
from elevon.diagnose.engine.plausibility import SHARE, chance_of_any, weigh_plausibility
from elevon.diagnose.engine.posterior import Posterior, posterior
from elevon.diagnose.engine.spread import LearnedSpread, needed

_ALL = 128  # pairs of faults that are all scored; of more the most promising of a faulty log
_MOST = 16
_WORTH = 0.01  # probability from which on a set of faults is worth a run
_RANKED = 40  # chances at which the rank among learnt days is asked
_UNKNOWN = 0.5  # probability of no candidate from which on none is named
NEVER_SEEN = (
    "no healthy state of this unit is known, neither by a calibration nor by a healthy log of each "
    "test: give a baseline, or calibrate (elevon calibrate)"
)
MISFIT: Literal["model_does_not_fit"] = "model_does_not_fit"
UNDECIDED: Literal["undecided"] = "undecided"
Status = Literal["healthy", "faulty", "unknown_fault", "model_does_not_fit", "undecided"]


def answer_of(
    cases: Sequence[LogCase],
    candidates: Sequence[CandidateFault],
    rate: float,
    spread: LearnedSpread | None = None,
    *,
    unit_known: bool = False,
) -> Diagnosis:
    """Return the answer of logs that stand against their healthy unit.

    Parameters
    ----------
    cases : sequence of LogCase
        One a log.
    candidates : sequence of CandidateFault
        Faults.
    rate : float
        Of false alarms.
    spread : LearnedSpread, optional
        That the cases stand on.
    unit_known : bool
        Whether this unit's healthy state is known otherwise than by its calibration, by healthy
        logs of each test or by the spread.
    """
    begin = clock.perf_counter()
    logs = JoinedLogs(tuple(cases))
    if not logs.explained:
        candidates = ()
    detector = logs.detector(candidates)
    blind, least = limits(logs, candidates)
    # What the logs cannot show would keep its prior, whatever they say: it is left out.
    seen = [c for c in candidates if c.key in least] or candidates
    chance, faulty = _judged(logs, detector, rate, spread)
    few = len(seen) * (len(seen) - 1) // 2 <= _ALL
    result = _posterior_of(logs, seen, pairs=faulty or few, most=None if few else _MOST)
    result = share_lookalikes(cases, seen, _with_plausibility(logs, seen, result))
    best = _best(result, faulty=faulty)
    known = {c.key: c for c in candidates}
    named = [(known[key], value) for key, value in zip(best.keys, best.best, strict=True)]
    unit_known |= spread is not None or all(case.unit_known for case in cases)
    status, reason, findings = _status(logs, result, named, faulty=faulty, unit_known=unit_known)
    clear = status in ("healthy", "faulty")
    keys = best.keys if clear else ()
    visible: dict[str, float] = {}
    if status == "healthy":
        threshold = _threshold(logs, detector, rate, spread)
        visible = would_be_seen(logs, seen, detector, threshold)
        if not logs.explained:
            findings = (*findings, *changes_seen(logs, detector, threshold))
    return Diagnosis(
        logs=tuple(case.name for case in cases),
        status=status,
        p_fault=result.faulty,
        false_alarm=rate,
        chance=chance,
        faults=causes(result, logs, seen, best.keys) if clear else (),
        best=keys,
        p_best=_probability(result, best, faulty=faulty) if clear else result.other,
        unobservable=blind,
        detectable=least,
        features=moved(cases, named if clear else ()),
        findings=(
            *(text for case in cases for text in case.findings),
            *findings,
            *(lookalike_findings(seen, result, keys) if status == "faulty" else ()),
        ),
        seconds=clock.perf_counter() - begin,
        hypotheses=explanations(result, candidates) if status not in (MISFIT, UNDECIDED) else (),
        alternatives=alternatives(result, logs, candidates, keys) if status != UNDECIDED else (),
        severity_units={c.key: c.unit for c in candidates},
        p_other=result.other,
        reason=reason,
        would_be_seen=visible,
        rate="guaranteed" if _guaranteed(logs, rate, spread) else "assumed",
    )


def _with_plausibility(
    logs: JoinedLogs, candidates: Sequence[CandidateFault], result: Posterior
) -> Posterior:
    """Weigh the hypotheses by what no candidate is looked for by; likely ones are run."""
    score = np.concatenate([case.plausible.score for case in logs.cases])
    if np.abs(score).max(initial=0.0) < SEEN:
        return result
    known = {c.key: c for c in candidates}
    sets = [[(known[k], b) for k, b in zip(h.keys, h.best, strict=True)] for h in result.hypotheses]
    runs = [p >= _WORTH for p in result.probabilities]
    degrees = min(case.plausible.degrees for case in logs.cases)
    return weigh_plausibility(result, score, degrees, *allowed(logs, sets, runs))


def judged(case: LogCase, candidates: Sequence[CandidateFault]) -> float:
    """Return how often a healthy unit deviates as much, by draws: what an alarm is decided by."""
    logs = JoinedLogs((case,))
    return _chance_of_draws(logs, logs.detector(candidates))


def _chance_of_draws(logs: JoinedLogs, detector: Detector) -> float:
    odd = chance_of_any([case.plausible for case in logs.cases]) / SHARE
    chance = detector.chance(logs.score(detector)) / (1.0 - _plausible_share(logs))
    return min(chance, 1.0, odd)


def _judged(
    logs: JoinedLogs, detector: Detector, rate: float, spread: LearnedSpread | None
) -> tuple[float, bool]:
    """Return how often a healthy unit deviates as much, and whether that is an alarm.

    Where there is something that no candidate moves, it has its share of the false alarms. Of one
    log two ranks must say so, too, where they reach the rate: that among the days that the spread
    was learnt of, and that among the unit's own healthy logs. Draws that are too narrow raise no
    alarm that these do not.
    """
    chance = _chance_of_draws(logs, detector)
    odd = chance_of_any([case.plausible for case in logs.cases]) / SHARE
    faulty = logs.score(detector) > _drawn_threshold(logs, detector, rate) or odd <= rate
    if len(logs.cases) == 1:
        (case,) = logs.cases
        ranks = [] if spread is None else [spread.rank(chance, case.unit.baselines, rate)]
        if len(case.baselines) >= needed(rate):
            ranks.append(rank_among_baselines(case))
        chance, faulty = max([chance, *ranks]), faulty and all(rank <= rate for rank in ranks)
    return chance, faulty


def _guaranteed(logs: JoinedLogs, rate: float, spread: LearnedSpread | None) -> bool:
    """Whether the rate of false alarms holds whatever the distribution of healthy days is."""
    if len(logs.cases) > 1:
        return False
    learnt = spread is not None and spread.enough(rate)
    return learnt or len(logs.cases[0].baselines) >= needed(rate)


def rank_among_baselines(case: LogCase) -> float:
    """Return how many of a log and its unit's healthy logs are as unlike the others as the log.

    As a share, the log among them. It is a p-value for a healthy log of a day that is exchangeable
    with theirs, whatever the features' distribution (Vovk, Gammerman and Shafer, 2005, chapter 2).
    How unlike: the largest deviation of a feature from the mean of the others, in their scatter.
    """
    rows = np.array([case.features.values, *(x.values for x in case.baselines)])
    seen = case.plausible
    if len(seen.baselines) == len(case.baselines):
        rows = np.hstack([rows, np.vstack([seen.values, seen.baselines])])
    unlike = []
    for k in range(len(rows)):
        others = np.delete(rows, k, axis=0)
        scatter = np.maximum(others.std(axis=0, ddof=1), 1e-12)
        unlike.append(float(np.max(np.abs(rows[k] - others.mean(axis=0)) / scatter)))
    return float(np.mean(np.array(unlike) >= unlike[0]))


def _plausible_share(logs: JoinedLogs) -> float:
    """Return the share of the false alarms that what no candidate moves has."""
    return SHARE if any(case.plausible.names for case in logs.cases) else 0.0


def _drawn_threshold(logs: JoinedLogs, detector: Detector, rate: float) -> float:
    return detector.threshold(rate * (1.0 - _plausible_share(logs)))


def _threshold(
    logs: JoinedLogs, detector: Detector, rate: float, spread: LearnedSpread | None
) -> float:
    """Return the detector's score from which on logs are called faulty, as `_judged` does."""
    if spread is None or len(logs.cases) > 1:
        return _drawn_threshold(logs, detector, rate)
    chances = np.geomspace(rate, 1.0 / DRAWS, _RANKED)
    baselines = logs.cases[0].unit.baselines
    passed = [chance for chance in chances if spread.rank(chance, baselines, rate) <= rate]
    return _drawn_threshold(logs, detector, passed[0]) if passed else np.inf


def _status(
    logs: JoinedLogs,
    result: Posterior,
    named: Faults,
    *,
    faulty: bool,
    unit_known: bool,
) -> tuple[Status, Reason | None, tuple[str, ...]]:
    """Return the verdict, why no cause is named, and the findings on what named faults leave.

    Nothing is decided where this unit's healthy state is not known: a deviation from the actuator
    file is then as likely the file's. What is named explains the logs better than anything else,
    and no feature refutes it.
    """
    misfit = next((case.misfit for case in logs.cases if case.misfit is not None), None)
    if misfit is not None:
        return MISFIT, misfit, ()
    furthest = farthest(logs.cases[_worst(logs.cases)])
    if not unit_known:
        return UNDECIDED, furthest, (NEVER_SEEN,)
    if not faulty:
        return "healthy", None, unexplained(logs, named)
    if not logs.explained:
        return "unknown_fault", furthest, ()
    if not named or result.other >= _UNKNOWN:
        text = f"{NO_CANDIDATE} (probability {result.other:.2g})"
        against: Reason | None = furthest
    else:
        against = refuting(logs, named)
        if against is None:
            return "faulty", None, unexplained(logs, named)
        names = " and ".join(c.key for c, _ in named)
        text = f"the most probable cause, {names}, is refuted by {against.feature}"
    return "unknown_fault", against, (text,)


def _worst(cases: Sequence[LogCase]) -> int:
    """The log with the greatest deviation of one feature."""
    scores = []
    for case in cases:
        off = np.abs(case.features.values - case.unit.mean) / np.sqrt(np.diag(case.covariance))
        scores.append(max(float(off.max()), float(np.abs(case.plausible.score).max(initial=0.0))))
    return int(np.argmax(scores))


def _best(result: Posterior, *, faulty: bool) -> Hypothesis:
    """Return the most probable set of faults; the empty one of a faulty unit: something else."""
    none = next(h for h in result.hypotheses if not h.keys)
    likely = next((h for h in result.hypotheses if bool(h.keys) or not faulty), none)
    known = result.probabilities[result.hypotheses.index(likely)]
    return none if faulty and known < result.other else likely


def _probability(result: Posterior, best: Hypothesis, *, faulty: bool) -> float:
    if faulty and not best.keys:
        return result.other
    return result.probabilities[result.hypotheses.index(best)]


def _posterior_of(
    logs: JoinedLogs, candidates: Sequence[CandidateFault], *, pairs: bool, most: int | None
) -> Posterior:
    return posterior(
        logs.residual, logs.covariance, logs.degrees, candidates, logs.shift, errors=logs.errors,
        uncertainty=logs.uncertainty, pairs=pairs, other=True, most=most,
    )  # fmt: skip
