"""Diagnosis of logs of one unit by the model."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.diagnose.bymodel.answer import SEEN, Cause, Diagnosis, Moved
from elevon.diagnose.bymodel.candidates import Candidate, chosen
from elevon.diagnose.bymodel.detection import Detector
from elevon.diagnose.bymodel.evidence import UNITS, Evidence
from elevon.diagnose.bymodel.healthy import Healthy, healthy
from elevon.diagnose.bymodel.log import TestLog, prepared
from elevon.diagnose.bymodel.posterior import Posterior, marginals, posterior, quantiles
from elevon.diagnose.bymodel.replay import Replay, logged_evidence, replay
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["diagnose"]

Floats = npt.NDArray[np.float64]
LISTED = 0.02  # probability below which a cause is not listed
ALIKE = 1.0  # deviations between two faults' shifts below which no log separates them
SUSPECT = 1e-3  # chance of a baseline below which it is called faulty
_SAME = 0.2  # relative difference of two logs' motion up to which they are one test


@dataclass(frozen=True)
class _Case:
    """One log against its healthy unit, before whitening."""

    name: str
    shown: Evidence
    unit: Healthy
    model: Replay

    @property
    def covariance(self) -> Floats:
        return self.unit.covariance + np.diag(self.shown.std**2)

    def shift(self, key: str, severity: Floats) -> Floats:
        at = [self.model.healthy.names.index(n) for n in self.unit.names]
        return self.model.shift(key, severity)[:, at]


def diagnose(
    logs: Sequence[TestLog],
    actuator: Actuator,
    *,
    baselines: Sequence[TestLog] = (),
    faults: Sequence[str] | None = None,
    false_alarm: float = 0.05,
) -> Diagnosis:
    """Say what is wrong with the unit that wrote the logs.

    Parameters
    ----------
    logs : sequence of TestLog
        Of one unit in one condition.
    actuator : Actuator
        The healthy unit, calibrated.
    baselines : sequence of TestLog
        Of the healthy unit; those of the same test serve.
    faults : sequence of str, optional
        ``KIND@PLACE`` of the candidates; default: all that are weighed.
    false_alarm : float
        Rate at which a healthy unit may be called faulty.

    Raises
    ------
    InputError
        A log that cannot be diagnosed, no candidate, a rate outside 0 to 1.
    """
    begin = clock.perf_counter()
    if not logs:
        raise InputError("diagnosis needs at least one log")
    if not 0.0 < false_alarm < 1.0:
        raise InputError(f"false-alarm rate {false_alarm:g} must be between 0 and 1")
    if actuator.wiring != "rotary":
        raise InputError(
            f"{actuator.name}: diagnosis by the model serves the wiring 'rotary' so far, "
            f"not {actuator.wiring!r}"
        )
    candidates = chosen(faults)
    findings: list[str] = []
    healthy_logs = [prepared(item, actuator) for item in baselines]
    cases = [
        _case(prepared(item, actuator), actuator, candidates, healthy_logs, findings)
        for item in logs
    ]
    return _answer(cases, candidates, false_alarm, findings, begin)


#: Evidence that only a measured torque current gives.
_OF_THE_CURRENT = frozenset(
    [
        "dry_current",
        "viscous_current",
        "inertia_current",
        "brake_current",
        "current_order_1",
        "current_order_2",
        "voltage_per_current",
    ]
)


def _case(
    item: TestLog,
    actuator: Actuator,
    candidates: Sequence[Candidate],
    baselines: Sequence[TestLog],
    findings: list[str],
) -> _Case:
    shown = logged_evidence(item, actuator)
    model = replay(item, actuator, candidates)
    names = [n for n in shown.names if n in model.healthy.names]
    same = [b for b in baselines if _same_test(item, b)]
    proofs = [(b.name, logged_evidence(b, actuator)) for b in same]
    names = [n for n in names if all(n in e.names for _, e in proofs)]
    if any(log.log.current_signal == "current_ref" for log in (item, *same)):
        # A set point has the derivative's spikes, which the motor's current never follows.
        names = [n for n in names if n not in _OF_THE_CURRENT]
    sound = _sound(model, names, proofs, candidates, findings)
    unit = healthy(model, names, sound)
    _lost(item, same, findings)
    return _Case(item.name, shown.only(names), unit, model)


def _lost(item: TestLog, same: Sequence[TestLog], findings: list[str]) -> None:
    """Say what a log lacks and what it costs."""
    if not same:
        findings.append(
            f"{item.name}: no baseline of this test: how far a healthy unit stands off the model "
            "is assumed, small faults are not seen"
        )
    if item.log.current_signal == "current_ref":
        findings.append(
            f"{item.name}: no measured torque current (r78): friction, current ripple and faults "
            "of the drive's current loop and of current sensors are not seen"
        )
    if item.voltage is None:
        findings.append(
            f"{item.name}: no voltage (r1733): shorts, eccentricity and lost flux are judged by "
            "the current's ripple alone"
        )
    if item.gain is None:
        findings.append(
            f"{item.name}: no waveform explains the command: drift of the position gain is not seen"
        )
    missing = 1.0 - float(np.mean(item.log.good))
    if missing > 0.01:
        findings.append(f"{item.name}: {100 * missing:.0f} % of the samples are missing; left out")


def _same_test(a: TestLog, b: TestLog) -> bool:
    """Whether two logs are of one test: brake, travel and speed alike."""
    if a.braked != b.braked:
        return False
    pairs = []
    for item in (a, b):
        assert item.log.user is not None
        pairs.append((float(np.std(item.log.user)), float(np.sqrt(np.mean(item.log.speed**2)))))
    return all(abs(x / y - 1.0) < _SAME for x, y in zip(*pairs, strict=True))


def _sound(
    model: Replay,
    names: Sequence[str],
    proofs: Sequence[tuple[str, Evidence]],
    candidates: Sequence[Candidate],
    findings: list[str],
) -> list[Evidence]:
    """Leave out baselines that stand off the model and off the other baselines alike."""
    kept = []
    for k, (name, shown) in enumerate(proofs):
        others = [e for j, (_, e) in enumerate(proofs) if j != k]
        alone = _chance(model, names, shown, [], candidates)
        beside = _chance(model, names, shown, others, candidates) if others else alone
        if max(alone, beside) < SUSPECT:
            findings.append(
                f"baseline {name} looks faulty itself, or {'' if others else 'the set is not '}"
                f"{'unlike the other baselines' if others else 'calibrated to this unit'} "
                f"(a healthy unit deviates as much in less than {100 * SUSPECT:g} % of logs); "
                "it is left out"
            )
        else:
            kept.append(shown)
    return kept


def _chance(
    model: Replay,
    names: Sequence[str],
    shown: Evidence,
    others: Sequence[Evidence],
    candidates: Sequence[Candidate],
) -> float:
    case = _Case("", shown.only(names), healthy(model, names, others), model)
    rest, root, detector = _detector([case], candidates)
    return detector.chance(float(detector.ratio((root @ rest)[None, :])[0]))


def _detector(
    cases: Sequence[_Case], candidates: Sequence[Candidate]
) -> tuple[Floats, Floats, Detector]:
    rest, covariance = _joined(cases)
    root = np.linalg.inv(np.linalg.cholesky(covariance))
    rows, both = [], []
    for c in candidates:
        at = cases[0].model.severities[c.key]
        rows.append(_shift(cases, c.key, at[at != 0.0]) @ root.T)
        both += [False] * int((at != 0.0).sum())
    degrees = min(case.unit.degrees for case in cases)
    return rest, root, Detector(np.vstack(rows), both, degrees)


def _joined(cases: Sequence[_Case]) -> tuple[Floats, Floats]:
    """Stack the logs; what changes from run to run is independent between them."""
    from scipy.linalg import block_diag

    rest = np.concatenate([case.shown.values - case.unit.mean for case in cases])
    return rest, np.asarray(block_diag(*[case.covariance for case in cases]))


def _shift(cases: Sequence[_Case], key: str, severity: Floats) -> Floats:
    return np.hstack([case.shift(key, severity) for case in cases])


def _answer(
    cases: Sequence[_Case],
    candidates: Sequence[Candidate],
    rate: float,
    findings: list[str],
    begin: float,
) -> Diagnosis:
    rest, root, detector = _detector(cases, candidates)
    ratio = float(detector.ratio((root @ rest)[None, :])[0])
    _, covariance = _joined(cases)
    degrees = min(case.unit.degrees for case in cases)
    result = posterior(rest, covariance, degrees, candidates, lambda k, s: _shift(cases, k, s))
    faulty = ratio > detector.threshold(rate)
    best = next(h for h in result.hypotheses if bool(h.keys) or not faulty)
    blind, limits = _limits(cases, candidates, root)
    moved = _moved(cases, best.keys, best.best)
    return Diagnosis(
        logs=tuple(case.name for case in cases),
        status="faulty" if faulty else "healthy",
        p_fault=result.faulty,
        false_alarm=rate,
        chance=detector.chance(ratio),
        faults=_causes(result, cases, candidates, root, best.keys),
        best=best.keys,
        p_best=result.probabilities[result.hypotheses.index(best)],
        unobservable=blind,
        detectable=limits,
        moved=moved,
        findings=(*findings, *_unexplained(root, rest, cases, best.keys, best.best)),
        seconds=clock.perf_counter() - begin,
    )


def _unexplained(
    root: Floats,
    rest: Floats,
    cases: Sequence[_Case],
    keys: Sequence[str],
    values: Sequence[float],
) -> tuple[str, ...]:
    from scipy.stats import f as fisher

    left = rest - _sum(cases, keys, values)
    degrees = min(case.unit.degrees for case in cases)
    square = float(np.sum((root @ left) ** 2)) / len(rest)
    chance = float(fisher.sf(square, len(rest), degrees))
    if chance > 1e-3:
        return ()
    return (
        "what is named does not explain all of the logs: another fault, or a set that is not "
        f"calibrated to this unit (rest {np.sqrt(square):.1f} deviations RMS)",
    )


def _sum(cases: Sequence[_Case], keys: Sequence[str], values: Sequence[float]) -> Floats:
    total = np.zeros(sum(len(case.unit.names) for case in cases))
    for key, value in zip(keys, values, strict=True):
        total = total + _shift(cases, key, np.array([value]))[0]
    return total


def _causes(
    result: Posterior,
    cases: Sequence[_Case],
    candidates: Sequence[Candidate],
    root: Floats,
    best: Sequence[str],
) -> tuple[Cause, ...]:
    ranked = sorted(candidates, key=lambda c: (c.key not in best, -result.of(c.key)))
    out: list[Cause] = []
    covered: set[str] = set()
    for c in ranked:
        probability = result.of(c.key)
        if c.key in covered or (probability < LISTED and c.key not in best):
            continue
        low, middle, high = quantiles(*marginals(result, c.key), (0.05, 0.5, 0.95))
        alike = [o for o in _alike(cases, c, middle, candidates, root) if o.key not in best]
        covered |= {o.key for o in alike}
        probability = min(probability + sum(result.of(o.key) for o in alike), 1.0)
        names = [(c.kind, place) for place in c.same]
        names += [(o.kind, p) for o in alike for p in (o.place, *o.same)]
        out.append(Cause(c.kind, c.place, c.unit, probability, middle, (low, high), tuple(names)))
    return tuple(sorted(out, key=lambda cause: -cause.probability))


def _alike(
    cases: Sequence[_Case],
    candidate: Candidate,
    severity: float,
    candidates: Sequence[Candidate],
    root: Floats,
) -> list[Candidate]:
    """Candidates that shift the evidence as this one does at this severity, to `ALIKE`."""
    own = root @ _shift(cases, candidate.key, np.array([severity]))[0]
    if np.linalg.norm(own) < SEEN:
        return []
    out = []
    for other in candidates:
        if other.key == candidate.key:
            continue
        grid = np.linspace(other.low, other.high, 401)
        moved = _shift(cases, other.key, grid) @ root.T
        if float(np.linalg.norm(moved - own, axis=1).min()) < ALIKE:
            out.append(other)
    return out


def _limits(
    cases: Sequence[_Case], candidates: Sequence[Candidate], root: Floats
) -> tuple[tuple[dict[str, str], ...], dict[str, float]]:
    blind, limits = [], {}
    for c in candidates:
        grid = np.linspace(0.0, c.high, 2001)
        size = np.linalg.norm(_shift(cases, c.key, grid) @ root.T, axis=1)
        seen = np.flatnonzero(size > SEEN)
        if seen.size:
            limits[c.key] = float(grid[seen[0]])
            continue
        reason = (
            f"up to {c.high:g} {c.unit if c.unit != '1' else ''}".rstrip()
            + f" it moves nothing here by {SEEN:g} deviations of a healthy unit"
        )
        blind.append({"kind": c.kind, "place": c.place, "reason": reason})
    return tuple(blind), limits


def _moved(
    cases: Sequence[_Case], keys: Sequence[str], values: Sequence[float]
) -> tuple[Moved, ...]:
    out = []
    for case in cases:
        std = np.sqrt(np.diag(case.covariance))
        explained = _sum([case], keys, values)
        for k, name in enumerate(case.unit.names):
            out.append(
                Moved(
                    case.name,
                    name,
                    UNITS[name][0],
                    float(case.shown.values[k]),
                    float(case.unit.mean[k]),
                    float(std[k]),
                    float(explained[k]),
                )
            )
    return tuple(out)
