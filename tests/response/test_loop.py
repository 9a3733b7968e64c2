"""Open loops and their margins against closed forms."""

import json

import numpy as np
import pytest

import elevon
from elevon.cli import main
from elevon.errors import InputError
from elevon.response import linearise, loop_response, margins

FREE = {
    "friction.static": 0.0,
    "friction.dynamic": 0.0,
    "friction.viscous": 0.0,
    "backlash.total": 0.0,
    "drive.kind": "pwm",
}
ACTUATOR = elevon.Actuator.load("torino-rotary").with_values(FREE)
GRID = np.geomspace(0.3, 3000.0, 4000)


def value(path):
    return ACTUATOR.parameters.value(path)


def current_loop(frequency):
    """PI, half a sample and the computation's delay, winding; the decoupling takes the EMF off."""
    s = 2j * np.pi * np.asarray(frequency)
    late = (0.5 + value("pwm.computation_delay")) * value("pwm.sample_time")
    controller = value("pwm.proportional_gain") + value("pwm.integral_gain") / s
    winding = value("motor.winding_inductance") * s + value("motor.winding_resistance")
    return controller / winding * np.exp(-late * s)


def speed_loop(frequency):
    """PID with filtered derivative, the closed current loop, the inertia."""
    s = 2j * np.pi * np.asarray(frequency)
    inner = current_loop(frequency)
    time = value("control.derivative_time")
    pid = 1.0 + 1.0 / (value("control.integral_time") * s)
    pid += time * s / (1.0 + time / value("control.derivative_filter") * s)
    ratio = value("gear.ratio")
    inertia = value("motor.inertia") + value("gear.inertia") + value("load.inertia") / ratio**2
    return value("control.speed_gain") * pid * inner / (1.0 + inner) / (inertia * s)


def position_loop(frequency):
    """The position's gain, the closed speed loop, the gear."""
    s = 2j * np.pi * np.asarray(frequency)
    inner = speed_loop(frequency)
    return value("control.position_gain") / value("gear.ratio") / s * inner / (1.0 + inner)


LOOPS = {"position": position_loop, "speed": speed_loop, "current": current_loop}


def exact(loop):
    return margins(GRID, LOOPS[loop](GRID), np.full(len(GRID), np.nan))


def test_the_closed_forms_have_the_known_margins():
    """An independent analysis of the loops with PWM: 2.6 Hz, 78 deg, 55 dB; 17.3 Hz, 133 deg."""
    position, speed = exact("position"), exact("speed")
    assert position.crossover.value == pytest.approx(2.6, abs=0.05)
    assert position.phase.value == pytest.approx(78.0, abs=1.0)
    assert position.gain.value == pytest.approx(55.0, abs=0.5)
    assert speed.crossover.value == pytest.approx(17.3, abs=0.1)
    assert speed.phase.value == pytest.approx(133.0, abs=1.0)


@pytest.mark.parametrize(
    ("loop", "options"),
    [
        ("current", {}),
        ("speed", {"low": 2.0, "high": 200.0}),
        pytest.param("position", {}, marks=pytest.mark.long),
        pytest.param("speed", {}, marks=pytest.mark.long),
    ],
)
def test_measured_loops_are_the_closed_forms(loop, options):
    """Within twice the interval, and 1 % for lines apart and edges on whole steps."""
    measured = loop_response(ACTUATOR, loop, realisations=4, **options).margins
    true = exact(loop)
    names = ("crossover", "phase") if options else ("crossover", "phase", "gain", "disk")
    for name in names:
        found, expected = getattr(measured, name), getattr(true, name).value
        half = 0.5 * (found.interval[1] - found.interval[0])
        assert half < 0.05 * expected, name
        assert abs(found.value - expected) < 2.0 * half + 0.01 * expected, name


@pytest.mark.long
def test_the_reduced_order_loop_is_that_of_its_linear_model():
    """L = T / (1 - T), with T from the impulse responses of a session."""
    model = linearise(ACTUATOR, period="0.5 ms", horizon="0.4 s")
    measured = loop_response(
        ACTUATOR, "position", 0.5, 20.0, "0.05 deg", fidelity="low", realisations=2
    )
    closed = model.response(measured.frequency)[:, 0, 0]
    predicted = closed / (1.0 - closed)
    near = (measured.frequency > 1.0) & (measured.frequency < 8.0)
    assert np.abs(measured.response / predicted - 1.0)[near].max() < 0.03
    expected = margins(measured.frequency, predicted, measured.std)
    found = measured.margins
    assert found.crossover.value == pytest.approx(expected.crossover.value, rel=0.01)
    assert found.phase.value == pytest.approx(expected.phase.value, abs=1.0)
    assert not measured.hint


def test_margins_of_a_double_lag():
    """L = k / (s (s + 1)^2): phase -180 at 1 rad/s, gain margin 2/k; the disk on a fine grid."""
    s = 1j * np.geomspace(0.01, 100.0, 200)
    frequency = np.abs(s) / (2.0 * np.pi)
    found = margins(frequency, 0.5 / (s * (s + 1.0) ** 2), np.full(200, np.nan))
    assert found.gain.value == pytest.approx(20.0 * np.log10(4.0), abs=0.01)
    assert found.gain.frequency == pytest.approx(1.0 / (2.0 * np.pi), rel=1e-3)
    w = 2.0 * np.pi * found.crossover.value
    assert 0.5 / (w * (w**2 + 1.0)) == pytest.approx(1.0, rel=1e-3)
    assert found.phase.value == pytest.approx(90.0 - 2.0 * np.rad2deg(np.arctan(w)), abs=0.05)
    fine = 1j * np.geomspace(0.01, 100.0, 100_001)
    loop = 0.5 / (fine * (fine + 1.0) ** 2)
    disk = np.min(2.0 * np.abs(1.0 + loop) / np.abs(1.0 - loop))
    assert found.disk.value == pytest.approx(disk, rel=2e-3)
    assert found.phase.interval is None
    short = margins(frequency[:50], 50.0 / s[:50], np.full(50, 0.01))
    assert short.crossover.value is None
    assert short.gain.to_dict() == {"value": None, "interval": None, "frequency_hz": None}


