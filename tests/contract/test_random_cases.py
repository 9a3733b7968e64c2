"""Random faults, loads, drives and actuators: both models show the same, or it is stated why not.

Another seed: `ELEVON_SEED=7 pytest tests/contract/test_random_cases.py`.
"""

from __future__ import annotations

import os

import pytest

from tests.contract.agreement import Sizes
from tests.contract.random_cases import Case, among, cases, declared, not_modelled, parted

SEED = int(os.environ.get("ELEVON_SEED", "1"))


def undeclared(case: Case) -> list[str]:
    """Features in which the models part without a reason."""
    if not_modelled(case):
        return []
    return [f"{case.title}: {text}" for text in parted(case) if not declared(case, text)]


def test_a_feature_lies_among_what_the_runs_show() -> None:
    """Within a tenth of the outermost ones; a single run is both."""
    one, other, middle, beyond = (Sizes("ok", "", {"x": x}) for x in (1.0, 2.0, 1.5, 2.3))
    assert among([one, other], middle, "x", 1.0)
    assert not among([one], middle, "x", 1.0)
    assert not among([one, other], beyond, "x", 1.0)
    assert among([other], Sizes("ok", "", {"x": 2.05}), "x", 1.0)


def test_three_random_cases() -> None:
    """The short form: one servo, which takes a second."""
    few = list(cases(3, SEED, ["torino-rotary"]))
    assert [line for case in few for line in undeclared(case)] == []


@pytest.mark.long
def test_sixty_random_cases() -> None:
    """Within a tenth, not in the reduced-order model, or declared."""
    assert [line for case in cases(60, SEED) for line in undeclared(case)] == []
