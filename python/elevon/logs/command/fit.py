"""A waveform fitted to a reconstructed command, with an honest uncertainty."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, NamedTuple

import numpy as np
import numpy.typing as npt

from elevon.arrays import Bools, Floats
from elevon.errors import InputError, unknown
from elevon.estimate.covariance import robust_covariance
from elevon.estimate.residual import ResidualFit, fit_residual
from elevon.logs.command.reconstruct import CommandTrace
from elevon.plain import WORKING, Plain, key
from elevon.waveforms import complete, evaluate, wave_records

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


_ANGLES = {"phase"}
_OUTLIER = 6.0
_FAR = 10.0  # of the robust spread: no noise reaches it
_FEW = 0.01  # of the samples: more than that is no stray but a model that does not fit
_LEAST = 20
_ROUGH = 25  # evaluations from each guess
_MOST = 200  # evaluations of the best one
_SCORED = 2000  # samples enough to tell the kinds apart


@dataclass(frozen=True, slots=True)
class WaveformFit(Plain):
    """A fitted command.

    All standard deviations hold for coloured residuals, and include the unknown instant at which
    the drive sampled the command (`fit_waveform`, `timing_std`).

    Attributes
    ----------
    kind : str
        Waveform.
    values : dict of str to float
        All its parameters (SI; phase at the log's time zero, within -pi to pi).
    std : dict of str to float
        Standard deviation of each fitted parameter, for coloured residuals.
    covariance : ndarray, shape (p, p)
        Of the fitted parameters, in the order of `std`.
    rms : float
        RMS of the residual [rad].
    samples : int
        Samples used.
    outliers : int
        Single samples left out because they stray far from all others, such as the first row of a
        log, taken before the drive had computed its first set point.
    window : (float, float)
        First and last instant used [s]: before it the command had not begun, or was another.
    converged : bool
        Whether the optimiser met its tolerance.
    """

    kind: Annotated[str, key("waveform")]
    values: dict[str, float]
    std: dict[str, float]
    covariance: Annotated[Floats, WORKING]
    rms: float
    samples: Annotated[int, WORKING]
    window: Annotated[tuple[float, float], WORKING]
    converged: Annotated[bool, WORKING]
    outliers: Annotated[int, WORKING] = 0

    def at(self, time: npt.ArrayLike) -> Floats:
        """Return the fitted command [rad] at instants [s]."""
        return evaluate(self.kind, self.values, np.asarray(time, dtype=np.float64))


def fit_waveform(
    trace: CommandTrace,
    kind: str = "sine",
    *,
    fixed: Mapping[str, float] | None = None,
) -> WaveformFit:
    """Fit a waveform to the valid samples of a command trace.

    The command's beginning and end are found in the trace: a span at rest at either end, and
    samples that no waveform of this kind explains. The instant at which the drive sampled the
    command, against the time stamp of the row, is uniform within one period of the log: it is in no
    residual, so it is added to the phase and the instants.

    Parameters
    ----------
    trace : CommandTrace
        From `elevon.logs.command.reconstruct.reconstruct`.
    kind : str
        Waveform, one of `FREE`.
    fixed : mapping of str to float, optional
        Parameters that are known and not fitted (SI).

    Returns
    -------
    WaveformFit
        With standard deviations that hold for coloured residuals.

    Raises
    ------
    InputError
        Unknown waveform or parameter, or too few valid samples.
    """
    known = dict(fixed or {})
    if kind not in FREE:
        raise unknown("waveform", kind, FREE)
    names = wave_records()[kind].names
    for name in known:
        if name not in names:
            raise unknown("parameter", name, names, f"waveform {kind}")
    t, y = _selected(trace)
    moving = kind not in {"constant", "step", "ramp", "trapezoid"}
    if moving:
        t, y = _without_rest(t, y)
    free = [name for name in FREE[kind] if name not in known]
    best = _best(kind, t, y, known, free=free)
    for _ in range(3 if moving else 0):
        first = _first_explained(t, best.residual)
        if first == 0 or len(t) - first < max(_LEAST, len(t) // 4):
            break
        t, y = t[first:], y[first:]
        best = _best(kind, t, y, known, free=free, start=best.values)
    strays = _strays(y, best.residual)
    if strays.any():
        t, y = t[~strays], y[~strays]
        best = _best(kind, t, y, known, free=free, start=best.values)
    return replace(_result(kind, free, t, best), outliers=int(strays.sum()))


def best_waveform(
    trace: CommandTrace,
    kinds: Sequence[str] = ("sine", "triangle", "trapezoid", "chirp", "ramp", "step"),
) -> WaveformFit:
    """Fit several waveforms and return the one of least Bayesian information criterion.

    All are scored on the same samples, with as many degrees of freedom as each has parameters.

    Raises
    ------
    InputError
        Too few valid samples for any of them.
    """
    t, y = _selected(trace)
    step = max(1, len(t) // _SCORED)
    t, y = t[::step], y[::step]
    thin = CommandTrace(t, y, np.ones(len(t), dtype=bool))
    scored = []
    for kind in kinds:
        fit = fit_waveform(thin, kind)
        inside = (t >= fit.window[0]) & (t <= fit.window[1])
        # Samples a kind leaves out are charged at the spread of the whole trace: a fit to a
        # fragment must not win against one that explains everything.
        misfit = np.where(inside, y - fit.at(t), y - y.mean())
        power = max(float(np.mean(misfit**2)), 1e-300)
        scored.append((len(t) * math.log(power) + len(fit.std) * math.log(len(t)), kind))
    return fit_waveform(trace, min(scored)[1])


def _selected(trace: CommandTrace) -> tuple[Floats, Floats]:
    mask = trace.valid
    if int(mask.sum()) < _LEAST:
        raise InputError(
            f"command: {int(mask.sum())} samples with the speed set point inside its limit; "
            f"{_LEAST} are needed"
        )
    return trace.time[mask], trace.position[mask]


def _without_rest(t: Floats, y: Floats) -> tuple[Floats, Floats]:
    """Drop a span at rest before and after the motion: there the command holds one value."""
    noise = 1.4826 * float(np.median(np.abs(np.diff(y)))) / math.sqrt(2.0)
    band = max(_OUTLIER * noise, 0.005 * float(np.ptp(y)))
    away = np.flatnonzero(np.abs(y - np.median(y[:_LEAST])) > band)
    back = np.flatnonzero(np.abs(y - np.median(y[-_LEAST:])) > band)
    first = int(away[0]) if away.size and away[0] > len(y) // 20 else 0
    last = int(back[-1]) + 1 if back.size and back[-1] < len(y) - len(y) // 20 else len(y)
    return (t[first:last], y[first:last]) if last - first >= _LEAST else (t, y)


def _first_explained(t: Floats, residual: Floats) -> int:
    """Index after the last sample of the first half beyond the second half's spread."""
    half = len(t) // 2
    spread = 1.4826 * float(np.median(np.abs(residual[half:] - np.median(residual[half:]))))
    off = np.flatnonzero(np.abs(residual[:half]) > max(_OUTLIER * spread, 1e-12))
    return int(off[-1]) + 1 if off.size > 3 else 0


def _strays(y: Floats, residual: Floats) -> Bools:
    """Mark samples far outside the spread of the others; none when they are more than a few."""
    middle = float(np.median(residual))
    spread = 1.4826 * float(np.median(np.abs(residual - middle)))
    far = np.abs(residual - middle) > max(_FAR * spread, 1e-6 * float(np.ptp(y)))
    return far if far.mean() <= _FEW else np.zeros_like(far)


class _Solved(NamedTuple):
    """A waveform's values, and the fit that found them: residuals are data less waveform."""

    values: dict[str, float]
    jacobian: Floats
    residual: Floats
    converged: bool


def _best(
    kind: str,
    t: Floats,
    y: Floats,
    known: Mapping[str, float],
    *,
    free: Sequence[str],
    start: Mapping[str, float] | None = None,
) -> _Solved:
    """Least squares from each guess, the best carried to its end.

    Returns its values, Jacobian (n, p), residual, and whether it converged.
    """
    spread = float(np.ptp(t))
    scale = np.array([_typical(name, y, spread) for name in free])

    def solve(base: Mapping[str, float], x0: Floats, most: int) -> ResidualFit:
        return fit_residual(
            lambda x: _model(kind, base, free, x, t) - y, x0, jacobian="3-point", scale=scale,
            tolerance=1e-13, most=most,
        )  # fmt: skip

    results = []
    for guess in [start] if start is not None else guesses(kind, t, y, known):
        base = {**guess, **known}
        if not free:
            return _Solved(base, np.empty((len(t), 0)), y - evaluate(kind, base, t), True)
        rough = solve(base, np.array([base[name] for name in free]), _ROUGH)
        results.append((rough.cost, base, rough))
    _, base, rough = min(results, key=lambda item: item[0])
    solution = rough if rough.converged else solve(base, rough.x, _MOST)
    values = {**base, **dict(zip(free, map(float, solution.x), strict=True))}
    return _Solved(values, solution.jacobian, -solution.residual, solution.converged)


def _model(
    kind: str, base: Mapping[str, float], free: Sequence[str], x: Floats, t: Floats
) -> Floats:
    values = {**base, **dict(zip(free, map(float, x), strict=True))}
    for name in ("rise", "fall", "hold_high", "hold_low", "sweep_time"):
        if name in values:
            values[name] = max(values[name], 1e-6)
    return evaluate(kind, values, t)


def _typical(name: str, y: Floats, spread: float) -> float:
    """Size of a meaningful change of a parameter, for the optimiser's scaling."""
    if "frequency" in name:
        return 0.05 / spread
    if name in _ANGLES:
        return 0.1
    if name in {"time", "start", "end", "rise", "fall", "hold_high", "hold_low", "sweep_time"}:
        return 0.01 * spread
    if name == "slope":
        return max(float(np.ptp(y)) / spread, 1e-12)
    return max(float(np.ptp(y)), 1e-12)


def _result(kind: str, free: Sequence[str], t: Floats, best: _Solved) -> WaveformFit:
    values, jacobian, residual, converged = best
    if values.get("amplitude", 1.0) < 0.0 and "phase" in free:
        values["amplitude"], values["phase"] = -values["amplitude"], values["phase"] + math.pi
        jacobian = jacobian * np.where(np.array(free) == "amplitude", -1.0, 1.0)
    if "phase" in values:
        values["phase"] = math.remainder(values["phase"], 2.0 * math.pi)
    covariance = _covariance(kind, free, jacobian, residual)
    timing_std = float(np.median(np.diff(t))) / math.sqrt(12.0)
    shift = _per_second(values, free)
    covariance += timing_std**2 * np.outer(shift, shift)
    std = {name: float(math.sqrt(covariance[k, k])) for k, name in enumerate(free)}
    rms = float(np.sqrt(np.mean(residual**2)))
    window = (float(t[0]), float(t[-1]))
    return WaveformFit(kind, values, std, covariance, rms, len(t), window, converged)


def _covariance(kind: str, free: Sequence[str], jacobian: Floats, residual: Floats) -> Floats:
    """Covariance of the fitted parameters, shape (p, p).

    A step's instant has no derivative: the sampling alone bounds it, which the caller adds.
    """
    smooth = [k for k, name in enumerate(free) if (kind, name) != ("step", "time")]
    covariance = np.zeros((len(free), len(free)))
    if smooth:
        part = robust_covariance(jacobian[:, smooth], residual)
        covariance[np.ix_(smooth, smooth)] = part
    return covariance


def _per_second(values: Mapping[str, float], free: Sequence[str]) -> Floats:
    """Change of each fitted parameter when the whole command comes one second later, shape (p,)."""
    rate = 2.0 * math.pi * values.get("frequency", values.get("start_frequency", 0.0))
    moves = {"phase": -rate, "start": 1.0, "end": 1.0, "time": 1.0}
    return np.array([moves.get(name, 0.0) for name in free])
