"""A surrogate from nothing: runs, training, and a test on units of another seed."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

from elevon.diagnose.surrogate.fit import TrainingPlan, fitted
from elevon.diagnose.surrogate.judge import judged, judged_at
from elevon.diagnose.surrogate.model import Surrogate
from elevon.diagnose.surrogate.table import TESTS, TrainingTable
from elevon.errors import InputError
from elevon.progress import Progress, part
from elevon.training.campaign import gathered

if TYPE_CHECKING:
    from elevon.actuator import Actuator

_LOW, _TEST = 100, 7  # added to the seed: units of the reduced-order model, and those that judge
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
        On the switching model, on the reduced-order one beside them, and on the former for the
        test.
    rounds : int
        Boosting rounds of each fault.
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
    plan = TrainingPlan(rounds=rounds, seed=seed)
    if units < 2 * plan.folds:
        raise InputError(f"--units {units}: at least {2 * plan.folds}")
    jobs = {
        "high": _Job(units, seed),
        "low": _Job(low_units, seed + _LOW, fidelity="low"),
        "test": _Job(test_units, seed + _TEST),
        "single_faults": _Job(test_units, seed + _TEST, single=True),
    }
    jobs = {name: job for name, job in jobs.items() if job.units}
    tables: dict[str, dict[str, TrainingTable]] = {}
    for number, (name, job) in enumerate(jobs.items()):
        share = part(progress, _RUNS * number / len(jobs), _RUNS * (number + 1) / len(jobs))
        tables[name] = _tables(actuator, job, folder, share)
    report = {
        "command": f"elevon diagnose-train --actuator {actuator.name} --units {units} --low-units "
        f"{low_units} --test-units {test_units} --rounds {rounds} --seed {seed}",
        "made": f"{datetime.now(UTC):%Y-%m-%d}", "actuator": actuator.name,
        "seeds": {name: job.seed for name, job in jobs.items()},
        "units": units, "low_units": low_units, "test_units": test_units, "rounds": rounds,
    }  # fmt: skip
    result = fitted(tables["high"], tables.get("low", {}), plan, report, part(progress, _RUNS, 1.0))
    if not test_units:
        return result
    more = {
        "test": judged(result, tables["test"]),
        "single_faults": judged_at(result, tables["test"], tables["single_faults"]),
    }
    return Surrogate(result.tests, {**result.report, **more})


@dataclass(frozen=True)
class _Job:
    units: int
    seed: int
    fidelity: str = "high"
    single: bool = False


def _tables(
    actuator: Actuator, job: _Job, folder: Path | None, progress: Progress | None
) -> dict[str, TrainingTable]:
    return {
        test: gathered(
            actuator, test, units=job.units, seed=job.seed, fidelity=job.fidelity,
            single=job.single,
            folder=folder, progress=part(progress, k / len(TESTS), (k + 1) / len(TESTS)),
        )
        for k, test in enumerate(TESTS)
    }  # fmt: skip
