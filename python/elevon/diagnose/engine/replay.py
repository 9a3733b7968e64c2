"""Model runs of a log's test: what the healthy unit and each fault would show, and the spread."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import SEEN
from elevon.diagnose.engine.candidates import CandidateFault
from elevon.diagnose.engine.reading import Reading, ReplayUnit
from elevon.diagnose.engine.table import (
    Feature,
    FeatureTable,
    FeatureVector,
    deviations,
    periodic_covariance,
)
from elevon.experiment import Variant

_MOST = 1e4  # least deviations that a fault moves a number by: beyond it nothing more is learnt
_ACTS = 0.5  # severity from which on a fault that is there or not acts
_BENT = 0.3  # of a straight line's shift: below it the shift sets in between two severities


@dataclass(frozen=True)
class Replay:
    """Features of the model in one test.

    Attributes
    ----------
    healthy : FeatureVector
        Of the actuator file as it is.
    severities : mapping of str to ndarray, shape (m,)
        Key of the candidate to the severities that were run.
    shifts : mapping of str to ndarray, shape (m, k)
        What they do to the features; of sizes the part at a right angle.
    table : FeatureTable
        Records of the features.
    mean : ndarray, shape (k,)
        Expected of a healthy unit.
    spread : ndarray, shape (k, k)
        Covariance from day to day, but for least deviations.
    degrees : float
        How well it is known.
    uncertainties : mapping of str to ndarray, shape (m, k)
        What severities do to features that depends on an angle no log shows, by key: its deviation.
    common_error : ndarray, shape (k,)
        What moves all features at once and is uncertain by its own size.
    alike : float
        As `Reading.ALIKE`.
    prior : bool
        As `Reading.PRIOR`.
    runs : int
        Of the model.
    """

    healthy: FeatureVector
    severities: Mapping[str, Floats]
    shifts: Mapping[str, Floats]
    table: FeatureTable
    mean: Floats
    spread: Floats
    degrees: float
    uncertainties: Mapping[str, Floats] = field(default_factory=dict)
    common_error: Floats | float = 0.0
    alike: float = 1.0
    prior: bool = True
    runs: int = 0

    def places(self, names: Sequence[str]) -> list[int]:
        """Return where features stand."""
        at = {name: k for k, name in enumerate(self.healthy.names)}
        return [at[name] for name in names]

    def shift(self, key: str, severity: Floats) -> Floats:
        """Return what severities of shape (m,) do to the features, shape (m, k)."""
        return _read(self.severities[key], self.shifts[key], severity)

    def uncertainty(self, key: str, severity: float) -> Floats:
        """Return the deviation that a severity gives the features, shape (k,)."""
        if key not in self.uncertainties:
            return np.zeros(len(self.healthy.names))
        at = np.array([severity])
        return np.asarray(_read(self.severities[key], self.uncertainties[key], at)[0])


def _read(at: Floats, table: Floats, severity: Floats) -> Floats:
    """Straight lines between the rows of a table; the ends beyond them."""
    below = np.searchsorted(at, severity, side="right") - 1
    low = np.minimum(np.maximum(below, 0), len(at) - 2)
    part = (severity - at[low]) / (at[low + 1] - at[low])
    part = np.minimum(np.maximum(part, 0.0), 1.0)[:, None]
    return np.asarray(table[low] * (1.0 - part) + table[low + 1] * part, dtype=np.float64)


def replay(
    item: Reading, candidates: Sequence[CandidateFault], baselines: Sequence[Reading] = ()
) -> Replay:
    """Run the test on the model: healthy, each candidate at several severities, and the spread.

    The healthy run is always the log's own. Shifts and spread are those of the first baseline whose
    runs serve, run once for all logs that stand against it; without one they are the log's own. So
    they depend on what the caller gives, not on earlier calls.

    Parameters
    ----------
    item : Reading
        The log.
    candidates : sequence of CandidateFault
        Faults.
    baselines : sequence of Reading
        Whose runs may serve.
    """
    alike = next((b for b in baselines if candidates and item.serves(b)), item)
    made = _remembered(alike, candidates)
    return made if alike is item else _about(made, modelled(item))


def modelled(item: Reading) -> FeatureVector:
    """Return the features of the healthy model in a log's test."""
    return _remembered(item, ()).healthy


