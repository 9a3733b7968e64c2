"""Scores against values by hand."""

import numpy as np
import pytest

from elevon.diagnose.modelfree.scores import (
    accuracy,
    confusion,
    macro_f1,
    resamples,
    share_interval,
)


def test_macro_f1_by_hand():
    truth, predicted = list("aaabbc"), list("aabbbb")
    # a: 2 2/(3+2) = 0.8, b: 2 2/(2+4) = 2/3, c: 0.
    assert macro_f1(truth, predicted) == pytest.approx((0.8 + 2.0 / 3.0) / 3.0)
    assert accuracy(truth, predicted) == pytest.approx(4.0 / 6.0)
    assert confusion(truth, predicted, ["a", "b", "c"]) == [[2, 1, 0], [0, 2, 0], [0, 1, 0]]


def test_share_interval_is_that_of_the_tables():
    # No hit of 10: 1 - 0.025**(1/10); 5 of 10: 0.1871 to 0.8129 (Clopper and Pearson).
    assert share_interval(0, 10) == pytest.approx((0.0, 1.0 - 0.025**0.1))
    assert share_interval(5, 10) == pytest.approx((0.1871, 0.8129), abs=5e-5)
    assert share_interval(10, 10) == pytest.approx((0.025**0.1, 1.0))
    assert share_interval(0, 0) == (0.0, 1.0)


def test_resamples_keep_the_strata():
    strata = np.array(list("abacba"))
    drawn = list(resamples(strata, draws=300, seed=1))
    for index in drawn:
        assert sorted(strata[index]) == sorted(strata)
    counts = np.bincount(np.concatenate(drawn), minlength=6) / 300.0
    # Each is drawn once on average; the share of a draw of 3 has a deviation of 0.047 here.
    assert counts == pytest.approx(np.ones(6), abs=0.25)
