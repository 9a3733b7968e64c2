"""A stiffness from loads that were set and angles that were measured.

Model: ``loss = load / stiffness + offset``, with one more offset for each group of observations
that started from elsewhere. The load is set and known to its printed digits; all the scatter is in
the measured angle. So the loss is regressed on the load, and the stiffness is the inverse of that
slope. The other regression (load on loss) puts the scatter where it is not, and its slope is too
small by the factor r^2 (the squared correlation): it would answer "which load do I expect for this
loss among loads chosen like these", a question nobody asked.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.estimate.regression import huber


@dataclass(frozen=True, slots=True)
class ComplianceFit:
    """Result of `fit_compliance`.

    Attributes
    ----------
    stiffness : float
        Load per loss, in the units of the data.
    offset : float
        Loss at zero load of the observations outside every group.
    group_offsets : ndarray, shape (g,)
        What each group loses beyond `offset`.
    residuals : ndarray, shape (n,)
        Measured less fitted loss.
    weights : ndarray, shape (n,)
        Weight each observation kept, in (0, 1].
    scale : float
        Robust standard deviation of the residuals.
    """

    stiffness: float
    offset: float
    group_offsets: Floats
    residuals: Floats
    weights: Floats
    scale: float


def load_on_loss(load: Floats, loss: Floats) -> float:
    """Slope of the least-squares line of load on loss (load per loss)."""
    return _slope(loss, load)


def loss_on_load(load: Floats, loss: Floats) -> float:
    """Inverse slope of the least-squares line of loss on load (load per loss)."""
    return 1.0 / _slope(load, loss)


def deming_stiffness(load: Floats, loss: Floats, load_sd: float, loss_sd: float) -> float:
    """Slope of the line that allows errors in both (Deming), for known standard deviations.

    Raises
    ------
    InputError
        A standard deviation is not positive.
    """
    if load_sd <= 0.0 or loss_sd <= 0.0:
        raise InputError(f"errors in both: needs positive deviations, got {load_sd} and {loss_sd}")
    x, y = (load - load.mean()) / load_sd, (loss - loss.mean()) / loss_sd
    difference, cross = float(y @ y - x @ x), float(x @ y)
    root = float(np.hypot(difference, 2.0 * cross))
    # Two forms of one root: the sum of numbers of one sign loses no digits.
    if difference >= 0.0:
        slope = (root + difference) / (2.0 * cross)
    else:
        slope = 2.0 * cross / (root - difference)
    return float(load_sd / (loss_sd * slope))


def fit_compliance(
    load: Floats, loss: Floats, group: npt.ArrayLike | None = None, *, robust: bool = True
) -> ComplianceFit:
    """Fit loss against load, with an offset a group.

    Parameters
    ----------
    load, loss : ndarray, shape (n,)
        Set loads and measured losses.
    group : array_like of int, shape (n,), optional
        0 for observations of the common offset, 1, 2, ... for groups with their own.
    robust : bool
        Huber's weights instead of plain least squares.

    Returns
    -------
    ComplianceFit

    Raises
    ------
    InputError
        Fewer observations than unknowns, values that are not finite, or one load only.
    """
    design = _design(load, group)
    if len(load) != len(loss) or not (np.isfinite(load).all() and np.isfinite(loss).all()):
        raise InputError(f"compliance: {len(load)} loads, {len(loss)} losses, all must be finite")
    if len(load) < design.shape[1] or np.linalg.matrix_rank(design) < design.shape[1]:
        raise InputError(
            f"compliance: {len(load)} observations do not determine {design.shape[1]} unknowns"
        )
    if robust:
        beta, residuals, weights = huber(design, loss)
    else:
        beta = np.asarray(np.linalg.lstsq(design, loss, rcond=None)[0], dtype=np.float64)
        residuals, weights = loss - design @ beta, np.ones(len(load))
    scale = 1.4826 * float(np.median(np.abs(residuals)))
    return ComplianceFit(1.0 / beta[0], float(beta[1]), beta[2:], residuals, weights, scale)


def bootstrap_interval(
    load: Floats,
    loss: Floats,
    group: npt.ArrayLike | None = None,
    *,
    cluster: npt.ArrayLike,
    level: float = 0.95,
    resamples: int = 2000,
    seed: int = 0,
) -> tuple[float, float]:
    """Interval of the robust stiffness, drawing whole clusters of observations with replacement.

    Drops of one weight share its errors (how it hung, how friction settled): drawing single rows
    would count them as independent and give an interval that is too narrow.

    Parameters
    ----------
    load, loss, group
        As `fit_compliance`.
    cluster : array_like of int, shape (n,)
        Which observations belong together.
    level : float
        Share of the resamples inside the interval.
    resamples : int
        Number of resamples.
    seed : int
        Seed of the draws.

    Returns
    -------
    (float, float)
        Lower and upper end, in load per loss.
    """
    labels = np.asarray(cluster)
    groups = np.zeros(len(load), dtype=int) if group is None else np.asarray(group)
    members = [np.flatnonzero(labels == label) for label in np.unique(labels)]
    random = np.random.default_rng(seed)
    slopes = []
    for _ in range(resamples):
        drawn = np.concatenate([members[k] for k in random.integers(0, len(members), len(members))])
        if np.ptp(load[drawn]) > 0.0:  # the same weight drawn each time determines no slope
            slopes.append(fit_compliance(load[drawn], loss[drawn], groups[drawn]).stiffness)
    tail = 50.0 * (1.0 - level)
    low, high = np.percentile(slopes, [tail, 100.0 - tail])
    return float(low), float(high)


def _slope(x: Floats, y: Floats) -> float:
    centred = x - x.mean()
    return float(centred @ y / (centred @ centred))


def _design(load: Floats, group: npt.ArrayLike | None) -> Floats:
    columns = [load, np.ones(len(load))]
    if group is not None:
        labels = np.asarray(group)
        columns += [(labels == label).astype(float) for label in np.unique(labels) if label != 0]
    return np.column_stack(columns)
