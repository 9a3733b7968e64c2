"""Stages: each serves an actuator, says what it needs, and takes only what the model can have."""

import pytest

from elevon import Actuator
from elevon.calibrate.calibration import DRIVE_STAGES
from elevon.calibrate.stages import STAGES
from elevon.calibrate.stages.context import Context, Stage, run_stages
from elevon.errors import InputError, Interrupted
from elevon.estimate import Estimate
from elevon.parameters.records import records, wiring_names

CONSTANT, RESISTANCE = "motor.emf_constant", "motor.winding_resistance"


@pytest.fixture
def context():
    return Context([], Actuator.load("nasa-ballscrew"))


def test_every_stage_serves_an_actuator_and_says_what_it_needs_and_gives():
    known = [records(name) for name in wiring_names()]
    stages = [*STAGES, *DRIVE_STAGES]
    for stage in stages:
        assert any(stage.of in paths for paths in known), stage.name
        assert stage.needs, stage.name
        assert stage.gives, stage.name
    for paths in known:
        assert any(stage.of in paths for stage in stages)


def test_what_the_model_cannot_have_is_not_determined(context):
    context.add({CONSTANT: Estimate(0.5, 0.01), RESISTANCE: Estimate(-0.8, 0.1)})
    assert list(context.levels) == [CONSTANT]
    estimates, missing = context.answer(None)
    assert [item.path for item in estimates] == [CONSTANT]
    assert "none that the model can have" in missing[RESISTANCE]
    assert context.settled().parameters.value(RESISTANCE) == context.given_value(RESISTANCE)
    with pytest.raises(InputError, match="none that the model can have"):
        context.answer([RESISTANCE])


def test_a_later_stage_may_determine_what_an_earlier_one_did_not(context):
    context.add({}, {CONSTANT: "no voltage"})
    context.add({CONSTANT: Estimate(0.5, 0.01)}, {CONSTANT: "no power"})
    context.stands_on([CONSTANT], ("screw.lead",))
    estimates, missing = context.answer(None)
    assert estimates[0].given == ("screw.lead",)
    assert missing == {}


def test_stages_run_in_their_order_where_they_serve_and_stop_where_they_are_stopped():
    order, fractions = [], []
    names = ("load.mass", "lock.strength", "screw.lead")
    stages = [
        Stage(name, name, "n", "g", lambda _, name=name: order.append(name)) for name in names
    ]
    running = Context([], Actuator.load("nasa-ballscrew"), progress=fractions.append)
    run_stages(stages, running, 0.0, 1.0)
    assert order == ["load.mass", "screw.lead"]
    assert fractions == [0.0, 0.5]
    stopping = Context([], Actuator.load("nasa-ballscrew"), progress=lambda _f: False)
    with pytest.raises(Interrupted):
        run_stages(stages, stopping, 0.0, 1.0)
