"""What an answer says beside its most probable set: causes, ambiguous ones, limits, what moved."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import (
    SEEN,
    Alternative,
    Cause,
    Explanation,
    FaultPlace,
    Moved,
    Reason,
    SuspectedFault,
)
from elevon.diagnose.engine.candidates import CandidateFault
from elevon.diagnose.engine.case import Detector, Faults, JoinedLogs, LogCase, allowed
from elevon.diagnose.engine.likelihood import stray_of
from elevon.diagnose.engine.posterior import Posterior, marginals, quantiles

LISTED = 0.02  # probability below which a cause is not listed
POSSIBLE = 1e-3  # probability below which a set of faults is not listed
REFUTED = 5.0  # deviations that faults leave of one feature: such faults are not named. ASSUMED
UNLIKELY = 1e-3  # chance of what the named faults leave below which that is a finding
_NINE_OF_TEN = 1.2816  # deviations that a standard normal number stays below in nine of ten
_STEPS, _FINER = 100, 20  # severities over the range, and between two of them
_POINTS = 201  # severities of another fault that are held against a cause
_FURTHEST = 40.0  # deviations up to which a change of one feature is tried
_FEW = 3  # features whose smallest visible change is told


#: The finding of a faulty unit with a fault that is not among the candidates.
NO_CANDIDATE = "no candidate explains these logs, nor is this the healthy unit"


def unexplained(logs: JoinedLogs, faults: Faults) -> tuple[str, ...]:
    """Return the finding that the named faults do not explain the logs, where they do not.

    What the model does not know of their shifts counts as explained.
    """
    from scipy.stats import f as fisher

    left, wide = _left(logs, faults)
    square = float(left @ np.linalg.solve(wide, left)) / len(left)
    if float(fisher.sf(square, len(left), logs.degrees)) > UNLIKELY:
        return ()
    return (
        "what is named does not explain all of the logs: another fault, or an actuator file not "
        f"calibrated to this unit (rest {np.sqrt(square):.1f} deviations RMS)",
    )


def refuting(logs: JoinedLogs, faults: Faults) -> Reason | None:
    """Return the feature that contradicts faults most, if one does by `REFUTED` deviations.

    A stray of the faults' shift (`likelihood.STRAY`) contradicts nothing.
    """
    left, wide = _left(logs, faults)
    shifts = [logs.shift_at(c.key, severity) for c, severity in faults]
    std = np.hypot(np.sqrt(np.diag(wide)), stray_of(logs.covariance, shifts))
    k = int(np.argmax(np.abs(left) / std))
    if abs(left[k]) < REFUTED * std[k]:
        return _implausible(logs, faults)
    values = np.concatenate([case.features.values for case in logs.cases])
    limit = values[k] - left[k] + REFUTED * np.sign(left[k]) * std[k]
    name = [name for case in logs.cases for name in case.unit.names][k]
    return Reason(name, float(values[k]), float(limit))


def _implausible(logs: JoinedLogs, faults: Faults) -> Reason | None:
    """Return what faults are not looked for by and leave more than `REFUTED` deviations of."""
    if all(np.abs(case.plausible.score).max(initial=0.0) < REFUTED for case in logs.cases):
        return None
    wide = np.hypot(1.0, allowed(logs, [faults], [True])[0][0])
    at = 0
    for case in logs.cases:
        plausible = case.plausible
        loose = wide[at : at + len(plausible.names)]
        score = np.abs(plausible.score) / loose
        at += len(loose)
        if len(score) and score.max() >= REFUTED:
            k = int(np.argmax(score))
            limit = (
                plausible.mean[k]
                + REFUTED * loose[k] * np.sign(plausible.score[k]) * plausible.std[k]
            )
            return Reason(plausible.names[k], float(plausible.values[k]), float(limit))
    return None


def causes(
    result: Posterior,
    logs: JoinedLogs,
    candidates: Sequence[CandidateFault],
    best: Sequence[str],
) -> tuple[Cause, ...]:
    """Return one cause for each fault of the best set, and for others of some probability."""
    ranked = sorted(candidates, key=lambda c: (c.key not in best, -result.of(c.key)))
    out: list[Cause] = []
    covered: set[str] = set()
    for c in ranked:
        probability = result.of(c.key)
        if c.key in covered or (probability < LISTED and c.key not in best):
            continue
        low, middle, high = _ends(c, *marginals(result, c.key))
        ambiguous = [o for o in _ambiguous(logs, c, middle, candidates) if o.key not in best]
        covered |= {o.key for o in ambiguous}
        probability = min(probability + sum(result.of(o.key) for o in ambiguous), 1.0)
        names = [(c.kind, place) for place in c.same] + list(c.ambiguous)
        names += [
            n for o in ambiguous for n in (*((o.kind, p) for p in (o.place, *o.same)), *o.ambiguous)
        ]
        places = tuple(FaultPlace(*name) for name in names)
        out.append(Cause(c.kind, c.place, c.unit, probability, middle, (low, high), places))
    return tuple(sorted(out, key=lambda cause: -cause.probability))


def _ends(c: CandidateFault, grid: Floats, weight: Floats) -> tuple[float, float, float]:
    """Ends and middle of a severity's interval of 90 %: low, middle, high."""
    ends = quantiles(grid, weight, (0.05, 0.5, 0.95))
    if c.whole:  # counted, or there or not
        ends = [max(float(round(x)), 1.0) for x in ends]
    return ends[0], ends[1], ends[2]


