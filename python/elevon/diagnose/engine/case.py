"""One log against its healthy unit: features, expectation, what each fault would do to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import SEEN, Reason
from elevon.diagnose.engine.candidates import CandidateFault
from elevon.diagnose.engine.healthy import Elsewhere, Healthy, healthy
from elevon.diagnose.engine.likelihood import STRAY
from elevon.diagnose.engine.plausibility import Plausibility, plausibility
from elevon.diagnose.engine.reading import Reading, ReplayUnit
from elevon.diagnose.engine.replay import Replay, bounded, modelled, replay
from elevon.diagnose.engine.spread import LearnedSpread
from elevon.diagnose.engine.table import FeatureVector
from elevon.experiment import Variant

if TYPE_CHECKING:
    from elevon.actuator import Actuator


DRAWS = 10_000  # by which 5 % is met to 0.2 %


class _Ways:
    """Directions in whitened features, and the likelihood ratio of the best of them."""

    def __init__(self, directions: Floats, both: Sequence[bool], degrees: float) -> None:
        size = np.linalg.norm(directions, axis=1)
        seen = size > 1e-9
        ways, either = directions[seen] / size[seen, None], np.array(both, dtype=np.bool_)[seen]
        self._ways, self._either = np.vstack([ways[either], ways[~either]]), int(either.sum())
        self._degrees = degrees

    def ratio(self, residual: Floats) -> Floats:
        if not len(self._ways):
            return np.zeros(len(residual))
        along = residual @ self._ways.T
        np.abs(along[:, : self._either], out=along[:, : self._either])
        most = np.maximum(along.max(axis=1), 0.0)
        square = np.einsum("mk,mk->m", residual, residual)
        gain = np.maximum(square - most**2, 0.0)
        power = 0.5 * (self._degrees + residual.shape[1])
        return np.asarray(
            power * (np.log1p(square / self._degrees) - np.log1p(gain / self._degrees))
        )


class Detector:
    """Likelihood ratio of the best fault against healthy, and how a healthy unit's is spread.

    Parameters
    ----------
    directions : ndarray, shape (d, k)
        Shifts of the candidates in the whitened features; length is of no matter.
    both : sequence of bool
        Whether the shift may have either sign.
    degrees : float
        Of freedom of Student's distribution.
    anywhere : float
        Share of the false-alarm rate for deviations in any direction.
    draws : ndarray, shape (d, k), optional
        Whitened healthy logs; by default they follow Student's distribution.
    each : ndarray, shape (e, k), optional
        Directions, either way, of what no candidate may do.
    alone : float
        Share of the false-alarm rate for them.
    """

    def __init__(
        self,
        directions: Floats,
        both: Sequence[bool],
        degrees: float,
        anywhere: float = 0.0,
        draws: Floats | None = None,
        *,
        each: Floats | None = None,
        alone: float = 0.0,
    ) -> None:
        self._degrees, self._anywhere = degrees, anywhere
        self._tests = [(_Ways(directions, both, degrees), max(1.0 - anywhere - alone, 1e-12))]
        if each is not None:
            self._tests.append((_Ways(each, [True] * len(each), degrees), alone))
        healthy = _student(directions.shape[1], degrees) if draws is None else draws
        ratios = [ways.ratio(healthy) for ways, _ in self._tests]
        self._ratios = [np.sort(ratio) for ratio in ratios]
        self._healthy = np.sort(self._score(healthy, ratios))

    def ratio(self, residual: Floats) -> Floats:
        """Log likelihood ratio of the candidates, of whitened features, shape (m, k) to (m,)."""
        return self._tests[0][0].ratio(residual)

    def score(self, residual: Floats) -> Floats:
        """What is judged of whitened features, shape (m, k) to (m,): the most seldom.

        The candidates' ratio, where nothing is set aside for anything else; else less the log of a
        chance. The squared length over k follows Fisher's distribution.
        """
        return self._score(residual, [ways.ratio(residual) for ways, _ in self._tests])

    def _score(self, residual: Floats, ratios: Sequence[Floats]) -> Floats:
        from scipy.stats import f as fisher

        if len(ratios) == 1 and not self._anywhere:
            return ratios[0]
        chances = []
        for (_, share), known, ratio in zip(self._tests, self._ratios, ratios, strict=True):
            above = len(known) - np.searchsorted(known, ratio)
            chances.append(np.maximum(above, 1) / len(known) / share)
        if self._anywhere:
            square = np.mean(residual**2, axis=1)
            off = fisher.sf(square, residual.shape[1], self._degrees) / self._anywhere
            chances.append(np.maximum(off, 1e-300))
        return np.asarray(-np.log(np.minimum.reduce(chances)), dtype=np.float64)

    def threshold(self, rate: float) -> float:
        """Score that a healthy unit exceeds at this rate."""
        return float(np.quantile(self._healthy, 1.0 - rate))

    def chance(self, score: float) -> float:
        """How often a healthy unit has this score or a larger one; at least one draw."""
        above = len(self._healthy) - int(np.searchsorted(self._healthy, score))
        return max(above, 1) / len(self._healthy)


def _student(width: int, degrees: float) -> Floats:
    """Draw whitened healthy logs of Student's distribution, shape (d, width)."""
    rng = np.random.default_rng(15)
    chi = rng.chisquare(degrees, DRAWS) / degrees
    return np.asarray(rng.standard_normal((DRAWS, width)) / np.sqrt(chi)[:, None])


