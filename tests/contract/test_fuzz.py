"""Numbers nobody would choose: a clear error, or a run that is ok, tripped or diverged; never a
panic, a traceback, a sample that is no number with status ok, or a neighbour harmed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from functools import cache

import numpy as np
import pytest

import elevon
from tests.contract import fuzz

#: What has no effect is stated elsewhere; here it may be anything.
pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")

#: Cases of each kind in the sample that always runs.
FEW = 150
#: Cases of each kind in the long test.
MANY = 4000

KINDS: dict[str, Callable[[], Iterator[fuzz.Case]]] = {
    "parameters": fuzz.parameter_cases,
    "faults": fuzz.fault_cases,
    "commands": fuzz.command_cases,
    "mixed": lambda: fuzz.mixed_cases(MANY, seed=1),
}


@cache
def healthy(name: str, fidelity: str) -> list[elevon.Recording]:
    """The healthy run alone."""
    case = fuzz.Case(name, fidelity)
    return elevon.simulate_batch([case.run()], fidelity=fidelity, record=case.record())


def judged(kind: str, count: int, seed: int) -> Counter[str]:
    """Outcomes of some cases of the whole space of a kind, each of them checked."""
    cases = list(KINDS[kind]())
    chosen = np.random.default_rng(seed).choice(len(cases), size=count, replace=False)
    return Counter(
        fuzz.outcome(case, healthy(case.name, case.fidelity)) for case in (cases[i] for i in chosen)
    )


@pytest.mark.parametrize(
    "count", [FEW, pytest.param(MANY, marks=pytest.mark.long)], ids=["few", "many"]
)
@pytest.mark.parametrize("kind", KINDS)
def test_absurd_numbers_end_clearly(kind: str, count: int) -> None:
    """Drawn by a fixed seed; some are refused and some run, else nothing was tried."""
    seen = judged(kind, count, seed=3)
    assert min(seen["refused"], seen["ok"]) > 0, seen