def _about(made: Replay, healthy: FeatureVector) -> Replay:
    """Return the runs of another log of the test about a log's own healthy run."""
    names = tuple(n for n in made.healthy.names if n in healthy.names)
    at = made.places(names)
    healthy = healthy.only(names)
    return replace(
        made,
        healthy=healthy,
        shifts={key: table[:, at] for key, table in made.shifts.items()},
        mean=made.mean[at] + healthy.values - made.healthy.values[at],
        spread=made.spread[np.ix_(at, at)],
        uncertainties={key: table[:, at] for key, table in made.uncertainties.items()},
        common_error=made.common_error[at]
        if isinstance(made.common_error, np.ndarray)
        else made.common_error,
    )


_REMEMBERED = 32  # logs
_RECENT: dict[tuple[object, ...], Replay] = {}  # by all that the runs depend on; the latest is last


def _remembered(item: Reading, candidates: Sequence[CandidateFault]) -> Replay:
    key = (item.actuator.hash, tuple(candidates), item.digest())
    made = _RECENT.pop(key, None) or _replayed(item, candidates)
    _RECENT[key] = made
    while len(_RECENT) > _REMEMBERED:
        _RECENT.pop(next(iter(_RECENT)))
    return made


def _replayed(item: Reading, candidates: Sequence[CandidateFault]) -> Replay:
    severities = {c.key: _severities(c, *item.SEVERITIES) for c in candidates}
    faulty = [(c, float(s)) for c in candidates for s in severities[c.key] if s != 0.0]
    days, doubts = (item.days(), item.doubts()) if candidates else (None, [])
    units = [ReplayUnit(), *doubts, *(_with(c, s) for c, s in faulty)]
    outcomes = list(item.outcomes([*units, *(days.units if days else [])]))
    table = item.table
    healthy = outcomes[0].only([n for n in outcomes[0].names if n in table])
    rows = np.array([_values(s, healthy) for s in outcomes])
    draws = rows[len(units) :]
    first = 1 + len(doubts)
    moved = _moved_by(rows[first : len(units)], healthy, table)
    shifts, uncertainties, at = {}, {}, 0
    for c in candidates:
        acts = severities[c.key] != 0.0
        full = np.zeros((len(acts), len(healthy.names)))
        full[acts] = moved[at : at + int(acts.sum())]
        at += int(acts.sum())
        shifts[c.key], unsure = _known_part(c, full, healthy.names)
        if c.known_features:
            uncertainties[c.key] = unsure
        if c.switched:  # nothing below the severity from which on it acts, everything above
            severities[c.key] = np.array([0.0, np.nextafter(_ACTS, 0.0), _ACTS, 1.0])
            shifts[c.key] = shifts[c.key][[0, 0, 1, 1]]
    mean, spread = _healthy_days(draws, None if days is None else days.steps, healthy.values)
    if days is not None:
        spread = spread + periodic_covariance(item.periodic()[0], healthy.names)
    made = Replay(
        healthy, severities, shifts, table, mean, spread, item.DEGREES, uncertainties,
        rows[0] - rows[1] if doubts else 0.0, item.ALIKE, item.PRIOR, len(outcomes),
    )  # fmt: skip
    return _refined(made, item, candidates) if candidates and item.SETS_IN else made


def _with(c: CandidateFault, severity: float) -> ReplayUnit:
    return ReplayUnit(Variant(faults=(c.text(severity),)))


def _values(outcomes: FeatureVector, healthy: FeatureVector) -> Floats:
    """Values by the healthy run's names; what a run does not show stands as in the healthy one."""
    known = dict(zip(outcomes.names, outcomes.values.tolist(), strict=True))
    rows = zip(healthy.names, healthy.values.tolist(), strict=True)
    values = np.array([known.get(name, value) for name, value in rows])
    return np.where(np.isfinite(values), values, healthy.values)


def _moved_by(rows: Floats, healthy: FeatureVector, table: FeatureTable) -> Floats:
    """Differences from the healthy run; of sizes, what must be added at a right angle."""
    records = [table[name] for name in healthy.names]
    out = rows - healthy.values
    sizes = [k for k, f in enumerate(records) if f.kind == "size"]
    out[:, sizes] = np.sqrt(np.maximum(rows[:, sizes] ** 2 - healthy.values[sizes] ** 2, 0.0))
    return bounded(out, records, healthy.values)


