"""A PID from position to current, logged at 100 Hz, is not taken for a cascade.

Six drives that the model which is fitted does not make: a sampled controller that acts one or two
milliseconds late, counts, a derivative with a filter or without, three gains, a mass on a
compliant link, friction on bristles that grows with the force.
"""

import math

import pytest

from elevon.calibrate.stages.closed_loop import calibrate_loop
from elevon.calibrate.stages.closed_loop.result import predict
from elevon.plain import plain
from tests.calibrate.linear import Linear, log, square, sweep
from tests.calibrate.linear_set import datasheet, loop

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
GAINS, FILTERS = (0.2, 0.4, 0.8), (3e-3, 0.0)
DRIVES = [(gain, lag) for gain in GAINS for lag in FILTERS]


def drive(number):
    """Return a drive: its link rings at 100 to 150 Hz where the motor stands."""
    gain, lag = DRIVES[number]
    mass = 8.0 * (1.0 + 0.1 * number)
    stiffness = (2.0 * math.pi * (100.0 + 10.0 * number)) ** 2 * mass
    return Linear(
        weight=(60.0, -40.0, 20.0)[number % 3], reverse=(1.2, 0.9, 1.1)[number % 3], mass=mass,
        gain=9000.0 * gain, integral=30_000.0 * gain, derivative=560.0 * math.sqrt(gain),
        filter=lag, delay=(1.0, 2.0, 1.0)[number % 3], count=(2e-6, 5e-6, 5e-7)[number % 3],
        stiffness=stiffness, joint_damping=0.2 * math.sqrt(stiffness * mass),
    )  # fmt: skip


def other(time):
    """A square wave that no drive is fitted to."""
    return square(time, 0.02, 3.0)


def errors_of(number):
    """Structure that is chosen, and what it misses of a log held out, percent."""
    bench = drive(number)
    data = [
        loop("square", log(bench, square, 13.0, seed=50 + number)),
        loop("sweep", log(bench, sweep, 13.0, seed=70 + number)),
    ]
    result = calibrate_loop(data, datasheet(bench))
    held_out = loop("other", log(bench, other, 13.0, seed=90 + number))
    rows, _ = predict([held_out], result.actuator, result.facts["logger"])
    of = {"current": "rms_percent_of_rms"}
    shares = {
        row["signal"]: row[of.get(row["signal"], "rms_percent_of_range")]
        for row in map(plain, rows)
    }
    return result.facts["structure"], shares


#: Without a filter, at the least gain and the coarsest count the current is missed by a third.
CASES = [
    pytest.param(
        number,
        marks=[pytest.mark.xfail(reason="current 33.7 %, 25 % asked", strict=True)] * (number == 1),
    )
    for number in range(len(DRIVES))
]


@pytest.mark.long
@pytest.mark.parametrize("number", CASES)
def test_a_pid_is_found_and_predicts_another_square_wave(number):
    structure, shares = errors_of(number)
    assert structure["chosen"] == "pid", structure["why"]
    assert shares["position"] < 0.9
    assert shares["speed"] < 2.6
    assert shares["current"] < 25.0
