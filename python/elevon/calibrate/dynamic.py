"""The stage of model runs: what the regressions cannot see, and what absorbs the model's misfit."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Annotated, ClassVar, NamedTuple

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats, Ints
from elevon.calibrate.model_runs import SpeedRuns, candidates, within_inertia
from elevon.calibrate.named import named
from elevon.errors import InputError, Interrupted
from elevon.estimate import Estimate, Free, quantile
from elevon.estimate.covariance import block_covariance
from elevon.estimate.free import inner, outer
from elevon.estimate.lanes import Lanes
from elevon.logs.log import Log
from elevon.parameters.relations import constant_is_tied, static_following
from elevon.plain import WORKING, Plain, key
from elevon.progress import Progress

_CORRELATED = 0.95
_LOOSEST = 0.25  # relative deviation (or of ten meaningful changes) still worth freeing
_HOPELESS = 1.0  # the same, above which a requested parameter is refused
_SAME = 0.995  # correlation at which two parameters are one
_BOUND = 3.0  # deviations beyond which a residual counts no more
_OFFSETS = 10.0  # meaningful changes of an offset or a delay that count as one of a number's size


@dataclass(frozen=True)
class SensitivityTable:
    """What changes of the free parameters do to the residuals.

    Attributes
    ----------
    free : tuple of Free
        Candidates.
    jacobian : ndarray, shape (n, p)
        Deviations of the residual a meaningful change.
    residual : ndarray, shape (n,)
        In deviations.
    blocks : ndarray of int, shape (n,)
        Of each sample.
    """

    free: tuple[Free, ...]
    jacobian: Floats
    residual: Floats
    blocks: Ints

    def only(self, left: Sequence[int]) -> SensitivityTable:
        """Return that of some candidates."""
        chosen = tuple(self.free[k] for k in left)
        return replace(self, free=chosen, jacobian=self.jacobian[:, list(left)])

    @cached_property
    def covariance(self) -> Floats:
        """That a fit would have, shape (p, p), in meaningful changes."""
        scores = self.jacobian * np.clip(self.residual, -_BOUND, _BOUND)[:, None]
        return block_covariance(self.jacobian.T @ self.jacobian, scores, self.blocks)[0]

    @property
    def std(self) -> Floats:
        """Deviations of the candidates."""
        return np.asarray(np.sqrt(np.maximum(np.diag(self.covariance), 0.0)))

    @property
    def correlation(self) -> Floats:
        """Of each with each other candidate, shape (p, p)."""
        if not self.finite:
            return np.ones_like(self.covariance)
        correlation = self.covariance / np.outer(self.std, self.std)
        np.fill_diagonal(correlation, 0.0)
        return np.asarray(correlation)

    @property
    def finite(self) -> bool:
        """Whether each candidate is determined at all."""
        return bool(np.isfinite(self.std).all() and self.std.all())

    @property
    def loose(self) -> Floats:
        """Relative deviation; offsets and delays count in ten meaningful changes."""
        sizes = [item.spread if item.log_scale else 1.0 / _OFFSETS for item in self.free]
        return np.asarray(np.where(np.isfinite(self.std), self.std * sizes, np.inf))

    @property
    def blind(self) -> Bools:
        """Which cannot be told from another one, even where both look tight."""
        return np.asarray(np.abs(self.correlation).max(axis=0) > _SAME)

    def reason(self, j: int) -> str:
        """Why one is not determined."""
        loose = float(self.loose[j])
        if not self.finite:
            return "it cannot be determined from the others"
        text = f"its deviation would be {100.0 * loose:.0f} %"
        other = int(np.argmax(np.abs(self.correlation[j])))
        if abs(self.correlation[j, other]) > _CORRELATED:
            name, size = self.free[other].path, self.correlation[j, other]
            text += f", and it cannot be determined from {name} ({size:+.3f})"
        return text


@dataclass(frozen=True)
class Identifiability(Plain):
    """Ranking of the candidates at the first values.

    Attributes
    ----------
    singular_values : ndarray, shape (p,)
        Of the scaled sensitivity matrix (deviations of the residual per meaningful change).
    weakest : tuple of (str, float)
        Components of the direction of the smallest singular value, largest first.
    predicted : dict of str to float
        Deviation each would have: relative for positive numbers, in SI else.
    pairs : tuple of (str, str, float)
        Pairs correlated by more than 0.95.
    dropped : dict of str to str
        Candidates left out, and why.
    """

    singular_values: Floats
    weakest: tuple[tuple[str, float], ...]
    predicted: dict[str, float]
    pairs: Annotated[tuple[tuple[str, str, float], ...], key("correlated")]
    dropped: dict[str, str]

    COMPUTED: ClassVar = ("condition",)

    @property
    def condition(self) -> float:
        """Largest over least singular value."""
        return float(self.singular_values[0] / max(self.singular_values[-1], 1e-300))


def rank(table: SensitivityTable, dropped: dict[str, str] | None = None) -> Identifiability:
    """Rank candidates by what they do to the residuals."""
    names = [item.path for item in table.free]
    _, singular, directions = np.linalg.svd(table.jacobian, full_matrices=False)
    spread = table
    order = np.argsort(-np.abs(directions[-1]))[:4]
    pairs = [
        (names[i], names[j], float(spread.correlation[i, j]))
        for i in range(len(names))
        for j in range(i)
        if spread.finite and abs(spread.correlation[i, j]) > _CORRELATED
    ]
    sizes = spread.std * [item.spread for item in table.free]
    return Identifiability(
        singular_values=singular,
        weakest=tuple((names[k], float(directions[-1][k])) for k in order),
        predicted=dict(zip(names, map(float, sizes), strict=True)),
        pairs=tuple(sorted(pairs, key=lambda item: -abs(item[2]))),
        dropped=dict(dropped or {}),
    )


def choose(table: SensitivityTable, required: Sequence[str]) -> tuple[list[int], Identifiability]:
    """Drop, one by one, what the logs cannot determine; return the indices kept, maybe none.

    Parameters
    ----------
    table : SensitivityTable
        Of all candidates.
    required : sequence of str
        Paths requested: never dropped.

    Raises
    ------
    InputError
        A required parameter that nothing in the logs excites, or that cannot be determined from
        others.
    """
    free = table.free
    dropped = _unexcited(table, required)
    left = [k for k, item in enumerate(free) if item.path not in dropped]
    while left:
        spread = table.only(left)
        optional = [j for j, item in enumerate(spread.free) if item.path not in required]
        # Of two that cannot be determined apart, the looser one goes.
        worst = max(optional, key=lambda j: (spread.blind[j], spread.loose[j]), default=None)
        if worst is None or not (spread.blind[worst] or spread.loose[worst] > _LOOSEST):
            break
        dropped[spread.free[worst].path] = spread.reason(worst)
        del left[worst]
    if not left:
        return [], Identifiability(np.empty(0), (), {}, (), dropped)
    for j, item in enumerate(spread.free):
        if item.path in required and (spread.loose[j] > _HOPELESS or spread.blind[j]):
            why = spread.reason(j)
            raise InputError(f"--free {item.path}: the logs cannot determine it: {why}")
    return left, rank(table.only(left), dropped)


def _unexcited(table: SensitivityTable, required: Sequence[str]) -> dict[str, str]:
    """Candidates that move no signal."""
    strength = np.linalg.norm(table.jacobian, axis=0)
    weak = [
        item for item, size in zip(table.free, strength, strict=True)
        if not size > 1e-6 * np.sqrt(len(table.jacobian))
    ]  # fmt: skip
    for item in weak:
        if item.path in required:
            raise InputError(
                f"--free {item.path}: nothing in the logs excites it (a change of "
                f"{item.spread:g} moves no signal); leave it out or add a log that does"
            )
    return {item.path: "nothing in the logs excites it" for item in weak}


_ABSORBS = 0.02  # relative difference to the direct estimate that is worth a name
_SIGMAS = 2.0  # deviations it must also exceed
_ROUNDS = 12  # of the fit: the regressions start it close by
_CLOUD = 32  # starts tried where the first values explain too little
_EXPLAINED = 0.5  # share of the current's variance the first values must explain
_KEEP = 3  # starts that go on


class Absorbed(NamedTuple):
    """A parameter that absorbs what the model lacks: its value by the model runs, and directly."""

    path: str
    simulation: float
    direct: float


class RunErrors(NamedTuple):
    """RMS of speed [rad/s] and current [A] of the fitted model runs of a log."""

    log: str
    speed: float
    current: float


@dataclass(frozen=True)
class Dynamic(Plain):
    """Result of the stage.

    Attributes
    ----------
    ranking : Identifiability
        Of the candidates, before the fit.
    free : tuple of Free
        What was fitted.
    x : ndarray, shape (p,)
        Solution, in spreads.
    covariance : ndarray, shape (p, p)
        Of `x`, for coloured residuals.
    degrees : float
        Degrees of freedom of the covariance.
    cost : float
        Mean robust cost a sample.
    converged : bool
        Whether the cost had settled.
    at_bound : tuple of str
        Parameters that ended at a bound.
    drive : str
        Kind of drive whose model explains the logs better.
    absorbed : tuple of Absorbed
        Where model runs and direct estimate part.
    rms : tuple of RunErrors
        Of each log.
    runs : int
        Model runs.
    """

    ranking: Annotated[Identifiability, WORKING]
    free: Annotated[tuple[Free, ...], WORKING]
    x: Annotated[Floats, WORKING]
    covariance: Annotated[Floats, WORKING]
    degrees: Annotated[float, WORKING]
    cost: float
    converged: bool
    at_bound: tuple[str, ...]
    drive: str
    absorbed: tuple[Absorbed, ...]
    rms: tuple[RunErrors, ...]
    runs: int

    COMPUTED: ClassVar = ("values",)

    @property
    def values(self) -> dict[str, float]:
        """What was fitted, in its own units."""
        return outer(self.free, self.x)

    def estimates(
        self, actuator: Actuator, known: Sequence[str], free: Sequence[str] | None
    ) -> list[Estimate]:
        """Estimates of what has no direct one."""
        estimates = []
        std = np.sqrt(np.maximum(np.diag(self.covariance), 0.0))
        for item, x, s in zip(self.free, map(float, self.x), std, strict=True):
            wanted = free is None or item.path in free
            if item.path in known or (item.kind == "parameter" and not wanted):
                continue
            if item.path in self.at_bound:  # the data do not say where it lies
                continue
            half = quantile(self.degrees) * float(s)
            number = Estimate(
                item.outer(x), item.slope(x) * float(s),
                interval=(item.outer(x - half), item.outer(x + half)),
            )  # fmt: skip
            estimates.append(
                named(
                    number, item.path, actuator, source="simulation", unit=item.unit,
                    register=item.register,
                )
            )  # fmt: skip
        return [item for item in estimates if np.isfinite(item.std)]


def dynamic_stage(
    logs: Sequence[Log],
    actuator: Actuator,
    known: Sequence[Estimate],
    free: Sequence[str] | None,
    *,
    fidelity: str,
    progress: Progress | None,
) -> Dynamic | None:
    """Rank, choose and fit on model runs that start from the direct estimates.

    Returns
    -------
    Dynamic or None
        None where the logs determine nothing of what could be freed.
    """
    at = 0.0

    def check() -> bool:
        return progress is None or progress(at)

    def advance(fraction: float) -> None:
        nonlocal at
        at = fraction
        if not check():
            raise Interrupted("calibration stopped")

    required = [p for p in free or () if p not in {item.path for item in known}]
    chosen = candidates(actuator, logs, free)
    start = {item.path: item.value for item in known if item.value != 0.0}
    problem = _best_drive(logs, actuator, chosen, start, fidelity=fidelity, check=check)
    lanes, x = problem.lanes(chosen), inner(chosen, start)
    lanes.refresh(x)
    advance(0.1)
    point = lanes.point(x)
    sensitivity = SensitivityTable(
        tuple(chosen), lanes.jacobian([point], central=True)[0], point.residual,
        lanes.blocks(point.residual),
    )  # fmt: skip
    determined, ranking = choose(sensitivity, required)
    advance(0.3)
    if not determined:
        return None
    return _fitted(problem, [chosen[k] for k in determined], start, ranking, known, advance)


def _fitted(  # noqa: PLR0917 - what the stage has made so far
    problem: SpeedRuns,
    free: Sequence[Free],
    start: Mapping[str, float],
    ranking: Identifiability,
    known: Sequence[Estimate],
    advance: Callable[[float], None],
) -> Dynamic:
    lanes, x = problem.lanes(free), inner(free, start)
    lanes.refresh(x)
    best = lanes.solve(
        _starts(lanes, x), rounds=_ROUNDS, keep=_KEEP, central=True,
        advance=lambda f: advance(0.3 + 0.65 * f),
    )[0]  # fmt: skip
    point = lanes.point(best.x)
    jac, weight = lanes.jacobian([point], central=True)[0], lanes.weight(point.residual)
    scores = weight * point.residual
    covariance, degrees = block_covariance(
        jac.T @ (weight[:, None] * jac), jac * scores[:, None], lanes.blocks(scores)
    )
    ends = np.minimum(point.x - lanes.low, lanes.high - point.x) < 1e-3
    advance(1.0)
    return Dynamic(
        ranking=ranking,
        free=tuple(free),
        x=point.x,
        covariance=covariance,
        degrees=degrees,
        cost=point.cost / max(float(lanes.share.sum()), 1.0),
        converged=best.slow or best.settled,
        at_bound=tuple(item.path for item, end in zip(free, ends, strict=True) if end),
        drive=str(problem.actuator.parameters["drive.kind"].value),
        absorbed=_absorbed(free, point.x, np.sqrt(np.diag(covariance)), known),
        rms=_rms(problem, lanes, point.residual),
        runs=problem.runs,
    )


def _starts(lanes: Lanes, x: Floats) -> Floats:
    """Keep the start where it explains the current; else add a cloud around it."""
    misfit = total = 0.0
    for item, values in zip(lanes.channels, lanes.predicted(x), strict=True):
        if "current" in item.name and values is not None:
            misfit += float(np.sum((values - item.data) ** 2))
            total += float(np.sum((item.data - item.data.mean()) ** 2))
    if total > 0.0 and 1.0 - misfit / total > _EXPLAINED:
        return x[None, :]
    from scipy.stats import qmc

    cloud = qmc.Sobol(len(x), seed=0).random(_CLOUD)
    reach = np.array([np.log(10.0) / f.spread if f.log_scale else 0.0 for f in lanes.free])
    return np.vstack((x, np.clip(x + (2.0 * cloud - 1.0) * reach, lanes.low, lanes.high)))


def _best_drive(
    logs: Sequence[Log],
    actuator: Actuator,
    free: Sequence[Free],
    start: Mapping[str, float],
    *,
    fidelity: str,
    check: Callable[[], bool],
) -> SpeedRuns:
    """The file's drive, or the carrier PWM of a real one, whichever explains the logs better."""
    nominal = str(actuator.parameters["drive.kind"].value)
    tied = constant_is_tied(actuator.parameters, 0.01)
    fixed, x = _fixed(start, actuator, free), inner(free, start)
    tried = []
    for kind in dict.fromkeys((nominal, "pwm")):
        changed = actuator.with_values({**fixed, "drive.kind": kind})
        problem = SpeedRuns(changed, logs, fidelity, check, tied=tied)
        residual = problem.lanes(free).residual(x[None, :])[0]
        tried.append((float(np.sum(np.minimum(np.abs(residual), 10.0))), problem))
    return min(tried, key=lambda item: item[0])[1]


