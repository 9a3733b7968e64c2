"""A command between its samples: the model's current is that of the command as it was given."""

import math

import numpy as np
import pytest

from elevon.actuator import Actuator
from elevon.calibrate.validation import ValidationTrace
from elevon.logs.command.curve import command_curve, rebuilt_curve
from elevon.logs.log import Log
from elevon.scenario import Scenario
from elevon.scenario.compile import evaluate_terms
from elevon.simulate import simulate

DURATION = 4.0
WAVES = {
    "triangle": {"kind": "triangle", "amplitude": "50 mm", "frequency": "0.3 Hz"},
    "trapezoid": {
        "kind": "trapezoid", "low": "0 mm", "high": "50 mm", "rise": "0.7 s",
        "hold_high": "0.41 s", "fall": "0.6133 s", "hold_low": "0.3 s", "start": "0.1237 s",
    },
    "sine": {"kind": "sine", "amplitude": "50 mm", "frequency": "0.19 Hz"},
    "step": {"kind": "step", "initial": "0 mm", "final": "5 mm", "time": "0.5 s"},
}  # fmt: skip


def scenario(term):
    return Scenario.from_dict(
        {"duration": DURATION, "command": {"mode": "position", "terms": [term]}}
    )


def current(term):
    run = simulate(
        Actuator.load("nasa-ballscrew"), scenario(term), fidelity="low",
        record="current_q_meas@every",
    )  # fmt: skip
    return np.asarray(run["current_q_meas"].values)


@pytest.fixture(scope="module", params=WAVES, ids=list(WAVES))
def wave(request):
    term = WAVES[request.param]
    return scenario(term).command.terms, current(term)


@pytest.mark.parametrize("rate", [200.0, 500.0, 1000.0])
def test_a_recorded_command_makes_the_current_of_the_command_itself(wave, rate):
    terms, exact = wave
    time = np.arange(0.0, DURATION + 0.5 / rate, 1.0 / rate)
    curve = rebuilt_curve(time, evaluate_terms(terms, "m", time))
    table = {"kind": "table", "times": curve.time.tolist(), "values": curve.values.tolist()}
    error = current(table) - exact
    assert math.sqrt(np.mean(error**2)) < 0.01 * np.std(exact)


def triangle(time, frequency=0.3, phase=0.4):
    return 2.0 / math.pi * np.arcsin(np.sin(2.0 * math.pi * frequency * time + phase))


@pytest.mark.parametrize("noise", [0.0, 1e-4])
@pytest.mark.parametrize("kept", [1.0, 0.98])
def test_a_corner_stands_where_it_is_and_its_interval_holds_it(noise, kept):
    rng = np.random.default_rng(4)
    time = np.arange(0.0, 9.0, 0.01)
    time = time[rng.random(len(time)) < kept]
    curve = rebuilt_curve(time, triangle(time) + rng.normal(0.0, noise, len(time)))
    true = (np.arange(6) + 0.5 - 0.4 / math.pi) / 0.6
    for instant in true[true < 8.9]:
        nearest = min(curve.breaks, key=lambda item: abs(item.time - instant))
        assert not nearest.step
        assert abs(nearest.time - instant) < (1e-3 if noise else 1e-9)
        assert nearest.low - 1e-9 <= instant <= nearest.high + 1e-9
    assert np.all(np.diff(curve.time) > 0.0)


def test_what_is_smooth_has_no_corner_and_passes_its_samples():
    time = np.arange(0.0, 6.0, 0.004)
    for values in (
        np.sin(3.0 * time + 0.5 * time**2),
        np.maximum(time - 2.0, 0.0) ** 2,
        0.0 * time,
    ):
        curve = rebuilt_curve(time, values)
        assert curve.breaks == ()
        np.testing.assert_allclose(curve.at(time), values, atol=1e-9 * max(1.0, np.ptp(values)))


def test_a_step_stays_one_until_the_sample_that_shows_it():
    time = np.arange(0.0, 2.0, 0.01)
    curve = rebuilt_curve(time, np.where(time < 0.995, 0.0, 1.0))
    (edge,) = curve.breaks
    assert edge.step
    assert (edge.low, edge.high, edge.time) == (time[99], time[100], time[100])
    assert curve.at(np.array([0.9999]))[0] == 0.0
    assert curve.at(np.array([1.0]))[0] == 1.0


@pytest.mark.parametrize("seed", range(40))
def test_whatever_is_sampled_the_instants_increase(seed):
    """Steps at either end, single samples between steps, corners on samples, lost rows, noise."""
    rng = np.random.default_rng(seed)
    knots = np.sort(rng.choice(np.arange(0.0, 1.0, 0.005), 6, replace=False)) + rng.choice(
        [0, 1e-3]
    )
    time = np.arange(0.0, 1.0, 0.01)
    time = time[rng.random(len(time)) < 0.95]
    values = np.interp(time, knots, rng.normal(0.0, 1.0, 6)) + rng.choice([0.0, 1e-5]) * rng.random(
        len(time)
    )
    for place in rng.choice(len(time), 3, replace=False):
        values[place:] += rng.choice([0.0, 3.0])
    values[rng.choice([0, -1])] += rng.choice([0.0, 5.0])
    curve = rebuilt_curve(time, values)
    assert np.all(np.diff(curve.time) > 0.0)
    assert np.isfinite(curve.values).all()
    np.testing.assert_allclose(curve.at(time), values, atol=2e-5 * max(1.0, np.ptp(values)))


def test_errors_are_stated_with_and_without_what_lies_about_corners():
    time = np.arange(0.0, 9.0, 0.002)
    command = triangle(time)
    log = Log("x", time, {"command": command, "torque_current": np.gradient(command, time)})
    near = command_curve(log).about_breaks(time)
    assert 0.02 < near.mean() < 0.04
    run = log.with_channels(torque_current=log["torque_current"] + np.where(near, 0.5, 0.01))
    (row,) = ValidationTrace.of(log, run, {"torque_current": "current"}).errors({"current": "A"})
    assert row.of_rms > 5.0
    assert row.of_rms_away == pytest.approx(1.0 / np.std(np.gradient(command, time)), rel=0.05)
    smooth = log.with_channels(command=np.sin(time))
    (row,) = ValidationTrace.of(smooth, run, {"torque_current": "current"}).errors({"current": "A"})
    assert row.of_rms_away is None
