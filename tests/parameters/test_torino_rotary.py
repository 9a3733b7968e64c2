"""The Torino set against the papers' own numbers: what follows from what."""

import math

import numpy as np
import pytest

import elevon
from elevon.units import parse_quantity
from elevon_cases.torino.compliance import reproduce_compliance

ACTUATOR = elevon.Actuator.load("torino-rotary")


def value(path):
    return ACTUATOR.parameters.value(path)


def test_ratio_follows_from_the_teeth():
    z_a, z_s1, z_s2, z_b, z_c = 21, 21, 20, 62, 63
    ratio = (1 + z_c / z_a) / (1 - z_c * z_s2 / (z_s1 * z_b))
    assert ratio == pytest.approx(124.0, rel=1e-12)
    assert value("gear.ratio") == 124.0


def torque_per_ampere_rms():
    """3 phases, each k/sqrt(2) per A rms."""
    return 3.0 * value("motor.emf_constant") / math.sqrt(2.0)


def test_torque_constant_is_the_printed_one():
    assert torque_per_ampere_rms() == pytest.approx(1.91, rel=1e-4)


def test_torque_constant_agrees_with_the_static_torque():
    assert torque_per_ampere_rms() == pytest.approx(6.0 / 3.15, rel=0.005)


def test_torque_constant_agrees_with_the_mechanical_time_constant():
    seconds = (
        3.0
        * value("motor.winding_resistance")
        * value("motor.inertia")
        / torque_per_ampere_rms() ** 2
    )
    assert seconds == pytest.approx(1.75e-3, rel=0.01)


def test_torque_constant_agrees_with_the_cold_voltage_constant_within_its_temperature():
    line_rms = 121.0 / parse_quantity("1000 rpm", "rad/s")
    cold = line_rms * math.sqrt(2.0 / 3.0)
    assert cold == pytest.approx(0.9434, rel=1e-3)
    assert cold / value("motor.emf_constant") == pytest.approx(1.048, abs=1e-3)


def test_the_other_printed_torque_constant_fails():
    """T2 prints 1.1 N m/A: far from all three proofs."""
    assert abs(1.1 / (6.0 / 3.15) - 1.0) > 0.4


def test_electrical_time_constant_is_the_printed_one():
    tau = value("motor.winding_inductance") / value("motor.winding_resistance")
    assert tau == pytest.approx(11.10e-3, rel=1e-3)


def test_controller_believes_the_motor_it_has():
    believed = 1.5 * value("motor.emf_constant")
    assert value("control.torque_constant") == pytest.approx(believed, rel=1e-6)


def test_backlash_is_the_intrinsic_one():
    assert value("backlash.total") == pytest.approx(math.radians(0.365568), rel=1e-12)
    assert value("backlash.total") == pytest.approx(0.00638, abs=1e-5)


def test_position_gain_and_speed_limit():
    assert value("control.position_gain") == pytest.approx(1000.0 / 60.0 * 124.0)
    assert value("control.speed_limit") == pytest.approx(500.0 * math.pi / 30.0)


def test_encoder_shows_eighty_thousand_counts_a_turn():
    counts = (
        value("sensor.encoder.pulses")
        * value("sensor.encoder.edges")
        * value("sensor.encoder.wheel_ratio")
    )
    assert counts == 80000.0


def test_assumed_numbers_follow_from_what_their_notes_say():
    friction = (6.0 - 5.3) / parse_quantity("2000 rpm", "rad/s")
    assert value("friction.viscous") == pytest.approx(friction, rel=2e-3)
    i0 = 63 * 20 / (21 * 62)
    efficiency = (1.0 - i0) / (1.0 - 0.99**2 * i0)
    assert value("gear.efficiency") == pytest.approx(efficiency, abs=0.002)
    assert value("gear.efficiency_aiding") == pytest.approx(2.0 - 1.0 / value("gear.efficiency"))
    omega = 2.0 * math.pi * 250.0
    assert value("pwm.proportional_gain") == pytest.approx(
        value("motor.winding_inductance") * omega, rel=1e-3
    )
    assert value("pwm.integral_gain") == pytest.approx(
        value("motor.winding_resistance") * omega, rel=1e-3
    )
    stiffness, inertia = value("backlash.stiffness"), value("load.inertia")
    damping = 2.0 * 0.3 * math.sqrt(stiffness * inertia)
    assert value("backlash.damping") == pytest.approx(damping, rel=0.01)


def test_stiffness_is_that_of_the_forty_drops():
    """The robust slope of loss on load; load on loss (625 N m/rad) lies outside its interval."""
    found = reproduce_compliance().to_dict()
    low, high = found["interval_nm_per_rad"]
    assert value("backlash.stiffness") == pytest.approx(found["stiffness_nm_per_rad"], rel=0.001)
    assert 2 * 68.16 * 0.08 * 180.0 / math.pi < low < value("backlash.stiffness") < high


def test_gains_place_well_damped_poles_below_the_derivative_limit():
    inertia = value("motor.inertia") + value("gear.inertia")
    gain, td = value("control.speed_gain"), value("control.derivative_time")
    assert gain * td < 0.8 * inertia
    loop = value("control.position_gain") / value("gear.ratio")
    ki = gain / value("control.integral_time")
    poles = np.roots([inertia + gain * td, gain, gain * loop + ki, ki * loop])
    assert all(-pole.real / abs(pole) > 0.7 for pole in poles)


@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_values_do_not_contradict_each_other(fidelity):
    assert ACTUATOR.findings(fidelity) == []


@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_follows_a_step_without_overshoot_and_settles(fidelity):
    step = {"duration": "2 s", "command": {"terms": [{"kind": "step", "final": "2 deg"}]}}
    recording = elevon.simulate(ACTUATOR, elevon.Scenario.from_dict(step), fidelity=fidelity)
    output = recording["output_position"].to("deg")
    assert output.max() < 2.0 * 1.02
    assert abs(output[-1] - 2.0) < 0.02


def test_follows_the_campaign_sine_with_the_lag_of_a_proportional_loop():
    """A P position loop follows a ramp with the error speed / gain, and nothing else."""
    scenario = elevon.Scenario.from_dict(ACTUATOR.default_scenario).replaced(duration="5 s")
    recording = elevon.simulate(ACTUATOR, scenario, record="command,output_position@400 Hz")
    error = recording["command"].values - recording["output_position"].values
    speed = math.radians(7.0) * 2.0 * math.pi * 0.2
    lag = speed / (value("control.position_gain") / value("gear.ratio"))
    assert np.abs(error[400:]).max() < 1.3 * lag
    assert np.abs(error[400:]).max() > 0.9 * lag


def test_every_number_says_where_it_comes_from():
    for parameter in ACTUATOR.parameters.values():
        assert parameter.source
        if parameter.confidence == "assumed":
            assert "ASSUMED" in parameter.source, parameter.path
        if "ASSUMED" in parameter.source:
            assert parameter.source.partition("ASSUMED:")[2].strip(), parameter.path
