"""Search, choice of the controller's structure, and the final fit.

A search leaves out friction that grows with the torque, and how late the drive acts. Both bias
gains, inertia and limits where they are missing: a screw's friction eats a share of the torque at
the current's limit, so that a model without it lowers the limit; a drive that reads, waits and
holds acts some milliseconds late, which the model's step stands for.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.closed_loop.log import asked_for, free_list, motion
from elevon.calibrate.stages.closed_loop.model import LoopModel, cloud, first_values, windows
from elevon.calibrate.stages.context import LAWS_WITHOUT_LOAD, LOAD_SHARE, grows_with_torque
from elevon.estimate import Free
from elevon.estimate.free import inner, outer
from elevon.estimate.held_out import folds
from elevon.estimate.lanes import Lanes
from elevon.logs.log import Log

Check = Callable[[], bool]
_STARTS = 32
_KEEP = 3
_MEMORY = 0.5  # s, of residuals
DECIDED = 3.0  # of the log-likelihood of held-out data, in nats, between two structures


@dataclass(frozen=True)
class Searched:
    """The best point of one structure on windows of the logs, and what it predicts.

    Attributes
    ----------
    structure : str
        Of the controller.
    free : tuple of Free
        What was moved.
    x : ndarray, shape (p,)
        Best point.
    held_out : float
        Log-likelihood of windows left out of the fit, nats of independent samples.
    runs : int
        Model runs.
    """

    structure: str
    free: tuple[Free, ...]
    x: Floats
    held_out: float
    runs: int


@dataclass(frozen=True)
class Fitted:
    """The final fit on whole logs."""

    model: LoopModel
    lanes: Lanes
    x: Floats

    @property
    def values(self) -> dict[str, float]:
        """Values by path."""
        return outer(self.lanes.free, self.x)


def search(
    actuator: Actuator,
    logs: Sequence[Log],
    structure: str,
    *,
    seed: int = 0,
    alone: bool = False,
    check: Check = lambda: True,
    advance: Callable[[float], object] = lambda _f: None,
) -> Searched:
    """Search one structure on windows of the logs, and predict each window from the others.

    What is left out is not predicted where there is no other structure to compare with (`alone`).
    """
    whole = LoopModel(actuator, logs, structure, check)
    parts = windows(logs, whole.per_output)
    free = free_list(actuator, logs, structure, first_values(whole))
    model = LoopModel(actuator, parts, structure, check)
    lanes = model.lanes(free)
    points = lanes.solve(
        cloud(free, model, _STARTS, seed), rounds=14, keep=_KEEP,
        advance=lambda f: advance(0.6 * f),
    )  # fmt: skip
    for _ in range(2):
        lanes.refresh(points[0].x)
        points = lanes.solve(np.array([point.x for point in points[:2]]), rounds=6)
    best = points[0].x
    advance(0.7)
    score, runs = (math.nan, 0) if alone else _held_out(model, free, best)
    advance(1.0)
    return Searched(structure, tuple(free), best, score, model.runs + runs)


def as_given(actuator: Actuator, logs: Sequence[Log], names: Sequence[str]) -> Searched:
    """Begin at the actuator file's values and structure: what some numbers are fitted from."""
    structure = str(actuator.parameters["control.structure"].value)
    free = asked_for(free_list(actuator, logs, structure, {}), names)
    return Searched(structure, tuple(free), inner(free), math.nan, 0)


def parts_apart(logs: Sequence[Log]) -> list[tuple[list[Log], list[Log]]]:
    """Pairs of logs kept and left out: of a single one each half."""
    if len(logs) > 1:
        return folds(logs)
    early = logs[0].time < 0.5 * logs[0].duration
    halves = [logs[0].counting(early), logs[0].counting(~early)]
    return folds(halves)


def _windows_apart(parts: Sequence[Log]) -> list[tuple[list[Log], list[Log]]]:
    """Pairs of windows kept and left out: those of one log, or of a single one every other."""
    names = list(dict.fromkeys(part.name for part in parts))
    groups = [[part for part in parts if part.name == name] for name in names]
    if len(groups) == 1 and len(parts) > 1:
        groups = [list(parts[1::2]), list(parts[::2])]
    if len(groups) == 1:
        return parts_apart(parts)[1:]
    return [([p for group in others for p in group], left[0]) for others, left in folds(groups)]


def refitted(model: LoopModel, free: Sequence[Free], x: Floats, rounds: int) -> Floats:
    """Fit other logs from a point; return where they end."""
    lanes = model.lanes(free)
    lanes.refresh(x)
    return lanes.solve(x[None, :], rounds=rounds)[0].x


def _held_out(searched: LoopModel, free: Sequence[Free], x: Floats) -> tuple[float, int]:
    """Log-likelihood of each window under values fitted to the others, and the runs it took."""
    total, runs = 0.0, 0
    for inside, outside in _windows_apart(searched.logs):
        model, other = searched.on(inside), searched.on(outside)
        total += _likelihood(other.lanes(free), refitted(model, free, x, 5))
        runs += model.runs + other.runs
    return total, runs


