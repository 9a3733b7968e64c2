"""Healthy baseline for each load, and how unlikely a recording is if the actuator is healthy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError, RangeError, did_you_mean


@dataclass(frozen=True, slots=True)
class HealthyBaseline:
    """Mean at each load, and one scatter for all loads.

    Attributes
    ----------
    names : tuple of str
        Features.
    loads : array, (loads,)
        Loads with healthy recordings [N].
    means : array, (loads, features)
        Healthy means.
    counts : array, (loads,)
        Healthy recordings of each load.
    spread : array, (features,)
        Deviation from recording to recording about the load's mean.
    freedom : int
        Degrees of freedom of `spread`.
    """

    names: tuple[str, ...]
    loads: Floats
    means: Floats
    counts: npt.NDArray[np.int64]
    spread: Floats
    freedom: int

    @classmethod
    def fit(
        cls, names: tuple[str, ...], values: npt.ArrayLike, load: npt.ArrayLike
    ) -> HealthyBaseline:
        """Fit means and scatter to healthy recordings.

        Parameters
        ----------
        names : tuple of str
            Features, the columns of `values`.
        values : array, (recordings, features)
            Of healthy recordings only.
        load : array, (recordings,)
            Load of each [N].

        Raises
        ------
        InputError
            No load has two recordings: there is no scatter.
        """
        x, at = np.atleast_2d(np.asarray(values, dtype=np.float64)), np.asarray(load, np.float64)
        loads, index, counts = np.unique(at, return_inverse=True, return_counts=True)
        freedom = len(x) - len(loads)
        if freedom < 1:
            raise InputError(
                f"healthy baseline: {len(x)} recordings at {len(loads)} loads; at least one load "
                "needs two, or the scatter from recording to recording is unknown"
            )
        means = np.array([x[at == value].mean(axis=0) for value in loads])
        spread = np.sqrt(((x - means[index]) ** 2).sum(axis=0) / freedom)
        return cls(names, loads, means, counts.astype(np.int64), spread, freedom)

    def deviations(self, values: npt.ArrayLike, load: npt.ArrayLike) -> Floats:
        """Return features in units of healthy spread, the uncertainty of the mean included.

        Raises
        ------
        InputError
            A load has no healthy recording.
        """
        x, at = np.atleast_2d(np.asarray(values, dtype=np.float64)), np.atleast_1d(load)
        rows = [self._row(float(value)) for value in at]
        width = self.spread * np.sqrt(1.0 + 1.0 / self.counts[rows])[:, None]
        return np.asarray((x - self.means[rows]) / np.where(width > 0.0, width, np.inf))

    def p_values(self, values: npt.ArrayLike, load: npt.ArrayLike) -> Floats:
        """Return the probability that a healthy recording deviates as much in any feature.

        The largest deviation follows Student's distribution; over all features the bound of
        Sidak holds for any positive dependence between them and errs to the safe side.
        """
        from scipy.special import stdtr

        largest = np.abs(self.deviations(values, load)).max(axis=1)
        single = 2.0 * stdtr(self.freedom, -largest)
        return np.asarray(-np.expm1(len(self.names) * np.log1p(-np.minimum(single, 1.0 - 1e-15))))

    def is_faulty(
        self, values: npt.ArrayLike, load: npt.ArrayLike, *, false_alarm: float = 0.05
    ) -> npt.NDArray[np.bool_]:
        """Tell which recordings deviate too much, at most `false_alarm` of the healthy ones."""
        if not 0.0 < false_alarm < 1.0:
            raise RangeError(f"false-alarm rate {false_alarm:g} is not between 0 and 1")
        return np.asarray(self.p_values(values, load) < false_alarm)

    def _row(self, load: float) -> int:
        near = np.flatnonzero(np.abs(self.loads - load) <= 1.0)
        if not near.size:
            known = [f"{value:g}" for value in self.loads]
            raise InputError(
                f"no healthy recording at a load of {load:g} N{did_you_mean(f'{load:g}', known)}"
            )
        return int(near[0])