def _left(logs: JoinedLogs, faults: Faults) -> tuple[Floats, Floats]:
    """Return what faults leave of the features, and its covariance with their model errors."""
    left, wide = logs.residual, logs.covariance
    for c, severity in faults:
        left = left - logs.shift_at(c.key, severity)
        wide = wide + logs.error_of(c, severity)
    return left, wide


def alternatives(
    result: Posterior,
    logs: JoinedLogs,
    candidates: Sequence[CandidateFault],
    best: Sequence[str],
) -> tuple[Alternative, ...]:
    """Return the healthy unit and the single faults that are not the answer, likely ones first."""
    known = {c.key: c for c in candidates}
    places = [(case.name, name) for case in logs.cases for name in case.unit.names]
    out = []
    for h, p in zip(result.hypotheses, result.probabilities, strict=True):
        if len(h.keys) > 1 or h.keys == tuple(best):
            continue
        faults = [(known[key], value) for key, value in zip(h.keys, h.best, strict=True)]
        left, wide = _left(logs, faults)
        score = left / np.sqrt(np.diag(wide))
        worst = int(np.argmax(np.abs(score)))
        key, severity = (h.keys[0], h.best[0]) if h.keys else ("", None)
        unit = known[key].unit if key else ""
        out.append(Alternative(key, p, severity, unit, *places[worst], float(score[worst])))
    return tuple(out)


def explanations(
    result: Posterior, candidates: Sequence[CandidateFault]
) -> tuple[Explanation, ...]:
    """Return the sets of faults that are still possible."""
    known = {c.key: c for c in candidates}
    out = []
    for h, p in zip(result.hypotheses, result.probabilities, strict=True):
        if p < POSSIBLE:
            continue
        ends = [_ends(known[k], g, w) for k, g, w in zip(h.keys, h.grids, h.weights, strict=True)]
        faults = (
            SuspectedFault(known[k].kind, known[k].place, middle, known[k].unit, (low, high))
            for k, (low, middle, high) in zip(h.keys, ends, strict=True)
        )
        out.append(Explanation(tuple(faults), p))
    return tuple(out)


def _ambiguous(
    logs: JoinedLogs,
    candidate: CandidateFault,
    severity: float,
    candidates: Sequence[CandidateFault],
) -> list[CandidateFault]:
    """Candidates that at some severity shift the features as this one does at this severity.

    What a fault does is known to the model's error only: within that error of each other's shift no
    log separates two faults. One that moves nothing to speak of is like no other.
    """
    shift = logs.shift_at(candidate.key, severity)
    square = float(shift @ np.linalg.solve(logs.covariance, shift))
    alike = max(case.model.alike for case in logs.cases)
    if square < alike**2:
        return []
    loose = logs.covariance + logs.error_of(candidate, severity)
    root = np.linalg.inv(np.linalg.cholesky(loose))
    out = []
    for other in candidates:
        if other.key == candidate.key:
            continue
        grid = other.range(_POINTS)
        if not other.counted:
            grid = np.sort(np.concatenate((grid, 0.05 * grid)))
        apart = (logs.shift(other.key, grid) - shift) @ root.T
        if float(np.linalg.norm(apart, axis=1).min()) < alike:
            out.append(other)
    return out


def limits(
    logs: JoinedLogs, candidates: Sequence[CandidateFault]
) -> tuple[tuple[dict[str, str], ...], dict[str, float]]:
    """Return what the logs cannot show, and the least severity of what they can."""
    blind, limits = [], {}
    for c in candidates:
        least = _least_seen(logs, c)
        if least is not None:
            limits[c.key] = least
            continue
        reason = (
            f"up to {c.high:g} {c.unit if c.unit != '1' else ''}".rstrip()
            + f" it moves nothing here by {SEEN:g} deviations of a healthy unit"
        )
        names = ((c.kind, c.place), *c.ambiguous)
        blind += [{"kind": kind, "place": place, "reason": reason} for kind, place in names]
    return tuple(blind), limits