@pytest.mark.long
def test_intervals_hold_the_truth_as_often_as_they_say():
    """A known loop under known noise, 100 draws: 90 % within +-7."""
    s = 2j * np.pi * np.geomspace(0.5, 50.0, 40)
    frequency, truth = np.abs(s) / (2.0 * np.pi), 20.0 / (s * (0.02 * s + 1.0))
    std = np.full(40, 0.03)
    true = margins(frequency, truth, np.full(40, np.nan))
    generator, covered = np.random.default_rng(4), []
    for number in range(100):
        noise = generator.normal(size=40) + 1j * generator.normal(size=40)
        found = margins(frequency, truth * np.exp(std * noise), std, seed=number)
        covered.append(found.phase.interval[0] <= true.phase.value <= found.phase.interval[1])
    assert 0.83 <= np.mean(covered) <= 0.97


def test_friction_lowers_the_coherence_and_says_so():
    worn = ACTUATOR.with_values({"friction.static": "0.4 N m", "friction.dynamic": "0.3 N m"})
    measured = loop_response(
        worn, "position", 0.5, 20.0, "0.05 deg", fidelity="low", realisations=4
    )
    assert "coherence falls to" in measured.hint
    assert "describing function" in measured.hint
    assert measured.feedback_amplitude > 0.0


def test_beside_friction_stands_the_linear_loop():
    """Its crossover and phase are those of the set without friction and backlash."""
    worn = ACTUATOR.with_values({"friction.static": "0.4 N m", "friction.dynamic": "0.3 N m"})
    options = {"low": 0.5, "high": 20.0, "fidelity": "low"}
    straight = loop_response(ACTUATOR, "position", amplitude="0.2 deg", realisations=2, **options)
    assert straight.linear is None
    measured = loop_response(worn, "position", amplitude="0.2 deg", realisations=4, **options)
    true = straight.margins
    assert measured.linear.crossover.value == pytest.approx(true.crossover.value, rel=0.01)
    assert measured.linear.phase.value == pytest.approx(true.phase.value, abs=0.5)
    assert measured.margins.crossover.value < 0.9 * true.crossover.value
    assert "linear: crossover [Hz]" in measured.margins_table


def test_a_margin_stands_within_its_interval_or_is_not_known():
    """A lag under noise that grows with the frequency: what chance crossings say is no margin."""
    s = 2j * np.pi * np.geomspace(0.5, 2000.0, 80)
    frequency, truth = np.abs(s) / (2.0 * np.pi), 20.0 / (s * (0.001 * s + 1.0))
    std = 1e-3 + 0.3 * (frequency / 200.0) ** 2
    generator = np.random.default_rng(1)
    for number in range(30):
        noise = generator.normal(size=80) + 1j * generator.normal(size=80)
        found = margins(frequency, truth * np.exp(std * noise), std, seed=number)
        for margin in (found.crossover, found.phase, found.gain, found.disk):
            if margin.value is not None and margin.interval is not None:
                assert margin.interval[0] <= margin.value <= margin.interval[1]
        assert found.gain.value is None


def test_the_feed_forward_is_not_part_of_the_loop():
    ahead = ACTUATOR.with_values({"control.speed_feedforward": 0.8})
    options = {"low": 1.0, "high": 8.0, "fidelity": "low", "realisations": 1}
    plain, other = (loop_response(a, "position", **options) for a in (ACTUATOR, ahead))
    assert np.array_equal(plain.response, other.response)
    assert plain.margins.phase.interval is None  # one realisation has no deviation


@pytest.mark.parametrize(
    ("name", "loop", "options", "message"),
    [
        ("torino-rotary", "positon", {}, "position"),
        ("torino-rotary", "current", {}, "drive.kind"),
        ("torino-rotary", "current", {"fidelity": "low"}, "reduced-order"),
        ("pisa-landing-gear", "speed", {}, "control unit"),
        ("torino-rotary", "speed", {"amplitude": 0.0}, "positive"),
        ("torino-rotary", "speed", {"realisations": 0}, "at least 1"),
        ("torino-rotary", "speed", {"low": 5.0, "high": 2.0}, "no range"),
    ],
)
def test_wrong_input_is_named(name, loop, options, message):
    with pytest.raises(InputError, match=message):
        loop_response(name, loop, **options)


def test_command(tmp_path, capsys):
    plot = tmp_path / "loop.png"
    arguments = ["response", "torino-rotary", "--loop", "position", "--fidelity", "low"]
    options = ["--to", "20 Hz", "--realisations", "2"]
    for path, number in FREE.items():
        options += ["--set", f"{path}={number}"]
    assert main([*arguments, *options, "--json", "--plot", str(plot)]) == 0
    answer = json.loads(capsys.readouterr().out)
    assert answer["margins"]["phase_margin_deg"]["value"] == pytest.approx(77.0, abs=2.0)
    assert answer["margins"]["gain_margin_db"]["value"] is None
    assert answer["hint"] == ""
    assert plot.stat().st_size > 10_000
    assert main([*arguments, *options]) == 0
    assert "not reached" in capsys.readouterr().out
    assert main([*arguments, *options, "--mode", "speed"]) == 2
    assert "--mode" in capsys.readouterr().err
