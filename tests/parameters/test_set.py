"""A parameter set is a mapping."""

from elevon import Actuator


def test_a_path_that_is_not_there_has_a_default():
    parameters = Actuator.load("torino-rotary").parameters
    assert parameters.get("motor.inertia") is parameters["motor.inertia"]
    assert parameters.get("sensor.encoder_delay") is None
    assert parameters.get("sensor.encoder_delay", 3) == 3