Faults = Sequence[tuple[CandidateFault, float]]

ANYWHERE = 0.2  # of the false alarms: what no candidate does. ASSUMED
ALONE = 0.1  # of them: what moves one feature and is no candidate. ASSUMED
SUSPECT = 1e-3  # chance of a baseline below which it is called faulty
_FEWER = 5000  # draws that show such a chance
_SEVERAL = 2  # baselines from which on a log can be judged by them without the model
_LOW = "low."  # parameters that `elevon fit-low` fits to the switching model
_SHARE = 3.0  # a unit's value over the model's, either way, that a shift is scaled by at most
#: Deviations that a fault moves the features by at least where its direction counts: what one
#: direction alone needs at 5 % of false alarms; a smaller fault is not called by itself.
_DIRECTED = 2.0


@dataclass(frozen=True)
class LogCase:
    """One log against its healthy unit, before whitening.

    Attributes
    ----------
    name : str
        The log.
    features : FeatureVector
        Of the log.
    unit : Healthy
        What a healthy unit would show.
    model : Replay
        What faults do to the features.
    findings : tuple of str
        What the log lacks, and baselines that were left out.
    misfit : Reason or None
        Where the model shows none of the unit's baselines: what of them it shows least.
    plausible : Plausibility
        What no candidate is looked for by.
    item : Reading, optional
        That runs the log's test.
    baselines : tuple of FeatureVector
        Healthy logs of the test that it stands on.
    explains : bool
        Whether the model shows the unit's healthy logs. Where it does not, `unit` stands on these
        logs alone and no fault of the model explains anything.
    """

    name: str
    features: FeatureVector
    unit: Healthy
    model: Replay
    findings: tuple[str, ...] = ()
    misfit: Reason | None = None
    plausible: Plausibility = field(default_factory=Plausibility)
    item: Reading | None = None
    baselines: tuple[FeatureVector, ...] = ()
    explains: bool = True

    @property
    def covariance(self) -> Floats:
        """Of the healthy unit's features with this log's noise, shape (k, k)."""
        return self.unit.covariance + np.diag(self.features.std**2)

    @property
    def residual(self) -> Floats:
        """How far the features are from the healthy unit's, shape (k,), bounded as shifts are."""
        at = self.model.places(self.unit.names)
        records = [self.model.table[name] for name in self.unit.names]
        return bounded(
            self.features.values - self.unit.mean, records, self.model.healthy.values[at]
        )

    @property
    def errors(self) -> Floats:
        """Model error of each number's shift on its own, as a share, shape (k,)."""
        return np.array([self.model.table[name].error for name in self.unit.names])

    @property
    def unit_known(self) -> bool:
        """Whether a healthy log of this unit was seen: a baseline, or one it is calibrated to."""
        return self.unit.baselines > 0 or self.item is None or calibrated(self.item.actuator)

    def shift(self, key: str, severity: Floats) -> Floats:
        """Return what severities, shape (m,), do to this unit's features, shape (m, k)."""
        at, sizes, level, factor = self._unit_ways
        out = self.model.shift(key, severity)[:, at]
        out[:, sizes] = np.hypot(level, out[:, sizes]) - level
        out *= factor
        return out

    @cached_property
    def _unit_ways(self) -> tuple[list[int], list[int], Floats, Floats]:
        """Places of features in the model; those of sizes, and their values; factors of shares."""
        at, mean = self.model.places(self.unit.names), self.unit.mean
        kinds = [self.model.table[name].kind for name in self.unit.names]
        sizes = [k for k, kind in enumerate(kinds) if kind == "size"]
        of_model = self.model.healthy.values[at]
        shares = np.array([kind == "share" for kind in kinds]) & (mean * of_model > 0.0)
        factor = np.ones(len(at))
        factor[shares] = np.clip(mean[shares] / of_model[shares], 1.0 / _SHARE, _SHARE)
        return at, sizes, np.maximum(mean[sizes], 0.0), factor

    def uncertainty(self, key: str, severity: float) -> Floats:
        """Return the deviation that a severity gives this unit's features, shape (k,)."""
        return self.model.uncertainty(key, severity)[self.model.places(self.unit.names)]


