"""No check of a published case is one that cannot fail: each sees the error planted for it."""

from functools import cache

import pytest

from elevon_cases.catalogue import published
from planted import GOOD, LONG, PLANTED

JUDGED = {(case, judged.check): judged for case, r in published().items() for judged in r.checks}


@cache
def good(case):
    return {check.name: check.passed for check in GOOD[case]()}


def test_every_kind_of_check_has_its_error():
    assert set(PLANTED) == set(JUDGED)


@pytest.mark.parametrize(
    ("case", "check"),
    [pytest.param(*key, marks=[pytest.mark.long] if key[0] in LONG else []) for key in PLANTED],
)
def test_the_planted_error_fails_its_check(case, check):
    judged = JUDGED[case, check]
    before = {name: passed for name, passed in good(case).items() if judged.judges(name)}
    assert before
    seen = [c for c in PLANTED[case, check]() if judged.judges(c.name)]
    assert len(seen) == len(before)
    assert any(not c.passed for c in seen)
    assert any(before[c.name] and not c.passed for c in seen)
