"""Spread from day to day and mismatch of model and machine: what is known of them, and the file.

Each is a factor of a variance that the package states: scaled inverse chi-square, worth so many
runs. A threshold by draws includes what is not known of it.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.draws import chi_square, uniform
from elevon.documents import Document, read_toml
from elevon.errors import FormatError
from elevon.files import write_text

DEGREES = 10.0  # ASSUMED: worth of the stated spread, and of the stated mismatch, in runs
#: ASSUMED: the same of a feature by itself, beside the factor that all features have in common.
STATED = 20.0
#: Density of the logarithm of the factor that all features' variances have in common falls with
#: its root. ASSUMED: so flat that a few baselines decide; a factor below one is none, as the
#: stated deviations are least ones.
_FACTORS = np.geomspace(1.0, 100.0, 61)
_FAR = 3.0  # ASSUMED: as `STATED`, of an offset: one feature that is far off is no matter of all
FORMAT = "elevon-spread"
_VERSION = 1
_ENDS = (0.05, 0.95)


class VarianceFactor(NamedTuple):
    """A variance over the stated one, and in how many runs it is worth that."""

    value: float = 1.0
    degrees: float = DEGREES

    def interval(self) -> tuple[float, float]:
        """Return the ends of its 90 % interval."""
        from scipy.stats import chi2

        high, low = (self.value * self.degrees / float(chi2.ppf(q, self.degrees)) for q in _ENDS)
        return low, high

    def root(self) -> tuple[float, float, float]:
        """Return the factor of the deviation, with the ends of its 90 % interval."""
        low, high = self.interval()
        return math.sqrt(self.value), math.sqrt(low), math.sqrt(high)


class FeatureSpread(NamedTuple):
    """What is known of one feature: its spread from day to day, and the model's mismatch."""

    days: VarianceFactor = VarianceFactor()
    mismatch: VarianceFactor = VarianceFactor()


class KnownSpread(NamedTuple):
    """Factors of features, shape (k,) each: of the spread, of the mismatch, with their worth."""

    days: Floats
    worth: Floats
    mismatch: Floats
    mismatch_worth: Floats


@dataclass(frozen=True)
class StepVariance:
    """Variances of a unit's steps from day to day over the stated ones: what is known of them.

    Each feature's is a factor that all features have in common, times one of its own (scaled
    inverse chi-square about one). Baselines tell both: few of them the common one well, as
    every feature counts for it.

    Attributes
    ----------
    worth : ndarray, shape (k,)
        Runs that the prior of a feature's own factor is worth.
    scatter : ndarray, shape (k,)
        Sum of squares of the baselines about their mean, over the stated variance.
    free : int
        Its degrees of freedom.
    common : ndarray, shape (m,)
        Probability of each of `_FACTORS`; none: there is no common factor.
    """

    worth: Floats
    scatter: Floats
    free: int = 0
    common: Floats = field(default_factory=lambda: np.zeros(0))

    @classmethod
    def of(cls, worth: Floats, scatter: Floats, free: int, alone: Floats) -> StepVariance:
        """Weigh a common factor by baselines.

        Parameters
        ----------
        worth, scatter, free
            As above.
        alone : ndarray, shape (k,)
            Square of the baselines' mean less the model's, over its stated variance.
        """
        from scipy.stats import f as fisher

        log = -0.5 * np.log(_FACTORS)
        seen = [(alone, 1, np.minimum(worth, _FAR)), (scatter / max(free, 1), free, worth)]
        for ratio, degrees, tail in seen if free else seen[:1]:
            each = np.maximum(ratio, 1e-9) / _FACTORS[:, None]
            log += np.sum(fisher.logpdf(each, degrees, tail) - np.log(_FACTORS)[:, None], axis=1)
        weight = np.exp(log - log.max())
        return cls(worth, scatter, free, weight / weight.sum())

    @property
    def value(self) -> Floats:
        """The factors, shape (k,)."""
        middle = 1.0 / float(np.sum(self.common / _FACTORS)) if len(self.common) else 1.0
        return (self.worth * middle + self.scatter) / (self.worth + self.free)

    def drawn(self, count: int, seed: int) -> tuple[Floats, Floats]:
        """Draw factors, shape (count, k), and the common one of each draw, shape (count, 1)."""
        common = np.ones((count, 1))
        if len(self.common):
            at = np.searchsorted(np.cumsum(self.common), uniform(count, (seed, 0)))
            common = _FACTORS[np.minimum(at, len(_FACTORS) - 1)][:, None]
        square = chi_square(count, tuple((self.worth + self.free).tolist()), (seed, 1))
        return (self.worth * common + self.scatter) / square, common


