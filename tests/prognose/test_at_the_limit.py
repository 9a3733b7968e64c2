"""A unit whose last severity is at its limit: the horizon follows the slowest living future."""

import numpy as np

from tests.prognose.cases import answer


def test_a_severity_at_its_limit_has_an_end_in_every_future():
    result = answer(*[(u, u / 5500.0, 0.95) for u in range(500, 5501, 500)])
    low, high = result.interval
    assert low == 0.0
    assert 0.0 < high < 600.0
    assert np.isfinite(result.future.end).mean() > 0.995
    assert result.survives(2000.0) < 0.01
    assert result.action.kind in ("replace", "inspect")
    assert result.action.within == 0.0
    assert "no end" not in result.headline


def test_the_slowest_future_is_followed_to_its_end():
    """Growth that nearly stands still ends late, not never."""
    result = answer((1000, 0.5, 1.0), (2000, 0.502, 1.0), (4000, 0.504, 1.0), (8000, 0.51, 1.0))
    assert np.isfinite(result.future.end).mean() > 0.95
