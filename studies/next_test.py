"""Tests chosen by expected information against a fixed order, on pairs that are hard to tell.

A unit has one of two conditions, equally likely; tests are run until one of them has 95 %. The
logs are the reduced-order model's, each of another day within the stated spread: this shows what
the order of the tests is worth, not what the model's errors cost (`diagnosis-limits` does).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import permutations
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.diagnose.engine.candidates import CANDIDATES
from elevon.diagnose.positions.reading import SPREAD
from elevon.nexttest import Belief, Possible, profiles
from elevon.nexttest.information import expected_information, likelihoods, planned
from elevon.report import Check, verdict
from studies.common import advance, student_interval

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.progress import Progress

__all__ = ["PAIRS", "NextTestResult", "study_next_test"]

Condition = tuple[str, float] | None
#: Two conditions each; None: healthy. Severities (ASSUMED) at which no test is expected to give
#: more than 0.7 of the one bit.
PAIRS: Mapping[str, tuple[Condition, Condition]] = {
    "friction or lubrication": (("friction@transmission", 0.06), ("lubrication@transmission", 0.2)),
    "lubrication or lost flux": (
        ("lubrication@transmission", 0.2),
        ("demagnetisation@motor", 0.03),
    ),
    "short or eccentricity": (("short@motor.phase_a", 0.015), ("eccentricity_static@motor", 0.008)),
    "short or lost flux": (("short@motor.phase_a", 0.03), ("demagnetisation@motor", 0.01)),
    "short or healthy": (("short@motor.phase_a", 0.02), None),
    "eccentricity or healthy": (("eccentricity_static@motor", 0.01), None),
    "friction or healthy": (("friction@transmission", 0.10), None),
    "position gain or healthy": (("gain_drift@control.position", 0.003), None),
}
STRATEGIES = ("information", "orders", "fixed", "random", "standard")
"""By information; the mean of every order of the tests that is fixed beforehand, repeated; the
order of the list; any of them; the three standard ones in turn."""
JUDGED = ("orders", "fixed", "random", "standard")
CERTAIN, MOST = 0.95, 10
_KNOWN_TO = 0.2  # deviation of a severity, of itself: what earlier tests left open (ASSUMED)
_ODDS = math.log(CERTAIN / (1.0 - CERTAIN))
_AHEAD = 2  # logs of each test that are made together


@dataclass(frozen=True)
class Episode:
    """Tests until it was certain.

    Attributes
    ----------
    pair, strategy : str
        Which; how tests were chosen.
    tests : float
        Run; `MOST` where it was still not certain. Over all orders: their mean.
    certain, right : float
        Share in which one condition reached `CERTAIN`, and in which the likelier one was the true
        one.
    """

    pair: str
    strategy: str
    tests: float
    certain: float
    right: float


@dataclass(frozen=True)
class NextTestResult:
    """All episodes; those of one number are of one unit by all strategies.

    Attributes
    ----------
    episodes : tuple of Episode
        The logs of a unit are the same for all strategies: the second run of a test is one log,
        whoever asks.
    orders : ndarray, shape (units, orders)
        Tests that each unit took by each fixed order.
    """

    episodes: tuple[Episode, ...]
    orders: npt.NDArray[np.float64]

    @property
    def best_order(self) -> tuple[float, tuple[str, ...]]:
        """Mean tests of the fixed order that proves best here, found afterwards, and the order."""
        means = self.orders.mean(axis=0)
        names = [profile.name for profile in profiles()]
        at = int(np.argmin(means))
        return float(means[at]), tuple(names[k] for k in _every_order(len(names))[at])

    def rows(self) -> list[dict[str, Any]]:
        """Return a row for each pair and strategy, and one over all pairs."""
        names = list(dict.fromkeys(e.pair for e in self.episodes))
        return [
            self._row(strategy, among)
            for among in (*([n] for n in names), names)
            for strategy in STRATEGIES
        ]

    def _row(self, strategy: str, pairs: Sequence[str]) -> dict[str, Any]:
        rows = [e for e in self.episodes if e.strategy == strategy and e.pair in pairs]
        mean, low, high = student_interval([float(e.tests) for e in rows])
        return {
            "pair": pairs[0] if len(pairs) == 1 else "all",
            "strategy": strategy,
            "units": len(rows),
            "tests": mean,
            "tests_interval": [low, high],
            "certain": float(sum(e.certain for e in rows)),
            "right": float(sum(e.right for e in rows)),
        }

    def saved(self, other: str) -> tuple[float, float, float]:
        """Return tests that information saved against another order, with its 95 % interval."""
        ours, theirs = ([e.tests for e in self.episodes if e.strategy == s]
                        for s in ("information", other))  # fmt: skip
        return student_interval([float(b - a) for a, b in zip(ours, theirs, strict=True)])

    def checks(self) -> list[Check]:
        """Return what must hold."""
        out = [
            Check(f"tests saved against {name} order, lower end of 95 %", self.saved(name)[1], 0.0,
                  "tests", at_least=True)
            for name in JUDGED
        ]  # fmt: skip
        certain = [e for e in self.episodes if e.strategy == "information" and e.certain == 1.0]
        share = sum(e.right for e in certain) / max(len(certain), 1)
        slack = 2.0 * math.sqrt(CERTAIN * (1.0 - CERTAIN) / max(len(certain), 1))
        text = "certain answers that are right (95 % less two deviations)"
        return [*out, Check(text, share, CERTAIN - slack, "", at_least=True)]

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        checks = self.checks()
        return {
            **verdict(checks),
            "saved": {name: list(self.saved(name)) for name in STRATEGIES[1:]},
            "best_fixed_order": {"tests": self.best_order[0], "order": list(self.best_order[1])},
            "rows": self.rows(),
        }


def study_next_test(
    *,
    seed: int = 0,
    units: int = 24,
    pairs: Sequence[str] = tuple(PAIRS),
    progress: Progress | None = None,
) -> NextTestResult:
    """Run tests on units of either condition until it is certain which.

    Parameters
    ----------
    seed : int
        Of units, days and draws.
    units : int
        Of each pair; every other one has the second condition.
    pairs : sequence of str
        Of `PAIRS`.
    progress : callable, optional
        Told the done fraction; returns False to stop.
    """
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.candidates import of_a_magnet

    actuator = of_a_magnet(Actuator.load("torino-rotary")).with_values({"drive.kind": "pwm"})
    bench = _Bench(actuator, pairs)
    episodes, orders = [], []
    for number, pair in enumerate(pairs):
        for k in range(units):
            done = (number + k / units) / len(pairs)
            advance(progress, done, "next-test")
            unit = _Unit(bench, pair, [seed, list(PAIRS).index(pair), k])
            of_orders = unit.by_orders()
            orders.append(of_orders[0])
            episodes += [unit.mean_of_orders(*of_orders) if s == "orders" else unit.episode(s)
                         for s in STRATEGIES]  # fmt: skip
    return NextTestResult(tuple(episodes), np.array(orders))


@lru_cache(maxsize=2)
def _every_order(count: int) -> npt.NDArray[np.intp]:
    return np.array(list(permutations(range(count))), dtype=np.intp)


class _Bench:
    """The tests, planned once, and units that go through them."""

    def __init__(self, actuator: Actuator, pairs: Sequence[str]) -> None:
        keys = {c[0] for pair in pairs for c in PAIRS[pair] if c is not None}
        candidates = [c for c in CANDIDATES if c.key in keys]
        self.actuator = actuator
        self.profiles = profiles()
        self.cases = [planned(p, actuator, candidates) for p in self.profiles]
        self._first: dict[str, int] = {}

    def most_informative(self, pair: str, belief: Belief, *, first: bool) -> int:
        """Return the test to run next; the first of a pair is the same for all its units."""
        if first and pair in self._first:
            return self._first[pair]
        at = int(np.argmax([expected_information(case, belief) for case in self.cases]))
        if first:
            self._first[pair] = at
        return at

    def logs(
        self, wanted: Sequence[tuple[int, int]], condition: Condition, factor: float,
        seed: Sequence[int],
    ) -> list[Any]:  # fmt: skip
        """Run tests, each on another day; what the logs show, in the order of the cases' names."""
        from elevon.bench.rig import setups
        from elevon.bench.traces import recorded, traced
        from elevon.diagnose.positions.log import prepared
        from elevon.diagnose.positions.reading import logged_features
        from elevon.scenario.compile import signal_records
        from elevon.simulate import Run, simulate_batch

        faults = [] if condition is None else [f"{condition[0]}={factor * condition[1]!r}"]
        days, ready = [], []
        for at, repeat in wanted:
            rng = np.random.default_rng([*seed, 2, at, repeat])
            days.append(_day(self.actuator, rng))
            run_seed, procedure = int(rng.integers(2**31)), self.profiles[at].procedure
            ready.append(setups(procedure, days[-1].actuator, faults=faults, seed=run_seed)[0])
        record = recorded(list(signal_records(self.actuator.wiring, "low")))
        runs = [Run(s.actuator, s.scenario, s.conditions.seed) for s in ready]
        out = []
        recordings = simulate_batch(runs, fidelity="low", record=record)
        for (at, _), day, setup, run in zip(wanted, days, ready, recordings, strict=True):
            item = prepared(traced(setup, run, cell=day.cell), self.actuator)
            names = self.cases[at].unit.names
            out.append(logged_features(item, self.actuator).only(names).values)
        return out


