"""Spread from day to day and mismatch of the model, from healthy logs: stated ones are priors.

A log's feature is y = model + offset(unit) + step(unit, day) + noise. The variance of a step is v
times the stated one, that of an offset q times, feature by feature. Their priors are scaled inverse
chi-square about one, worth `DEGREES` runs. v has the same form afterwards, in closed form; q is
summed over a grid. Tests of one unit share its days and its offset, so together they count once.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.by_model import reading_of
from elevon.diagnose.engine.candidates import CandidateFault, candidates_of
from elevon.diagnose.engine.case import LogCase, chance_of, transferred
from elevon.diagnose.engine.healthy import healthy
from elevon.diagnose.engine.replay import Replay, replay
from elevon.diagnose.engine.spread import DEGREES, FeatureSpread, LearnedSpread, VarianceFactor
from elevon.diagnose.engine.table import FeatureVector, deviations
from elevon.errors import InputError, Interrupted
from elevon.progress import Progress
from elevon.threads import one_blas_thread

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.reading import Reading
    from elevon.logs.log import Log

_GRID = np.geomspace(1e-4, 1e4, 400)  # of q; the inverse chi-square prior is nothing beyond
_WORTH = np.geomspace(1.0, 300.0, 60)  # runs that one unit's spread is worth for another's
_UNSURE = 1.0  # deviation of the logarithm of that about `DEGREES`. ASSUMED
Strings = npt.NDArray[np.str_]


@dataclass(frozen=True)
class TestResiduals:
    """Healthy logs of one test, less the model's run of each.

    Attributes
    ----------
    names : tuple of str
        Features that all of them show.
    unit, day : ndarray of str, shape (n,)
        Of each log.
    off : ndarray, shape (n, k)
        Features less the model's.
    noise : ndarray, shape (n, k)
        Variance by the noise within each log.
    daily, mismatch : ndarray, shape (k,)
        Stated variances.
    """

    __test__ = False  # not a test, whatever pytest thinks of the name

    names: tuple[str, ...]
    unit: Strings
    day: Strings
    off: Floats
    noise: Floats
    daily: Floats
    mismatch: Floats

    def without(self, unit: str, day: str) -> TestResiduals:
        """Return the logs of other days."""
        keep = (self.unit != unit) | (self.day != day)
        return replace(
            self, unit=self.unit[keep], day=self.day[keep], off=self.off[keep],
            noise=self.noise[keep],
        )  # fmt: skip


@dataclass(frozen=True)
class _Test:
    """Logs of one test, with the model's runs."""

    readings: tuple[Reading, ...]
    models: tuple[Replay, ...]
    residuals: TestResiduals


@one_blas_thread()
def learned_spread(
    logs: Sequence[Log],
    actuator: Actuator,
    days: Sequence[tuple[str, str]] | None = None,
    progress: Progress | None = None,
) -> LearnedSpread:
    """Fit spread and mismatch to healthy logs, and hold each day out for the threshold.

    Parameters
    ----------
    logs : sequence of Log
        Of healthy units.
    actuator : Actuator
        As `elevon.diagnose` will be given it.
    days : sequence of (str, str), optional
        Unit and day of each log; default: one unit, each log a day of its own.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        No log; another number of days; a log that cannot be diagnosed.
    Interrupted
        `progress` returned False.
    """
    if not logs:
        raise InputError("learn-spread needs at least one log of a healthy unit")
    pairs = [("", str(k)) for k in range(len(logs))] if days is None else list(days)
    if len(pairs) != len(logs):
        raise InputError(f"{len(logs)} logs, but units and days of {len(pairs)}")
    candidates = candidates_of(actuator)
    tests = []
    for group in _groups([reading_of(log, actuator) for log in logs]):
        members = [(item, pairs[k]) for k, item in group]
        tests.append(_test(members, candidates))
        done = sum(len(t.models) for t in tests) / len(logs)
        if progress is not None and not progress(0.9 * done):
            raise Interrupted(f"interrupted after {sum(len(t.models) for t in tests)} logs")
    residuals = [t.residuals for t in tests]
    scores = [_held_out(t, residuals, candidates) for t in tests]
    return LearnedSpread(
        actuator.name, len(logs), len({unit for unit, _ in pairs}), len(set(pairs)),
        fitted(residuals), *(tuple(x for s in scores for x in s[k]) for k in (0, 1)),
    )  # fmt: skip


