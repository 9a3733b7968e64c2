"""A log's test on a model: variants, batches of several logs, sensors, refusals."""

import numpy as np
import pytest

from elevon import Actuator, Scenario, simulate
from elevon.errors import InputError, UnknownNameError
from elevon.experiment import Experiment, Inputs, Sensor, Variant, run_all, signals_by_role
from elevon.logs.log import Log

SHOWS = {"motor_speed": "motor_speed", "torque_current": "current_q_meas"}


@pytest.fixture(scope="module")
def unit():
    return Actuator.load("torino-rotary")


@pytest.fixture(scope="module")
def wave():
    time = np.arange(0.0, 1.0, 0.0025)
    return Log("log", time, {"command": 0.05 * np.sin(6.0 * time), "motor_speed": 0.0 * time})


def experiment(log, unit, **changes):
    inputs = Inputs(0.8, "position", (log.time, log["command"]), **changes)
    return Experiment(log, unit, inputs, SHOWS, rate="400 Hz")


def test_a_run_is_that_of_the_same_scenario(unit, wave):
    fault = "backlash@transmission=0.3deg"
    run = next(experiment(wave, unit).run([Variant({"friction.dynamic": 0.4}, (fault,))]))
    table = {"kind": "table", "times": wave.time.tolist(),
             "values": wave["command"].tolist()}  # fmt: skip
    scenario = Scenario.from_dict(
        {"duration": 0.8, "command": {"mode": "position", "terms": [table]}, "fault": [fault]}
    )
    same = simulate(
        unit.with_values({"friction.dynamic": 0.4}), scenario, fidelity="low",
        record="motor_speed,current_q_meas@400 Hz",
    )  # fmt: skip
    assert (run.status, run.complete) == ("ok", True)
    np.testing.assert_array_equal(run.log.speed, same["motor_speed"].values)
    np.testing.assert_array_equal(run.log.current, same["current_q_meas"].values)
    known = Experiment(wave, unit, scenario.with_faults([]), SHOWS, rate="400 Hz")
    again = next(known.run([Variant({"friction.dynamic": 0.4}, (fault,))]))
    np.testing.assert_array_equal(again.log.speed, run.log.speed)


def test_several_logs_run_in_one_batch(unit, wave):
    other = Log("other", wave.time, {"command": 0.5 * wave["command"]})
    pair = [experiment(wave, unit), experiment(other, unit)]
    together = run_all([(item, Variant()) for item in pair])
    for item, run in zip(pair, together, strict=True):
        np.testing.assert_array_equal(next(item.run()).log.speed, run.log.speed)


def test_a_sensor_shows_a_channel_late_scaled_and_offset(unit, wave):
    run = next(experiment(wave, unit).run())
    sensors = {"motor_speed": Sensor(delay=0.01, offset=2.0, scale=0.5),
               "torque_current": Sensor(unsigned=True)}  # fmt: skip
    seen = run.seen(wave, sensors)
    inside = (wave.time > 0.02) & (wave.time < 0.79)
    plain = np.interp(wave.time - 0.01, run.log.time, run.log.speed)
    np.testing.assert_allclose(seen.speed[inside], 0.5 * plain[inside] + 2.0)
    assert seen.current.min() >= 0.0 > run.log.current.min()


def test_derivatives_are_those_of_the_run(unit, wave):
    moved = experiment(wave, unit)
    slope = moved.sensitivities(Variant(), ["motor.inertia"])["motor.inertia"]["motor_speed"]
    value, step = unit.parameters.value("motor.inertia"), 1e-4
    up, down = (
        run.seen(wave).speed
        for run in moved.run([Variant({"motor.inertia": value * (1.0 + s)}) for s in (step, -step)])
    )
    off = slope - (up - down) / (2.0 * step * value)
    assert np.median(np.abs(off)) < 0.01 * np.abs(slope).max()


def test_what_cannot_be_run_is_refused(unit, wave):
    gap = wave.with_channels(command=np.where(wave.time > 0.5, np.nan, 0.0))
    with pytest.raises(InputError, match="log: command: a sample is missing"):
        experiment(gap, unit)
    back = (wave.time[::-1], wave.time)
    with pytest.raises(InputError, match="log: output: time does not increase"):
        experiment(wave, unit, loads={"output": back})
    with pytest.raises(UnknownNameError, match="backlash"):
        next(experiment(wave, unit).run([Variant(faults=("backlsh@transmission=0.1deg",))]))


def test_a_sensor_is_shown_before_what_is_true():
    assert signals_by_role("rotary", "low")["output_position"] == "encoder_position"
    assert None not in signals_by_role("landing_gear", "low")
