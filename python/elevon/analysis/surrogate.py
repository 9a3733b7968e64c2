"""How well a surrogate predicts a response it has not seen: one fidelity against two."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np
import numpy.typing as npt

from elevon.analysis.response import Pairs, Samples
from elevon.arrays import Floats
from elevon.errors import InputError, Interrupted
from elevon.plain import Plain
from elevon.results import Result


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


#: Part of the high points that is held out, and of the budget that co-kriging spends on high runs.
_HELD_OUT, _HIGH_SHARE = 0.3, 0.5


@dataclass(frozen=True)
class SurrogateScore(Plain):
    """A surrogate's error on held-out high points over random splits.

    Attributes
    ----------
    name : str
        ``kriging``, ``cokriging``, ``low`` (kriging of the reduced-order model alone) or
        ``mean`` (no surrogate: the training runs' mean).
    high, low : int
        Runs it was given.
    errors : list of float
        Root mean square error of each split over the response's standard deviation.
    mean, interval : float, (float, float)
        Of `errors`; 95 %, Student's t over the splits.
    """

    name: str
    high: int
    low: int
    errors: list[float]
    mean: float
    interval: tuple[float, float]


@dataclass(frozen=True)
class Study(Result):
    """Surrogates of one response at equal cost.

    Attributes
    ----------
    cost_ratio : float or None
        Cost of a high run over that of a low one.
    budget : int
        In high runs.
    gain, gain_interval : float and (float, float), or None
        Error of kriging less that of co-kriging, split by split: positive where two fidelities
        help.
    """

    response: str
    unit: str
    points: int
    held_out: int
    splits: int
    budget: int
    cost_ratio: float | None
    correlation: float | None
    variants: list[SurrogateScore]
    gain: float | None
    gain_interval: tuple[float, float] | None

    KIND: ClassVar = "surrogate"
    COMPUTED: ClassVar = ("status",)
    TABLE: ClassVar = "variants"
    BARS: ClassVar = ("name", "mean")
    status: ClassVar = "ok"

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        best = min(self.variants, key=lambda item: item.mean)
        return (
            f"{self.response}: {best.name} predicts runs it has not seen within {best.mean:.3g} of "
            "the response's standard deviation."
        )


def study(
    high: Samples,
    pairs: Pairs | None = None,
    *,
    response: str = "",
    unit: str = "1",
    cost_ratio: float = 1.0,
    budget: int | None = None,
    splits: int = 10,
    seed: int = 0,
    progress: Callable[[float], object] | None = None,
) -> Study:
    """Compare surrogates on held-out points at equal cost.

    In each of `splits` random splits 30 % of the high points are held out. Kriging gets `budget` of
    the others; co-kriging half as many, and low runs for the rest of the cost, the paired points
    first (never a held-out point's partner); kriging of the reduced-order model
    alone gets low runs only.

    Parameters
    ----------
    high : Samples
        Of the switching model.
    pairs : Pairs, optional
        With the reduced-order model.
    cost_ratio : float
        Cost of a high run over that of a low one.
    budget : int, optional
        High runs; default half of those not held out.
    splits, seed : int
        Number of random splits, and their seed.
    progress : callable, optional
        Called with the done fraction; returning False interrupts.

    Raises
    ------
    InputError
        Too few points, or a budget that they do not have.
    """
    count = len(high.values)
    withheld = max(round(_HELD_OUT * count), 1)
    budget = (count - withheld) // 2 if budget is None else budget
    _check_budget(high, withheld, budget)
    generator = np.random.default_rng(seed)
    errors: dict[str, list[float]] = {}
    runs: dict[str, tuple[int, int]] = {}
    for split in range(splits):
        order = generator.permutation(count)
        for name, made in _fits(high, pairs, order, withheld, budget, cost_ratio, split):
            model, runs[name] = made
            errors.setdefault(name, []).append(_error(model, high, order[:withheld]))
        if progress is not None and progress((split + 1) / splits) is False:
            raise Interrupted(f"interrupted after {split + 1} of {splits} splits")
    gain: tuple[float | None, tuple[float, float] | None] = (None, None)
    if "cokriging" in errors:
        gain = _interval(np.subtract(errors["kriging"], errors["cokriging"]))
    variants = [SurrogateScore(name, *runs[name], them, *_interval(np.array(them)))
                for name, them in errors.items()]  # fmt: skip
    ratio = None if pairs is None else cost_ratio
    correlation = None if pairs is None else pairs.correlation
    return Study(response, unit, count, withheld, splits, budget, ratio, correlation,
                 variants, *gain)  # fmt: skip


def _check_budget(high: Samples, withheld: int, budget: int) -> None:
    count, quantities = len(high.values), high.points.shape[1]
    least = 2 * (quantities + 1)
    if count - withheld < least:
        raise InputError(
            f"{count} points are too few, {withheld} of them held out: {quantities} varied "
            f"quantities need at least {least} to learn from"
        )
    if not least <= budget <= count - withheld:
        raise InputError(
            f"budget = {budget} high runs of {count} points, {withheld} of them held out: give "
            f"{least} to {count - withheld}"
        )


@dataclass(frozen=True)
class _Mean:
    value: float

    def predict(self, points: Floats) -> tuple[Floats, Floats]:
        return np.full(len(points), self.value), np.zeros(len(points))


def _fits(  # noqa: PLR0917 - one split, all of it needed
    high: Samples,
    pairs: Pairs | None,
    order: npt.NDArray[np.int64],
    withheld: int,
    budget: int,
    ratio: float,
    seed: int,
) -> list[tuple[str, tuple[Interpolator, tuple[int, int]]]]:
    training = order[withheld : withheld + budget]
    points, values = high.points[training], high.values[training]
    fits: list[tuple[str, tuple[Interpolator, tuple[int, int]]]] = [
        ("mean", (_Mean(float(values.mean())), (budget, 0))),
        ("kriging", (Kriging.fit(points, values, seed), (budget, 0))),
    ]
    if pairs is None:
        return fits
    some = training[: max(round(_HIGH_SHARE * budget), high.points.shape[1] + 2)]
    low = _low_runs(pairs, order, withheld, round((budget - len(some)) * ratio), some)
    every = _low_runs(pairs, order, withheld, round(budget * ratio), training)
    below = pairs.low
    both = CoKriging.fit(
        below.points[low],
        below.values[low],
        high.points[some],
        high.values[some],
        seed=seed,
    )
    alone = Kriging.fit(below.points[every], below.values[every], seed)
    fits.append(("cokriging", (both, (len(some), len(low)))))
    fits.append(("low", (alone, (0, len(every)))))
    return fits


def _low_runs(
    pairs: Pairs,
    order: npt.NDArray[np.int64],
    withheld: int,
    most: int,
    first: Sequence[int] | npt.NDArray[np.int64],
) -> npt.NDArray[np.int64]:
    """Return low runs for a cost: the partners of the high runs first, none of a held-out one."""
    out = set(pairs.partner[order[:withheld]].tolist())
    partners = [int(p) for p in pairs.partner[first] if p >= 0]
    order_of_low = np.random.default_rng(order[:1]).permutation(len(pairs.low.values))
    chosen = dict.fromkeys([*partners, *(int(r) for r in order_of_low)])
    wanted = [index for index in chosen if index not in out]
    return np.array(wanted[: max(most, 4)], dtype=np.int64)


def _error(model: Interpolator, high: Samples, withheld: npt.NDArray[np.int64]) -> float:
    mean, _ = model.predict(high.points[withheld])
    spread = float(high.values.std())
    return float(np.sqrt(np.mean((mean - high.values[withheld]) ** 2)) / spread)


def _interval(values: Floats) -> tuple[float, tuple[float, float]]:
    from scipy.stats import t

    mean, count = float(np.mean(values)), len(values)
    if count < 2:
        return mean, (float("nan"), float("nan"))
    half = float(t.ppf(0.975, count - 1) * np.std(values, ddof=1) / np.sqrt(count))
    return mean, (mean - half, mean + half)
