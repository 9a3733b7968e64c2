"""An inspection counts with its whole posterior: probability and severity are weights."""

import pytest

from tests.prognose.cases import LIMIT, answer

USES = range(500, 5501, 500)
LEFT = 5500.0 / 0.88 - 5500.0  # 88 % of the limit at flight 5,500, in proportion


def course(*probabilities):
    return [(u, 0.88 * u / 5500.0, probabilities[k % len(probabilities)])
            for k, u in enumerate(USES)]  # fmt: skip


def test_sightings_that_are_not_sure_are_no_absence():
    """Right severities, probability 0.9 and 0.48 in turn: as with 0.9 throughout."""
    steady, turns = answer(*course(0.9)), answer(*course(0.9, 0.48))
    assert turns.median == pytest.approx(steady.median, rel=0.1)
    for result in (steady, turns):
        low, high = result.interval
        assert low < LEFT < high < 1500.0
        assert result.known[0].severity == pytest.approx(0.88 * LIMIT, rel=0.03)


def test_one_miss_after_two_sightings_is_a_miss():
    result = answer((2000, 0.32, 0.9), (3500, 0.56, 0.9), (5500, None, 0.0))
    low, high = result.interval
    assert low < LEFT < high < 3000.0
    assert 300.0 < result.median < 1300.0