def calibrated(actuator: Actuator) -> bool:
    """Whether an actuator's numbers stand on logs; those of its reduced-order model need none."""
    known = actuator.parameters
    return any(known[p].confidence == "calibrated" and not p.startswith(_LOW) for p in known)


def case_of(
    item: Reading,
    candidates: Sequence[CandidateFault],
    baselines: Sequence[Reading],
    spread: LearnedSpread | None = None,
    left_out: Sequence[str] = (),
) -> LogCase:
    """Hold a log against the model and the baselines, in whatever order they come.

    Parameters
    ----------
    item : Reading
        The log.
    candidates : sequence of CandidateFault
        Faults.
    baselines : sequence of Reading
        Healthy logs; those of the same test serve, others by what is pooled.
    spread : LearnedSpread, optional
        Of healthy days; default: the stated one.
    left_out : sequence of str
        Beginnings of names of features that do not count, since something else moves them.
    """
    baselines = sorted(baselines, key=lambda b: b.key())
    others = [b for b in baselines if not item.same(b)]
    item, same = item.matched([b for b in baselines if item.same(b)])
    model = replay(item, candidates, same)
    references = [(b.name, b.features if item.repeats(b) else transferred(b, model)) for b in same]
    names = [n for n in item.features.names if n in model.healthy.names]
    names = [n for n in names if all(n in e.names for _, e in references)]
    names = [n for n in item.usable(names, same) if not n.startswith(tuple(left_out))]
    elsewhere = []
    if any(model.table[n].pooled for n in names):
        elsewhere = [Elsewhere(b.features, modelled(b)) for b in others if item.pools(b)]
    trial = _Trial(model, tuple(names), tuple(candidates), spread)
    sound, findings, misfit, explains = _sound(references, trial)
    known = tuple(features.only(names) for k, (_, features) in enumerate(references) if k in sound)
    unit = trial.unit(known, elsewhere, by_data=not explains)
    trusted = [b for k, b in enumerate(same) if k in sound]
    plausible = plausibility(item, trusted).without(left_out)
    return LogCase(
        item.name, item.features.only(names), unit, model, (*findings, *item.notes(same)), misfit,
        plausible, item, known, explains,
    )  # fmt: skip


def transferred(item: Reading, model: Replay) -> FeatureVector:
    """Return a baseline's features, moved by what the model says of the two logs' commands."""
    features, there, here = item.features, modelled(item), model.healthy
    values = features.values.copy()
    for k, name in enumerate(features.names):
        if name not in here.names or name not in there.names:
            continue
        if model.table[name].kind != "size" and not model.table[name].constant:
            values[k] += float((here.only([name]).values - there.only([name]).values)[0])
    return replace(features, values=values)


@dataclass(frozen=True)
class _Trial:
    """What a log of one test is held against, with one choice of healthy logs or another."""

    model: Replay
    names: tuple[str, ...]
    candidates: tuple[CandidateFault, ...]
    spread: LearnedSpread | None

    def unit(
        self,
        logs: Sequence[FeatureVector],
        elsewhere: Sequence[Elsewhere] = (),
        *,
        by_data: bool = False,
    ) -> Healthy:
        """Return the healthy unit by some logs."""
        return healthy(
            self.model, self.names, logs, elsewhere, spread_known=self.spread, by_data=by_data
        )

    def case(
        self, features: FeatureVector, logs: Sequence[FeatureVector], *, by_data: bool = False
    ) -> LogCase:
        """Return a log against the healthy unit by others."""
        unit = self.unit(logs, by_data=by_data)
        return LogCase("", features.only(self.names), unit, self.model, explains=not by_data)

    def chance(
        self, features: FeatureVector, logs: Sequence[FeatureVector], *, by_data: bool = False
    ) -> float:
        """Return how often a healthy unit deviates as much; by data no fault gives a direction."""
        case = self.case(features, logs, by_data=by_data)
        return chance_of(case, () if by_data else self.candidates)