def _fixed(
    start: Mapping[str, float], actuator: Actuator, free: Sequence[Free]
) -> dict[str, str | float]:
    """Known values of parameters the model runs keep fixed."""
    taken = {item.path for item in free} | {"backlash.total", "sensor.encoder.offset"}
    values: dict[str, str | float] = {
        p: v for p, v in start.items() if p in actuator.parameters and p not in taken
    }
    if "friction.dynamic" in start:
        static = static_following(actuator.parameters, start["friction.dynamic"])
        values.setdefault("friction.static", static)
        values.setdefault("friction.dynamic", start["friction.dynamic"])
    return values | within_inertia(actuator, values)


def _absorbed(
    free: Sequence[Free], x: Floats, std: Floats, known: Sequence[Estimate]
) -> tuple[Absorbed, ...]:
    direct = {item.path: item for item in known}
    absorbed = []
    for item, at, s in zip(free, map(float, x), std, strict=True):
        other = direct.get(item.path)
        if other is None or not item.log_scale or not other.value > 0.0:
            continue
        gap = (at - item.inner(other.value)) * item.spread
        noise = float(np.hypot(s * item.spread, other.std / other.value))
        if abs(gap) > _ABSORBS and abs(gap) > _SIGMAS * noise:
            absorbed.append(Absorbed(item.path, item.outer(at), other.value))
    return tuple(sorted(absorbed, key=lambda row: -abs(np.log(row.simulation / row.direct))))


def _rms(problem: SpeedRuns, lanes: Lanes, residual: Floats) -> tuple[RunErrors, ...]:
    """RMS errors of speed and current, log by log."""
    sizes = [
        scale * float(np.sqrt(np.mean(residual[place] ** 2)))
        for place, scale in zip(lanes.slices, lanes.scales, strict=True)
    ]
    return tuple(
        RunErrors(log.name, *pair)
        for log, pair in zip(problem.logs, zip(sizes[::2], sizes[1::2], strict=True), strict=True)
    )
