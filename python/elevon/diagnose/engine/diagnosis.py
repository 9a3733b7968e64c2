"""Diagnosis of logs of one unit by the model."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.diagnose.engine.answer import Diagnosis
from elevon.diagnose.engine.candidates import CandidateFault, chosen
from elevon.diagnose.engine.case import (
    LogCase,
    case_of,
    detector_of,
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
from elevon.diagnose.engine.not_modelled import not_modelled
from elevon.diagnose.engine.posterior import Posterior, posterior
from elevon.diagnose.positions.log import prepared
from elevon.errors import InputError
from elevon.threads import one_blas_thread

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

ANYWHERE = 0.2  # of the false alarms: what no candidate does. ASSUMED


@one_blas_thread()
def diagnose(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    baselines: Sequence[Log] = (),
    faults: Sequence[str] | None = None,
    false_alarm: float = 0.05,
) -> Diagnosis:
    """Say what is wrong with the unit that wrote the logs.

    Parameters
    ----------
    logs : sequence of Log
        Of one unit in one condition.
    actuator : Actuator
        The healthy unit, calibrated.
    baselines : sequence of Log
        Of the healthy unit; those of the same test serve.
    faults : sequence of str, optional
        ``KIND@PLACE`` of the candidates; default: all.
    false_alarm : float
        Rate at which a healthy unit may be called faulty.

    Raises
    ------
    InputError
        A log that cannot be diagnosed, no candidate, a rate outside 0 to 1.
    """
    begin = clock.perf_counter()
    check_request(logs, actuator, false_alarm, "diagnosis by the model")
    candidates = chosen(faults)
    healthy_logs = [prepared(item, actuator) for item in baselines]
    cases = [case_of(prepared(item, actuator), actuator, candidates, healthy_logs) for item in logs]
    result = answer_of(cases, candidates, false_alarm, other=True)
    blind = result.unobservable
    if not faults:
        blind += not_modelled()
    return replace(result, unobservable=blind, seconds=clock.perf_counter() - begin)


def check_request(logs: Sequence[Log], actuator: Actuator, rate: float, who: str) -> None:
    """Refuse what no method for rotary actuators can answer; `who` is the method."""
    if not logs:
        raise InputError("diagnosis needs at least one log")
    if not 0.0 < rate < 1.0:
        raise InputError(f"false-alarm rate {rate:g} must be between 0 and 1")
    if actuator.wiring != "rotary":
        raise InputError(
            f"{actuator.name}: {who} serves the wiring 'rotary' so far, not {actuator.wiring!r}"
        )


def answer_of(
    cases: Sequence[LogCase],
    candidates: Sequence[CandidateFault],
    rate: float,
    *,
    most: int | None = None,
    other: bool = False,
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
    most : int, optional
        Pairs of faults that are scored, the most promising of a log that is called faulty;
        default: all.
    other : bool
        Whether something that is no candidate may be there.
    """
    begin = clock.perf_counter()
    residual, root, detector = detector_of(cases, candidates, ANYWHERE if other else 0.0)
    score = float(detector.score((root @ residual)[None, :])[0])
    blind, least = limits(cases, candidates, root)
    # What the logs cannot show would keep its prior, whatever they say: it is left out.
    seen = [c for c in candidates if c.key in least] or candidates
    faulty = score > detector.threshold(rate)
    result = _posterior_of(cases, seen, pairs=faulty or most is None, most=most, other=other)
    best = _best(result, faulty=faulty)
    known = {c.key: c for c in candidates}
    named = [(known[key], value) for key, value in zip(best.keys, best.best, strict=True)]
    return Diagnosis(
        logs=tuple(case.name for case in cases),
        status="faulty" if faulty else "healthy",
        p_fault=result.faulty,
        false_alarm=rate,
        chance=detector.chance(score),
        faults=causes(result, cases, seen, root, best.keys),
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
    other: bool,
) -> Posterior:
    residual, covariance = joined(cases)
    return posterior(
        residual,
        covariance,
        min(case.unit.degrees for case in cases),
        candidates,
        lambda k, s: shift_of(cases, k, s),
        errors=np.concatenate([case.errors for case in cases]),
        uncertainty=lambda k, s: uncertainty_of(cases, k, s),
        pairs=pairs,
        other=other,
        most=most,
    )
