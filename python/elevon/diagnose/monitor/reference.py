"""What healthy windows of a stream show, and what each fault does to them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import SEEN, Cause, FaultPlace
from elevon.diagnose.engine.candidates import CandidateFault
from elevon.diagnose.engine.case import LogCase
from elevon.diagnose.engine.healthy import healthy
from elevon.diagnose.engine.likelihood import prior_density
from elevon.diagnose.engine.posterior import quantiles
from elevon.diagnose.engine.spread import DEGREES
from elevon.diagnose.engine.table import FeatureVector, deviations
from elevon.diagnose.monitor.filter import Change, WindowSpread
from elevon.diagnose.monitor.windows import Windows
from elevon.errors import InputError

MEMORY = 3600.0  # s, ASSUMED: time in which a day's temperatures and friction become another day's
_LEAST = 3  # windows of the baselines together


@dataclass(frozen=True)
class WindowReference:
    """A healthy unit's windows, each number in units of `scale`.

    Attributes
    ----------
    names : tuple of str
        The features.
    case : LogCase
        Healthy unit and faults, SI.
    spread : WindowSpread
        Of healthy windows.
    scale : ndarray, shape (k,)
        Deviation of a healthy window, SI.
    directions : ndarray, shape (d, k)
        What the severities that were run do.
    windows : int
        Of the baselines.
    fault_error : ndarray, shape (k,)
        Least deviation of what the model says a fault does.
    """

    names: tuple[str, ...]
    case: LogCase
    spread: WindowSpread
    scale: Floats
    directions: Floats
    windows: int
    fault_error: Floats

    @property
    def noise_degrees(self) -> float:
        """How well the noise of windows is known, in degrees of freedom."""
        return DEGREES + self.windows - 1

    def deviation(self, features: FeatureVector) -> Floats:
        """Return a window's features less the healthy mean, NaN where it is not there."""
        known = dict(zip(features.names, features.values.tolist(), strict=True))
        values = np.array([known.get(name, np.nan) for name in self.names])
        return (values - self.case.unit.mean) / self.scale

    def shift(self, key: str, severity: Floats) -> Floats:
        """Return what severities, shape (m,), do to a window, shape (m, k)."""
        return self.case.shift(key, severity) / self.scale


def reference(windows: Windows, candidates: Sequence[CandidateFault]) -> WindowReference:
    """Join the model's spread with the windows of the baselines.

    Raises
    ------
    InputError
        Fewer than three windows in which the unit moves.
    """
    features = [list(windows.of(log)) for log in windows.baselines]
    count = sum(map(len, features))
    if count < _LEAST:
        raise InputError(
            f"the baselines have {count} windows of {windows.width:g} s in which the unit moves "
            f"as it is watched; {_LEAST} are needed, better thirty; a motion that does not repeat "
            "within a baseline is not watched: elevon diagnose takes its log as a whole"
        )
    features = [log for log in features if log]
    model = windows.model(candidates)
    names = [n for n in model.healthy.names if all(n in e.names for log in features for e in log)]
    rows = [np.array([e.only(names).values for e in log]) for log in features]
    error = np.mean(np.array([e.only(names).std for log in features for e in log]) ** 2, axis=0)
    least = deviations([model.table[n] for n in names], np.vstack(rows).mean(axis=0), "repeats")
    error += (windows.within_day * least) ** 2
    noise = _noise(rows, error)
    means = [
        FeatureVector(tuple(names), log.mean(axis=0), np.sqrt(np.diag(noise) / len(log)))
        for log in rows
    ]
    unit = healthy(model, names, means)
    case = LogCase(windows.baselines[0].name, replace(means[0]), unit, model)
    made = _scaled(case, noise, windows.width, candidates, count)
    return replace(made, fault_error=windows.of_faults * least / made.scale)


def _noise(rows: Sequence[Floats], square: Floats) -> Floats:
    """Covariance from window to window.

    The baselines' scatter, and what each window says of itself (its square), worth `DEGREES`
    windows.
    """
    scatter = sum((log - log.mean(axis=0)).T @ (log - log.mean(axis=0)) for log in rows)
    free = sum(len(log) - 1 for log in rows)
    return np.asarray((DEGREES * np.diag(square) + scatter) / (DEGREES + free))


def _scaled(
    case: LogCase, noise: Floats, width: float, candidates: Sequence[CandidateFault], count: int
) -> WindowReference:
    unit = case.unit
    scale = np.sqrt(np.diag(unit.covariance) + np.diag(noise))
    outer = np.outer(scale, scale)
    memory = float(np.exp(-width / MEMORY))
    day = unit.covariance - unit.offset
    spread = WindowSpread(unit.offset / outer, day / outer, noise / outer, memory)
    rows = []
    for c in candidates:
        at = case.model.severities[c.key]
        rows.append(case.shift(c.key, at[at != 0.0]) / scale)
    directions = np.vstack(rows)
    size = np.linalg.norm(directions, axis=1)
    seen = size > 1e-6
    return WindowReference(
        unit.names, case, spread, scale, directions[seen] / size[seen, None], count,
        np.zeros(len(scale)),
    )  # fmt: skip


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