def _least_seen(logs: JoinedLogs, c: CandidateFault) -> float | None:
    """Return the least severity that moves the features by `SEEN`, by a grid and one within it."""
    grid = np.linspace(0.0, c.high, _STEPS + 1)
    for _ in range(2):
        size = np.linalg.norm(logs.shift(c.key, grid) @ logs.root.T, axis=1)
        seen = np.flatnonzero(size > SEEN)
        if not seen.size:
            return None
        k = int(seen[0])
        least = float(np.ceil(grid[k])) if c.counted else float(grid[k])
        grid = np.linspace(grid[max(k - 1, 0)], least, _FINER + 1)
    return least


def would_be_seen(
    logs: JoinedLogs,
    candidates: Sequence[CandidateFault],
    detector: Detector,
    threshold: float,
) -> dict[str, float]:
    """Return the severity from which on each candidate raises an alarm in nine of ten logs.

    What is below the threshold even at the largest severity is left out.

    Parameters
    ----------
    logs : JoinedLogs
        The logs.
    candidates : sequence of CandidateFault
        Faults.
    detector : Detector
        The test.
    threshold : float
        Its score from which on logs are called faulty.

    Returns
    -------
    dict of str to float
        ``KIND@PLACE`` to severity, the most frequent fault first.
    """
    out = {}
    for c in sorted(candidates, key=lambda c: -c.rate):
        grid = c.range(_STEPS + 1) if c.counted else np.linspace(0.0, c.high, _STEPS + 1)
        first = _first_seen(logs.shift(c.key, grid) @ logs.root.T, detector, threshold)
        if first < len(grid):
            out[c.key] = float(grid[first])
    return out


def _first_seen(moved_by: Floats, detector: Detector, threshold: float) -> int:
    """Return from which of whitened shifts, shape (m, k), on logs are called faulty.

    A log's noise shortens the shift of one in ten by `_NINE_OF_TEN` deviations or more.
    """
    size = np.linalg.norm(moved_by, axis=1)
    shorter = np.maximum(1.0 - _NINE_OF_TEN / np.maximum(size, _NINE_OF_TEN), 0.0)
    unseen = np.flatnonzero(detector.score(moved_by * shorter[:, None]) <= threshold)
    return int(unseen[-1]) + 1 if unseen.size else 0


def changes_seen(logs: JoinedLogs, detector: Detector, threshold: float) -> tuple[str, ...]:
    """Return the finding from which change on single features would raise an alarm.

    Of a unit that the model does not show; the features that show the smallest change, as a share.
    """
    steps = np.linspace(0.0, _FURTHEST, _STEPS + 1)
    mean = np.concatenate([case.unit.mean for case in logs.cases])
    names = [name for case in logs.cases for name in case.unit.names]
    shares: dict[str, float] = {}
    for k, std in enumerate(np.sqrt(np.diag(logs.covariance)).tolist()):
        first = _first_seen(np.outer(steps * std, logs.root[:, k]), detector, threshold)
        if first <= _STEPS and mean[k]:
            shares[names[k]] = float(steps[first]) * std / abs(float(mean[k]))
    best = sorted(shares, key=lambda name: shares[name])[:_FEW]
    listed = ", ".join(f"{name} from {100.0 * shares[name]:.2g} %" for name in best)
    return (f"a change of one feature would be seen: {listed}",) if best else ()


def moved(cases: Sequence[LogCase], faults: Faults) -> tuple[Moved, ...]:
    """Return the features with what the named faults make of it."""
    out = []
    for case in cases:
        std = np.sqrt(np.diag(case.covariance))
        explained = np.zeros(len(std))
        for c, severity in faults:
            explained = explained + case.shift(c.key, np.array([severity]))[0]
        for k, name in enumerate(case.unit.names):
            out.append(
                Moved(
                    case.name,
                    name,
                    case.model.table[name].unit,
                    float(case.features.values[k]),
                    float(case.unit.mean[k]),
                    float(std[k]),
                    float(explained[k]),
                )
            )
        out += _moved_plausibility(case)
    return tuple(out)


def _moved_plausibility(case: LogCase) -> list[Moved]:
    """What no candidate moves and has moved."""
    plausible = case.plausible
    rows = zip(
        plausible.names,
        plausible.units,
        plausible.values,
        plausible.mean,
        plausible.std,
        strict=True,
    )
    return [
        Moved(case.name, name, unit, float(value), float(mean), float(std), 0.0)
        for name, unit, value, mean, std in rows
        if abs(value - mean) > SEEN * std
    ]
