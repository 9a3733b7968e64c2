"""What is still possible after the tests so far: sets of faults, their weights and severities."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import chain, combinations
from pathlib import Path
from typing import Annotated, Any

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import Explanation
from elevon.diagnose.engine.candidates import CANDIDATES, CandidateFault
from elevon.diagnose.engine.posterior import PRIOR_FAULTY, SECOND
from elevon.errors import FormatError, InputError
from elevon.plain import REMAINDER, Plain
from elevon.results import read_json

_LEAST = 1e-4  # weight that all sets have together that a result does not list
_SMALL = 0.1  # root of the least severity over the greatest, where nothing is known of it
_NINETY = 3.29  # deviations in a Gaussian's interval of 90 %


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

    def severities(
        self, count: int, rng: np.random.Generator, known: Mapping[str, CandidateFault]
    ) -> Floats:
        """Draw severities, shape (count, faults), within the ranges of candidates, by key."""
        columns = []
        for key, centre, deviation in zip(self.keys, self.centre, self.deviation, strict=True):
            c = known[key]
            if c.whole:
                deviation = min(deviation, c.high)  # noqa: PLW2901 - any count is as likely
            if math.isfinite(deviation):
                drawn = centre + deviation * rng.standard_normal(count)
            else:
                end = np.where(rng.random(count) * (c.high - c.low) < -c.low, c.low, c.high)
                drawn = end * rng.uniform(_SMALL, 1.0, count) ** 2
            drawn = np.clip(drawn, c.low, c.high)
            columns.append(np.maximum(np.rint(drawn), 1.0) if c.whole else drawn)
        return np.stack(columns, axis=1) if columns else np.zeros((count, 0))


@dataclass(frozen=True)
class Belief:
    """Sets of faults whose weights sum to one, and the candidates that they are of."""

    possible: tuple[Possible, ...]
    candidates: tuple[CandidateFault, ...] = CANDIDATES

    @cached_property
    def known(self) -> dict[str, CandidateFault]:
        """The candidates by their keys."""
        return {c.key: c for c in self.candidates}

    @classmethod
    def of(
        cls, possible: Sequence[Possible], candidates: Sequence[CandidateFault] = CANDIDATES
    ) -> Belief:
        """Return the sets with their weights made to sum to one."""
        total = sum(p.weight for p in possible)
        if not total > 0.0:
            raise InputError("next-test: nothing is possible; the results contradict each other")
        return cls(tuple(replace(p, weight=p.weight / total) for p in possible), tuple(candidates))

    @classmethod
    def prior(cls, candidates: Sequence[CandidateFault] = CANDIDATES) -> Belief:
        """Return what is believed before any test: the prior of diagnosis by the model."""
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
        return cls.of(out, candidates)

    @classmethod
    def after(
        cls,
        results: Sequence[Mapping[str, object]],
        candidates: Sequence[CandidateFault] = CANDIDATES,
    ) -> Belief:
        """Return what is believed after diagnoses (`elevon diagnose --json`) of different logs.

        Each result counts by how far it moved the weights from its own prior; a fault that it did
        not score counts as absent, as it would on a log that cannot show it.
        """
        prior = cls.prior(candidates).possible
        answered = [Answered.of(result, candidates) for result in results]
        out = []
        for before in prior:
            weight = before.weight * math.prod(t.ratio(before) for t in answered)
            known = [t.possible[before.keys] for t in answered if before.keys in t.possible]
            out.append(_merged(replace(before, weight=weight), known))
        return cls.of([p for p in out if p.weight > 0.0], candidates)

    @property
    def entropy(self) -> float:
        """What is not known, in bits."""
        weights = np.array([p.weight for p in self.possible])
        weights = weights[weights > 0.0]
        return float(-np.sum(weights * np.log2(weights)))

    def leading(self, least: float = 0.003) -> Belief:
        """Return the sets that are worth telling apart."""
        return Belief.of([p for p in self.possible if p.weight >= least], self.candidates)


def _merged(possible: Possible, results: Sequence[Possible]) -> Possible:
    """Join severities by their precision."""
    known = [s for s in results if all(map(math.isfinite, s.deviation))]
    if not known or not possible.keys:
        return possible
    centres = np.array([s.centre for s in known])
    precision = np.array([s.deviation for s in known]) ** -2.0
    centre = (precision * centres).sum(axis=0) / precision.sum(axis=0)
    deviation = 1.0 / np.sqrt(precision.sum(axis=0))
    return replace(possible, centre=tuple(centre.tolist()), deviation=tuple(deviation.tolist()))


def read_result(
    result: Mapping[str, object] | str | Path,
    candidates: Sequence[CandidateFault] = CANDIDATES,
) -> dict[str, object]:
    """Take what `elevon diagnose --json` printed, from a file or as a mapping, and check it.

    Parameters
    ----------
    result : mapping or path
        What was printed.
    candidates : sequence of CandidateFault
        Of the actuator; default: a turning servo's.

    Raises
    ------
    FormatError
        No such file, no JSON, or no diagnosis of such an actuator.
    """
    data = result if isinstance(result, Mapping) else read_json(result)
    try:
        Answered.of(data, candidates)
    except FormatError as error:
        place = "the diagnosis" if isinstance(result, Mapping) else f"{result}"
        raise FormatError(
            f"{place}: not a result of elevon diagnose --json of this actuator: {error}"
        ) from error
    return dict(data)


@dataclass(frozen=True)
class OpenQuestion(Plain):
    """What of a diagnosis' JSON is read here.

    Attributes
    ----------
    hypotheses : tuple of Explanation
        The sets of faults that it lists.
    detectable : dict of str to float
        The faults that it scored.
    prior : dict of str to float
        Of a diagnosis by learnt classes: the share of each fault in what was learnt.
    others : dict
        All else.
    """

    hypotheses: tuple[Explanation, ...]
    detectable: dict[str, float]
    prior: dict[str, float] = field(default_factory=dict)
    others: Annotated[dict[str, Any], REMAINDER] = field(default_factory=dict)


@dataclass(frozen=True)
class Answered:
    """What one result says.

    Attributes
    ----------
    possible : dict
        The sets it lists, by their keys.
    remaining : float
        Weight of all other sets together.
    candidates : frozenset of str
        Faults that it scored; what its log cannot show is not among them.
    prior : dict
        Weight of every set before its log.
    """

    possible: dict[tuple[str, ...], Possible]
    remaining: float
    candidates: frozenset[str]
    prior: dict[tuple[str, ...], float]

    @classmethod
    def of(
        cls, result: Mapping[str, object], candidates: Sequence[CandidateFault] = CANDIDATES
    ) -> Answered:
        """Read a result; raise `FormatError` where it is none."""
        known, read = [c.key for c in candidates], OpenQuestion.from_dict(result, "result")
        possible = {one.keys: one for one in (_possible(h, known) for h in read.hypotheses)}
        seen = {*read.detectable, *chain.from_iterable(possible)}
        candidates = [c for c in candidates if c.key in seen]
        prior = {p.keys: p.weight for p in Belief.prior(candidates).possible}
        if read.prior:
            prior = {keys: _learnt_share(keys, read.prior) for keys in prior}
        remaining = max(1.0 - sum(p.weight for p in possible.values()), _LEAST)
        return cls(possible, remaining, frozenset(c.key for c in candidates), prior)

    def ratio(self, before: Possible) -> float:
        """How far it moved the weight of a set."""
        keys = tuple(key for key in before.keys if key in self.candidates)
        if keys in self.possible:
            return self.possible[keys].weight / self.prior[keys]
        return self.remaining / sum(w for k, w in self.prior.items() if k not in self.possible)


def _learnt_share(keys: Sequence[str], prior: Mapping[str, float]) -> float:
    """Return the share of a set of faults in what was learnt, as if they came independently."""
    return math.prod(p if key in keys else 1.0 - p for key, p in prior.items()) or _LEAST


def _possible(item: Explanation, known: Sequence[str]) -> Possible:
    """Return one listed set; its keys in the order of the candidates."""
    rows = {f"{fault.kind}@{fault.place}": fault for fault in item.faults}
    if not rows.keys() <= set(known):
        raise FormatError(f"{', '.join(sorted(rows.keys() - set(known)))} is no candidate")
    keys = tuple(sorted(rows, key=known.index))
    centre = tuple(rows[key].severity for key in keys)
    deviation = tuple(_deviation(*rows[key].interval) for key in keys)
    if not all(map(math.isfinite, (item.probability, *centre, *deviation))):
        raise FormatError(f"{', '.join(keys) or 'healthy'}: a number is missing")
    return Possible(keys, item.probability, centre, deviation)


def _deviation(low: float, high: float) -> float:
    return max(high - low, 1e-9) / _NINETY
