"""Causes that are no candidates and leave what a candidate leaves: their part of its probability.

A log shows the lost motion, not whether it is backlash or the wind-up of a soft part. Over a short
stroke an error once a turn of a gear is a straight line, as a sensor's gain is; and friction of
another law than the model's is friction. What tells the two apart counts where the log shows it;
where it does not, the candidate shares its probability with what is none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.diagnose.engine.posterior import Posterior

if TYPE_CHECKING:
    from elevon.diagnose.engine.candidates import CandidateFault
    from elevon.diagnose.engine.case import LogCase

#: How often such a cause comes, over how often the candidate does. ASSUMED: no table has them;
#: workshops find worn flanks and sensors more often than loose hubs and eccentric wheels.
SHARE = 0.2
_WORTH = 0.05  # probability of a candidate from which on its lookalike is a finding
_UNSURE = 0.5  # of what a lookalike moves: its phase and its shape are not known. ASSUMED
_WIDE = (3.0, 10.0, 30.0)  # deviations by which one of another law moves what tells it. ASSUMED


@dataclass(frozen=True)
class Lookalike:
    """What looks like a candidate.

    Attributes
    ----------
    text : str
        In words.
    tells : str
        Plausibility feature that tells it from the candidate.
    scaled : bool
        Whether the candidate scales that feature; else it may move it by its share, either way.
    """

    text: str
    tells: str = ""
    scaled: bool = False


_ONCE_A_TURN = Lookalike("an error of gear or sensor once a turn", "position_cubic")
_WIND_UP = Lookalike("wind-up of a soft part under the friction behind it")
#: By kind of a fault, or ``KIND@PLACE``.
LOOKALIKES = {
    "backlash": _WIND_UP,
    "adapter_gap": _WIND_UP,
    "gain@sensor.encoder": _ONCE_A_TURN,
    "gain@sensor.resolver": _ONCE_A_TURN,
    "friction": Lookalike("friction that changes with speed or load", "creeping_current", True),
    "gain_drift@control.speed": Lookalike(
        "another integral time of the speed controller", "integral_rate"
    ),
}


def lookalike_of(c: CandidateFault) -> Lookalike | None:
    """Return what looks like a candidate, if anything does."""
    return LOOKALIKES.get(c.key, LOOKALIKES.get(c.kind))


def share_lookalikes(
    cases: Sequence[LogCase], candidates: Sequence[CandidateFault], result: Posterior
) -> Posterior:
    """Return the hypotheses with a part of their probability given to what looks like them."""
    known = {c.key: c for c in candidates}
    out, other = [], result.other
    for h, p in zip(result.hypotheses, result.probabilities, strict=True):
        odds = sum(
            _odds(cases, known[key], value) for key, value in zip(h.keys, h.best, strict=True)
        )
        out.append(p / (1.0 + odds))
        other += p - out[-1]
    order = sorted(range(len(out)), key=lambda k: -out[k])
    return replace(
        result,
        hypotheses=tuple(result.hypotheses[k] for k in order),
        probabilities=tuple(out[k] for k in order),
        other=other,
    )


def lookalike_findings(
    candidates: Sequence[CandidateFault], result: Posterior, named: Sequence[str]
) -> tuple[str, ...]:
    """Say what looks like the named faults, where the logs do not tell it from them."""
    out = []
    for c in candidates:
        like = lookalike_of(c)
        if like is not None and c.key in named and result.other >= _WORTH:
            out.append(f"{c.key} or {like.text}: these logs do not tell for sure")
    return tuple(out)


def _odds(cases: Sequence[LogCase], c: CandidateFault, severity: float) -> float:
    """Odds of the lookalike against the candidate, after what tells them apart."""
    like = lookalike_of(c)
    if like is None:
        return 0.0
    ratio = 1.0
    for case in cases:
        if like.tells in case.plausible.names:
            ratio *= _ratio(case, c, like, severity)
    return SHARE * ratio


def _ratio(case: LogCase, c: CandidateFault, like: Lookalike, severity: float) -> float:
    """Likelihood of what tells them under the lookalike over that under the candidate."""
    from scipy.stats import t as student

    name = like.tells
    k = case.plausible.names.index(name)
    score, std = float(case.plausible.score[k]), float(case.plausible.std[k])
    degrees = case.plausible.degrees
    if name in c.amplified:  # the other moves it anyhow
        shift = severity * float(case.plausible.mean[k]) / std
        off, wide = (score - shift, 1.0) if like.scaled else (score, float(np.hypot(1.0, shift)))
        density = student.pdf(off, degrees, scale=np.hypot(1.0, _WIDE))
        return float(np.mean(density) / student.pdf(off, degrees, scale=wide))
    moved = case.item.lookalike_moves(c.key, severity).get(name) if case.item is not None else None
    if moved is None:
        return 1.0
    wide = float(np.hypot(1.0, _UNSURE * moved / std))
    density = student.pdf(score - moved / std, degrees, scale=wide)
    return float(density / student.pdf(score, degrees))
