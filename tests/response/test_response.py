"""Frequency responses against closed forms, and linear models against frequency responses."""

import json

import numpy as np
import pytest

import elevon
from elevon.cli import main
from elevon.errors import InputError
from elevon.response import frequency_response, linearise
from elevon.response.estimate import estimate

FREE = {
    "friction.static": 0.0,
    "friction.dynamic": 0.0,
    "friction.viscous": 0.0,
    "backlash.total": 0.0,
    "drive.kind": "pwm",
}


@pytest.fixture(scope="module")
def free():
    """A linear actuator: no friction, no backlash, continuous currents."""
    return elevon.Actuator.load("torino-rotary").with_values(FREE)


def _inertia(actuator):
    p = {path: actuator.parameters.value(path) for path in actuator.parameters}
    return p["motor.inertia"] + p["gear.inertia"] + p["load.inertia"] / p["gear.ratio"] ** 2


def test_a_free_shaft_integrates_torque(free):
    """From torque to speed: 1 / (J s), and the lag of the current loop."""
    model = linearise(free, mode="torque", outputs=["motor_speed"])
    assert model.error < 1e-6
    slow, fast = sorted(model.poles, key=abs)
    assert abs(slow) < 1e-6
    frequency = 0.5
    gain = abs(model.response(frequency)[0, 0, 0])
    assert gain == pytest.approx(1.0 / (_inertia(free) * 2 * np.pi * frequency), rel=2e-3)
    gain_of_loop = free.parameters.value("pwm.proportional_gain")
    inductance = free.parameters.value("motor.winding_inductance")
    assert -fast.real == pytest.approx(gain_of_loop / inductance, rel=0.05)


def test_the_linear_model_is_what_a_multisine_measures(free):
    """Two ways of one figure: impulses of a session, sines of a batch. A command that is held over
    a period has no slope in it, which the derivative would answer: it acts up to a period later."""
    model = linearise(free, period="0.5 ms", horizon="0.4 s")
    measured = frequency_response(free, 0.5, 20.0, "0.05 deg", fidelity="low", realisations=2)
    assert measured.coherence.min() > 0.999
    assert free.parameters.value("low.step") == model.period  # so both see the same samples
    predicted = model.response(measured.frequency)[:, 0, 0]
    late = 2 * np.pi * measured.frequency * model.period
    assert np.all(np.abs(predicted / measured.response - 1.0) < 0.005 + late)
    assert measured.gain[0] == pytest.approx(1.0, abs=0.05)  # it follows a slow command


def test_backlash_and_friction_lower_the_coherence(free):
    linear = frequency_response(free, 1.0, 8.0, "0.5 deg", fidelity="low", realisations=4)
    worn = free.with_values({"friction.static": "0.4 N m", "friction.dynamic": "0.3 N m"})
    stiff = frequency_response(worn, 1.0, 8.0, "0.05 deg", fidelity="low", realisations=4)
    assert linear.coherence.min() > 0.999 > 0.95 > stiff.coherence.min()
    assert np.nanmax(stiff.std) > 10.0 * np.nanmax(linear.std)


def test_a_sweep_and_a_multisine_agree(free):
    options = {"fidelity": "low", "realisations": 2}
    lines = frequency_response(free, 1.0, 8.0, "0.1 deg", **options)
    sweep = frequency_response(free, 1.0, 8.0, "0.1 deg", method="sweep", **options)
    inner = (lines.frequency > 1.5) & (lines.frequency < 7.0)
    gain = np.interp(lines.frequency[inner], sweep.frequency, sweep.gain)
    assert gain == pytest.approx(lines.gain[inner], rel=0.03)


def test_the_estimate_and_its_deviation():
    """A known response under noise: the deviation says how far the estimates scatter."""
    generator = np.random.default_rng(2)
    truth, errors, claimed = 2.0 - 1.0j, [], []
    for _ in range(300):
        inputs = generator.normal(size=(12, 1)) + 1j * generator.normal(size=(12, 1))
        noise = generator.normal(size=(12, 1)) + 1j * generator.normal(size=(12, 1))
        response, _, std = estimate(inputs, truth * inputs + 0.6 * noise)
        errors.append(abs(response[0]) / abs(truth) - 1.0)
        claimed.append(std[0])
    assert np.std(errors) == pytest.approx(np.mean(claimed), rel=0.15)
    assert abs(np.mean(errors)) < 3 * np.std(errors) / np.sqrt(300) + 0.01
    assert np.isnan(estimate(inputs[:1], inputs[:1])[2]).all()


def test_bandwidth_and_lag(free):
    measured = frequency_response(free, 0.5, 20.0, "0.05 deg", fidelity="low", realisations=2)
    at = measured.crossing(3.0)
    gain = np.interp(np.log(at), np.log(measured.frequency), 20 * np.log10(measured.gain))
    assert gain == pytest.approx(20 * np.log10(measured.gain[0]) - 3.0, abs=1e-6)
    assert measured.crossing(200.0) is None
    assert 0.5 < measured.lag(45.0) < measured.lag(90.0)


def test_a_shaft_at_rest_has_no_linear_model():
    with pytest.raises(InputError, match="friction holds the shaft"):
        linearise("torino-rotary")
    moving = linearise("torino-rotary", mode="speed", command=20.0, outputs=["motor_speed"])
    assert moving.error < 1e-4
    assert moving.nonlinearity < 1e-4
    assert np.all(moving.poles.real < 0.0)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"low": 3.0, "high": 2.0}, "no range"),
        ({"high": 1e6}, "resolves up to"),
        ({"amplitude": 0.0}, "positive"),
        ({"amplitude": "1 kg"}, "kg"),
        ({"amplitude": "1"}, "'1 deg'"),
        ({"method": "multisin"}, "multisine"),
        ({"mode": "gear"}, "position"),
        ({"output": "motor_sped"}, "motor_speed"),
        ({"realisations": 0}, "at least 1"),
        ({"fidelity": "middle"}, "high"),
    ],
)
def test_wrong_input_is_named(options, message):
    given = {"low": 1.0, "high": 10.0, "amplitude": 0.01, "fidelity": "low", **options}
    with pytest.raises(InputError, match=message):
        frequency_response("torino-rotary", **given)


def test_command(tmp_path, capsys):
    plot = tmp_path / "bode.png"
    arguments = ["response", "nasa-ballscrew", "--from", "1 Hz", "--to", "10 Hz"]
    options = ["--fidelity", "low", "--realisations", "2", "--plot", str(plot)]
    assert main([*arguments, *options, "--json"]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["status"] == "ok"
    assert len(answer["frequency_hz"]) == len(answer["gain_db"]) == len(answer["coherence"])
    assert plot.stat().st_size > 10_000
    assert main([*arguments, *options]) == 2  # the plot is there
    assert main([*arguments, *options[:4], "--mode", "speed", "--output", "motor_speed"]) == 0
    assert "coherence" in capsys.readouterr().out
