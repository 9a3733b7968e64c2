"""A surrogate from nothing: runs, training, and a test on units of another seed."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from elevon.diagnose.surrogate.campaign import TESTS, Table, gathered
from elevon.diagnose.surrogate.fit import Plan, fitted, judged
from elevon.diagnose.surrogate.model import Surrogate
from elevon.errors import InputError
from elevon.progress import Progress, part

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
    progress: Progress | None = None,
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
    steps = len(jobs) * len(TESTS)
    for number, (name, count, own) in enumerate(jobs):
        for at, test in enumerate(TESTS, number * len(TESTS)):
            share = part(progress, _RUNS * at / steps, _RUNS * (at + 1) / steps)
            tables[name][test] = gathered(
                actuator, test, units=count, seed=own, folder=folder, progress=share,
                fidelity="low" if name == "low" else "high",
            )  # fmt: skip
    report = {
        "actuator": actuator.name, "units": units, "low_units": low_units,
        "test_units": test_units, "rounds": rounds, "seed": seed,
    }  # fmt: skip
    result = fitted(tables["high"], tables.get("low", {}), plan, report, part(progress, _RUNS, 1.0))
    if not test_units:
        return result
    return Surrogate(result.tests, {**result.report, "test": judged(result, tables["test"])})
