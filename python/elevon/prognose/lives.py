"""Lives without severities: a Weibull distribution with covariates (extra ``lives``)."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.plain import Plain


@dataclass(frozen=True)
class LifeDistribution(Plain):
    """A Weibull distribution whose scale depends on covariates (accelerated failure time).

    Attributes
    ----------
    names : tuple of str
        Of the coefficients of the logarithm of the scale: ``1``, then covariates.
    coefficients : tuple of float
        Theirs.
    log_shape : float
        Logarithm of the shape.
    covariance : tuple of tuple of float
        Of coefficients and `log_shape`, in this order.
    failed, censored : int
        Units behind it.
    """

    names: tuple[str, ...]
    coefficients: tuple[float, ...]
    log_shape: float
    covariance: tuple[tuple[float, ...], ...]
    failed: int
    censored: int

    @property
    def shape(self) -> float:
        """Above 1: failures become more frequent with use."""
        return float(np.exp(self.log_shape))

    def remaining(
        self, use: float, covariates: Mapping[str, str], count: int, rng: np.random.Generator
    ) -> Floats:
        """Draw remaining lives of a unit that has been used without failing, shape (count,).

        Each is of parameters of its own, drawn by their covariance.

        Raises
        ------
        InputError
            A covariate that is missing or unknown.
        """
        row = _row(covariates, self.names)
        mean = np.array([*self.coefficients, self.log_shape])
        drawn = rng.multivariate_normal(mean, np.array(self.covariance), size=count, method="eigh")
        scale, shape = np.exp(drawn[:, :-1] @ row), np.exp(np.clip(drawn[:, -1], -3.0, 4.0))
        passed = (use / scale) ** shape
        total = (passed + rng.standard_exponential(count)) ** (1.0 / shape)
        return np.asarray(np.maximum(scale * total - use, 0.0))


def fit_lives(
    use: Floats, failed: npt.NDArray[np.bool_], covariates: Sequence[Mapping[str, str]]
) -> LifeDistribution:
    """Fit lives of which some are censored.

    Parameters
    ----------
    use : ndarray, shape (n,)
        When each unit failed, was removed, or until now.
    failed : ndarray of bool, shape (n,)
        Whether it failed.
    covariates : sequence of mapping of str to str
        Of each unit; numbers, or classes.

    Raises
    ------
    InputError
        No Weibull distribution fits the lives.
    """
    import pandas as pd
    from lifelines import WeibullAFTFitter
    from lifelines.exceptions import ConvergenceError

    names = _names(covariates)
    rows = [_row(item, ("1", *names))[1:] for item in covariates]
    table = pd.DataFrame(np.array(rows).reshape(len(use), len(names)), columns=names)
    table["use"], table["failed"] = use, failed.astype(np.int64)
    fitter: Any = WeibullAFTFitter()
    try:
        with warnings.catch_warnings():
            # How lifelines calls pandas is none of the caller's doing.
            warnings.simplefilter("ignore", DeprecationWarning)
            warnings.simplefilter("ignore", FutureWarning)
            fitter.fit(table, "use", "failed")
    except (ConvergenceError, ValueError, np.linalg.LinAlgError) as error:
        raise InputError(
            f"the lives cannot be fitted by a Weibull distribution: {error}"
        ) from error
    order = [("lambda_", "Intercept"), *(("lambda_", name) for name in names)]
    order.append(("rho_", "Intercept"))
    values = [float(fitter.params_[key]) for key in order]
    covariance = fitter.variance_matrix_.loc[order, order].to_numpy()
    return LifeDistribution(
        ("1", *names),
        tuple(values[:-1]),
        values[-1],
        tuple(tuple(map(float, row)) for row in covariance),
        int(failed.sum()),
        int((~failed).sum()),
    )


def _names(covariates: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the columns of covariates: numbers as they are, of classes all but the first."""
    out = []
    for name in covariates[0] if covariates else ():
        values = [item[name] for item in covariates]
        if all(_number(v) is not None for v in values):
            out += [name] if len(set(values)) > 1 else []
        else:
            out += [f"{name}={kind}" for kind in sorted(set(values))[1:]]
    return out


def _row(covariates: Mapping[str, str], names: Sequence[str]) -> Floats:
    """Return the numbers that coefficients multiply."""
    needed = {name.partition("=")[0] for name in names[1:]}
    for name in needed:
        if name not in covariates:
            raise InputError(f"the covariate {name} is missing: --covariate {name}=VALUE")
    row = [1.0]
    for name in names[1:]:
        key, _, kind = name.partition("=")
        if kind:
            row.append(float(covariates[key] == kind))
            continue
        value = _number(covariates[key])
        if value is None:
            raise InputError(f"covariate {key} = {covariates[key]!r} is not a number")
        row.append(value)
    return np.array(row)


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
