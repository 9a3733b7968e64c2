"""Metrics on tracks whose values are known."""

import numpy as np
import pytest

from elevon.errors import InputError
from elevon.prognose.metrics import (
    Track,
    alpha_lambda,
    convergence,
    coverage,
    cumulative_relative_accuracy,
    prognostic_horizon,
    relative_accuracy,
    wilson,
)


def track(error, width=10.0, usage=range(0, 100, 10), end=100.0):
    usage = np.array(usage, dtype=float)
    median = end - usage + error
    return Track(usage, median, median - width, median + width, end)


def test_a_perfect_track():
    perfect = track(0.0)
    assert relative_accuracy(perfect, 0.5) == 1.0
    assert cumulative_relative_accuracy(perfect, [0.5, 0.9]) == pytest.approx(1.0)
    assert prognostic_horizon(perfect) == 1.0
    assert np.isnan(convergence(perfect))
    assert coverage([perfect], 0.7) == 1.0


def test_relative_accuracy_falls_with_what_remains():
    late = track(5.0)
    assert relative_accuracy(late, 0.5) == pytest.approx(0.9)
    assert relative_accuracy(late, 0.9) == pytest.approx(0.5)
    assert alpha_lambda(late, 0.75)
    assert not alpha_lambda(late, 0.8)
    assert relative_accuracy(late, 0.55) == pytest.approx(1 - 5 / 45)  # used on since 50


def test_the_horizon_is_that_of_the_last_stretch_inside():
    error = np.array([50, 0, 0, 0, 40, 0, 0, 0, 0, 0])
    assert prognostic_horizon(track(error)) == pytest.approx(0.5)
    assert prognostic_horizon(track(error[::-1].cumsum())) == 0.0
    assert prognostic_horizon(track(20.0)) == 1.0
    assert prognostic_horizon(track(21.0)) == 0.0


def test_coverage_counts_units():
    assert coverage([track(0.0), track(9.0), track(11.0), track(-20.0)], 0.5) == 0.5


def test_an_early_error_converges_faster_than_a_late_one():
    early = convergence(track(np.linspace(30, 0, 10)))
    late = convergence(track(np.linspace(0, 30, 10)))
    # A triangle's centre lies at a third of its base and of its height.
    assert early == pytest.approx(np.hypot(1 / 3, 1 / 3), rel=0.03)
    assert late == pytest.approx(np.hypot(2 / 3, 1 / 3), rel=0.03)


def test_wilson_against_a_printed_value():
    """Agresti and Coull 1998: no success in ten gives 0 to 0.278."""
    low, high = wilson(0.0, 10)
    assert low == pytest.approx(0.0, abs=1e-12)
    assert high == pytest.approx(0.278, abs=5e-4)


def test_tracks_that_are_none():
    with pytest.raises(InputError, match="rise"):
        track(0.0, usage=[0, 10, 10])
    with pytest.raises(InputError, match="ends at"):
        track(0.0, end=0.0)
    with pytest.raises(InputError, match="no prediction"):
        relative_accuracy(track(0.0, usage=[60, 70]), 0.5)


def test_the_picture_shows_each_metric_at_its_value():
    from elevon.prognose.metrics import metrics_figure

    tracks = [track(0.0), track(5.0), track(30.0, width=1.0)]
    wedge, band, rates = metrics_figure(tracks, shares=(0.5, 0.9)).axes
    assert [line.get_ydata()[0] for line in wedge.lines[1:]] == pytest.approx([1.0, 1.05, 1.3])
    dots = [line for line in band.lines if line.get_marker() == "o"]
    assert [dot.get_xdata()[0] for dot in dots] == pytest.approx([0.0, 0.0])  # the third has none
    middle, covered = rates.lines
    np.testing.assert_allclose(middle.get_ydata(), [0.9, 0.5])
    np.testing.assert_allclose(covered.get_ydata(), [2 / 3, 2 / 3])
