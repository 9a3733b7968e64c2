"""A linear discriminant with shrunk scatter and probabilities calibrated on groups left out.

Every class has a mean, all share one scatter (Fisher). The scatter is shrunk towards its diagonal
(Friedman, "Regularized Discriminant Analysis", JASA 84(405), 1989; by scikit-learn), and the
probabilities are flattened or sharpened by one temperature, both chosen on groups that the fit had
not seen.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError

SHRINKAGES = (0.1, 0.2, 0.4, 0.6)
_TEMPERATURES = np.geomspace(0.5, 30.0, 25)
_MARGIN = 0.5
"""How far beyond the training range a feature counts, in widths of that range."""


@dataclass(frozen=True, slots=True)
class Discriminant:
    """A fitted classifier.

    Attributes
    ----------
    classes : tuple of str
        In the order of the probabilities.
    means : array, (classes, features)
        In units of `scale`.
    scale : array, (features,)
        Deviation of each feature about its class's mean.
    precision : array, (features, features)
        Inverse of the shrunk scatter of the scaled features.
    low, high : array, (features,)
        Range of the training values.
    shrinkage, temperature : float
        As chosen on the groups left out.
    """

    classes: tuple[str, ...]
    means: Floats
    scale: Floats
    precision: Floats
    low: Floats
    high: Floats
    shrinkage: float
    temperature: float

    @classmethod
    def fit(
        cls,
        values: npt.ArrayLike,
        labels: Sequence[str],
        groups: npt.ArrayLike,
        *,
        shrinkage: float | None = None,
    ) -> Discriminant:
        """Fit means and scatter; choose shrinkage and temperature on groups left out.

        Parameters
        ----------
        values : array, (recordings, features)
            Finite numbers.
        labels : sequence of str
            Class of each recording.
        groups : array, (recordings,)
            What is left out together: the load, where another load will be predicted, or the run.
        shrinkage : float, optional
            0 to 1; chosen from `SHRINKAGES` by default.

        Raises
        ------
        InputError
            Fewer than two classes, lengths that differ, numbers that are not finite.
        ModuleNotFoundError
            scikit-learn is missing; it names the command that installs the extra.
        """
        x, y, g = _check_examples(values, labels, groups)
        candidates = SHRINKAGES if shrinkage is None else (shrinkage,)
        best = min((_left_out_loss(x, y, g, value) for value in candidates), key=lambda c: c[0])
        return _fit_discriminant(x, y, best[1], best[2])

    def distances(self, values: npt.ArrayLike) -> Floats:
        """Return the squared distance of each recording to each class."""
        x = np.atleast_2d(np.asarray(values, dtype=np.float64))
        width = _MARGIN * (self.high - self.low)
        offsets = np.clip(x, self.low - width, self.high + width) / self.scale
        delta = offsets[:, None, :] - self.means[None, :, :]
        return np.asarray(((delta @ self.precision) * delta).sum(axis=2))

    def predict_proba(self, values: npt.ArrayLike) -> Floats:
        """Return the probability of each class, (recordings, classes); rows sum to one."""
        return _softmax(-0.5 * self.distances(values) / self.temperature)

    def predict(self, values: npt.ArrayLike) -> list[str]:
        """Return the most probable class of each recording."""
        return [self.classes[index] for index in self.distances(values).argmin(axis=1)]

    def outside(self, values: npt.ArrayLike) -> npt.NDArray[np.bool_]:
        """Tell which features lie outside the training range and its margin."""
        x = np.atleast_2d(np.asarray(values, dtype=np.float64))
        width = _MARGIN * (self.high - self.low)
        return np.asarray((x < self.low - width) | (x > self.high + width))


def _check_examples(
    values: npt.ArrayLike, labels: Sequence[str], groups: npt.ArrayLike
) -> tuple[Floats, npt.NDArray[np.str_], npt.NDArray[np.generic]]:
    x = np.asarray(values, dtype=np.float64)
    y, g = np.asarray(labels, dtype=np.str_), np.asarray(groups)
    if x.ndim != 2 or len(x) != len(y) or len(x) != len(g):
        raise InputError(f"classifier: {x.shape} features, {len(y)} labels, {len(g)} groups")
    if not np.isfinite(x).all():
        raise InputError("classifier: a feature is not a finite number")
    if len(np.unique(y)) < 2:
        raise InputError("classifier: it takes at least two classes to tell apart")
    return x, y, g


def _fit_discriminant(
    x: Floats, y: npt.NDArray[np.str_], shrinkage: float, temperature: float
) -> Discriminant:
    classes = np.unique(y)
    means = np.array([x[y == name].mean(axis=0) for name in classes])
    residual = x - means[np.searchsorted(classes, y)]
    scale = np.sqrt((residual**2).sum(axis=0) / max(1, len(x) - len(classes)))
    varies = scale > 0.0
    # A feature that does not vary (one recording a class) must not divide by zero.
    scale = np.where(varies, scale, np.maximum(np.abs(means).max(axis=0), 1.0))
    scatter = shrinkage * np.eye(x.shape[1])
    if varies.any():
        scatter[np.ix_(varies, varies)] = _shrunk_scatter(
            x[:, varies] / scale[varies], y, shrinkage
        )
    return Discriminant(
        tuple(str(name) for name in classes), means / scale, scale,
        np.asarray(np.linalg.inv(scatter), dtype=np.float64), x.min(axis=0), x.max(axis=0),
        shrinkage, temperature,
    )  # fmt: skip


def _shrunk_scatter(x: Floats, y: npt.NDArray[np.str_], shrinkage: float) -> Floats:
    """Return the shrunk scatter about the classes' means, by degrees of freedom.

    The features have a deviation of one each, so that the library shrinks to their diagonal.
    """
    from sklearn.discriminant_analysis import LinearDiscriminantAnalysis

    library = LinearDiscriminantAnalysis(solver="lsqr", shrinkage=shrinkage)
    with warnings.catch_warnings():
        # A class of one recording adds nothing to the scatter; that is no fault of the fit.
        warnings.filterwarnings("ignore", "Only one sample available", UserWarning)
        library.fit(x, y)
    share = len(x) / (len(x) - len(library.classes_))  # it counts recordings
    return np.asarray(share * library.covariance_, dtype=np.float64)


def _left_out_loss(
    x: Floats, y: npt.NDArray[np.str_], g: npt.NDArray[np.generic], shrinkage: float
) -> tuple[float, float, float]:
    """Return (log loss, shrinkage, best temperature) over the groups, each left out once."""
    scores, truth = [], []
    for group in np.unique(g):
        test = g == group
        if set(y[test]) - set(y[~test]) or len(np.unique(y[~test])) < 2:
            continue  # a class would be missing: this group cannot be left out
        fitted = _fit_discriminant(x[~test], y[~test], shrinkage, 1.0)
        scores.append(-0.5 * fitted.distances(x[test]))
        truth.append(np.searchsorted(fitted.classes, y[test]))
    if not scores or len({score.shape[1] for score in scores}) != 1:
        return np.inf, shrinkage, 1.0
    table, right = np.vstack(scores), np.concatenate(truth)
    losses = [_log_loss(_softmax(table / t), right) for t in _TEMPERATURES]
    best = int(np.argmin(losses))
    return losses[best], shrinkage, float(_TEMPERATURES[best])


def _log_loss(probability: Floats, right: npt.NDArray[np.intp]) -> float:
    chosen = probability[np.arange(len(right)), right]
    return float(-np.log(np.maximum(chosen, 1e-12)).mean())


def _softmax(scores: Floats) -> Floats:
    weights = np.exp(scores - scores.max(axis=1, keepdims=True))
    return np.asarray(weights / weights.sum(axis=1, keepdims=True))