@dataclass(frozen=True)
class LearnedSpread:
    """Spread of healthy units, learnt from their logs.

    Attributes
    ----------
    actuator : str
        Name of the actuator file that the logs were held against.
    logs, units, days : int
        Learnt from; a unit's days are counted apart from another's.
    features : mapping of str to FeatureSpread
        By name; the stated ones hold where a feature is missing.
    alone, based : tuple of float
        Chance that draws give each learnt log, held out by its day: without a baseline, and with
        one of another day.
    """

    actuator: str = ""
    logs: int = 0
    units: int = 0
    days: int = 0
    features: Mapping[str, FeatureSpread] = field(default_factory=dict)
    alone: tuple[float, ...] = ()
    based: tuple[float, ...] = ()

    def of(self, names: Sequence[str]) -> KnownSpread:
        """Return what is known of features."""
        rows = [self.features.get(name, FeatureSpread()) for name in names]
        table = np.array([[*r.days, *r.mismatch] for r in rows], dtype=np.float64).reshape(-1, 4)
        return KnownSpread(*table.T)

    def enough(self, rate: float) -> bool:
        """Whether a conformal threshold reaches a rate of false alarms."""
        return self.days >= needed(rate)

    def chance(self, chance: float, baselines: int, rate: float) -> float:
        """Return how often a healthy log has such a chance: conformal, where that reaches a rate.

        The rank among the held-out healthy logs (Vovk, Gammerman and Shafer, 2005, chapter 2);
        it holds for a day that is exchangeable with theirs, whatever the features' distribution.
        """
        scores = self.based if baselines else self.alone
        if not scores or not self.enough(rate):
            return chance
        return (1.0 + sum(c <= chance for c in scores)) / (len(scores) + 1.0)

    def threshold_text(self, rate: float) -> str:
        """Say what a threshold stands on."""
        how = "conformal" if self.enough(rate) else "by draws of what is not known of the spread"
        return (
            f"threshold {how}: {self.days} healthy days were learnt, a conformal one at "
            f"{100.0 * rate:g} % needs {needed(rate)}"
        )

    def to_dict(self) -> dict[str, Any]:
        """Return it as plain types."""
        rows = {
            name: {
                "days": row.days.value, "days_worth": row.days.degrees,
                "mismatch": row.mismatch.value, "mismatch_worth": row.mismatch.degrees,
            }
            for name, row in self.features.items()
        }  # fmt: skip
        return {
            "format": FORMAT, "version": _VERSION, "actuator": self.actuator, "logs": self.logs,
            "units": self.units, "days": self.days, "alone": list(self.alone),
            "based": list(self.based), "features": rows,
        }  # fmt: skip

    def save(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Write it as TOML.

        Raises
        ------
        OutputExistsError
            The file is there, and not `force`.
        """
        data = self.to_dict()
        rows = data.pop("features")
        lines = ["# Variances over those that the package states, and their worth in runs."]
        lines += [f"{name} = {json.dumps(value)}" for name, value in data.items()]
        for name, row in rows.items():
            values = ", ".join(f"{key} = {value!r}" for key, value in row.items())
            lines.append(f"features.{json.dumps(name)} = {{ {values} }}")
        return write_text(path, "\n".join(lines) + "\n", force=force)

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> LearnedSpread:
        """Read a file that `save` wrote.

        Raises
        ------
        FormatError
            Another file, or a value that is none of a spread.
        """
        document = read_toml(Path(path))
        data = dict(document.data)
        if data.pop("format", None) != FORMAT or data.pop("version", None) != _VERSION:
            raise FormatError(f"{path}: no file of elevon learn-spread (format = {FORMAT!r})")
        try:
            rows = data.pop("features", {})
            features = {name: _row(document, name, row) for name, row in rows.items()}
            alone, based = (tuple(map(float, data.pop(name))) for name in ("alone", "based"))
            return cls(features=features, alone=alone, based=based, **data)
        except (TypeError, AttributeError, KeyError, ValueError) as error:
            raise FormatError(f"{path}: a key is missing or of another kind: {error}") from None


def stated(count: int) -> KnownSpread:
    """Return what is known of features whose spread was not learnt."""
    one, worth = np.ones(count), np.full(count, STATED)
    return KnownSpread(one, worth, one, worth)


def needed(rate: float) -> int:
    """Return how many healthy days a conformal threshold needs: the least n of 1/(n + 1) <= rate.

    >>> needed(0.05), needed(0.01)
    (19, 99)
    """
    return max(math.ceil(1.0 / rate - 1e-9) - 1, 1)


def _row(document: Document, name: str, row: Mapping[str, float]) -> FeatureSpread:
    values = [float(row[k]) for k in ("days", "days_worth", "mismatch", "mismatch_worth")]
    if len(row) != 4 or not all(math.isfinite(v) and v > 0.0 for v in values):
        place = document.place(("features", name))
        raise FormatError(f"{place}: days, mismatch and their worth must be above zero, not {row}")
    return FeatureSpread(VarianceFactor(*values[:2]), VarianceFactor(*values[2:]))