def _groups(items: Sequence[Reading]) -> list[list[tuple[int, Reading]]]:
    """Logs by test, each with its number."""
    out: list[list[tuple[int, Reading]]] = []
    for k, item in enumerate(items):
        group = next((g for g in out if item.same(g[0][1])), None)
        if group is None:
            out.append([(k, item)])
        else:
            group.append((k, item))
    return out


def _test(
    members: Sequence[tuple[Reading, tuple[str, str]]], candidates: Sequence[CandidateFault]
) -> _Test:
    first, later = members[0][0].matched([item for item, _ in members[1:]])
    items = (first, *later)
    models = tuple(replay(item, candidates, [first]) for item in items)
    sets = [*(set(i.features.names) for i in items), *(set(m.healthy.names) for m in models)]
    names = [n for n in first.features.names if all(n in s for s in sets)]
    names = first.usable(names, later)
    at = models[0].places(names)
    off, noise = [], []
    for item, model in zip(items, models, strict=True):
        features = item.features.only(names)
        off.append(features.values - model.mean[model.places(names)])
        noise.append(features.std**2)
    records = [models[0].table[name] for name in names]
    level = models[0].mean[at]
    common = models[0].common_error
    error = common[at] if isinstance(common, np.ndarray) else np.zeros(len(at))
    residuals = TestResiduals(
        tuple(names),
        np.array([unit for _, (unit, _) in members]),
        np.array([day for _, (_, day) in members]),
        np.array(off),
        np.array(noise),
        np.diag(models[0].spread)[at] + deviations(records, level, "repeats") ** 2,
        deviations(records, level, "mismatch") ** 2 + error**2,
    )
    return _Test(items, models, residuals)


def fitted(tests: Sequence[TestResiduals]) -> dict[str, FeatureSpread]:
    """Return what healthy logs say of each feature's spread and mismatch."""
    out = {}
    for name in dict.fromkeys(n for test in tests for n in test.names):
        columns = [_column(test, name) for test in tests if name in test.names]
        units = sorted({str(u) for c in columns for u in c.unit})
        scatter = [row for unit in units if (row := _scatter(columns, unit)) is not None]
        days = _days(scatter)
        out[name] = FeatureSpread(days, _mismatch(columns, units, days.value))
    return out


def _column(test: TestResiduals, name: str) -> TestResiduals:
    """One feature of a test."""
    at = [test.names.index(name)]
    return replace(
        test, names=(name,), off=test.off[:, at], noise=test.noise[:, at], daily=test.daily[at],
        mismatch=test.mismatch[at],
    )  # fmt: skip


def _scatter(columns: Iterable[TestResiduals], unit: str) -> tuple[float, float] | None:
    """Mean square of a unit's steps over the stated variance, and its degrees; None of one day.

    It is half the mean square of differences between logs of different days, each pair alike:
    a step's variance, however many logs a day has.
    """
    ratios, degrees = [], []
    for c in columns:
        mine = c.unit == unit
        days = [c.off[mine & (c.day == d), 0] for d in sorted(set(c.day[mine].tolist()))]
        count = len(days)
        if count < 2:
            continue
        mean = np.array([day.mean() for day in days])
        square = np.array([np.mean(day**2) for day in days])
        products = (mean.sum() ** 2 - np.sum(mean**2)) / (count * (count - 1.0))
        ratios.append((square.mean() - products) / (c.daily[0] + c.noise[mine, 0].mean()))
        degrees.append(count - 1.0)
    return (float(np.mean(ratios)), max(degrees)) if ratios else None


