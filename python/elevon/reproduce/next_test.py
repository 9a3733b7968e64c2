"""Tests chosen by expected information against a fixed order, on pairs that are hard to tell.

A unit has one of two conditions, equally likely; tests are run until one of them has 95 %. The
logs are the low model's, each of another day within the stated spread: this shows what the order
of the tests is worth, not what the model's errors cost (`diagnosis-limits` does).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.diagnose.bymodel.candidates import CANDIDATES
from elevon.diagnose.nexttest import Belief, Possible, profiles
from elevon.diagnose.nexttest.information import expected_information, planned, updated
from elevon.errors import Interrupted
from elevon.report import Check, all_passed

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.progress import Progress

__all__ = ["PAIRS", "NextTestResult", "reproduce_next_test"]

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
STRATEGIES = ("information", "fixed", "random", "standard")
"""By information; all in the order of the list; any of them; the three standard ones in turn."""
JUDGED = ("fixed", "random")
CERTAIN, MOST = 0.95, 10
_KNOWN_TO = 0.2  # deviation of a severity, of itself: what earlier tests left open (ASSUMED)


@dataclass(frozen=True)
class Episode:
    """Tests until it was certain.

    Attributes
    ----------
    pair, strategy : str
        Which; how tests were chosen.
    tests : int
        Run; `MOST` where it was still not certain.
    certain, right : bool
        Whether one condition reached `CERTAIN`; whether the likelier one was the true one.
    """

    pair: str
    strategy: str
    tests: int
    certain: bool
    right: bool


@dataclass(frozen=True)
class NextTestResult:
    """All episodes; those of one number are of one unit by all strategies."""

    episodes: tuple[Episode, ...]

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
        mean, low, high = _interval([float(e.tests) for e in rows])
        return {
            "pair": pairs[0] if len(pairs) == 1 else "all",
            "strategy": strategy,
            "units": len(rows),
            "tests": mean,
            "tests_interval": [low, high],
            "certain": sum(e.certain for e in rows),
            "right": sum(e.right for e in rows),
        }

    def saved(self, other: str) -> tuple[float, float, float]:
        """Return tests that information saved against another order, with its 95 % interval."""
        ours, theirs = ([e.tests for e in self.episodes if e.strategy == s]
                        for s in ("information", other))  # fmt: skip
        return _interval([float(b - a) for a, b in zip(ours, theirs, strict=True)])

    def checks(self) -> list[Check]:
        """Return what must hold."""
        out = [
            Check(f"tests saved against {name} order, lower end of 95 %", self.saved(name)[1], 0.0,
                  "tests", at_least=True)
            for name in JUDGED
        ]  # fmt: skip
        certain = [e for e in self.episodes if e.strategy == "information" and e.certain]
        share = sum(e.right for e in certain) / max(len(certain), 1)
        slack = 2.0 * math.sqrt(CERTAIN * (1.0 - CERTAIN) / max(len(certain), 1))
        text = "certain answers that are right (95 % less two deviations)"
        return [*out, Check(text, share, CERTAIN - slack, "", at_least=True)]

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        checks = self.checks()
        return {
            "status": "pass" if all_passed(checks) else "fail",
            "checks": [check.to_dict() for check in checks],
            "saved": {name: list(self.saved(name)) for name in STRATEGIES[1:]},
            "rows": self.rows(),
        }


def _interval(values: Sequence[float]) -> tuple[float, float, float]:
    """Mean and its 95 % interval by Student's distribution."""
    from scipy.stats import t

    mean = float(np.mean(values))
    half = float(t.ppf(0.975, len(values) - 1) * np.std(values, ddof=1) / math.sqrt(len(values)))
    return mean, mean - half, mean + half