@dataclass(frozen=True)
class _Day:
    """A unit on one day; `cell` is the measured brake torque over the true one."""

    actuator: Actuator
    cell: float


def _day(unit: Actuator, rng: np.random.Generator) -> _Day:
    """Draw a day of a unit within the stated spread of diagnosis by the model."""
    values: dict[str, float | str] = {}
    cell = 1.0
    for path, (spread, way) in SPREAD.items():
        step = spread * float(rng.standard_normal())
        if way == "brake":
            cell += step
            continue
        name = "sensor.current.gain_" + path[-1] if way == "fault" else path
        old = unit.parameters.value(name)
        values[name] = old + step if way == "add" else old * max(1.0 + step, 0.05)
        if path == "friction.dynamic":
            static = unit.parameters.value("friction.static")
            values["friction.static"] = static * max(1.0 + step, 0.05)
    return _Day(unit.with_values(values, source="day"), cell)


class _Unit:
    """A unit of one of two conditions; each run of each test is one log for all strategies."""

    def __init__(self, bench: _Bench, pair: str, seed: Sequence[int]) -> None:
        self._rng = np.random.default_rng([*seed, 1])
        self._bench, self._pair, self._seed = bench, pair, seed
        self._truth = seed[-1] % 2
        self._factor = max(1.0 + _KNOWN_TO * float(self._rng.standard_normal()), 0.3)
        self._prior = Belief.of([_possible(c) for c in PAIRS[pair]])
        self._odds: dict[tuple[int, int], float] = {}

    def odds(self, at: int, repeat: int) -> float:
        """Return log odds that a run of a test gives for the second condition."""
        if (at, repeat) not in self._odds:
            block = repeat // _AHEAD * _AHEAD
            some = [(at, block)] if block else [(k, 0) for k in range(len(self._bench.cases))]
            wanted = [(k, first + j) for k, first in some for j in range(_AHEAD)]
            condition = PAIRS[self._pair][self._truth]
            logs = self._bench.logs(wanted, condition, self._factor, self._seed)
            for key, values in zip(wanted, logs, strict=True):
                log = likelihoods(self._bench.cases[key[0]], self._prior, values)
                self._odds[key] = float(log[1] - log[0])
        return self._odds[at, repeat]

    def episode(self, strategy: str) -> Episode:
        """Run tests by a strategy until it is certain."""
        done: list[int] = []
        odds = 0.0
        while len(done) < MOST and abs(odds) < _ODDS:
            at = self._next(strategy, len(done), odds)
            odds += self.odds(at, done.count(at))
            done.append(at)
        right = (odds > 0.0) == bool(self._truth)
        return Episode(self._pair, strategy, len(done), float(abs(odds) >= _ODDS), float(right))

    def _next(self, strategy: str, number: int, odds: float) -> int:
        """Return the test that a strategy runs next."""
        if strategy == "information":
            return self._informed(number, odds)
        every = range(len(self._bench.profiles))
        if strategy == "random":
            return int(self._rng.integers(len(every)))
        some = [k for k in every if strategy == "fixed" or self._bench.profiles[k].standard]
        return some[number % len(some)]

    def _informed(self, number: int, odds: float) -> int:
        share = 1.0 / (1.0 + math.exp(-odds))
        weights = (1.0 - share, share)
        sets = zip(self._prior.possible, weights, strict=True)
        belief = Belief.of([replace(p, weight=w) for p, w in sets])
        return self._bench.most_informative(self._pair, belief, first=number == 0)

    def by_orders(self) -> tuple[Any, Any, Any]:
        """Return tests, whether certain and whether right, of each fixed order, shape (orders,)."""
        count = len(self._bench.cases)
        rounds = -(-MOST // count)
        table = np.array([[self.odds(k, r) for k in range(count)] for r in range(rounds)])
        orders = _every_order(count)
        odds = np.cumsum(np.hstack([row[orders] for row in table])[:, :MOST], axis=1)
        decided = np.abs(odds) >= _ODDS
        last = np.where(decided.any(axis=1), decided.argmax(axis=1), MOST - 1)
        at_end = odds[np.arange(len(orders)), last]
        return last + 1.0, decided.any(axis=1), (at_end > 0.0) == bool(self._truth)

    def mean_of_orders(self, tests: Any, certain: Any, right: Any) -> Episode:
        """Return the mean over the fixed orders as an episode."""
        means = [float(np.mean(values)) for values in (tests, certain, right)]
        return Episode(self._pair, "orders", *means)


def _possible(condition: Condition) -> Possible:
    if condition is None:
        return Possible((), 0.5)
    key, severity = condition
    return Possible((key,), 0.5, (severity,), (_KNOWN_TO * severity,))