def _days(scatter: Sequence[tuple[float, float]]) -> VarianceFactor:
    """The factor of a step's variance, by what units scatter.

    Of several units it is worth less for the next one where theirs differ.
    """
    total = sum(n for _, n in scatter)
    value = (DEGREES + sum(n * square for square, n in scatter)) / (DEGREES + total)
    worth = DEGREES + total
    if len(scatter) > 1:
        worth = 1.0 / (1.0 / worth + 1.0 / _between(scatter, value))
    return VarianceFactor(value, max(worth, 1.0))


def _between(scatter: Sequence[tuple[float, float]], value: float) -> float:
    """Runs that what is known of all units is worth for one: its scatter follows Fisher's law."""
    from scipy.stats import f as fisher

    log = -0.5 * (np.log(_WORTH / DEGREES) / _UNSURE) ** 2
    for square, n in scatter:
        log = log + fisher.logpdf(square / value, n, _WORTH)
    weight = np.exp(log - log.max())
    return float(weight.sum() / np.sum(weight / _WORTH))


def _mismatch(
    columns: Sequence[TestResiduals], units: Sequence[str], daily: float
) -> VarianceFactor:
    """The factor of an offset's variance; tests of one unit share it, so they count once."""
    log = -(0.5 * DEGREES) * (np.log(_GRID) + 1.0 / _GRID)
    for unit in units:
        rows = [_centre(c, unit, daily) for c in columns if (c.unit == unit).any()]
        for centre, of_mean, stated in rows:
            variance = _GRID * stated + of_mean
            log = log - 0.5 * (np.log(variance) + centre**2 / variance) / len(rows)
    # Evenly in the logarithm: the prior's density in it is what stands above.
    weight = np.exp(log - log.max())
    weight /= weight.sum()
    mean = float(np.sum(weight / _GRID))
    scatter = float(np.sum(weight * (1.0 / _GRID - mean) ** 2))
    return VarianceFactor(1.0 / mean, 2.0 * mean**2 / scatter)


def _centre(c: TestResiduals, unit: str, daily: float) -> tuple[float, float, float]:
    """A unit's mean over its days, the variance that days and noise give it, the stated one."""
    mine = c.unit == unit
    days = [mine & (c.day == d) for d in sorted(set(c.day[mine].tolist()))]
    centre = float(np.mean([c.off[d, 0].mean() for d in days]))
    of_mean = (daily * float(c.daily[0]) + float(c.noise[mine, 0].mean())) / len(days)
    return centre, of_mean, float(c.mismatch[0])


def _held_out(
    test: _Test, residuals: Sequence[TestResiduals], candidates: Sequence[CandidateFault]
) -> tuple[list[float], list[float]]:
    """Chance of each log by what the other days say: without a baseline, and with one of theirs."""
    alone, based, r = [], [], test.residuals
    known: Mapping[tuple[str, str], LearnedSpread] = {
        (u, d): LearnedSpread(features=fitted([x.without(u, d) for x in residuals]))
        for u, d in dict.fromkeys(zip(r.unit.tolist(), r.day.tolist(), strict=True))
    }
    for k, (item, model) in enumerate(zip(test.readings, test.models, strict=True)):
        spread = known[str(r.unit[k]), str(r.day[k])]
        others = np.flatnonzero((r.unit == r.unit[k]) & (r.day != r.day[k]))

        def chance(
            baselines: Sequence[FeatureVector],
            item: Reading = item,
            model: Replay = model,
            spread: LearnedSpread = spread,
        ) -> float:
            unit = healthy(model, r.names, baselines, spread_known=spread)
            return chance_of(LogCase("", item.features.only(r.names), unit, model), candidates)

        alone.append(chance([]))
        if len(others):  # the next day, in turn
            near = int(others[np.searchsorted(others, k) % len(others)])
            base = test.readings[near]
            there = base.features if item.repeats(base) else transferred(base, model)
            based.append(chance([there]))
    return alone, based
