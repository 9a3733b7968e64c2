"""Causes that are no candidates and look like one: what tells them apart decides, or both share."""

from types import SimpleNamespace

import numpy as np
import pytest

from elevon.diagnose.engine.candidates import CANDIDATES
from elevon.diagnose.engine.likelihood import Hypothesis
from elevon.diagnose.engine.lookalikes import LOOKALIKES, SHARE, lookalike_of, share_lookalikes
from elevon.diagnose.engine.plausibility import Plausibility
from elevon.diagnose.engine.posterior import Posterior
from elevon.diagnose.positions.plausibility import PLAUSIBLE

GAIN = next(c for c in CANDIDATES if c.key == "gain@sensor.encoder")
FRICTION = next(c for c in CANDIDATES if c.key == "friction@transmission")
SPEED = next(c for c in CANDIDATES if c.key == "gain_drift@control.speed")


def other(c, severity, name, mean, value, expected=None):
    """Probability of no candidate where one alone explains the features."""
    plausible = Plausibility((name,), ("",), np.array([value]), np.array([mean]), np.ones(1), 20.0)
    moves = {} if expected is None else {name: expected}
    item = SimpleNamespace(lookalike_moves=lambda _key, _severity: moves)
    case = SimpleNamespace(plausible=plausible, item=item)
    known = Posterior((Hypothesis((c.key,), 0.0, 1.0, best=(severity,)),), (1.0,))
    result = share_lookalikes([case], [c], known)
    assert sum(result.probabilities) + result.other == pytest.approx(1.0)
    return result.other


def test_each_is_of_a_candidate_and_told_by_a_number_that_is_read():
    found = {like.text for c in CANDIDATES if (like := lookalike_of(c)) is not None}
    assert found == {like.text for like in LOOKALIKES.values()}
    assert all(like.tells in PLAUSIBLE for like in LOOKALIKES.values() if like.tells)


def test_an_encoders_gain_is_told_from_an_error_once_a_turn_by_a_long_stroke_only():
    short = other(GAIN, 0.005, "position_cubic", 0.0, 0.0, expected=0.01)
    assert short == pytest.approx(SHARE / (1.0 + SHARE), rel=0.01)
    assert other(GAIN, 0.005, "position_cubic", 0.0, 0.0, expected=10.0) < 0.1
    assert other(GAIN, 0.005, "position_cubic", 0.0, 10.0, expected=10.0) > 0.9


def test_dry_friction_scales_what_falls_with_speed_another_law_moves_it_anyhow():
    assert other(FRICTION, 0.5, "creeping_current", 4.0, 6.0) < 0.1
    assert other(FRICTION, 0.5, "creeping_current", 4.0, 14.0) > 0.5


def test_a_speed_gain_leaves_the_ratio_to_its_integral_another_integral_time_moves_it():
    assert other(SPEED, 0.3, "integral_rate", 10.0, 10.0) < 0.1
    assert other(SPEED, 0.1, "integral_rate", 10.0, 2.0) > 0.9
    # Of a slow log a great gain moves the ratio, too: nothing is refuted.
    assert other(SPEED, 0.5, "integral_rate", 10.0, 5.0) < 0.15
