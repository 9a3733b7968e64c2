"""Backlash recovered from encoder signals whose backlash is known: a closed loop in numpy.

The oracle is not the product's model: a linear loop with the backlash operator, Coulomb friction as
a
torque of the speed's sign, no motor, no inverter, stepped at 1 ms for many cases side by side.
"""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from elevon.errors import InputError
from elevon_cases.torino.backlash import measured_rows
from elevon_cases.torino.backlash_estimate import backlash_from_encoder, flat_lengths, lost_motion

STEP, FREQUENCY, START = 1e-3, 0.2, 10.0
COUNT = np.radians(360.0 / 80000.0)


def closed_loop(
    backlash, amplitude, *, gain=16.7, speed=40.0, integral=4.0, friction=0.0, seconds=25
):
    """Encoder and motor (at the output) of a P loop around a PI speed loop around backlash.

    `backlash`, `amplitude`: arrays of one shape; returns arrays of shape (n, ...) in rad.
    """
    time = np.arange(0.0, seconds, STEP)
    output = np.zeros(np.shape(backlash))
    motor, rate, sum_ = output.copy(), output.copy(), output.copy()
    encoder, turned = [], []
    for t in time:
        torque = gain * (amplitude * np.sin(2 * np.pi * FREQUENCY * t) + 0.17 - output)
        error = torque - rate
        push = speed * (error + sum_) - friction * np.tanh(rate / 1e-4)
        sum_ = sum_ + integral * error * STEP
        rate = rate + push * STEP
        motor = motor + rate * STEP
        output = np.minimum(np.maximum(output, motor - backlash / 2), motor + backlash / 2)
        encoder.append(output)
        turned.append(motor)
    return time, np.array(encoder), np.array(turned)


def _counts(angle):
    return COUNT * np.floor(angle / COUNT)


def _recover(time, encoder, blank, gain):
    return backlash_from_encoder(
        time, encoder, blank, frequency=FREQUENCY, loop_gain=gain, start=START
    )


@pytest.mark.long
@settings(max_examples=12)
@given(
    gain=st.floats(8.0, 25.0),
    integral=st.floats(3.5, 12.0),
    friction=st.floats(0.0, 2.0),
    amplitude=st.floats(4.0, 45.0),
    seed=st.integers(0, 2**32 - 1),
)
def test_exact_but_for_the_encoders_resolution(gain, integral, friction, amplitude, seed):
    backlashes = np.radians(np.random.default_rng(seed).uniform(0.05, 3.0, 8))
    size = np.full(9, np.radians(amplitude))
    time, encoder, _ = closed_loop(
        np.append(backlashes, 0.0), size, gain=gain, integral=integral, friction=friction
    )
    seen = _counts(encoder)
    flat_exact = flat_lengths(time, seen[:, -1], FREQUENCY, START).mean()
    for k, backlash in enumerate(backlashes):
        found = _recover(time, encoder[:, k], encoder[:, -1], gain)
        assert abs(found.total - backlash) <= 0.005 * backlash + 1e-5
        # A flat holds one reading that deviates by half a count at most, in either run.
        flat_counted = flat_lengths(time, seen[:, k], FREQUENCY, START).mean()
        counted = _recover(time, seen[:, k], seen[:, -1], gain)
        resolution = 0.5 * COUNT * gain * (flat_exact + flat_counted)
        assert abs(counted.total - backlash) <= 0.005 * backlash + 1e-5 + resolution


@pytest.mark.parametrize("row", range(15))
def test_the_campaigns_backlashes_within_a_count_and_two_percent(row, campaign):
    time, encoder, backlashes = campaign
    found = _recover(time, _counts(encoder[:, row]), _counts(encoder[:, -1]), 16.7)
    assert abs(found.total - backlashes[row]) <= COUNT + 0.02 * backlashes[row]


@pytest.fixture(scope="module")
def campaign():
    """The bench's motion at its own backlashes, on a lively loop with friction; the blank last."""
    backlashes = np.radians([*(row.measured_total_deg for row in measured_rows()), 0.0])
    time, encoder, _ = closed_loop(backlashes, np.full(16, np.radians(7.0)), friction=0.5)
    return time, encoder, backlashes


def test_noise_averages_out():
    backlash = np.radians([0.3656, 0.0])
    time, encoder, _ = closed_loop(backlash, np.radians([7.0, 7.0]))
    noise = np.random.default_rng(5).normal(0.0, 2 * COUNT, encoder.shape)
    seen = _counts(encoder + noise)
    found = _recover(time, seen[:, 0], seen[:, 1], 16.7)
    assert abs(found.total - backlash[0]) <= COUNT + 0.02 * backlash[0]
    # White noise of both signals, summed over the 2500 samples of half a period.
    expected = 16.7 * STEP * np.sqrt(2 * 2500 * (4 + 1 / 12)) * COUNT
    assert 0.3 * expected < found.spread < 2.0 * expected


def test_without_backlash_there_is_none():
    time, encoder, _ = closed_loop(np.zeros(2), np.radians([7.0, 7.0]), friction=1.0)
    found = _recover(time, encoder[:, 0], encoder[:, 1], 16.7)
    assert found.total == 0.0


def test_a_loop_without_integral_action_is_not_this_estimators_case():
    """The condition in the module's text is needed: without it friction and lag get in."""
    backlash = np.radians([1.0, 0.0])
    time, encoder, _ = closed_loop(backlash, np.radians([7.0, 7.0]), integral=0.0, speed=10.0)
    found = _recover(time, encoder[:, 0], encoder[:, 1], 2 * 16.7)
    assert abs(found.total - backlash[0]) > COUNT + 0.02 * backlash[0]


def test_lost_motion_and_flats_see_the_backlash_directly():
    backlashes = np.radians([0.4, 1.0, 2.5])
    time, encoder, motor = closed_loop(backlashes, np.full(3, np.radians(7.0)))
    for k, backlash in enumerate(backlashes):
        assert lost_motion(time, motor[:, k], encoder[:, k], START) == pytest.approx(backlash)
    lengths = [
        flat_lengths(time, _counts(encoder[:, k]), FREQUENCY, START).mean() for k in range(3)
    ]
    assert lengths == sorted(lengths)
    assert lengths[0] > 0.1


def test_bad_signals_are_refused():
    time = np.arange(0.0, 20.0, 0.01)
    wave = np.sin(2 * np.pi * FREQUENCY * time)
    with pytest.raises(InputError, match="samples"):
        _recover(time, wave, wave[:-1], 16.7)
    with pytest.raises(InputError, match="finite"):
        _recover(time, np.where(time > 5, np.nan, wave), wave, 16.7)
    with pytest.raises(InputError, match="half period"):
        _recover(time[time < 11], wave[time < 11], wave[time < 11], 16.7)
    with pytest.raises(InputError, match="no samples"):
        _recover(time[time < 9], wave[time < 9], wave[time < 9], 16.7)
