"""Kriging of one fidelity, and co-kriging of two."""

from __future__ import annotations

import warnings
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np

from elevon.arrays import Floats


class Interpolator(Protocol):
    """Predicts a response from the factors, coded -1 to +1."""

    def predict(self, points: Floats) -> tuple[Floats, Floats]:
        """Return mean and standard deviation at points of shape (n, factors)."""
        ...


@dataclass(frozen=True)
class Kriging:
    """A Gaussian process with a squared-exponential kernel, one length a factor, and noise.

    The library is scikit-learn: its numbers are the maximum of the marginal likelihood from three
    starts.
    """

    model: Any

    @classmethod
    def fit(cls, points: Floats, values: Floats, seed: int = 0) -> Kriging:
        """Fit to values, shape (n,), at points, shape (n, factors), coded -1 to +1."""
        from sklearn.exceptions import ConvergenceWarning
        from sklearn.gaussian_process import GaussianProcessRegressor
        from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

        factors = points.shape[1]
        kernel = ConstantKernel(1.0, (1e-3, 1e3)) * RBF(np.ones(factors), (0.05, 50.0))
        kernel += WhiteKernel(1e-3, (1e-9, 1.0))
        model = GaussianProcessRegressor(
            kernel, normalize_y=True, n_restarts_optimizer=2, random_state=seed
        )
        with warnings.catch_warnings():
            # A length at its bound is a factor that does nothing; that is no fault of the fit.
            warnings.simplefilter("ignore", ConvergenceWarning)
            model.fit(points, values)
        return cls(model)

    def predict(self, points: Floats) -> tuple[Floats, Floats]:
        """Return mean and standard deviation at points."""
        mean, deviation = self.model.predict(points, return_std=True)
        return np.asarray(mean, dtype=np.float64), np.asarray(deviation, dtype=np.float64)


@dataclass(frozen=True)
class CoKriging:
    """Switching model = scale x reduced-order model + difference (autoregressive, two levels).

    M. C. Kennedy and A. O'Hagan, Biometrika 87(1), 2000, in the recursive form of L. Le Gratiet and
    J. Garnier, Int. J. Uncertainty Quantification 4(5), 2014: one process for the reduced-order
    model, one for the difference at the high points; the scale by least squares of the high
    values on the low process there, beside a linear trend where the points allow one. The
    recursive form needs no
    library beside the one for kriging.
    """

    low: Kriging
    difference: Kriging
    scale: float

    @classmethod
    def fit(
        cls,
        low_points: Floats,
        low_values: Floats,
        high_points: Floats,
        high_values: Floats,
        *,
        seed: int = 0,
    ) -> CoKriging:
        """Fit to values of both fidelities at their points, coded -1 to +1."""
        low = Kriging.fit(low_points, low_values, seed)
        below, _ = low.predict(high_points)
        scale = _scale(below, high_points, high_values)
        difference = Kriging.fit(high_points, high_values - scale * below, seed)
        return cls(low, difference, scale)

    def predict(self, points: Floats) -> tuple[Floats, Floats]:
        """Return mean and standard deviation at points."""
        below, below_sd = self.low.predict(points)
        above, above_sd = self.difference.predict(points)
        return self.scale * below + above, np.hypot(self.scale * below_sd, above_sd)


def _scale(below: Floats, points: Floats, values: Floats) -> float:
    """Return the factor of the low process in the high values, beside a trend."""
    trend = points if len(values) > points.shape[1] + 2 else points[:, :0]
    matrix = np.column_stack([below, np.ones(len(values)), trend])
    return float(np.linalg.lstsq(matrix, values)[0][0])
