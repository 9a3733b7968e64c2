"""The answer to logs of one unit that stand against their healthy unit."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence

from elevon.diagnose.engine.answer import Diagnosis
from elevon.diagnose.engine.candidates import CandidateFault
from elevon.diagnose.engine.case import (
    LogCase,
    detector_of,
    errors_of,
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
    unexplained,
)
from elevon.diagnose.engine.likelihood import Hypothesis
from elevon.diagnose.engine.posterior import Posterior, posterior

_ALL = 128  # pairs of faults that are all scored; of more the most promising of a faulty log
_MOST = 16


def answer_of(
    cases: Sequence[LogCase],
    candidates: Sequence[CandidateFault],
    rate: float,
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
    """
    begin = clock.perf_counter()
    residual, root, detector = detector_of(cases, candidates)
    score = float(detector.score((root @ residual)[None, :])[0])
    blind, least = limits(cases, candidates, root)
    # What the logs cannot show would keep its prior, whatever they say: it is left out.
    seen = [c for c in candidates if c.key in least] or candidates
    faulty = score > detector.threshold(rate)
    few = len(seen) * (len(seen) - 1) // 2 <= _ALL
    result = _posterior_of(cases, seen, pairs=faulty or few, most=None if few else _MOST)
    best = _best(result, faulty=faulty)
    known = {c.key: c for c in candidates}
    named = [(known[key], value) for key, value in zip(best.keys, best.best, strict=True)]
    return Diagnosis(
        logs=tuple(case.name for case in cases),
        status="faulty" if faulty else "healthy",
        p_fault=result.faulty,
        false_alarm=rate,
        chance=detector.chance(score),
        faults=causes(result, cases, seen, best.keys),
        best=best.keys,
        p_best=_probability(result, best, faulty=faulty),
        unobservable=blind,
        detectable=least,
        features=moved(cases, best.keys, best.best),
        findings=(
            *(text for case in cases for text in case.findings),
            *_left(result, cases, named, faulty=faulty),
        ),
        seconds=clock.perf_counter() - begin,
        hypotheses=explanations(result, candidates),
        alternatives=alternatives(result, cases, candidates, best.keys),
        severity_units={c.key: c.unit for c in candidates},
        p_other=result.other,
    )


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


def _left(
    result: Posterior,
    cases: Sequence[LogCase],
    named: Sequence[tuple[CandidateFault, float]],
    *,
    faulty: bool,
) -> tuple[str, ...]:
    """Return the findings on what the named faults leave."""
    if faulty and not named:
        return (f"{NO_CANDIDATE} (probability {result.other:.2g})",)
    return unexplained(cases, named)


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
