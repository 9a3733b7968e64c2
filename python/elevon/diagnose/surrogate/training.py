"""A surrogate from nothing: runs, training, and a test on units of another seed."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.diagnose.surrogate.campaign import TESTS, Table, gathered
from elevon.diagnose.surrogate.fit import Plan, fitted, judged
from elevon.diagnose.surrogate.model import Surrogate
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["trained"]

_LOW, _TEST = 100, 1  # added to the seed: units of the low model, and those that judge
_RUNS = 0.7  # of the work


def trained(
    actuator: Actuator,
    *,
    units: int,
    low_units: int,
    test_units: int,
    rounds: int,
    seed: int = 0,
    folder: Path | None = None,
    progress: Callable[[float], Any] | None = None,
) -> Surrogate:
    """Simulate, train, test.

    Parameters
    ----------
    actuator : Actuator
        Units are drawn about it.
    units, low_units, test_units : int
        On the high model, on the low one beside them, and on the high one for the test.
    rounds : int
        Training steps of a network.
    seed : int
        Of everything.
    folder : path, optional
        Keeps finished blocks of runs; work that was cut short goes on from there.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        Too few units, another wiring.
    Interrupted
        `progress` returned False.
    """
    plan = Plan(rounds=rounds, seed=seed)
    if units < 2 * plan.folds:
        raise InputError(f"--units {units}: at least {2 * plan.folds}")
    jobs = [
        ("high", units, seed),
        ("low", low_units, seed + _LOW),
        ("test", test_units, seed + _TEST),
    ]
    jobs = [job for job in jobs if job[1]]
    tables: dict[str, dict[str, Table]] = {name: {} for name, _, _ in jobs}
    for number, (name, count, own) in enumerate(jobs):
        for k, test in enumerate(TESTS):
            done = (number + k / len(TESTS)) / len(jobs)
            share = _part(progress, _RUNS * done, _RUNS / len(jobs) / len(TESTS))
            tables[name][test] = gathered(
                actuator, test, units=count, seed=own, folder=folder, progress=share,
                fidelity="low" if name == "low" else "high",
            )  # fmt: skip
    report = {
        "actuator": actuator.name, "units": units, "low_units": low_units,
        "test_units": test_units, "rounds": rounds, "seed": seed,
    }  # fmt: skip
    result = fitted(
        tables["high"], tables.get("low", {}), plan, report, _part(progress, _RUNS, 1.0 - _RUNS)
    )
    if not test_units:
        return result
    return Surrogate(result.tests, {**result.report, "test": judged(result, tables["test"])})


def _part(
    progress: Callable[[float], Any] | None, first: float, share: float
) -> Callable[[float], Any] | None:
    return None if progress is None else lambda done: progress(first + share * done)
