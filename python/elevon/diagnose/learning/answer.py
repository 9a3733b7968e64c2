"""Diagnosis by what was learnt from labelled logs."""

from __future__ import annotations

import math
import time as clock
from collections.abc import Sequence
from typing import TYPE_CHECKING

from elevon.diagnose.by_model import check_request
from elevon.diagnose.engine.answer import Cause, Diagnosis, Moved, Reason
from elevon.diagnose.engine.spread import needed
from elevon.diagnose.learning.classes import HEALTHY, ClassOpinion, LearnedClasses
from elevon.diagnose.learning.motion import LoggedMotion, motion_of

if TYPE_CHECKING:
    from elevon.logs.log import Log

LISTED = 0.02  # probability below which a cause is not listed
_UNLIKE = 0.01  # chance of the distance to every class below which a log is of none. ASSUMED
_FEATURES = 12  # that moved most


def diagnose_by_classes(
    logs: Sequence[Log], learned: LearnedClasses, *, false_alarm: float = 0.05
) -> Diagnosis:
    """Say of which class the logs of one unit are.

    Parameters
    ----------
    logs : sequence of Log
        Of the motion that was learnt.
    learned : LearnedClasses
        Of labelled logs.
    false_alarm : float
        Rate at which a healthy unit may be called faulty.

    Raises
    ------
    InputError
        No log, a rate outside 0 to 1, a log of another motion.
    """
    begin = clock.perf_counter()
    check_request(logs, false_alarm)
    items = [motion_of(log, learned.pole_pairs) for log in logs]
    says = learned.says(items)
    fault = 1.0 - says.probability[HEALTHY]
    alarm = says.chance <= false_alarm if learned.enough(false_alarm) else fault > 0.5
    causes = _causes(says)
    unknown = alarm and says.unlike <= _UNLIKE
    moved = _moved(items, learned)
    best = (f"{causes[0].kind}@{causes[0].place}",) if alarm and not unknown else ()
    return Diagnosis(
        logs=tuple(item.name for item in items),
        status="unknown_fault" if unknown else "faulty" if alarm else "healthy",
        p_fault=fault,
        false_alarm=false_alarm,
        chance=says.chance,
        faults=() if unknown else tuple(c for c in causes if c.probability >= LISTED or best),
        best=best,
        p_best=causes[0].probability if best else 1.0 - fault,
        unobservable=(),
        detectable={},
        features=moved,
        findings=(_threshold_text(learned, false_alarm),),
        seconds=clock.perf_counter() - begin,
        p_other=fault if unknown else 0.0,
        reason=_reason(moved) if unknown else None,
        method="learned",
    )


def _threshold_text(learned: LearnedClasses, rate: float) -> str:
    count, least = len(learned.healthy), needed(rate)
    how = "conformal" if learned.enough(rate) else "the most probable class"
    return (
        f"threshold {how}: {count} healthy logs were judged by other groups, a conformal one at "
        f"{100.0 * rate:g} % needs {least}"
    )


def _causes(says: ClassOpinion) -> list[Cause]:
    """Classes as causes, most probable first; a label without a place is one of the unit."""
    out = []
    for name, share in says.probability.items():
        if name != HEALTHY:
            kind, _, place = name.partition("@")
            out.append(Cause(kind, place or "unit", "1", share, math.nan, (math.nan, math.nan)))
    return sorted(out, key=lambda cause: -cause.probability)


def _moved(items: Sequence[LoggedMotion], learned: LearnedClasses) -> tuple[Moved, ...]:
    """The numbers that stand furthest from the healthy class, in its scatter."""
    fit = learned.discriminant
    mean = fit.means[fit.classes.index(HEALTHY)] * fit.scale
    out = [
        Moved(item.name, name, "", float(value), float(middle), float(scale), math.nan)
        for item, row in zip(items, learned.values(items), strict=True)
        for name, value, middle, scale in zip(learned.features, row, mean, fit.scale, strict=True)
    ]
    return tuple(sorted(out, key=lambda m: -abs(m.score))[:_FEATURES])


def _reason(moved: Sequence[Moved]) -> Reason:
    first = moved[0]
    limit = first.expected + math.copysign(3.0 * first.deviation, first.score)
    return Reason(first.name, first.value, limit)
