"""First guesses for the waveform fit, from the trace alone."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from elevon.arrays import Floats
from elevon.waveforms import complete

#: Parameters fitted for each waveform; the others keep their guess or the value given.
FREE: dict[str, tuple[str, ...]] = {
    "constant": ("value",),
    "step": ("initial", "final", "time"),
    "ramp": ("initial", "slope", "start", "end"),
    "sine": ("amplitude", "frequency", "phase", "bias"),
    "triangle": ("amplitude", "frequency", "phase", "bias"),
    "chirp": ("amplitude", "start_frequency", "end_frequency", "phase", "bias"),
    "trapezoid": ("low", "high", "rise", "hold_high", "fall", "hold_low", "start"),
}
_TAU = 2.0 * math.pi
_COARSE = 1200  # samples enough for a scan
_CHUNK = 128  # rows of a scan held at once
_HIGHEST = 50.0  # Hz: no position command of an actuator goes faster


def guesses(kind: str, t: Floats, y: Floats, known: Mapping[str, float]) -> list[dict[str, float]]:
    """Return starting values for one waveform, best first; known parameters as given."""
    if kind == "constant":
        return [{"value": float(np.median(y))}]
    if kind in {"sine", "triangle"}:
        return _oscillation(kind, t, y, known)
    if kind == "chirp":
        return _chirp(t, y, known)
    if kind == "step":
        return [_step(t, y)]
    if kind == "ramp":
        return [_ramp(t, y)]
    return _trapezoid(t, y, known)


def _thin(t: Floats, y: Floats) -> tuple[Floats, Floats]:
    step = max(1, len(t) // _COARSE)
    return t[::step], y[::step]


def _oscillation(
    kind: str, t: Floats, y: Floats, known: Mapping[str, float]
) -> list[dict[str, float]]:
    duration = float(np.ptp(t))
    if "frequency" in known:
        grid = np.array([known["frequency"]])
    else:
        # The scan thins the samples, so its upper end is what the thinned samples can carry.
        coarse, _ = _thin(t, y)
        top = min(_HIGHEST, 0.4 / float(np.median(np.diff(coarse))))
        grid = np.arange(0.2 / duration, top, 0.125 / duration)
    best = _scan(t, y, grid)
    growth = math.pi**2 / 8.0 if kind == "triangle" else 1.0
    starts = []
    for frequency, (a, b, bias) in best:
        amplitude = growth * math.hypot(a, b)
        # The fit's phase is at `start`; a shift of the time origin turns it.
        phase = math.atan2(b, a) + _TAU * frequency * known.get("start", 0.0)
        given = {"amplitude": amplitude, "frequency": frequency, "phase": phase, "bias": bias}
        starts.append(complete(kind, given))
    return starts


def _scan(t: Floats, y: Floats, grid: Floats) -> list[tuple[float, tuple[float, float, float]]]:
    """Best frequencies of a sine with free amplitude, phase and bias (variable projection)."""
    x, v = _thin(t, y)
    costs, weights = [], []
    for first in range(0, len(grid), _CHUNK):
        cost, weight = _project(_TAU * np.outer(grid[first : first + _CHUNK], x), v)
        costs.append(cost)
        weights.append(weight)
    cost, weight = np.concatenate(costs), np.concatenate(weights)
    best = np.argsort(cost, kind="stable")[:2]
    return [
        (float(grid[k]), (float(weight[k, 0]), float(weight[k, 1]), float(weight[k, 2])))
        for k in best
    ]


def _project(angle: Floats, v: Floats) -> tuple[Floats, Floats]:
    """Project values on sin, cos and a constant for each row of angles.

    Parameters
    ----------
    angle : ndarray, shape (m, n)
        Radians.
    v : ndarray, shape (n,)
        Values.

    Returns
    -------
    cost : ndarray, shape (m,)
        Sum of squares left.
    weights : ndarray, shape (m, 3)
        Of sin, cos and the constant; a whisper of ridge keeps rows without a turn solvable.
    """
    basis = np.stack((np.sin(angle), np.cos(angle), np.ones_like(angle)), axis=1)
    normal = basis @ basis.transpose(0, 2, 1) + 1e-9 * len(v) * np.eye(3)
    right = basis @ v
    weights = np.linalg.solve(normal, right[..., None])[..., 0]
    residual = v - np.einsum("mk,mkn->mn", weights, basis)
    return np.einsum("mn,mn->m", residual, residual), np.asarray(weights, dtype=np.float64)


def _chirp(t: Floats, y: Floats, known: Mapping[str, float]) -> list[dict[str, float]]:
    start = known.get("start", float(t[0]))
    sweep = known.get("sweep_time", float(t[-1]) - start)
    base = {"start": start, "sweep_time": sweep, **known}
    tau = np.clip(t - start, 0.0, sweep)
    top = min(_HIGHEST, 0.4 / float(np.median(np.diff(t))))
    lows = [known["start_frequency"]] if "start_frequency" in known else [0.0, *_rates(sweep, top)]
    highs = [known["end_frequency"]] if "end_frequency" in known else _rates(sweep, top)
    inside = tau < sweep if bool(np.any(tau < sweep)) else np.ones_like(tau, dtype=bool)
    x, v = tau[inside], y[inside]
    step = max(1, len(x) // _COARSE)
    x, v = x[::step], v[::step]
    scored = []
    rates = np.array(highs)
    for low in lows:
        turns = low * x + 0.5 * np.outer((rates - low) / sweep, x**2)
        costs, weights = _project(_TAU * turns, v)
        scored += [
            (float(cost), low, high, tuple(map(float, weight)))
            for cost, high, weight in zip(costs, highs, weights, strict=True)
        ]
    scored.sort(key=lambda item: item[0])
    starts = []
    for _, low, high, (a, b, bias) in scored[:4]:
        given = {
            **base,
            "amplitude": math.hypot(a, b),
            "phase": math.atan2(b, a),
            "bias": bias,
            "start_frequency": low,
            "end_frequency": high,
        }
        starts.append(complete("chirp", {**given, **known}))
    return starts


def _rates(sweep: float, top: float) -> list[float]:
    """Frequencies close enough that half a turn is not missed over the sweep, 60 at most."""
    count = int(min(60, max(8, 4.0 * top * sweep)))
    return [float(f) for f in np.linspace(0.25 / sweep, top, count)]


def _step(t: Floats, y: Floats) -> dict[str, float]:
    n = len(y)
    total = np.cumsum(y)
    k = np.arange(1, n)
    gain = total[:-1] ** 2 / k + (total[-1] - total[:-1]) ** 2 / (n - k)
    split = int(np.argmax(gain)) + 1
    return {
        "initial": float(y[:split].mean()),
        "final": float(y[split:].mean()),
        "time": float(0.5 * (t[split - 1] + t[split])),
    }


def _ramp(t: Floats, y: Floats) -> dict[str, float]:
    """Best hinge pair on a coarse grid, linear in the level and the slope."""
    x, v = _thin(t, y)
    knots = np.linspace(x[0], x[-1], 41)
    best = (math.inf, 0.0, 0.0, 0.0, 0.0)
    for i, start in enumerate(knots[:-1].tolist()):
        for end in knots[i + 1 :].tolist():
            basis = np.column_stack((np.ones_like(x), np.clip(x, start, end) - start))
            normal = basis.T @ basis
            if abs(np.linalg.det(normal)) < 1e-12:
                continue
            level, slope = np.linalg.solve(normal, basis.T @ v)
            cost = float(np.sum((v - basis @ (level, slope)) ** 2))
            if cost < best[0]:
                best = (cost, float(level), float(slope), start, end)
    _, level, slope, start, end = best
    return {"initial": level, "slope": slope, "start": start, "end": end}


def _trapezoid(t: Floats, y: Floats, known: Mapping[str, float]) -> list[dict[str, float]]:
    low, high = (float(v) for v in np.quantile(y, (0.02, 0.98)))
    span = max(high - low, 1e-12)
    marks = {level: _crossings(t, y, low + level * span) for level in (0.1, 0.5, 0.9)}
    ups = [time for time, rising in marks[0.5] if rising]
    downs = [time for time, rising in marks[0.5] if not rising]
    duration = float(np.ptp(t))
    period = float(np.median(np.diff(ups))) if len(ups) > 1 else duration
    rise = _edge(marks, rising=True) or 0.02 * period
    fall = _edge(marks, rising=False) or 0.02 * period
    first = ups[0] if ups else float(t[0])
    after = [time for time in downs if time > first]
    width = after[0] - first if after else 0.5 * period
    hold_high = max(width - 0.5 * (rise + fall), 0.0)
    given = {
        "low": low,
        "high": high,
        "rise": rise,
        "fall": fall,
        "hold_high": hold_high,
        "hold_low": max(period - rise - fall - hold_high, 0.0),
        "start": first - 0.5 * rise,
        **known,
    }
    return [complete("trapezoid", given)]


def _crossings(t: Floats, y: Floats, level: float) -> list[tuple[float, bool]]:
    above = (y > level).astype(np.int8)
    crossings = []
    for k in np.flatnonzero(np.diff(above)).tolist():
        part = (level - y[k]) / (y[k + 1] - y[k])
        crossings.append((float(t[k] + part * (t[k + 1] - t[k])), bool(above[k + 1])))
    return crossings


def _edge(marks: Mapping[float, list[tuple[float, bool]]], *, rising: bool) -> float:
    """Duration of the first whole edge, from the times of 10 and 90 %; 0 when there is none."""
    starts = [time for time, up in marks[0.1 if rising else 0.9] if up == rising]
    ends = [time for time, up in marks[0.9 if rising else 0.1] if up == rising]
    for start in starts:
        after = [end for end in ends if end > start]
        if after:
            return (after[0] - start) / 0.8
    return 0.0
