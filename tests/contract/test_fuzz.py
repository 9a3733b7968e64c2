"""Numbers that nobody would choose: a clear error, or a run that is ok, tripped or diverged; never a panic, a traceback,
a sample that is no number with status ok, or a neighbour harmed.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator
from functools import cache

import numpy as np
import pytest

import elevon
from tests.contract import fuzz

#: Cases of each kind in the sample that always runs.
FEW = 60

KINDS: dict[str, Callable[[], Iterator[fuzz.Case]]] = {
    "parameters": fuzz.parameter_cases,
    "faults": fuzz.fault_cases,
    "commands": fuzz.command_cases,
    "mixed": lambda: fuzz.mixed_cases(20_000, seed=1),
}


@cache
def healthy(name: str, fidelity: str) -> list[elevon.Recording]:
    """The healthy run alone."""
    case = fuzz.Case(name, fidelity)
    return elevon.simulate_batch([case.run()], fidelity=fidelity, record=case.record())


def judged(cases: Iterable[fuzz.Case]) -> Counter[str]:
    """Outcomes of the cases, each of them checked."""
    return Counter(fuzz.outcome(case, healthy(case.name, case.fidelity)) for case in cases)


@pytest.mark.parametrize("kind", KINDS)
def test_a_sample_of_absurd_numbers_ends_clearly(kind: str) -> None:
    """Drawn from the whole space by a fixed seed."""
    cases = list(KINDS[kind]())
    chosen = np.random.default_rng(3).choice(len(cases), size=FEW, replace=False)
    seen = judged(cases[i] for i in chosen)
    assert seen["refused"] and seen["ok"], seen


@pytest.mark.long
@pytest.mark.parametrize("kind", KINDS)
def test_all_absurd_numbers_end_clearly(kind: str) -> None:
    """The whole space."""
    seen = judged(KINDS[kind]())
    assert seen["refused"] and seen["ok"], seen
