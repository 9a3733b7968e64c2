"""Causes that channels of a log show by themselves, in one answer with what the model says.

A sign is a number of a log with a limit that lies four deviations of a healthy unit off. Its
probability is that of the cause against a healthy unit and against what looks like the cause. The
features that it moves are left out of the posterior over the candidates; what the others say is
as likely with the cause as without it, so probabilities multiply, and a fault of another kind is
named beside it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from elevon.diagnose.engine.answer import Cause, Diagnosis, Explanation, SuspectedFault
from elevon.diagnose.engine.explain import POSSIBLE
from elevon.diagnose.engine.lookalikes import SHARE
from elevon.diagnose.engine.posterior import OTHER, PRIOR_FAULTY

if TYPE_CHECKING:
    from elevon.logs.log import Log

_FAR = 4.0  # deviations of a healthy unit at which each limit lies. ASSUMED, with each limit
_SIZES = 100.0  # over the limit, the largest size that is as likely in its logarithm. ASSUMED
_UNSURE = 0.05  # probability of something else from which on it is a finding
EVERYTHING = ("",)  # the beginning of every name
#: What looks like a cause by its kind; each comes `SHARE` as often.
_ALIKE = {
    "missing_counts": ("an error of gear or sensor once an output turn",
                       "a soft spring behind the encoder"),
    "dark_sectors": ("an error of gear or sensor once an output turn",),
    "channel_offset": ("an error of the gear once a motor turn",),
    "resolver_short": ("an error of the gear twice a motor turn",),
}  # fmt: skip


@dataclass(frozen=True)
class Sign:
    """A cause with what it stands on.

    Attributes
    ----------
    cause : Cause
        Its probability is that against a healthy unit and what looks like it.
    present : float
        Probability that the unit is not healthy: of the cause, or of what looks like it.
    moves : tuple of str
        Beginnings of names of features that the cause moves.
    text : str
        What it stands on.
    """

    cause: Cause
    present: float
    moves: tuple[str, ...]
    text: str

    @property
    def key(self) -> str:
        """``KIND@PLACE``."""
        return f"{self.cause.kind}@{self.cause.place}"

    @property
    def alike(self) -> tuple[str, ...]:
        """What looks like the cause, in words."""
        return _ALIKE.get(self.cause.kind, ())


def sign_of(
    cause: Cause,
    size: float,
    limit: float,
    *,
    moves: Sequence[str],
    text: str,
    error: float = 0.0,
) -> Sign:
    """Return a sign with its probability by the size of what is seen.

    Of a healthy unit the size is half-normal, with a quarter of the limit and the log's own error
    as its deviation. Of the cause it is as likely in each octave up to a hundred limits.

    Parameters
    ----------
    cause : Cause
        Its probability counts for nothing.
    size, limit : float
        What is seen, and from which on it is told, in one unit.
    moves : sequence of str
        Beginnings of names of features that it moves.
    text : str
        What it stands on.
    error : float
        Deviation of the size by the log's noise.
    """
    deviation = math.hypot(limit / _FAR, error)
    healthy = 0.5 * math.log(2.0 / math.pi) - math.log(deviation) - 0.5 * (size / deviation) ** 2
    there = -math.log(size * math.log(_SIZES))
    prior = PRIOR_FAULTY * OTHER
    log_odds = math.log(prior / (1.0 - prior)) + there - healthy
    present = 1.0 / (1.0 + math.exp(-min(log_odds, 700.0)))
    share = 1.0 / (1.0 + SHARE * len(_ALIKE.get(cause.kind, ())))
    return Sign(replace(cause, probability=share * present), present, tuple(moves), text)


def likely_signs(signs: Sequence[Sign]) -> list[Sign]:
    """Return those that are likelier there than not; the others leave all to the candidates."""
    return [sign for sign in signs if sign.present > 0.5]


def joined_signs(
    logs: Sequence[Log], signs: Sequence[Sign], rate: float, remaining: Diagnosis | None
) -> Diagnosis:
    """Return the answer of signs and of what the posterior says of all that they leave alone.

    Parameters
    ----------
    logs : sequence of Log
        That were diagnosed.
    signs : sequence of Sign
        At least one.
    rate : float
        Of false alarms that was asked for.
    remaining : Diagnosis or None
        By features that no sign moves; None where none is left.
    """
    named = math.prod(sign.cause.probability for sign in signs)
    absent = math.prod(1.0 - sign.present for sign in signs)
    alike = 1.0 - absent - named
    keys = tuple(sign.key for sign in signs)
    units = {sign.key: sign.cause.unit for sign in signs}
    suspected = tuple(_suspected(sign.cause) for sign in signs)
    causes = tuple(sign.cause for sign in signs)
    findings = _findings(signs)
    if remaining is None:
        return Diagnosis(
            logs=tuple(log.name for log in logs), status="faulty", p_fault=1.0 - absent,
            false_alarm=rate, chance=absent, faults=causes, best=keys, p_best=named,
            unobservable=(), detectable={}, features=(), findings=findings, seconds=0.0,
            hypotheses=(Explanation(suspected, named),), severity_units=units, p_other=alike,
        )  # fmt: skip
    clear = remaining.status in ("healthy", "faulty")
    left = () if clear else (f"of what is left, {remaining.headline}",)
    sets = [(named, suspected, h) for h in remaining.hypotheses]
    sets += [(absent, (), h) for h in remaining.hypotheses]
    every = [Explanation((*some, *h.faults), p * h.probability) for p, some, h in sets]
    likely = [h for h in every if h.probability >= POSSIBLE]
    return replace(
        remaining,
        status="faulty",
        p_fault=1.0 - absent * (1.0 - remaining.p_fault),
        chance=min(absent, remaining.chance),
        faults=(*causes, *remaining.faults),
        best=(*keys, *remaining.best),
        p_best=named * (remaining.p_best if clear else 1.0),
        p_other=1.0 - (1.0 - alike) * (1.0 - remaining.p_other),
        findings=(*findings, *left, *remaining.findings),
        hypotheses=tuple(sorted(likely, key=lambda h: -h.probability)),
        severity_units={**units, **remaining.severity_units},
        would_be_seen={},
        reason=None,
    )


def _suspected(cause: Cause) -> SuspectedFault:
    return SuspectedFault(cause.kind, cause.place, cause.severity, cause.unit, cause.interval)


def _findings(signs: Sequence[Sign]) -> tuple[str, ...]:
    """Say what signs stand on, and what looks like them."""
    texts = list(dict.fromkeys(sign.text for sign in signs))
    for sign in signs:
        if sign.alike and sign.present - sign.cause.probability > _UNSURE:
            names = " or ".join((sign.key, *sign.alike))
            texts.append(f"{names}: these logs do not tell for sure")
    return tuple(texts)