#: Of a unit that the model does not show: what its logs are judged by.
BY_DATA = (
    "the model does not show the healthy logs of this unit, so no fault of it is named: detection "
    "is by these logs alone"
)


def _sound(
    references: Sequence[tuple[str, FeatureVector]], trial: _Trial
) -> tuple[list[int], list[str], Reason | None, bool]:
    """Return which baselines count, findings, the model's misfit, and whether it explains.

    A baseline that deviates from the model and from the others is left out. Where the model shows
    none of several, what is left of them is no spread of healthy days: then each is held against
    the others without the model. Where none is left the model does not show what the healthy unit
    shows, nor then what a fault would do to it.
    """
    logs = [features for _, features in references]
    alone = [trial.chance(features, ()) for features in logs]
    explains = len(logs) < _SEVERAL or max(alone) >= SUSPECT
    sound: list[int] = []
    findings: list[str] = []
    misfit = None
    for k, (name, features) in enumerate(references):
        others = [*logs[:k], *logs[k + 1 :]]
        chance = alone[k]
        if others:
            chance = max(chance, trial.chance(features, others, by_data=not explains))
        if chance >= SUSPECT:
            sound.append(k)
            continue
        misfit = misfit or farthest(trial.case(features, ()))
        reason = "it is unlike the other baselines"
        if not others:
            reason = "the actuator file is not calibrated to this unit (elevon calibrate)"
        findings.append(
            f"baseline {name} looks faulty itself, or {reason}: a healthy unit deviates as much "
            f"in less than {100 * SUSPECT:g} % of logs; it is left out"
        )
    if not explains and len(sound) >= _SEVERAL:
        off = farthest(trial.case(logs[sound[0]], ()))
        findings.append(f"{BY_DATA} ({off.feature} is {off.value:.3g}, beyond {off.limit:.3g})")
        return sound, findings, None, False
    return sound, findings, None if sound and explains else misfit, True


def farthest(case: LogCase) -> Reason:
    """Return the feature that is furthest from the healthy unit, in deviations, and its limit."""
    std = np.sqrt(np.diag(case.covariance))
    score = (case.features.values - case.unit.mean) / std
    k = int(np.argmax(np.abs(score)))
    plausible = case.plausible
    if len(plausible.names) and np.abs(plausible.score).max() > abs(score[k]):
        k = int(np.argmax(np.abs(plausible.score)))
        limit = plausible.mean[k] + SEEN * np.sign(plausible.score[k]) * plausible.std[k]
        return Reason(plausible.names[k], float(plausible.values[k]), float(limit))
    limit = case.unit.mean[k] + SEEN * np.sign(score[k]) * std[k]
    return Reason(case.unit.names[k], float(case.features.values[k]), float(limit))


def chance_of(case: LogCase, candidates: Sequence[CandidateFault]) -> float:
    """Return how often a healthy unit deviates as much as this log."""
    logs = JoinedLogs((case,))
    detector = logs.detector(candidates, _FEWER)
    return detector.chance(logs.score(detector))


