"""Runs of the reduced-order model through a log's test: healthy, with each fault, on other days."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import SEEN
from elevon.diagnose.engine.candidates import CandidateFault, of_a_magnet
from elevon.diagnose.engine.replay import Replay
from elevon.diagnose.positions.features import FeatureVector
from elevon.diagnose.roles.candidates import counted_of, switched_of
from elevon.diagnose.roles.channels import (
    RoleUnit,
    as_on_stand,
    deflection_under,
    numbers_by,
    numbers_of_log,
)
from elevon.diagnose.roles.numbers import Numbers, floors
from elevon.diagnose.roles.role_test import RoleTest, action_numbers, same_test
from elevon.diagnose.roles.spread import daily, factors_of

if TYPE_CHECKING:
    from elevon.actuator import Actuator

_DRAWS = 28
#: Deviations of the days that are run over those stated: what sets in on a rare day is seen, and
#: counts in full; what is linear counts as stated.
_WIDE = 2.0
_POINTS = 4  # severities of each candidate, one way
_ACTS = 0.5  # severity from which on a fault that is there or not acts
_BENT = 0.3  # of a straight line's shift: below it the shift sets in between two severities
_LATE = 0.1  # deviation, in samples, of where a log is seen to begin. ASSUMED: straight onsets
_REMEMBERED = 16  # tests
_MOST = 1e4  # least deviations that a fault moves a number by: beyond it nothing more is learnt


class RoleReplay(Replay):
    """Numbers of the model in one test.

    Attributes
    ----------
    numbers : Numbers
        Of the healthy unit, with their kinds and sizes.
    spread : ndarray, shape (k, k)
        Covariance of the numbers from day to day.
    switched : frozenset of str
        Kinds of faults that are there or not.
    compliance : ndarray, shape (k,)
        What the output's stated compliance under the log's load does to the numbers.
    """

    def __init__(
        self, numbers: Numbers, severities: Mapping[str, Floats], shifts: Mapping[str, Floats],
        *, draws: Floats, spread: Floats, switched: frozenset[str], compliance: Floats,
    ) -> None:  # fmt: skip
        super().__init__(_features(numbers), severities, shifts, draws)
        self.numbers = numbers
        self.spread = spread
        self.switched = switched
        self.compliance = compliance

    def shift(self, key: str, severity: Floats) -> Floats:
        """Return what severities of shape (m,) do to the features, shape (m, k)."""
        at, table = self.severities[key], self.shifts[key]
        if key.partition("@")[0] in self.switched:  # as `CandidateFault.switched`
            severity = (severity >= _ACTS).astype(np.float64)
        low = np.clip(np.searchsorted(at, severity, side="right") - 1, 0, len(at) - 2)
        part = np.clip((severity - at[low]) / (at[low + 1] - at[low]), 0.0, 1.0)[:, None]
        return np.asarray(table[low] * (1.0 - part) + table[low + 1] * part, dtype=np.float64)


@dataclass(frozen=True)
class _Remembered:
    """A replay and what it served."""

    actuator: str
    candidates: tuple[CandidateFault, ...]
    roles: tuple[str, ...]
    clock: tuple[int, int]
    test: RoleTest
    made: RoleReplay


_RECENT: list[_Remembered] = []


def replay_by_roles(
    item: RoleTest, actuator: Actuator, candidates: Sequence[CandidateFault]
) -> RoleReplay:
    """Run the test: healthy, each candidate at several severities, and the spread.

    Logs of one test share the runs of the first of them.
    """
    actuator = of_a_magnet(actuator)
    entry = _Remembered(
        actuator.hash,
        tuple(candidates),
        tuple(item.seen),
        (len(item.log.time), round(item.rate)),
        item,
        None,  # type: ignore[arg-type]
    )
    for past in _RECENT:
        alike = all(
            getattr(past, name) == getattr(entry, name)
            for name in ("actuator", "candidates", "roles", "clock")
        )
        if alike and past.test.settings == item.settings and same_test(past.test, item):
            return past.made
    compliant = _deflects(item, actuator)
    model = _replayed(item, actuator, candidates, compliant=compliant)
    made = _refined(model, item, actuator, candidates, compliant=compliant)
    _RECENT.append(replace(entry, made=made))
    del _RECENT[:-_REMEMBERED]
    return made


def _deflects(item: RoleTest, actuator: Actuator) -> bool:
    """Whether a log is nearer to a compliant model: what faults do to a number depends on it."""
    if deflection_under(item, as_on_stand(actuator, item)) is None:
        return True
    logged = numbers_of_log(item, actuator, item.seen).values
    units = [RoleUnit({}), RoleUnit({}, compliant=False)]
    both = list(numbers_by(item, actuator, units))
    names = [name for name in both[0].values if name in logged]
    values = np.array(
        [[n.get(name, np.nan) for name in names] for n in (logged, *(b.values for b in both))]
    )
    least = floors(both[0], names, values[0])
    soft, rigid = (float(np.nansum(((values[0] - v) / least) ** 2)) for v in values[1:])
    return soft <= rigid


def _replayed(
    item: RoleTest, actuator: Actuator, candidates: Sequence[CandidateFault], *, compliant: bool
) -> RoleReplay:
    severities = {c.key: _severities(c, actuator) for c in candidates}
    units = [RoleUnit({}), RoleUnit({})]
    for c in candidates:
        units += [RoleUnit({}, (c.text(float(s)),)) for s in severities[c.key] if s != 0.0]
    ready = as_on_stand(actuator, item)
    steps = _steps_of_days(len(factors_of(ready)))
    units += _days(ready, steps)
    units = [
        replace(u, compliant=compliant if k != 1 else not compliant) for k, u in enumerate(units)
    ]
    results = list(numbers_by(item, actuator, units))
    names = tuple(results[0].values)
    rows = np.array([[s.values.get(n, np.nan) for n in names] for s in results])
    most = _MOST * floors(results[0], names, rows[0])
    shifts, at = {}, 2
    for c in candidates:
        zero = severities[c.key] == 0.0
        table = np.zeros((len(zero), len(names)))
        count = int((~zero).sum())
        table[~zero] = np.clip(np.nan_to_num(rows[at : at + count] - rows[0]), -most, most)
        shifts[c.key] = table
        at += count
    draws = np.where(np.isfinite(rows[at:]), rows[at:], rows[0])
    return RoleReplay(
        results[0],
        severities,
        shifts,
        draws=draws,
        spread=spread_of(draws, steps),
        switched=switched_of(actuator),
        compliance=np.nan_to_num(rows[0] - rows[1]),
    )


def _steps_of_days(factors: int) -> Floats:
    """Draws in deviations, shape (d, factors + 2): factors, where it begins, the clock's phase.

    The factors are drawn `_WIDE` times as far as they are; the phase is even over a sample.
    """
    rng = np.random.default_rng(15)
    wide = _WIDE * rng.standard_normal((_DRAWS, factors))
    phase = np.sqrt(12.0) * (rng.random(_DRAWS) - 0.5)
    return np.column_stack([wide, rng.standard_normal(_DRAWS), phase])


def _days(ready: Actuator, steps: Floats) -> list[RoleUnit]:
    """Healthy units of other days; an action is seen at a sample, so it has no other lateness."""
    factors = factors_of(ready)
    late = 0.0 if action_numbers(ready.wiring) else _LATE
    return [
        RoleUnit(
            daily(ready, dict(zip(factors, row, strict=False))),
            late=late * row[-2],
            phase=row[-1] / np.sqrt(12.0),
            number=k + 1,
        )
        for k, row in enumerate(steps.tolist())
    ]


def _refined(
    model: RoleReplay,
    item: RoleTest,
    actuator: Actuator,
    candidates: Sequence[CandidateFault],
    *,
    compliant: bool,
) -> RoleReplay:
    """Run one more severity of each fault that is seen where straight lines say little."""
    names, values = model.healthy.names, model.healthy.values
    least = floors(model.numbers, names, values)
    # With one baseline, as which most logs are judged.
    root = np.linalg.inv(np.linalg.cholesky(2.0 * (model.spread + np.diag(least**2))))
    more = [(c, s) for c in candidates for s in _between(model, c, root)]
    units = [RoleUnit({}, (c.text(s),), compliant=compliant) for c, s in more]
    severities, shifts = dict(model.severities), dict(model.shifts)
    for (c, severity), numbers in zip(more, numbers_by(item, actuator, units), strict=True):
        row = np.array([numbers.values.get(name, np.nan) for name in names])
        row = np.clip(np.nan_to_num(row - values), -_MOST * least, _MOST * least)
        at = int(np.searchsorted(severities[c.key], severity))
        severities[c.key] = np.insert(severities[c.key], at, severity)
        shifts[c.key] = np.insert(shifts[c.key], at, row, axis=0)
    return RoleReplay(
        model.numbers,
        severities,
        shifts,
        draws=model.draws,
        spread=model.spread,
        switched=model.switched,
        compliance=model.compliance,
    )


def _between(model: RoleReplay, c: CandidateFault, root: Floats) -> list[float]:
    """A severity between those that were run: where it is first seen, or where it sets in."""
    if len(model.severities[c.key]) == 2:  # there or not, or counted
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


def _severities(c: CandidateFault, actuator: Actuator) -> Floats:
    """Those that are run, from the least to the greatest; what is counted or there or not: one."""
    if c.kind in counted_of(actuator) | switched_of(actuator):
        return np.array([0.0, 1.0])
    steps = np.linspace(0.0, 1.0, _POINTS + 1) ** 3
    low = c.low * steps[:0:-1] if c.low < 0.0 else np.zeros(0)
    return np.concatenate((low, c.high * steps))


def _features(numbers: Numbers) -> FeatureVector:
    values = np.array(list(numbers.values.values()))
    return FeatureVector(tuple(numbers.values), values, np.zeros(len(values)))
