"""Diagnosis by what was learnt: classes of logs, beside or in place of the model's answer."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, combinations
from typing import TYPE_CHECKING

from elevon.diagnose.by_model import check_request
from elevon.diagnose.by_model import diagnose as diagnose_by_model
from elevon.diagnose.engine.answer import (
    Cause,
    Diagnosis,
    Explanation,
    Moved,
    Reason,
    SuspectedFault,
)
from elevon.diagnose.engine.explain import POSSIBLE
from elevon.diagnose.engine.spread import needed
from elevon.diagnose.learning.labels import HEALTHY
from elevon.diagnose.learning.model import ClassOpinion, ClassView, LearnedClasses, enough
from elevon.diagnose.learning.motion import LoggedMotion, motion_of
from elevon.errors import ElevonError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.arrays import Floats
    from elevon.diagnose.engine.spread import LearnedSpread
    from elevon.logs.log import Log

LISTED = 0.02  # probability below which a cause is not listed
_UNLIKE = 0.01  # chance of the distance to every class below which a log is of none. ASSUMED
_FEATURES = 12  # that moved most
_UNKNOWN = (math.nan, math.nan, math.nan)  # severity and its interval


def diagnose_by_classes(
    logs: Sequence[Log],
    learned: LearnedClasses,
    *,
    baselines: Sequence[Log] = (),
    false_alarm: float = 0.05,
) -> Diagnosis:
    """Return of which classes the logs of one unit are.

    Parameters
    ----------
    logs : sequence of Log
        Of the motion that was learnt.
    learned : LearnedClasses
        By `elevon.learn`.
    baselines : sequence of Log
        Of the healthy unit, of the same motion.
    false_alarm : float
        Rate at which a healthy unit may be called faulty.

    Raises
    ------
    InputError
        No log, a rate outside 0 to 1, a log of another motion, baselines that the model cannot use.
    """
    begin = clock.perf_counter()
    check_request(logs, false_alarm)
    view = learned.view(baselines)
    items = [motion_of(log, learned.pole_pairs) for log in logs]
    healthy = [motion_of(log, learned.pole_pairs) for log in baselines]
    values = learned.values(items, healthy)
    opinion = learned.says(values, relative=bool(healthy))
    conformal = enough(view, false_alarm)
    alarm = opinion.chance <= false_alarm if conformal else opinion.p_fault > 0.5
    unknown = alarm and opinion.unlike <= _UNLIKE
    causes = _causes(opinion, learned)
    moved = _moved(items, values, view, learned.features)
    best = () if unknown or not alarm else _best(causes, exclusive=learned.exclusive)
    listed = tuple(c for c in causes if c.probability >= LISTED or f"{c.kind}@{c.place}" in best)
    return Diagnosis(
        logs=tuple(item.name for item in items),
        status="unknown_fault" if unknown else "faulty" if alarm else "healthy",
        p_fault=opinion.p_fault,
        false_alarm=false_alarm,
        chance=opinion.chance,
        faults=() if unknown else listed,
        best=best,
        p_best=_probability_of(best, causes, opinion, exclusive=learned.exclusive),
        unobservable=(),
        detectable=_detectable(view, learned.kinds),
        features=moved,
        findings=(_threshold_text(view, false_alarm, conformal=conformal),),
        seconds=clock.perf_counter() - begin,
        hypotheses=_explanations(causes, opinion, exclusive=learned.exclusive),
        severity_units=dict(zip(map(_key, learned.kinds), learned.severity_units, strict=True)),
        p_other=opinion.p_fault if unknown else 0.0,
        reason=_reason(moved) if unknown else None,
        method="learned",
        prior=dict(zip(map(_key, learned.kinds), learned.share.tolist(), strict=True)),
    )


def diagnose_by_spread_and_classes(
    logs: Sequence[Log],
    actuator: Actuator,
    spread: LearnedSpread,
    learned: LearnedClasses,
    *,
    baselines: Sequence[Log] = (),
    faults: Sequence[str] | None = None,
    false_alarm: float = 0.05,
) -> Diagnosis:
    """Return the model's answer, or that of the classes where the model names nothing.

    Each may call half of the rate of healthy units faulty, so both together call no more than the
    rate. A model that names a fault is believed; where it names none, and the classes name one,
    theirs is the answer. What the other one said is a finding. Where the classes cannot answer
    (another motion, baselines of a motion of their own), the model answers at the whole rate.

    Raises
    ------
    InputError
        As `elevon.diagnose.by_model.diagnose`.
    """
    begin = clock.perf_counter()
    check_request(logs, false_alarm)
    half = 0.5 * false_alarm
    with_baselines = baselines if "relative" in learned.views else ()
    try:
        second = diagnose_by_classes(logs, learned, baselines=with_baselines, false_alarm=half)
    except ElevonError as error:
        only = diagnose_by_model(
            logs, actuator, baselines=baselines, faults=faults, false_alarm=false_alarm,
            spread=spread,
        )  # fmt: skip
        note = f"the learnt classes give no answer: {error}"
        return replace(only, findings=(*only.findings, note), seconds=clock.perf_counter() - begin)
    first = diagnose_by_model(
        logs, actuator, baselines=baselines, faults=faults, false_alarm=half, spread=spread
    )
    answer, other = (first, second) if first.best or not second.best else (second, first)
    by = {"learned": "the learnt classes", "model": "the model with the learnt spread"}
    note = f"{by[other.method]}: {other.headline}"
    return replace(
        answer, false_alarm=false_alarm, findings=(*answer.findings, note),
        chance=min(2.0 * min(first.chance, second.chance), 1.0),
        seconds=clock.perf_counter() - begin,
    )  # fmt: skip


def _threshold_text(view: ClassView, rate: float, *, conformal: bool) -> str:
    how = "conformal" if conformal else "the most probable class"
    return (
        f"threshold {how}: {len(view.healthy)} healthy logs were judged by other groups, a "
        f"conformal one at {100.0 * rate:g} % needs {needed(rate)}"
    )


def _key(kind: str) -> str:
    """Return ``KIND@PLACE``; a label without a place is one of the unit."""
    name, _, place = kind.partition("@")
    return f"{name}@{place or 'unit'}"


def _causes(opinion: ClassOpinion, learned: LearnedClasses) -> list[Cause]:
    """Return classes as causes, most probable first."""
    units = dict(zip(learned.kinds, learned.severity_units, strict=True))
    out = []
    for kind, probability in opinion.probability.items():
        name, _, place = _key(kind).partition("@")
        middle, low, high = opinion.severity.get(kind, _UNKNOWN)
        out.append(Cause(name, place, units[kind], probability, middle, (low, high)))
    return sorted(out, key=lambda cause: -cause.probability)


def _best(causes: Sequence[Cause], *, exclusive: bool) -> tuple[str, ...]:
    """Return the kinds more likely there than not, two at most; the likeliest if none is."""
    likely = [c for c in causes[:2] if c.probability > 0.5 and not exclusive]
    return tuple(f"{c.kind}@{c.place}" for c in likely or causes[:1])


def _probability_of(
    best: Sequence[str], causes: Sequence[Cause], opinion: ClassOpinion, *, exclusive: bool
) -> float:
    """Return the probability of the named kinds and no other."""
    if not best:
        return 1.0 - opinion.p_fault
    if exclusive:
        return causes[0].probability
    return math.prod(
        c.probability if f"{c.kind}@{c.place}" in best else 1.0 - c.probability for c in causes
    )


def _explanations(
    causes: Sequence[Cause], opinion: ClassOpinion, *, exclusive: bool
) -> tuple[Explanation, ...]:
    """Return sets of up to two kinds with their probability, where severities are known."""
    if any(math.isnan(c.severity) for c in causes):
        return ()
    shares: list[tuple[float, tuple[Cause, ...]]]
    if exclusive:
        shares = [(c.probability, (c,)) for c in causes]
    else:
        sets = chain[tuple[Cause, ...]](combinations(causes, 1), combinations(causes, 2))
        odds = [(math.prod(_odds(c.probability) for c in some), some) for some in sets]
        total = sum(odd for odd, _ in odds)
        shares = [(opinion.p_fault * odd / total, some) for odd, some in odds]
    rows = [(share, some) for share, some in shares if share >= POSSIBLE]
    rows.append((1.0 - opinion.p_fault, ()))
    return tuple(
        Explanation(
            tuple(SuspectedFault(c.kind, c.place, c.severity, c.unit, c.interval) for c in some),
            share,
        )
        for share, some in sorted(rows, key=lambda row: -row[0])
    )


def _odds(probability: float) -> float:
    return probability / max(1.0 - probability, 1e-12)


def _detectable(view: ClassView, kinds: Sequence[str]) -> dict[str, float]:
    named = zip(kinds, view.named.tolist(), strict=True)
    return {_key(kind): value for kind, value in named if math.isfinite(value)}


def _moved(
    items: Sequence[LoggedMotion], values: Floats, view: ClassView, features: Sequence[str]
) -> tuple[Moved, ...]:
    """Return the numbers that stand furthest from the healthy class, in its scatter."""
    fit = view.discriminant
    mean = fit.means[fit.classes.index(HEALTHY)] * fit.scale
    out = [
        Moved(item.name, name, "", float(value), float(middle), float(scale), math.nan)
        for item, row in zip(items, values, strict=True)
        for name, value, middle, scale in zip(features, row, mean, fit.scale, strict=True)
    ]
    return tuple(sorted(out, key=lambda m: -abs(m.score))[:_FEATURES])


def _reason(moved: Sequence[Moved]) -> Reason:
    first = moved[0]
    limit = first.expected + math.copysign(3.0 * first.deviation, first.score)
    return Reason(first.name, first.value, limit)
