"""Spread from day to day and mismatch of the model, from healthy logs: stated ones are priors.

A log's feature is y = model + offset(unit) + step(unit, day) + noise. Of each feature the mean
squares of steps and of offsets over the stated variances are taken, with their degrees of freedom;
`engine.spread` weighs them against the stated ones, by a factor that all features have in common
and one of each. Tests of one unit share its days and its offset, so together they count once.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.diagnose.by_model import reading_of
from elevon.diagnose.engine.candidates import CandidateFault, candidates_of
from elevon.diagnose.engine.case import SUSPECT, LogCase, transferred
from elevon.diagnose.engine.diagnosis import judged
from elevon.diagnose.engine.healthy import healthy
from elevon.diagnose.engine.plausibility import plausibility
from elevon.diagnose.engine.replay import Replay, replay
from elevon.diagnose.engine.spread import (
    STATED,
    FeatureSpread,
    HeldOutLog,
    LearnedSpread,
    VarianceFactor,
)
from elevon.diagnose.engine.table import deviations
from elevon.errors import ElevonWarning, InputError, Interrupted
from elevon.progress import Progress
from elevon.threads import one_blas_thread

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.reading import Reading
    from elevon.logs.log import Log

_WORTH = np.geomspace(1.0, 300.0, 60)  # runs that one unit's spread is worth for another's
_UNSURE = 1.0  # deviation of the logarithm of that about `STATED`. ASSUMED
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
        """Return the logs of other days; without a day, of other units."""
        keep = (self.unit != unit) | ((self.day != day) & bool(day))
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
        No log; another number of days; a log that cannot be diagnosed; one given twice.
    Interrupted
        `progress` returned False.
    """
    if not logs:
        raise InputError("the spread needs at least one log of a healthy unit")
    pairs = [("", str(k)) for k in range(len(logs))] if days is None else list(days)
    if len(pairs) != len(logs):
        raise InputError(f"{len(logs)} logs, but units and days of {len(pairs)}")
    candidates = candidates_of(actuator)
    readings = [reading_of(log, actuator) for log in logs]
    _refuse_same_recording(readings)
    tests = []
    for group in _logs_by_test(readings):
        members = [(item, pairs[k]) for k, item in group]
        tests.append(_residuals_of_test(members, candidates))
        done = sum(len(t.models) for t in tests) / len(logs)
        if progress is not None and not progress(0.9 * done):
            raise Interrupted(f"interrupted after {sum(len(t.models) for t in tests)} logs")
    residuals = [t.residuals for t in tests]
    rows = [row for k, t in enumerate(tests) for row in _held_out_logs(k, t, residuals, candidates)]
    return LearnedSpread(
        actuator.name, len(logs), len({unit for unit, _ in pairs}), len(set(pairs)),
        fitted(residuals), tuple(rows),
    )  # fmt: skip


def _held_out_logs(
    number: int,
    test: _Test,
    residuals: Sequence[TestResiduals],
    candidates: Sequence[CandidateFault],
) -> Iterator[HeldOutLog]:
    """A test's logs, each held out; one that looks faulty is told of."""
    r = test.residuals
    units = list(dict.fromkeys(str(u) for x in residuals for u in x.unit))
    days = list(dict.fromkeys(str(d) for x in residuals for d in x.day))
    known: dict[tuple[str, str], LearnedSpread] = {}
    for k, item in enumerate(test.readings):
        # Of several units the whole unit is held out, else the day.
        unit, day = str(r.unit[k]), "" if len(units) > 1 else str(r.day[k])
        if (unit, day) not in known:
            left = [x for x in (x.without(unit, day) for x in residuals) if len(x.unit)]
            known[unit, day] = LearnedSpread(features=fitted(left))
        spread = known[unit, day]
        others = np.flatnonzero((r.unit == r.unit[k]) & (r.day != r.day[k]))
        near = others[np.searchsorted(others, k) % len(others)] if len(others) else None
        alone = _held_out_chance(test, k, [], spread, candidates)
        # The next day, in turn.
        based = 1.0 if near is None else _held_out_chance(test, k, [int(near)], spread, candidates)
        if min(alone, based) < SUSPECT:
            _warn_of(item, _held_out_chance(test, k, others.tolist(), spread, candidates))
        group = units.index(unit) if len(units) > 1 else days.index(day)
        yield HeldOutLog(number, group, alone, based)


def _held_out_chance(
    test: _Test,
    number: int,
    others: Sequence[int],
    spread: LearnedSpread,
    candidates: Sequence[CandidateFault],
) -> float:
    """Chance of a log with some of the others as baselines."""
    item, model, names = test.readings[number], test.models[number], test.residuals.names
    base = [test.readings[k] for k in others]
    there = [b.features if item.repeats(b) else transferred(b, model) for b in base]
    unit = healthy(model, names, there, spread_known=spread)
    plain = plausibility(item, base)
    case = LogCase("", item.features.only(names), unit, model, plausible=plain)
    return judged(case, candidates)


