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
    LogCase,
    allowed,
    detector_of,
    errors_of,
    farthest,
    joined,
    shift_of,
    uncertainty_of,
)
from elevon.diagnose.engine.explain import (
    NO_CANDIDATE,
    alternatives,
    causes,
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
from elevon.diagnose.engine.spread import LearnedSpread

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
    residual, root, detector = detector_of(cases, candidates)
    score = float(detector.score((root @ residual)[None, :])[0])
    blind, least = limits(cases, candidates, root)
    # What the logs cannot show would keep its prior, whatever they say: it is left out.
    seen = [c for c in candidates if c.key in least] or candidates
    chance, faulty = _judged(detector, score, cases, rate, spread)
    few = len(seen) * (len(seen) - 1) // 2 <= _ALL
    result = _posterior_of(cases, seen, pairs=faulty or few, most=None if few else _MOST)
    result = share_lookalikes(cases, seen, _with_plausibility(cases, seen, result))
    best = _best(result, faulty=faulty)
    known = {c.key: c for c in candidates}
    named = [(known[key], value) for key, value in zip(best.keys, best.best, strict=True)]
    unit_known |= spread is not None or all(case.unit_known for case in cases)
    status, reason, findings = _status(cases, result, named, faulty=faulty, unit_known=unit_known)
    clear = status in ("healthy", "faulty")
    keys, values = (best.keys, best.best) if clear else ((), ())
    visible = {}
    if status == "healthy":
        threshold = _threshold(detector, cases, rate, spread)
        visible = would_be_seen(cases, seen, root, detector, threshold)
    return Diagnosis(
        logs=tuple(case.name for case in cases),
        status=status,
        p_fault=result.faulty,
        false_alarm=rate,
        chance=chance,
        faults=causes(result, cases, seen, best.keys) if clear else (),
        best=keys,
        p_best=_probability(result, best, faulty=faulty) if clear else result.other,
        unobservable=blind,
        detectable=least,
        features=moved(cases, keys, values),
        findings=(
            *(text for case in cases for text in case.findings),
            *findings,
            *(lookalike_findings(seen, result, keys) if status == "faulty" else ()),
        ),
        seconds=clock.perf_counter() - begin,
        hypotheses=explanations(result, candidates) if status not in (MISFIT, UNDECIDED) else (),
        alternatives=alternatives(result, cases, candidates, keys) if status != UNDECIDED else (),
        severity_units={c.key: c.unit for c in candidates},
        p_other=result.other,
        reason=reason,
        would_be_seen=visible,
    )


def _with_plausibility(
    cases: Sequence[LogCase], candidates: Sequence[CandidateFault], result: Posterior
) -> Posterior:
    """Weigh the hypotheses by what no candidate is looked for by; likely ones are run."""
    score = np.concatenate([case.plausible.score for case in cases])
    if np.abs(score).max(initial=0.0) < SEEN:
        return result
    known = {c.key: c for c in candidates}
    sets = [[(known[k], b) for k, b in zip(h.keys, h.best, strict=True)] for h in result.hypotheses]
    runs = [p >= _WORTH for p in result.probabilities]
    degrees = min(case.plausible.degrees for case in cases)
    return weigh_plausibility(result, score, degrees, *allowed(cases, sets, runs))


def judged(cases: Sequence[LogCase], candidates: Sequence[CandidateFault]) -> float:
    """Return how often a healthy unit deviates as much, by draws: what an alarm is decided by."""
    residual, root, detector = detector_of(cases, candidates)
    score = float(detector.score((root @ residual)[None, :])[0])
    return _judged(detector, score, cases, 1.0, None)[0]


def _judged(
    detector: Detector,
    score: float,
    cases: Sequence[LogCase],
    rate: float,
    spread: LearnedSpread | None,
) -> tuple[float, bool]:
    """Return how often a healthy unit deviates as much, and whether that is an alarm.

    Where there is something that no candidate moves, it has its share of the false alarms. Of one
    log the rank among those that the spread was learnt of must say so, too: draws that are too
    narrow raise no alarm that it does not.
    """
    share = _plausible_share(cases)
    odd = chance_of_any([case.plausible for case in cases]) / SHARE
    chance = min(detector.chance(score) / (1.0 - share), 1.0, odd)
    faulty = score > detector.threshold(rate * (1.0 - share)) or odd <= rate
    if spread is not None and len(cases) == 1:
        rank = spread.rank(chance, cases[0].unit.baselines, rate)
        chance, faulty = max(chance, rank), faulty and rank <= rate
    return chance, faulty


def _plausible_share(cases: Sequence[LogCase]) -> float:
    """Return the share of the false alarms that what no candidate moves has."""
    return SHARE if any(case.plausible.names for case in cases) else 0.0


def _threshold(
    detector: Detector, cases: Sequence[LogCase], rate: float, spread: LearnedSpread | None
) -> float:
    """Return the detector's score from which on logs are called faulty, as `_judged` does."""
    left = 1.0 - _plausible_share(cases)
    if spread is None or len(cases) > 1:
        return detector.threshold(rate * left)
    chances = np.geomspace(rate, 1.0 / DRAWS, _RANKED)
    baselines = cases[0].unit.baselines
    passed = [chance for chance in chances if spread.rank(chance, baselines, rate) <= rate]
    return detector.threshold(passed[0] * left) if passed else np.inf


def _status(
    cases: Sequence[LogCase],
    result: Posterior,
    named: Sequence[tuple[CandidateFault, float]],
    *,
    faulty: bool,
    unit_known: bool,
) -> tuple[Status, Reason | None, tuple[str, ...]]:
    """Return the verdict, why no cause is named, and the findings on what named faults leave.

    Nothing is decided where this unit's healthy state is not known: a deviation from the actuator
    file is then as likely the file's. What is named explains the logs better than anything else,
    and no feature refutes it.
    """
    misfit = next((case.misfit for case in cases if case.misfit is not None), None)
    if misfit is not None:
        return MISFIT, misfit, ()
    if not unit_known:
        return UNDECIDED, farthest(cases[_worst(cases)]), (NEVER_SEEN,)
    if not faulty:
        return "healthy", None, unexplained(cases, named)
    if not named or result.other >= _UNKNOWN:
        text = f"{NO_CANDIDATE} (probability {result.other:.2g})"
        against: Reason | None = farthest(cases[_worst(cases)])
    else:
        against = refuting(cases, named)
        if against is None:
            return "faulty", None, unexplained(cases, named)
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
    likely = next(h for h in result.hypotheses if bool(h.keys) or not faulty)
    known = result.probabilities[result.hypotheses.index(likely)]
    if not faulty or known >= result.other:
        return likely
    return next(h for h in result.hypotheses if not h.keys)


def _probability(result: Posterior, best: Hypothesis, *, faulty: bool) -> float:
    if faulty and not best.keys:
        return result.other
    return result.probabilities[result.hypotheses.index(best)]


def _posterior_of(
    cases: Sequence[LogCase],
    candidates: Sequence[CandidateFault],
    *,
    pairs: bool,
    most: int | None,
) -> Posterior:
    residual, covariance = joined(cases)
    return posterior(
        residual,
        covariance,
        min(case.unit.degrees for case in cases),
        candidates,
        lambda k, s: shift_of(cases, k, s),
        errors=errors_of(cases),
        uncertainty=lambda k, s: uncertainty_of(cases, k, s),
        pairs=pairs,
        other=True,
        most=most,
    )