def _likelihood(lanes: Lanes, x: Floats) -> float:
    """Gaussian log-likelihood of held-out residuals at their own spread, nats.

    The spread is robust (one jump missed by a sample does not decide), and a log counts one
    independent sample a memory of fixed length, so that structures are compared alike.
    """
    total = 0.0
    for item, values in zip(lanes.channels, lanes.predicted(x), strict=True):
        if values is None:
            return -np.inf
        residual = (values - item.data) / item.size
        typical = float(np.median(np.abs(residual))) + 1e-9
        spread = float(np.sqrt(np.mean(np.minimum(residual**2, (5.0 * typical) ** 2))))
        total -= len(residual) * item.period / _MEMORY * np.log(spread + 1e-4)
    return float(total)


def choose(searched: Sequence[Searched]) -> tuple[Searched, str]:
    """Return the structure that predicts best what was left out, and why, in words."""
    order = sorted(searched, key=lambda item: item.held_out, reverse=True)
    best = order[0]
    if len(order) == 1:
        return best, "as given"
    gap = best.held_out - order[1].held_out
    if gap < DECIDED:
        return best, (
            f"not decided: the logs held out are {gap:.1f} nats more likely than with "
            f"{order[1].structure}"
        )
    return best, f"the logs held out are {gap:.0f} nats more likely than with {order[1].structure}"


def final_fit(
    actuator: Actuator,
    logs: Sequence[Log],
    chosen: Searched,
    *,
    rounds: int = 10,
    check: Check = lambda: True,
    advance: Callable[[float], object] = lambda _f: None,
) -> Fitted:
    """Fit whole logs from the best point of the search, deviations renewed between rounds."""
    model = LoopModel(actuator, logs, chosen.structure, check)
    lanes = model.lanes(chosen.free)
    x = inner(chosen.free, outer(chosen.free, chosen.x))
    for number in range(3):
        lanes.refresh(x)
        x = lanes.solve(x[None, :], rounds=rounds, central=number == 2)[0].x
        advance((number + 1) / 3)
    lanes.refresh(x)
    return Fitted(model, lanes, x)


_TICKS = (1e-3, 2e-3, 3e-3)  # s, tried beside the actuator file's own step
_PERIODS = 0.25  # of the log, a step at most
_ROUNDS = 6


def refined(
    actuator: Actuator,
    logs: Sequence[Log],
    chosen: Searched,
    *,
    check: Callable[[], bool] = lambda: True,
) -> tuple[Actuator, Searched]:
    """Return the servo and the point from which whole logs are fitted.

    Friction is let grow with the motor's torque (laws that know of no such share), and the model's
    step becomes the one of a few under which windows of the logs are followed best.
    """
    servo = load_share(actuator, logs, chosen.structure)
    free = tuple(free_list(servo, logs, chosen.structure, outer(chosen.free, chosen.x)))
    per_output = LoopModel(servo, logs, chosen.structure, check).per_output
    parts = windows(logs, per_output)
    tried = []
    scales = None
    for step in steps(servo, logs):
        late = servo.with_values({"low.step": step}, source="calibration")
        lanes = LoopModel(late, parts, chosen.structure, check).lanes(free)
        x = inner(free, outer(chosen.free, chosen.x))
        if scales is None:
            lanes.refresh(x)
            scales = lanes.scales
        lanes.scales = scales.copy()
        tried.append((late, lanes.solve(x[None, :], rounds=_ROUNDS)[0]))
    best, point = min(tried, key=lambda item: item[1].cost)
    # The belief stays with the first values of the search.
    first = {item.path: item.start for item in chosen.free}
    free = tuple(replace(item, start=first.get(item.path, item.start)) for item in free)
    return best, replace(chosen, free=free, x=point.x)


def steps(actuator: Actuator, logs: Sequence[Log]) -> list[float]:
    """Return the steps of the model that are tried, the actuator file's own first, s."""
    coarse = actuator.parameters.value("low.step")
    longest = _PERIODS * min(log.period for log in logs)
    if str(actuator.parameters["drive.kind"].value) == "pwm":
        # How late it acts is the current loop's lag, which is fitted: no step stands for it.
        return [max(coarse, min(_TICKS[0], longest))]
    return [coarse, *(tick for tick in _TICKS if coarse < tick <= longest)]


def load_share(actuator: Actuator, logs: Sequence[Log], structure: str) -> Actuator:
    """Return the servo with friction that grows with the torque; a law of bristles stays."""
    if str(actuator.parameters["friction.law"].value) not in LAWS_WITHOUT_LOAD:
        return actuator
    model = LoopModel(actuator, logs, structure)
    top = max(float(np.nanmax(np.abs(motion(log, model.per_output)[0]))) for log in logs)
    if not top > 0.0:
        return actuator
    values = grows_with_torque(top) | {LOAD_SHARE: 0.05}
    return actuator.with_values(values, source="calibration")
