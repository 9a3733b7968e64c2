"""Diagnosis by the surrogate, and by both: the surrogate proposes, the model refines."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, combinations
from typing import TYPE_CHECKING

from elevon.diagnose.by_model import check_request, diagnose
from elevon.diagnose.engine.answer import Cause, Diagnosis, Explanation, FaultPlace, SuspectedFault
from elevon.diagnose.engine.candidates import CandidateFault, chosen
from elevon.diagnose.engine.explain import POSSIBLE
from elevon.diagnose.surrogate.model import Surrogate
from elevon.diagnose.surrogate.population import FAULTS, learned
from elevon.diagnose.surrogate.proposal import Proposal, proposed
from elevon.errors import ElevonError, InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

LISTED = 0.02  # probability below which a cause is not listed, and not proposed to the model
LEAST_PROPOSED = 3  # causes that the model is given at least


def diagnose_by_surrogate(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    baselines: Sequence[Log] = (),
    faults: Sequence[str] | None = None,
    false_alarm: float = 0.05,
    surrogate: Surrogate | None = None,
) -> Diagnosis:
    """Say what is wrong by trained trees.

    Parameters
    ----------
    logs : sequence of Log
        Of one unit in one condition.
    actuator : Actuator
        Gear ratio and pole pairs are used, nothing else.
    baselines : sequence of Log
        Of the healthy unit; those of the same test serve.
    faults : sequence of str, optional
        ``KIND@PLACE`` of the candidates; default: all that were trained.
    false_alarm : float
        Rate at which a healthy unit may be called faulty.
    surrogate : Surrogate, optional
        Default: the one that comes with the package.

    Raises
    ------
    InputError
        No log, a rate outside 0 to 1, another wiring, a test that was not trained, a log without
        positions or measured current.
    UnknownNameError
        A fault that is no candidate.
    """
    begin = clock.perf_counter()
    check_request(logs, false_alarm)
    candidates = _known(faults)
    proposal = proposed(logs, actuator, baselines=baselines, surrogate=surrogate)
    faulty = proposal.chance <= false_alarm
    best = _best(proposal, candidates, faulty=faulty)
    shares = [proposal.probability[c.key] for c in learned()]
    p_best = math.prod(
        p if c.key in best else 1.0 - p for c, p in zip(learned(), shares, strict=True)
    )
    findings = list(proposal.findings)
    if proposal.outside:
        findings.append(
            "outside the training set, do not trust this answer (--method model): "
            + "; ".join(proposal.outside)
        )
    return Diagnosis(
        logs=proposal.logs,
        status="faulty" if faulty else "healthy",
        p_fault=proposal.p_fault,
        false_alarm=false_alarm,
        chance=proposal.chance,
        faults=_causes(proposal, candidates, best),
        best=best,
        p_best=p_best,
        unobservable=_blind(proposal, candidates),
        detectable={
            k: v for k, v in proposal.detectable.items() if k in {c.key for c in candidates}
        },
        features=proposal.moved,
        findings=tuple(findings),
        seconds=clock.perf_counter() - begin,
        hypotheses=_explanations(proposal, candidates),
        severity_units={c.key: c.unit for c in candidates},
        method="surrogate",
    )


def _known(faults: Sequence[str] | None) -> list[CandidateFault]:
    """Return the candidates that the surrogate was trained on."""
    candidates = learned() if not faults else [c for c in chosen(faults) if c.key in FAULTS]
    if not candidates:
        raise InputError(f"--fault: the surrogate knows {', '.join(FAULTS)}")
    return candidates


def _best(
    proposal: Proposal, candidates: Sequence[CandidateFault], *, faulty: bool
) -> tuple[str, ...]:
    """The faults more likely there than not, two at most; the likeliest if none is."""
    if not faulty:
        return ()
    ranked = sorted(candidates, key=lambda c: -proposal.probability[c.key])
    likely = [c.key for c in ranked if proposal.probability[c.key] > 0.5]
    return tuple(likely[:2]) or (ranked[0].key,)


def _causes(
    proposal: Proposal, candidates: Sequence[CandidateFault], best: Sequence[str]
) -> tuple[Cause, ...]:
    out = []
    for c in candidates:
        p = proposal.probability[c.key]
        if p >= LISTED or c.key in best:
            middle, low, high = proposal.severity[c.key]
            alike = tuple(FaultPlace(c.kind, place) for place in c.same)
            out.append(Cause(c.kind, c.place, c.unit, p, middle, (low, high), alike))
    return tuple(sorted(out, key=lambda cause: -cause.probability))


def _explanations(
    proposal: Proposal, candidates: Sequence[CandidateFault]
) -> tuple[Explanation, ...]:
    """Sets of up to two faults, as if the faults were independent; they share `p_fault`."""
    rows = []
    for keys in chain(combinations(candidates, 1), combinations(candidates, 2)):
        odds = math.prod(_odds(proposal.probability[c.key]) for c in keys)
        rows.append((odds, keys))
    total = sum(odds for odds, _ in rows)
    shares = [(proposal.p_fault * odds / total, keys) for odds, keys in rows]
    shares.append((1.0 - proposal.p_fault, ()))
    return tuple(
        Explanation(tuple(_suspected(c, proposal.severity[c.key]) for c in keys), share)
        for share, keys in sorted(shares, key=lambda row: -row[0])
        if share >= POSSIBLE
    )


def _suspected(c: CandidateFault, severity: tuple[float, float, float]) -> SuspectedFault:
    return SuspectedFault(c.kind, c.place, severity[0], c.unit, severity[1:])


def _blind(proposal: Proposal, candidates: Sequence[CandidateFault]) -> tuple[dict[str, str], ...]:
    reason = "no severity of it was named in 95 % of held-out runs of this test"
    return tuple(
        {"kind": c.kind, "place": c.place, "reason": reason}
        for c in candidates
        if c.key not in proposal.detectable
    )


def diagnose_by_both(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    baselines: Sequence[Log] = (),
    faults: Sequence[str] | None = None,
    false_alarm: float = 0.05,
    surrogate: Surrogate | None = None,
) -> Diagnosis:
    """Let the surrogate propose causes and the model score those; as `diagnose_by_surrogate`.

    Where the surrogate cannot speak, or says that the logs lie outside its training set, the
    model scores all causes.
    """
    begin = clock.perf_counter()
    check_request(logs, false_alarm)
    candidates = chosen(faults)
    keys, note = _proposal(logs, actuator, baselines, candidates, surrogate)
    result = diagnose(logs, actuator, baselines=baselines, faults=keys, false_alarm=false_alarm)
    return replace(result, findings=(*result.findings, note), seconds=clock.perf_counter() - begin)


def _proposal(
    logs: Sequence[Log],
    actuator: Actuator,
    baselines: Sequence[Log],
    candidates: Sequence[CandidateFault],
    surrogate: Surrogate | None,
) -> tuple[list[str], str]:
    """Return the keys for the model and a finding."""
    every = [c.key for c in candidates]
    try:
        proposal = proposed(logs, actuator, baselines=baselines, surrogate=surrogate)
    except ElevonError as error:
        return every, f"surrogate: no proposal ({error}); the model scored all causes"
    if proposal.outside:
        return every, (
            "surrogate: outside its training set; the model scored all causes: "
            + "; ".join(proposal.outside)
        )
    ranked = sorted(every, key=lambda key: -proposal.probability.get(key, 1.0))
    keys = [
        key
        for k, key in enumerate(ranked)
        if k < LEAST_PROPOSED or proposal.probability.get(key, 1.0) >= LISTED
    ]
    shares = ", ".join(
        f"{k} {proposal.probability[k]:.2g}" for k in keys if k in proposal.probability
    )
    others = ", ".join(k for k in keys if k not in proposal.probability)
    untrained = (
        f"; scored beside them, since it was not trained on them: {others}" if others else ""
    )
    return keys, f"surrogate: proposed {shares}{untrained}"


def _odds(probability: float) -> float:
    return probability / max(1.0 - probability, 1e-12)
