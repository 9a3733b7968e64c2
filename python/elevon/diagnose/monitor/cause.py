"""Which fault a change looks like, and how far it has gone: single faults on fine grids."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import SEEN, Cause, FaultPlace
from elevon.diagnose.engine.candidates import CandidateFault
from elevon.diagnose.engine.likelihood import prior_density
from elevon.diagnose.engine.posterior import quantiles
from elevon.diagnose.monitor.filter import Change
from elevon.diagnose.monitor.reference import WindowReference

LISTED = 0.02
_POINTS = 81
_ZOOMS = 5
_DEEP = 14.0  # of the log likelihood below its top that a grid covers


def likely_causes(
    change: Change, reference: WindowReference, candidates: Sequence[CandidateFault]
) -> tuple[Cause, ...]:
    """Return single faults with their probability, given that one of them has begun."""
    seen = [c for c in candidates if _seen(change, reference, c)] or list(candidates)
    lines = [_line(change, reference, c) for c in seen]
    top = max(float(log.max()) for _, log in lines)
    mass = [
        c.rate * np.exp(log - top) * prior_density(c, grid) * np.gradient(grid)
        for c, (grid, log) in zip(seen, lines, strict=True)
    ]
    total = sum(float(m.sum()) for m in mass)
    out = []
    for c, (grid, _), weights in zip(seen, lines, mass, strict=True):
        probability = float(weights.sum()) / total
        if probability < LISTED:
            continue
        low, middle, high = quantiles(grid, weights / weights.sum(), (0.05, 0.5, 0.95))
        alike = tuple(FaultPlace(c.kind, place) for place in c.same)
        out.append(Cause(c.kind, c.place, c.unit, probability, middle, (low, high), alike))
    return tuple(sorted(out, key=lambda cause: -cause.probability))


def _seen(change: Change, reference: WindowReference, c: CandidateFault) -> bool:
    """Whether some severity would show in the windows since the change."""
    shift = reference.shift(c.key, np.array([c.low, c.high]))
    size = np.einsum("mk,kl,ml->m", shift, change.information, shift)
    return bool(size.max() > SEEN**2)


def _line(change: Change, reference: WindowReference, c: CandidateFault) -> tuple[Floats, Floats]:
    """Severities, dense where they are likely, and their log likelihood ratio."""
    low, high = c.low, c.high
    for _ in range(_ZOOMS):
        grid = np.linspace(low, high, _POINTS)
        log = _log_likelihood(change, reference, c, grid)
        inside = np.flatnonzero(log > log.max() - _DEEP)
        if len(inside) > _POINTS // 4:
            break
        low, high = grid[max(inside[0] - 1, 0)], grid[min(inside[-1] + 1, _POINTS - 1)]
    return grid, log


def _log_likelihood(
    change: Change, reference: WindowReference, c: CandidateFault, grid: Floats
) -> Floats:
    """Log likelihood ratio of each severity, the model's error in its shift integrated out.

    With d + V w in place of d and w standard normal, d'c - d'C d / 2 becomes that, plus
    g'(I + V'C V)^-1 g / 2 - log det(I + V'C V) / 2, where g = V'(c - C d).
    """
    shift = reference.shift(c.key, grid)
    linear, information = change.linear[0], change.information
    log = shift @ linear - 0.5 * np.einsum("mk,kl,ml->m", shift, information, shift)
    error = np.hypot(np.abs(shift) * reference.case.errors, reference.fault_error)
    error = np.hypot(
        error, [reference.case.uncertainty(c.key, float(s)) / reference.scale for s in grid]
    )
    wide = np.concatenate(
        (c.error * shift[:, :, None], error[:, :, None] * np.eye(len(linear))), axis=2
    )
    inner = np.eye(wide.shape[2]) + wide.transpose(0, 2, 1) @ information @ wide
    slope = np.einsum("mkr,mk->mr", wide, linear - shift @ information)
    better = np.einsum("mr,mr->m", slope, np.linalg.solve(inner, slope[:, :, None])[:, :, 0])
    return np.asarray(log + 0.5 * better - 0.5 * np.linalg.slogdet(inner)[1])