def _warn_of(item: Reading, chance: float) -> None:
    """Warn of a log that looks faulty beside all the others of its unit."""
    if chance < SUSPECT:
        warnings.warn(
            f"{item.name} looks faulty itself: by the other logs a healthy day deviates as much in "
            f"less than {100 * SUSPECT:g} % of logs. It counts as healthy here: learn without it "
            "unless it is",
            ElevonWarning,
            stacklevel=5,
        )


def _refuse_same_recording(readings: Sequence[Reading]) -> None:
    """Refuse one recording under two names: it would count as two days that are alike."""
    known: dict[bytes, str] = {}
    for item in readings:
        key = item.key()
        if key in known:
            raise InputError(f"{item.name} is the same recording as {known[key]}: give it once")
        known[key] = item.name


def _logs_by_test(items: Sequence[Reading]) -> list[list[tuple[int, Reading]]]:
    """Logs by test, each with its number."""
    out: list[list[tuple[int, Reading]]] = []
    for k, item in enumerate(items):
        group = next((g for g in out if item.same(g[0][1])), None)
        if group is None:
            out.append([(k, item)])
        else:
            group.append((k, item))
    return out


def _residuals_of_test(
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
    """Return what healthy logs show of each feature's spread and mismatch."""
    out = {}
    for name in dict.fromkeys(n for test in tests for n in test.names):
        columns = [_one_feature(test, name) for test in tests if name in test.names]
        units = sorted({str(u) for c in columns for u in c.unit})
        scatter = [row for unit in units if (row := _scatter_of_unit(columns, unit)) is not None]
        days, worth = _days_factor(scatter)
        daily = (worth + days.value * days.runs) / (worth + days.runs)
        out[name] = FeatureSpread(days, _mismatch_factor(columns, units, daily), worth)
    return out


def _one_feature(test: TestResiduals, name: str) -> TestResiduals:
    """One feature of a test."""
    at = [test.names.index(name)]
    return replace(
        test, names=(name,), off=test.off[:, at], noise=test.noise[:, at], daily=test.daily[at],
        mismatch=test.mismatch[at],
    )  # fmt: skip


def _scatter_of_unit(columns: Iterable[TestResiduals], unit: str) -> tuple[float, float] | None:
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
    return (max(float(np.mean(ratios)), 0.0), max(degrees)) if ratios else None


def _days_factor(scatter: Sequence[tuple[float, float]]) -> tuple[VarianceFactor, float]:
    """The mean square of steps, and what the stated one is worth beside it.

    Where several units differ, both are worth less for the next one.
    """
    total = sum(n for _, n in scatter)
    if not total:
        return VarianceFactor(), STATED
    value = sum(n * square for square, n in scatter) / total
    share = 1.0
    if len(scatter) > 1:
        share = 1.0 / (1.0 + (STATED + total) / _worth_between_units(scatter, max(value, 1e-9)))
    return VarianceFactor(value, share * total), max(share * STATED, 1.0)


def _worth_between_units(scatter: Sequence[tuple[float, float]], value: float) -> float:
    """Runs that what is known of all units is worth for one: its scatter follows Fisher's law."""
    from scipy.stats import f as fisher

    log = -0.5 * (np.log(_WORTH / STATED) / _UNSURE) ** 2
    for square, n in scatter:
        log = log + fisher.logpdf(square / value, n, _WORTH)
    weight = np.exp(log - log.max())
    return float(weight.sum() / np.sum(weight / _WORTH))


def _mismatch_factor(
    columns: Sequence[TestResiduals], units: Sequence[str], daily: float
) -> VarianceFactor:
    """The mean square of offsets; tests of one unit share it, so they count once.

    A unit counts by what of its mean's variance is the offset's.
    """
    total, runs = 0.0, 0.0
    for unit in units:
        rows = [_unit_mean(c, unit, daily) for c in columns if (c.unit == unit).any()]
        weights = [(stated / (stated + of_mean)) ** 2 for _, of_mean, stated in rows]
        ratios = [centre**2 / (stated + of_mean) for centre, of_mean, stated in rows]
        total += float(np.mean(np.multiply(weights, ratios)))
        runs += float(np.mean(weights))
    return VarianceFactor(total / runs, runs)


def _unit_mean(c: TestResiduals, unit: str, daily: float) -> tuple[float, float, float]:
    """A unit's mean over its days, the variance that days and noise give it, the stated one."""
    mine = c.unit == unit
    days = [mine & (c.day == d) for d in sorted(set(c.day[mine].tolist()))]
    centre = float(np.mean([c.off[d, 0].mean() for d in days]))
    of_mean = (daily * float(c.daily[0]) + float(c.noise[mine, 0].mean())) / len(days)
    return centre, of_mean, float(c.mismatch[0])
