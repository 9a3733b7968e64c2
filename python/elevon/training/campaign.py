"""The runs a surrogate learns from: drawn units on the bench's own tests."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from elevon.bench.procedure import load_procedure
from elevon.bench.rig import Setup, setups
from elevon.bench.traces import recorded
from elevon.bench.virtual import first_trace, traced
from elevon.diagnose.surrogate.features import NAMES, SurrogateFeatures, log_features
from elevon.diagnose.surrogate.population import (
    ALIKE,
    FAULTS,
    NOISE,
    UnitDay,
    build_of,
    day_of,
    drawn_faults,
    learned,
    unit_of,
)
from elevon.diagnose.surrogate.table import (
    FAULTY_DAYS,
    HEALTHY_DAYS,
    SINGLE_FAULTS,
    TESTS,
    TrainingTable,
)
from elevon.errors import ElevonWarning, InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.progress import Progress
    from elevon.recording import Recording

_DAY_SINGLE = 100  # number of the first day with a fault of `ASKED`
_UNITS = 16  # of a block: what is run, and written, at a time
_VERSION = 2


def gathered(
    actuator: Actuator,
    test: str,
    *,
    units: int,
    seed: int,
    fidelity: str = "high",
    single: bool = False,
    folder: Path | None = None,
    progress: Progress | None = None,
) -> TrainingTable:
    """Run drawn units through a test and gather what the logs show.

    Parameters
    ----------
    actuator : Actuator
        The units are drawn about it.
    test : str
        Of `TESTS`.
    units : int
        How many; each `HEALTHY_DAYS` days healthy and then seven days that may be faulty.
    seed : int
        Of everything that is drawn.
    fidelity : str
        ``high`` or ``low``.
    single : bool
        One day for each fault of `ASKED` instead.
    folder : path, optional
        Finished blocks are kept there, and used when they are there already.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        An actuator of another wiring, an unknown test.
    Interrupted
        `progress` returned False; finished blocks stay.
    """
    if actuator.wiring != "rotary":
        raise InputError(f"{actuator.name}: the surrogate learns rotary actuators so far")
    if test not in TESTS:
        raise InputError(f"test {test!r}: one of {', '.join(TESTS)}")
    plan = _Plan(actuator, test, seed, fidelity, single)
    parts = []
    blocks = list(_blocks(units))
    for number, block in enumerate(blocks):
        path = None if folder is None else folder / _file(plan, block)
        share = _share(progress, number, len(blocks))
        if path is not None and path.exists():
            parts.append(_read(path))
            continue
        parts.append(_block(plan, block, share))
        if path is not None:
            _write(path, parts[-1])
    return TrainingTable.joined(parts)


@dataclass(frozen=True)
class _Plan:
    actuator: Actuator
    test: str
    seed: int
    fidelity: str
    single: bool


def _blocks(units: int) -> Iterator[range]:
    for first in range(0, units, _UNITS):
        yield range(first, min(first + _UNITS, units))


def _share(progress: Progress | None, number: int, total: int) -> Progress | None:
    from elevon.progress import part

    return part(progress, number / total, (number + 1) / total)


def _file(plan: _Plan, block: range) -> str:
    name = f"{plan.actuator.hash[:12]}-v{_VERSION}-s{plan.seed}"
    kind = "" if plan.fidelity == "high" else f"-{plan.fidelity}"
    if plan.single:
        kind += "-single"
    return f"{plan.test}{kind}-{name}-{block.start:05d}-{block.stop:05d}.npz"


def _read(path: Path) -> TrainingTable:
    with np.load(path, allow_pickle=False) as data:
        return TrainingTable(
            *(data[n] for n in ("unit", "baseline", "severity", "values", "about"))
        )


def _write(path: Path, table: TrainingTable) -> None:
    import io

    from elevon.files import write_bytes

    stream = io.BytesIO()
    np.savez(stream, **vars(table))
    write_bytes(path, stream.getvalue())


def _block(plan: _Plan, block: range, progress: Progress | None) -> TrainingTable:
    """Simulate some units; runs that trip or diverge give no row."""
    from elevon.scenario.compile import signal_records
    from elevon.simulate import Run, simulate_batch

    planned = [row for number in block for row in _unit_runs(plan, number)]
    runs = [Run(p.setup.actuator, p.setup.scenario, p.setup.conditions.seed) for p in planned]
    record = recorded(list(signal_records(plan.actuator.wiring, plan.fidelity)))
    with warnings.catch_warnings():
        # Units are drawn for both fidelities: what does not act in one of them is no news.
        warnings.simplefilter("ignore", ElevonWarning)
        recordings = simulate_batch(runs, fidelity=plan.fidelity, record=record, progress=progress)
    rows = []
    for p, recording in zip(planned, recordings, strict=True):
        if recording.status == "ok" and (row := _row(p, recording)) is not None:
            rows.append((p, row))
    return TrainingTable(
        np.array([p.unit for p, _ in rows], dtype=np.int64),
        np.array([p.baseline for p, _ in rows], dtype=np.bool_),
        np.array([[p.faults.get(key, 0.0) for key in FAULTS] for p, _ in rows]).reshape(
            -1, len(FAULTS)
        ),
        np.array([row.values for _, row in rows]).reshape(-1, len(NAMES)),
        np.array([[row.travel, row.speed] for _, row in rows]).reshape(-1, 2),
    )


@dataclass(frozen=True)
class _Planned:
    unit: int
    baseline: bool
    day: UnitDay
    faults: dict[str, float]
    noise: dict[str, float]
    setup: Setup


def _unit_runs(plan: _Plan, number: int) -> Iterator[_Planned]:
    """One unit, drawn alike for every test, and its days, which are not."""
    seed, test = plan.seed, plan.test
    unit_rng = np.random.default_rng([seed, number])
    build = build_of(np.random.default_rng([seed, len(TESTS), number // ALIKE]))
    unit = unit_of(plan.actuator, build, unit_rng)
    noise = {name: most * float(unit_rng.random()) for name, most in NOISE.items()}
    procedure, candidates = first_trace(load_procedure(test)), learned()
    for k, single in _days(plan):
        rng = np.random.default_rng([seed, number, TESTS.index(test), k])
        day = day_of(unit, rng)
        faults = drawn_faults(rng, candidates) if single is None else single
        texts = [_text(key, severity, rng) for key, severity in faults.items()]
        setup = setups(procedure, day.actuator, faults=texts, seed=int(rng.integers(2**31)))[0]
        yield _Planned(number, k < HEALTHY_DAYS, day, faults, noise, setup)


def _days(plan: _Plan) -> Iterator[tuple[int, dict[str, float] | None]]:
    """Numbers of a unit's days with the faults there; None: they are drawn."""
    if plan.single:
        for k, (key, severity) in enumerate(SINGLE_FAULTS[plan.test].items()):
            yield _DAY_SINGLE + k, {key: severity}
        return
    for k in range(HEALTHY_DAYS + FAULTY_DAYS):
        yield k, {} if k < HEALTHY_DAYS else None


def _text(key: str, severity: float, rng: np.random.Generator) -> str:
    """Return a fault in the grammar; what the electrical zero hides is drawn."""
    if key.startswith("short@"):
        return f"short@motor.phase_{rng.choice(list('abc'))}={severity!r}"
    if key.startswith("eccentricity"):
        return f"{key}={severity!r},phase={float(rng.uniform(0.0, 2.0 * math.pi))!r}"
    return f"{key}={severity!r}"


def _row(planned: _Planned, recording: Recording) -> SurrogateFeatures | None:
    try:
        log = traced(planned.setup, recording, cell=planned.day.cell, noise=planned.noise)
        return log_features(log, planned.setup.actuator)
    except InputError:
        return None