@dataclass(frozen=True)
class JoinedLogs:
    """Logs of one unit taken together; what changes from run to run is independent between them.

    Attributes
    ----------
    cases : tuple of LogCase
        One a log.
    """

    cases: tuple[LogCase, ...]

    @cached_property
    def residual(self) -> Floats:
        """How far the features are from the healthy unit's, shape (k,)."""
        return np.concatenate([case.residual for case in self.cases])

    @cached_property
    def covariance(self) -> Floats:
        """Of a healthy unit's, shape (k, k)."""
        from scipy.linalg import block_diag

        return np.asarray(block_diag(*[case.covariance for case in self.cases]))

    @cached_property
    def root(self) -> Floats:
        """What whitens the features, shape (k, k)."""
        return np.asarray(np.linalg.inv(np.linalg.cholesky(self.covariance)))

    @cached_property
    def errors(self) -> Floats:
        """Model error of each number's shift on its own, as a share, shape (k,)."""
        return np.concatenate([case.errors for case in self.cases])

    @property
    def degrees(self) -> float:
        """Of freedom: how well the spread is known."""
        return min(case.unit.degrees for case in self.cases)

    @property
    def explained(self) -> bool:
        """Whether the model shows the unit's healthy logs in all tests."""
        return all(case.explains for case in self.cases)

    def shift(self, key: str, severity: Floats) -> Floats:
        """Return what severities, shape (m,), do to the features, shape (m, k)."""
        return np.hstack([case.shift(key, severity) for case in self.cases])

    def shift_at(self, key: str, severity: float) -> Floats:
        """Return what one severity does to the features, shape (k,)."""
        return np.asarray(self.shift(key, np.array([severity]))[0])

    def uncertainty(self, key: str, severity: float) -> Floats:
        """Return the deviation that a severity gives the features, shape (k,)."""
        return np.concatenate([case.uncertainty(key, severity) for case in self.cases])

    def error_of(self, c: CandidateFault, severity: float) -> Floats:
        """Return the covariance of the model's error in what a fault does, shape (k, k)."""
        shift = self.shift_at(c.key, severity)
        each = (self.errors * shift) ** 2 + self.uncertainty(c.key, severity) ** 2
        return np.asarray(np.diag(each) + c.error**2 * np.outer(shift, shift))

    def detector(self, candidates: Sequence[CandidateFault], count: int = DRAWS) -> Detector:
        """Return the test by so many draws.

        A shift shorter than `_DIRECTED` has no direction that is known: the runs' rounding is as
        large, and another in each. Each feature alone is a direction, too, for a share of its own:
        something else may move no other.
        """
        rows = [np.zeros((0, len(self.root)))]
        for c in candidates:
            at = self.cases[0].model.severities[c.key]
            moved = self.shift(c.key, at[at != 0.0]) @ self.root.T
            rows.append(moved[np.linalg.norm(moved, axis=1) >= _DIRECTED])
        parts = [c.unit.drawn(count, c.features.std, 15 + k) for k, c in enumerate(self.cases)]
        ways, draws = np.vstack(rows), np.hstack(parts) @ self.root.T
        alone = ALONE if len(ways) else 1.0 - ANYWHERE  # no fault's direction takes a share
        return Detector(
            ways, [False] * len(ways), self.degrees, ANYWHERE, draws, each=self.root.T, alone=alone
        )

    def score(self, detector: Detector) -> float:
        """Return what the logs are judged by."""
        return float(detector.score((self.root @ self.residual)[None, :])[0])


def allowed(
    logs: JoinedLogs, sets: Sequence[Faults], runs: Sequence[bool]
) -> tuple[Floats, Floats]:
    """Return by how much sets of faults let stray what they are not looked for by, shape (h, m).

    In deviations: a share of their whole shift, noise that they amplify, and what a model run makes
    of it, which has neither noise nor a sampled controller. Beside it the latter alone.

    Parameters
    ----------
    logs : JoinedLogs
        The logs.
    sets : sequence of sequence of (CandidateFault, float)
        Faults and severities.
    runs : sequence of bool
        Whether a set is worth a run.
    """
    strays = []
    for faults in sets:
        moved = [logs.shift_at(c.key, s) for c, s in faults]
        size = float(np.linalg.norm(logs.root @ np.sum(moved, axis=0))) if moved else 0.0
        strays.append(STRAY * size)
    chosen = [faults if run else () for faults, run in zip(sets, runs, strict=True)]
    by_run = np.hstack([_run_plausible(case, chosen) for case in logs.cases])
    louder = np.hstack([_amplified(case, chosen) for case in logs.cases])
    return np.hypot(by_run + louder, np.array(strays)[:, None]), by_run


def _amplified(case: LogCase, sets: Sequence[Faults]) -> Floats:
    """How far faults that amplify noise move it, shape (h, m), in deviations."""
    names, out = case.plausible.names, np.zeros((len(sets), len(case.plausible.names)))
    size = np.abs(case.plausible.mean) / case.plausible.std
    for k, faults in enumerate(sets):
        for c, severity in faults:
            out[k] += np.isin(names, c.amplified) * abs(severity) * size
    return out


def _run_plausible(case: LogCase, sets: Sequence[Faults]) -> Floats:
    """How far model runs with faults move it, shape (h, m), in deviations."""
    names, out = case.plausible.names, np.zeros((len(sets), len(case.plausible.names)))
    at = [k for k, faults in enumerate(sets) if faults]
    if case.item is None or not names or not at:
        return out
    units = [Variant(faults=tuple(c.text(s) for c, s in sets[k])) for k in at]
    healthy, *others = case.item.plausible_of([ReplayUnit(), *map(ReplayUnit, units)])
    for k, seen in zip(at, others, strict=True):
        known = [n for n in names if n in healthy.names and n in seen.names]
        moved = np.abs(seen.only(known).values - healthy.only(known).values)
        places = [names.index(n) for n in known]
        out[k, places] += moved / case.plausible.std[places]
    return out