def bounded(moved: Floats, records: Sequence[Feature], values: Floats) -> Floats:
    """Limit how far features are moved, shape (..., k): of logs and of runs alike."""
    most = _MOST * deviations(records, values, "repeats")
    return np.clip(moved, -most, most)


def _known_part(c: CandidateFault, full: Floats, names: Sequence[str]) -> tuple[Floats, Floats]:
    """Split shifts into what is known of them and what depends on what no log shows.

    What is moved in full or not at all has the mean and the deviation of the two cases.
    """
    known = np.array([not c.known_features or n in c.known_features for n in names])
    there = np.array([n not in c.fixed_features for n in names])
    part = 0.5 if c.either else 1.0
    unsure = full * ~known * part
    return full * (known & there) + (unsure if c.either else 0.0), np.abs(unsure)


def _healthy_days(draws: Floats, steps: Floats | None, healthy: Floats) -> tuple[Floats, Floats]:
    """Mean and covariance of healthy days; rare ones that were drawn too often count as rare."""
    if not len(draws):
        return healthy, np.zeros((len(healthy), len(healthy)))
    if steps is None:
        return draws.mean(axis=0), np.cov(draws.T).reshape(len(healthy), len(healthy))
    return np.median(draws, axis=0), spread_of(draws, steps)


def spread_of(draws: Floats, steps: Floats) -> Floats:
    """Covariance of healthy days, shape (k, k), from draws, shape (d, k), and their factors.

    What is linear in the factors stands as it is. The rest (a motion that ends a step later, a
    loop at its limit) is known from few draws only, so each number carries its own.
    """
    design = np.column_stack([np.ones(len(steps)), steps])
    slopes = np.linalg.lstsq(design, draws, rcond=None)[0]
    residual = draws - design @ slopes
    free = max(len(steps) - design.shape[1], 1)
    scatter = np.sum(residual**2, axis=0) / free
    return np.asarray(slopes[1:].T @ slopes[1:] + np.diag(scatter), dtype=np.float64)


def _severities(c: CandidateFault, points: int, power: int) -> Floats:
    """Zero, and severities that grow from it to each end; what is counted, each."""
    if c.whole:
        return np.arange(c.high + 1.0)
    steps = np.linspace(0.0, 1.0, points + 1) ** power
    low = c.low * steps[:0:-1] if c.low < 0.0 else np.zeros(0)
    return np.concatenate((low, c.high * steps))


def _refined(model: Replay, item: Reading, candidates: Sequence[CandidateFault]) -> Replay:
    """Run one more severity of each fault that is seen where straight lines say little."""
    records = [model.table[name] for name in model.healthy.names]
    least = deviations(records, model.healthy.values, "repeats")
    # With one baseline, as which most logs are judged.
    root = np.linalg.inv(np.linalg.cholesky(2.0 * (model.spread + np.diag(least**2))))
    more = [(c, s) for c in candidates for s in _between(model, c, root)]
    severities, shifts = dict(model.severities), dict(model.shifts)
    outcomes = item.outcomes([_with(c, s) for c, s in more])
    for (c, severity), features in zip(more, outcomes, strict=True):
        values = _values(features, model.healthy)
        row = _moved_by(values[None, :], model.healthy, model.table)
        at = int(np.searchsorted(severities[c.key], severity))
        severities[c.key] = np.insert(severities[c.key], at, severity)
        shifts[c.key] = np.insert(shifts[c.key], at, row[0], axis=0)
    return replace(model, severities=severities, shifts=shifts, runs=model.runs + len(more))


def _between(model: Replay, c: CandidateFault, root: Floats) -> list[float]:
    """A severity between those that were run: where it is first seen, or where it sets in."""
    if c.whole:
        return []
    grid = np.linspace(0.0, c.high, 2001)
    seen = np.flatnonzero(np.linalg.norm(model.shift(c.key, grid) @ root.T, axis=1) > SEEN)
    if not seen.size:
        return []
    limit = float(grid[seen[0]])
    at = model.severities[c.key]
    k = int(np.searchsorted(at, limit))
    low, high = float(at[k - 1]), float(at[k])
    if low == 0.0:
        return [2.0 * limit] if 4.0 * limit < high else []
    sizes = np.linalg.norm(model.shift(c.key, np.array([low, high])) @ root.T, axis=1)
    return [0.5 * (low + high)] if sizes[0] < _BENT * sizes[1] * low / high else []
