"""The standard tests of an actuator: its stand's procedures that diagnosis reads, run and read.

The stand chooses how a log is made and diagnosed; no actuator is known by name.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.bench.procedure import POSITION, StandardTest, standard_tests
from elevon.bench.stand import stand_of
from elevon.errors import ElevonWarning
from elevon.logs.log import Log
from elevon.progress import part

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.answer import Diagnosis
    from elevon.progress import Progress

__all__ = ["Day", "StandardTest", "day_logs", "diagnosed", "standard_tests"]

_BLOCK = 12  # logs held at the recorder's inner rate at once


@dataclass(frozen=True)
class Day:
    """A day on the bench: what is broken, and what chance sets.

    Attributes
    ----------
    faults : tuple of str
        As in ``--fault``.
    seed : int
        Of the day's temperatures, friction and supply, of the command's start, of noise.
    """

    faults: tuple[str, ...]
    seed: int


def day_logs(
    actuator: Actuator,
    test: StandardTest,
    days: Sequence[Day],
    fidelity: str = "low",
    progress: Progress | None = None,
) -> list[Log]:
    """Run a test on several days, in a batch; return the logs as diagnosis reads them."""
    out: list[Log] = []
    for first in range(0, len(days), _BLOCK):
        block = days[first : first + _BLOCK]
        share = part(progress, first / len(days), (first + len(block)) / len(days))
        rotary = stand_of(actuator.wiring).equipment == POSITION
        made = _rotary if rotary else _loaded
        with (
            warnings.catch_warnings()
        ):  # a day may set what an actuator's own model of heat replaces
            warnings.simplefilter("ignore", ElevonWarning)
            out += made(actuator, test, block, fidelity, share)
    return out


def _of_day(actuator: Actuator, day: Day) -> Actuator:
    from elevon.diagnose.engine.candidates import of_a_magnet
    from elevon.diagnose.engine.days import drawn

    return drawn(of_a_magnet(actuator), np.random.default_rng([day.seed, 16]))


def _rotary(
    actuator: Actuator,
    test: StandardTest,
    days: Sequence[Day],
    fidelity: str,
    progress: Progress | None,
) -> list[Log]:
    from elevon.bench.rig import setups
    from elevon_cases.torino.bench_unit import logs_of

    ready = [
        setups(test.procedure, _of_day(actuator, day), faults=day.faults, seed=day.seed)[0]
        for day in days
    ]
    return logs_of(ready, fidelity, progress, whole=False)


def _loaded(
    actuator: Actuator,
    test: StandardTest,
    days: Sequence[Day],
    fidelity: str,
    progress: Progress | None,
) -> list[Log]:
    from elevon.bench.loaded import loaded_setups, run_loaded_batch

    stand = stand_of(actuator.wiring)
    ready = [
        loaded_setups(
            test.procedure, _of_day(actuator, day), stand, faults=day.faults, seed=day.seed
        )[0]
        for day in days
    ]
    return [Log.of(log, "log") for log, _ in run_loaded_batch(ready, fidelity, progress)]


def diagnosed(
    actuator: Actuator, log: Log, baselines: Sequence[Log], faults: Sequence[str] | None = None
) -> Diagnosis:
    """Return the diagnosis of one log as `elevon diagnose` makes it."""
    from elevon.diagnose.by_model import diagnose

    named = [replace(item, name=f"baseline {k + 1}") for k, item in enumerate(baselines)]
    return diagnose([log], actuator, baselines=named, faults=faults)
