"""What the surrogate says of logs of one unit: presence, size, what moved, what lies outside."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import Moved
from elevon.diagnose.positions.features import FEATURES
from elevon.diagnose.surrogate.features import NAMES, SCALES, SurrogateFeatures, log_features
from elevon.diagnose.surrogate.model import Head, LogOpinion, Surrogate, TestModel, shipped
from elevon.diagnose.surrogate.population import FAULTS
from elevon.diagnose.surrogate.sampling import severities
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

PRESENT, FAULTY = 0.09, 0.63  # shares of trained runs: of each fault, and of any
SUSPECT = 0.01  # chance of a baseline below which it is called faulty


@dataclass(frozen=True)
class Proposal:
    """What the surrogate says of logs of one unit.

    Attributes
    ----------
    logs : tuple of str
        The logs.
    probability : dict of str to float
        Of each fault, by key.
    p_fault, chance : float
        Probability of any fault; how often a healthy unit looks as faulty.
    severity : dict of str to (float, float, float)
        Of each fault were it there: middle, ends of the 90 % interval.
    detectable : dict of str to float
        Severity from which on 95 % of held-out single faults were named.
    moved : tuple of Moved
        The features.
    outside, findings : tuple of str
        What lies outside the training set; what the caller should know.
    """

    logs: tuple[str, ...]
    probability: dict[str, float]
    p_fault: float
    chance: float
    severity: dict[str, tuple[float, float, float]]
    detectable: dict[str, float]
    moved: tuple[Moved, ...]
    outside: tuple[str, ...]
    findings: tuple[str, ...]


@dataclass(frozen=True)
class _Read:
    """One log with its head and baselines."""

    features: SurrogateFeatures
    head: Head
    baselines: list[Floats]
    opinion: LogOpinion
    doubted: tuple[SurrogateFeatures, ...] = ()


def proposed(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    baselines: Sequence[Log] = (),
    surrogate: Surrogate | None = None,
) -> Proposal:
    """Ask the surrogate; arguments and errors as `diagnose_by_surrogate`."""
    trained = surrogate or shipped()
    healthy = [log_features(item, actuator) for item in baselines]
    read = [_read(log_features(item, actuator), trained, healthy) for item in logs]
    logits = _joint([r.opinion.presence for r in read])
    faulty = float(_joint([np.array([r.opinion.faulty]) for r in read])[0])
    chance = 1.0 - (1.0 - min(r.opinion.chance for r in read)) ** len(read)
    sizes, reach = _sizes(read)
    ends = [severities(sizes + k * reach) for k in (0.0, -1.0, 1.0)]
    severity = {
        key: (float(ends[0][k]), float(ends[1][k]), float(ends[2][k]))
        for k, key in enumerate(FAULTS)
    }
    return Proposal(
        tuple(r.features.name for r in read),
        {key: _logistic(float(logits[k])) for k, key in enumerate(FAULTS)},
        _logistic(faulty),
        chance,
        severity,
        _detectable(read),
        tuple(m for r in read for m in _moved(r)),
        tuple(f"{r.features.name}: {text}" for r in read for text in r.opinion.outside),
        tuple(text for r in read for text in _findings(r)),
    )


def _read(
    features: SurrogateFeatures, trained: Surrogate, healthy: Sequence[SurrogateFeatures]
) -> _Read:
    name = trained.test_of(features)
    if name is None:
        raise InputError(
            f"{features.name}: the surrogate was not trained on such a test (travel "
            f"{math.degrees(features.travel):.3g} deg, motor {features.speed:.3g} rad/s, brake "
            f"{'on' if features.braked else 'off'}); it knows {', '.join(trained.tests)}; "
            "--method model serves any test"
        )
    test = trained.tests[name]
    same = [b for b in healthy if test.matches(b)]
    doubted = _doubted(test, same)
    baselines = [b.values for b in same if b not in doubted or len(doubted) == len(same)]
    head = test.heads["relative" if baselines else "absolute"]
    return _Read(features, head, baselines, head.says(features.values, baselines), tuple(doubted))


def _doubted(test: TestModel, same: Sequence[SurrogateFeatures]) -> list[SurrogateFeatures]:
    """Return baselines that look faulty: against the others, or, alone, against all units."""
    out = []
    for item in same:
        others = [b.values for b in same if b is not item]
        opinion = test.heads["relative" if others else "absolute"].says(item.values, others)
        if opinion.chance < SUSPECT and (opinion.presence > 0.0).any():
            out.append(item)
    if len(out) > 1 and len(out) == len(same):
        # They contradict each other: those that all units make less likely are doubted.
        alone = [test.heads["absolute"].says(b.values, []).faulty for b in out]
        out = [b for b, faulty in zip(out, alone, strict=True) if faulty > min(alone)]
    return out


def _findings(read: _Read) -> list[str]:
    out = []
    if not read.baselines:
        out.append(
            f"{read.features.name}: no baseline of this test: held against all units that were "
            "trained; small faults are not seen"
        )
    for item in read.doubted:
        alone = any(item.values is b for b in read.baselines)
        used = "it is used, there is no other" if alone else "it is left out"
        out.append(
            f"baseline {item.name} looks faulty itself (a healthy unit does in less than "
            f"{100 * SUSPECT:g} % of logs); {used}"
        )
    return out


def _joint(logits: Sequence[Floats]) -> Floats:
    """Join logs of one unit: they differ from day to day by themselves."""
    prior = _logit(PRESENT if len(logits[0]) > 1 else FAULTY)
    return np.asarray(np.sum(logits, axis=0) - (len(logits) - 1) * prior)


def _sizes(read: Sequence[_Read]) -> tuple[Floats, Floats]:
    """Weigh the logs' sizes by their intervals."""
    weight = np.array([1.0 / r.opinion.reach**2 for r in read])
    size = (weight * np.array([r.opinion.size for r in read])).sum(axis=0) / weight.sum(axis=0)
    return size, 1.0 / np.sqrt(weight.sum(axis=0))


def _detectable(read: Sequence[_Read]) -> dict[str, float]:
    named = np.array([r.head.named for r in read])
    out = {}
    for k, key in enumerate(FAULTS):
        if np.isfinite(named[:, k]).any():
            out[key] = float(np.nanmin(named[:, k]))
    return out


def _moved(read: _Read) -> list[Moved]:
    view, features = read.head.view, read.features
    healthy = np.mean(read.baselines, axis=0) if read.baselines else view.centre
    share = np.array([name in SCALES for name in NAMES])
    size = np.where(share, np.maximum(np.abs(healthy), view.floor), 1.0)
    return [
        Moved(
            features.name, name, FEATURES[name].unit, float(features.values[k]), float(healthy[k]),
            float(view.spread[k] * size[k]), math.nan,
        )
        for k, name in enumerate(NAMES)
        if math.isfinite(features.values[k]) and math.isfinite(healthy[k])
    ]  # fmt: skip


def _logistic(logit: float) -> float:
    return 0.5 * (1.0 + math.tanh(0.5 * logit))


def _logit(share: float) -> float:
    return math.log(share / (1.0 - share))
