"""Two gains of a cascade that change places: what logs without set points cannot separate.

With a speed feed-forward of one the current is K N q' + (K k_v + K N/T_i) q + (K k_v/T_i) times the
integral of q, of the position's error q, speed gain K and motor angle N over the output: k_v/N and
1/T_i enter alike. Only a speed set point at its limit tells one from the other.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.closed_loop.fit import DECIDED, Fitted
from elevon.estimate.free import outer
from elevon.estimate.lanes import Lanes, Point

GAIN, TIME = "control.position_gain", "control.integral_time"
_ROUNDS = 8  # of the fit with the gains exchanged
_DEVIATIONS = 3.0  # between two pairs: from here on the logs prefer one
_WHOLE = 0.02  # of one: a feed-forward that is nearer counts as one


def exchanged(fitted: Fitted, given: Actuator) -> tuple[Fitted, dict[str, str]]:
    """Return the fit with both gains near to the actuator file's, and why they are unsettled.

    All else is fitted anew with both gains in each other's place. Where the logs are followed
    alike, the pair nearer to the values `given` is taken, and both are named with the other pair;
    else the pair that follows them better.
    """
    lanes = fitted.lanes
    paths = [item.path for item in lanes.free]
    feedforward = given.parameters.value("control.speed_feedforward")
    if fitted.model.structure != "cascade" or abs(feedforward - 1.0) > _WHOLE:
        return fitted, {}
    if GAIN not in paths or TIME not in paths:
        return fitted, {}
    here = lanes.point(fitted.x)
    # The friction, the delays and the lag are fitted to their pair: so must they be to the other.
    other = lanes.solve(_swapped(fitted)[None, :], rounds=_ROUNDS, central=True)[0]
    if not _alike(lanes, here, other):
        return (fitted if here.cost < other.cost else replace(fitted, x=other.x)), {}
    pairs = [outer(lanes.free, x) for x in (fitted.x, other.x)]
    if _distance(pairs[1], given) < _distance(pairs[0], given):
        fitted, pairs = replace(fitted, x=other.x), pairs[::-1]
    return fitted, _reasons(pairs[0], pairs[1])


def _alike(lanes: Lanes, one: Point, other: Point) -> bool:
    """Whether two fits follow the logs alike (Vuong, Econometrica 57(2), 1989, for blocks of time).

    Neither is the truth: a model that errs at corners of the command may prefer the wrong pair by
    many nats there. So the difference counts only beyond three deviations of its sum over blocks.
    """
    gap = lanes.costs(other.residual) - lanes.costs(one.residual)
    blocks = np.bincount(lanes.blocks(one.residual), gap)
    spread = float(np.sqrt(len(blocks)) * np.std(blocks))
    # A cost is twice a negative log-likelihood.
    return abs(other.cost - one.cost) < max(2.0 * DECIDED, _DEVIATIONS * spread)


def _swapped(fitted: Fitted) -> Floats:
    """The point with k_v/N and 1/T_i in each other's place."""
    lanes, values = fitted.lanes, fitted.values
    turns = fitted.model.per_output
    swap = {GAIN: turns / values[TIME], TIME: turns / values[GAIN]}
    x = np.array(fitted.x)
    for k, item in enumerate(lanes.free):
        if item.path in swap:
            x[k] = min(max(item.inner(swap[item.path]), lanes.low[k]), lanes.high[k])
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
