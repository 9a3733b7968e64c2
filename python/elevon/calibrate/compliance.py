"""Stiffness and dead zone of a transmission from loads that were hung and angles that were lost.

    loss = dead zone + load / stiffness (+ an offset for each further group of drops)

The load is set and exact, the scatter is in the angle: so the loss is regressed on the load. Drops
of one weight share their errors and count as one block.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.blocks import block_covariance
from elevon.calibrate.estimate import Estimate, quantile
from elevon.calibrate.regression import robust_regression
from elevon.errors import InputError, RangeError

__all__ = ["ComplianceCalibration", "calibrate_compliance"]


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

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "status": "ok",
            "parameters": {item.path: item.to_dict() for item in self.estimates},
            "residual_rms": float(np.sqrt(np.mean(self.residual**2))),
            "outliers": list(self.outliers),
        }


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
    beta, misfit, trust, _ = robust_regression(design, y)
    if not beta[0] > 0.0:
        raise RangeError("compliance: the loss does not grow with the load: no stiffness")
    covariance, degrees = block_covariance(
        design.T @ ((trust >= 1.0)[:, None] * design),
        [design * (trust * misfit)[:, None]],
        [blocks],
    )
    std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    half = quantile(degrees) * std
    stiffness = 1.0 / float(beta[0])
    # The compliance has the even interval; its inverse, the stiffness, an uneven one.
    low = 1.0 / float(beta[0] + half[0])
    high = 1.0 / float(beta[0] - half[0]) if beta[0] > half[0] else math.inf
    estimates = [
        Estimate(
            "backlash.stiffness",
            stiffness,
            stiffness**2 * float(std[0]),
            (low, high),
            "N m/rad",
            "plant",
            old,
            "direct",
            (),
            "loss regressed on load",
        )
    ]
    names = ["derived.dead_zone", *(f"derived.group_offset[{k}]" for k in labels)]
    estimates += [
        Estimate(
            name,
            float(b),
            float(s),
            (float(b - h), float(b + h)),
            "rad",
            "plant",
            note="angle lost without load" if k == 0 else "lost beyond the common offset",
            method="direct",
            in_set=False,
        )
        for k, (name, b, s, h) in enumerate(zip(names, beta[1:], std[1:], half[1:], strict=True))
    ]
    outliers = tuple(int(k) for k in np.flatnonzero(trust < 0.5))
    return ComplianceCalibration(tuple(estimates), misfit, outliers)


def _check(
    x: Floats, y: Floats, blocks: npt.NDArray[np.int64], groups: npt.NDArray[np.int64]
) -> None:
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
