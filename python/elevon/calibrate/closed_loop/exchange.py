"""Two gains of a cascade that change places: what logs without set points cannot separate.

With a speed feed-forward of one the current is K N q' + (K k_v + K N/T_i) q + (K k_v/T_i) times the
integral of q, of the position's error q, speed gain K and motor angle N over the output: k_v/N and
1/T_i enter alike. Only a speed set point at its limit tells one from the other.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.closed_loop.fit import DECIDED, Fitted
from elevon.calibrate.closed_loop.free import outer

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["exchanged"]

GAIN, TIME = "control.position_gain", "control.integral_time"
_WHOLE = 0.02  # of one: a feed-forward that is nearer counts as one


def exchanged(fitted: Fitted, given: Actuator) -> tuple[Fitted, dict[str, str]]:
    """Return the fit with both gains near to the actuator file's, and why they are unsettled.

    Where the logs are followed alike with both gains in each other's place, the pair nearer to the
    values `given` is taken, and both are named with the other pair; else nothing changes.
    """
    objective = fitted.objective
    paths = [item.path for item in objective.free]
    feedforward = given.parameters.value("control.speed_feedforward")
    if objective.model.structure != "cascade" or abs(feedforward - 1.0) > _WHOLE:
        return fitted, {}
    if GAIN not in paths or TIME not in paths:
        return fitted, {}
    other = _swapped(fitted)
    costs = [
        objective.cost(row, x)
        for row, x in zip(
            objective.residual(np.array([fitted.x, other])), (fitted.x, other), strict=True
        )
    ]
    # A cost is twice a negative log-likelihood.
    if not costs[1] - costs[0] < 2.0 * DECIDED:
        return fitted, {}
    pairs = [outer(objective.free, x) for x in (fitted.x, other)]
    if _distance(pairs[1], given) < _distance(pairs[0], given):
        fitted, pairs = Fitted(objective, other), pairs[::-1]
    return fitted, _reasons(pairs[0], pairs[1])


def _swapped(fitted: Fitted) -> Floats:
    """The point with k_v/N and 1/T_i in each other's place."""
    objective, values = fitted.objective, fitted.values
    turns = objective.model.per_output
    swap = {GAIN: turns / values[TIME], TIME: turns / values[GAIN]}
    x = np.array(fitted.x)
    for k, item in enumerate(objective.free):
        if item.path in swap:
            x[k] = min(max(item.inner(swap[item.path]), objective.low[k]), objective.high[k])
    return x


def _distance(values: dict[str, float], given: Actuator) -> float:
    """How far a pair is from the actuator file's own, in logarithms."""
    total = 0.0
    for path in (GAIN, TIME):
        previous = given.parameters.value(path)
        total += abs(math.log(values[path] / previous)) if previous > 0.0 else 0.0
    return total


def _reasons(taken: dict[str, float], other: dict[str, float]) -> dict[str, str]:
    text = (
        "cannot be separated from {}: with control.speed_feedforward = 1 the logs are followed "
        f"alike with {GAIN} = {taken[GAIN]:.4g} and {TIME} = {taken[TIME]:.4g} s, and with "
        f"{other[GAIN]:.4g} and {other[TIME]:.4g} s; the pair nearer to the file is written"
    )
    return {GAIN: text.format(TIME), TIME: text.format(GAIN)}
