"""What is still possible after the tests so far: sets of faults, their weights and severities."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.diagnose.bymodel.candidates import CANDIDATES, Candidate
from elevon.diagnose.bymodel.posterior import PRIOR_FAULTY, SECOND
from elevon.errors import FormatError, InputError

__all__ = ["Belief", "Possible", "read_result"]

Floats = npt.NDArray[np.float64]
_UNLISTED = 0.002  # weight of a single fault that a result does not list
_SMALL = 0.1  # root of the least severity over the greatest, where nothing is known of it
_NINETY = 3.29  # deviations in a Gaussian's interval of 90 %
_KNOWN = {c.key: c for c in CANDIDATES}


@dataclass(frozen=True)
class Possible:
    """One set of faults.

    Attributes
    ----------
    keys : tuple of str
        ``KIND@PLACE``; none for healthy.
    weight : float
        Probability.
    centre, deviation : tuple of float
        Severity of each; a deviation of infinity: anywhere in the candidate's range, small
        more often than large.
    """

    keys: tuple[str, ...]
    weight: float
    centre: tuple[float, ...] = ()
    deviation: tuple[float, ...] = ()

    def severities(self, count: int, rng: np.random.Generator) -> Floats:
        """Draw severities, shape (count, faults), within the candidates' ranges."""
        columns = []
        for key, centre, deviation in zip(self.keys, self.centre, self.deviation, strict=True):
            c = _KNOWN[key]
            if math.isfinite(deviation):
                drawn = centre + deviation * rng.standard_normal(count)
            else:
                end = np.where(rng.random(count) * (c.high - c.low) < -c.low, c.low, c.high)
                drawn = end * rng.uniform(_SMALL, 1.0, count) ** 2
            columns.append(np.clip(drawn, c.low, c.high))
        return np.stack(columns, axis=1) if columns else np.zeros((count, 0))


@dataclass(frozen=True)
class Belief:
    """Sets of faults whose weights sum to one."""

    possible: tuple[Possible, ...]

    @classmethod
    def of(cls, possible: Sequence[Possible]) -> Belief:
        """Return the sets with their weights made to sum to one."""
        total = sum(p.weight for p in possible)
        if not total > 0.0:
            raise InputError("next-test: nothing is possible; the results contradict each other")
        return cls(tuple(replace(p, weight=p.weight / total) for p in possible))

    @classmethod
    def prior(cls, candidates: Sequence[Candidate] = CANDIDATES) -> Belief:
        """Return what is believed before any test: as diagnosis by the model weighs it."""
        total = sum(c.rate for c in candidates)
        out = [Possible((), 1.0 - PRIOR_FAULTY)]
        for c in candidates:
            share = PRIOR_FAULTY * (1.0 - SECOND) * c.rate / total
            out.append(Possible((c.key,), share, (0.0,), (math.inf,)))
        pairs = list(combinations(candidates, 2))
        norm = sum(a.rate * b.rate for a, b in pairs) or 1.0
        for a, b in pairs:
            share = PRIOR_FAULTY * SECOND * a.rate * b.rate / norm
            out.append(Possible((a.key, b.key), share, (0.0, 0.0), (math.inf, math.inf)))
        return cls.of(out)

    @classmethod
    def after(cls, results: Sequence[Mapping[str, Any]]) -> Belief:
        """Return what is believed after diagnoses (`elevon diagnose --json`) of different logs.

        Each result counts by how far it moved the weights from the prior.
        """
        prior = {p.keys: p for p in cls.prior().possible}
        if not results:
            return cls.of(list(prior.values()))
        single = [_one(result) for result in results]
        out = []
        for keys, before in prior.items():
            said = [s.get(keys) for s in single]
            weight = before.weight
            for other in said:
                ratio = (other.weight if other else _unlisted(keys)) / before.weight
                weight *= ratio
            known = [other for other in said if other is not None]
            out.append(_merged(replace(before, weight=weight), known))
        return cls.of([p for p in out if p.weight > 0.0])

    @property
    def entropy(self) -> float:
        """What is not known, in bits."""
        weights = np.array([p.weight for p in self.possible])
        weights = weights[weights > 0.0]
        return float(-np.sum(weights * np.log2(weights)))

    def leading(self, least: float = 0.003) -> Belief:
        """Return the sets that are worth telling apart."""
        return Belief.of([p for p in self.possible if p.weight >= least])


def _unlisted(keys: tuple[str, ...]) -> float:
    return _UNLISTED if len(keys) == 1 else 0.1 * _UNLISTED


def _merged(possible: Possible, said: Sequence[Possible]) -> Possible:
    """Join severities by their precision."""
    known = [s for s in said if all(map(math.isfinite, s.deviation))]
    if not known or not possible.keys:
        return possible
    centres = np.array([s.centre for s in known])
    precision = np.array([s.deviation for s in known]) ** -2.0
    centre = (precision * centres).sum(axis=0) / precision.sum(axis=0)
    deviation = 1.0 / np.sqrt(precision.sum(axis=0))
    return replace(possible, centre=tuple(centre.tolist()), deviation=tuple(deviation.tolist()))


def read_result(path: str | Path) -> dict[str, Any]:
    """Read what `elevon diagnose --json` printed.

    Raises
    ------
    FormatError
        No such file, no JSON, or no diagnosis.
    """
    try:
        data = json.loads(Path(path).read_text("utf-8"))
        _one(data)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FormatError(
            f"{path}: not a result of elevon diagnose --json: {type(error).__name__} {error}"
        ) from error
    return dict(data)


def _one(result: Mapping[str, Any]) -> dict[tuple[str, ...], Possible]:
    """Return the sets that one result lists."""
    p_fault = min(max(float(result["p_fault"]), 1e-6), 1.0 - 1e-6)
    faults = {f"{f['kind']}@{f['place']}": f for f in result["faults"]}
    best = tuple(sorted(result.get("best", {}).get("faults", ()), key=_order))
    share = float(result.get("best", {}).get("probability", 0.0)) if len(best) == 2 else 0.0
    out: dict[tuple[str, ...], Possible] = {(): Possible((), 1.0 - p_fault)}
    for key, fault in faults.items():
        weight = max(float(fault["probability"]) - (share if key in best else 0.0), 1e-4)
        alike = [f"{e['kind']}@{e['place']}" for e in fault["equivalents"]]
        alike = [k for k in alike if k in _KNOWN and k.partition("@")[0] != fault["kind"]]
        rates = [_KNOWN[k].rate for k in (key, *alike) if k in _KNOWN]
        for k, rate in zip((key, *alike), rates, strict=False):
            known = k == key
            centre = float(fault["severity"]) if known else 0.0
            deviation = _deviation(fault) if known else math.inf
            out[k,] = Possible((k,), weight * rate / sum(rates), (centre,), (deviation,))
    if len(best) == 2 and all(k in faults for k in best):
        out[best] = Possible(
            best, share, tuple(float(faults[k]["severity"]) for k in best),
            tuple(_deviation(faults[k]) for k in best),
        )  # fmt: skip
    return out


def _deviation(fault: Mapping[str, Any]) -> float:
    low, high = fault["interval"]
    return max(float(high) - float(low), 1e-9) / _NINETY


def _order(key: str) -> int:
    return list(_KNOWN).index(key)
