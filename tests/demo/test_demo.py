"""The hidden actuator of a bench is another one, drawn by the seed."""

from elevon import Actuator
from elevon.bench.hidden import RECOVERED, hidden_actuator


def test_the_hidden_actuator_differs_and_is_drawn_by_the_seed():
    base = Actuator.load("torino-rotary")
    hidden = hidden_actuator(base, 3)
    assert hidden.hash == hidden_actuator(base, 3).hash
    assert hidden.hash != hidden_actuator(base, 4).hash
    moved = [path for path in RECOVERED if path in base.parameters]
    assert len(moved) == 6
    for path in moved:
        assert hidden.parameters.value(path) != base.parameters.value(path)
    assert not hidden.findings("high")