def reproduce_next_test(
    *,
    seed: int = 0,
    units: int = 8,
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

    actuator = Actuator.load("torino-rotary").with_values({"drive.kind": "pwm"})
    bench = _Bench(actuator, pairs)
    out = []
    for number, pair in enumerate(pairs):
        for k in range(units):
            done = (number + k / units) / len(pairs)
            if progress is not None and progress(done) is False:
                raise Interrupted("interrupted between two units")
            for strategy in STRATEGIES:
                out.append(bench.episode(pair, strategy, [seed, list(PAIRS).index(pair), k]))
    return NextTestResult(tuple(out))


class _Bench:
    """The tests, planned once, and units that go through them."""

    def __init__(self, actuator: Actuator, pairs: Sequence[str]) -> None:
        keys = {c[0] for pair in pairs for c in PAIRS[pair] if c is not None}
        candidates = [c for c in CANDIDATES if c.key in keys]
        self._actuator = actuator
        self._profiles = profiles()
        self._cases = [planned(p, actuator, candidates) for p in self._profiles]
        self._first: dict[str, int] = {}

    def episode(self, pair: str, strategy: str, seed: Sequence[int]) -> Episode:
        rng = np.random.default_rng([*seed, 1])
        truth = seed[-1] % 2
        condition = PAIRS[pair][truth]
        factor = max(1.0 + _KNOWN_TO * float(rng.standard_normal()), 0.3)
        belief = Belief.of([_possible(c) for c in PAIRS[pair]])
        pick = self._picker(pair, strategy, rng)
        for number in range(MOST):
            at = pick(number, belief)
            values = self._log(at, condition, factor, [*seed, 2, number])
            belief = updated(self._cases[at], belief, values)
            weights = [p.weight for p in belief.possible]
            if max(weights) >= CERTAIN:
                break
        right = int(np.argmax(weights)) == truth
        return Episode(pair, strategy, number + 1, max(weights) >= CERTAIN, right)

    def _picker(
        self, pair: str, strategy: str, rng: np.random.Generator
    ) -> Callable[[int, Belief], int]:
        count = len(self._cases)
        if strategy == "fixed":
            return lambda number, _belief: number % count
        if strategy == "standard":
            own = [k for k, profile in enumerate(self._profiles) if profile.standard]
            return lambda number, _belief: own[number % len(own)]
        if strategy == "random":
            return lambda _number, _belief: int(rng.integers(count))

        def informed(number: int, belief: Belief) -> int:
            if number == 0 and pair in self._first:
                return self._first[pair]
            information = [expected_information(case, belief) for case in self._cases]
            if number == 0:
                self._first[pair] = int(np.argmax(information))
            return int(np.argmax(information))

        return informed

    def _log(self, at: int, condition: Condition, factor: float, seed: Sequence[int]) -> Any:
        """Run one test on another day; what the log shows, in the order of the case's names."""
        from elevon.bench.rig import setups
        from elevon.bench.traces import recorded
        from elevon.diagnose.bymodel.log import prepared
        from elevon.diagnose.bymodel.replay import logged_evidence
        from elevon.diagnose.surrogate.population import day_of
        from elevon.diagnose.virtual import traced
        from elevon.scenario.compile import signal_records
        from elevon.simulate import Run, simulate_batch

        rng = np.random.default_rng(seed)
        day = day_of(self._actuator, rng)
        faults = [] if condition is None else [f"{condition[0]}={factor * condition[1]!r}"]
        own = int(rng.integers(2**31))
        setup = setups(self._profiles[at].procedure, day.actuator, faults=faults, seed=own)[0]
        record = recorded(list(signal_records(self._actuator.wiring, "low")))
        run = Run(setup.actuator, setup.scenario, setup.conditions.seed)
        shown = simulate_batch([run], fidelity="low", record=record)[0]
        item = prepared(traced(setup, shown, cell=day.cell), self._actuator)
        return logged_evidence(item, self._actuator).only(self._cases[at].unit.names).values


def _possible(condition: Condition) -> Possible:
    if condition is None:
        return Possible((), 0.5)
    key, severity = condition
    return Possible((key,), 0.5, (severity,), (_KNOWN_TO * severity,))
