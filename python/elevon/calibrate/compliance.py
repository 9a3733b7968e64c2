"""Stiffness and dead zone of a transmission from loads that were hung and angles that were lost.

    loss = dead zone + load / stiffness (+ an offset for each further group of drops)

The load is set and exact, the scatter is in the angle: so the loss is regressed on the load. Drops
of one weight share their errors and count as one block.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats, Ints
from elevon.errors import InputError, RangeError
from elevon.estimate import Estimate
from elevon.estimate.regression import huber, with_deviations


@dataclass(frozen=True)
class ComplianceCalibration:
    """The answer, in SI at the output shaft.

    Attributes
    ----------
    estimates : tuple of Estimate
        ``backlash.stiffness`` [N m/rad], ``derived.dead_zone`` [rad]: angle lost at the smallest
        load, one ``derived.group_offset[k]`` [rad] a further group.
    residual : ndarray, shape (n,)
        Measured less fitted loss [rad].
    outliers : tuple of int
        Observations (from 0) that kept less than half their weight.
    """

    estimates: tuple[Estimate, ...]
    residual: Floats
    outliers: tuple[int, ...]


def calibrate_compliance(
    torque: npt.ArrayLike,
    loss: npt.ArrayLike,
    *,
    weight: npt.ArrayLike,
    group: npt.ArrayLike | None = None,
    old: float | None = None,
) -> ComplianceCalibration:
    """Estimate stiffness and dead zone with intervals.

    Parameters
    ----------
    torque : array_like, shape (n,)
        Torque of the load at the output [N m].
    loss : array_like, shape (n,)
        Angle lost between motor over ratio and encoder [rad].
    weight : array_like of int, shape (n,)
        Which observations share one weight: they count as one block.
    group : array_like of int, shape (n,), optional
        0 for the common offset, 1, 2, ... for drops that began from elsewhere.
    old : float, optional
        Stiffness before [N m/rad].

    Raises
    ------
    InputError
        Lengths that differ, fewer than four weights, one torque only.
    RangeError
        A value that is not finite, or a loss that does not grow with the load.
    """
    x, y = np.asarray(torque, dtype=np.float64), np.asarray(loss, dtype=np.float64)
    blocks = np.unique(np.asarray(weight), return_inverse=True)[1].astype(np.int64)
    groups = np.zeros(len(x), dtype=np.int64) if group is None else np.asarray(group)
    _check(x, y, blocks, groups)
    labels = [label for label in np.unique(groups) if label != 0]
    design = np.column_stack((x, np.ones_like(x), *[(groups == k) * 1.0 for k in labels]))
    beta, misfit, trust = huber(design, y)
    if not beta[0] > 0.0:
        raise RangeError("compliance: the loss does not grow with the load: no stiffness")
    names = ("compliance", "derived.dead_zone", *(f"derived.group_offset[{k}]" for k in labels))
    fit = with_deviations(names, beta, design, misfit, trust, strokes=blocks)
    # The compliance has the even interval; its inverse, the stiffness, an uneven one.
    low, high = fit.estimate(names[0]).interval
    ends = (1.0 / high, 1.0 / low if low > 0.0 else math.inf)
    stiffness = replace(
        fit.estimate(names[0]).inverted(), interval=ends, path="backlash.stiffness",
        unit="N m/rad", register="plant", old=old, note="loss regressed on load",
    )  # fmt: skip
    notes = ("angle lost without load", *["lost beyond the common offset"] * len(labels))
    others = [
        replace(
            fit.estimate(name), path=name, unit="rad", register="plant", note=note, in_set=False
        )
        for name, note in zip(names[1:], notes, strict=True)
    ]
    outliers = tuple(int(k) for k in np.flatnonzero(trust < 0.5))
    return ComplianceCalibration((stiffness, *others), misfit, outliers)


def _check(x: Floats, y: Floats, blocks: Ints, groups: Ints) -> None:
    if not x.shape == y.shape == blocks.shape == groups.shape or x.ndim != 1:
        raise InputError(
            f"compliance: {x.shape} torques, {y.shape} losses, {blocks.shape} weights, "
            f"{groups.shape} groups"
        )
    if not (np.isfinite(x).all() and np.isfinite(y).all()):
        raise RangeError("compliance: a torque or a loss is not finite")
    if len(np.unique(blocks)) < 4 or np.ptp(x) == 0.0:
        raise InputError(
            f"compliance: {len(np.unique(blocks))} weights; four different ones are needed"
        )
