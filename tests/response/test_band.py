"""The band in which the reduced-order model answers as the switching one does."""

import json

import numpy as np
import pytest

from elevon import Actuator
from elevon.errors import InputError
from elevon.response import FrequencyResponse, band_of, frequency_response
from tests.cli.conftest import elevon_cli  # noqa: F401 - a fixture

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")


def synthetic(gain=1.0, delay=0.0, coherence=1.0, top=100.0):
    """A flat response with a delay, at lines of 1 Hz."""
    lines = np.arange(1.0, top + 1.0)
    share = np.full(lines.shape, coherence)
    return FrequencyResponse(
        frequency=lines, response=gain * np.exp(-2j * np.pi * lines * delay), coherence=share,
        std=0.0 * lines, input="command", output="motor_speed", unit="1", method="multisine",
        amplitude=1.0, realisations=3,
    )  # fmt: skip


def test_a_delay_ends_the_band_at_its_own_frequency():
    """Ten degrees of half a millisecond are 55.6 Hz: what one step of the solver is worth."""
    band = band_of(synthetic(), synthetic(delay=5e-4))
    assert (band.holds_to, band.fails_at) == (55.0, 56.0)
    assert "to 55 Hz, not at 56 Hz" in band.text
    assert band.to_dict()["phase_limit_deg"] == pytest.approx(10.0)


def test_a_gain_out_of_limits_has_no_band():
    band = band_of(synthetic(), synthetic(gain=1.11))
    assert (band.holds_to, band.fails_at) == (None, 1.0)
    inside = band_of(synthetic(), synthetic(gain=0.91))
    assert (inside.holds_to, inside.fails_at) == (100.0, None)


def test_what_is_not_linear_decides_nothing():
    band = band_of(synthetic(coherence=0.4), synthetic(gain=2.0))
    assert (band.holds_to, band.fails_at, band.undecided) == (None, None, 100)
    with pytest.raises(InputError, match="same frequencies"):
        band_of(synthetic(), synthetic(top=50.0))


@pytest.mark.parametrize("drive", ["pwm", "hysteresis"])
@pytest.mark.parametrize(
    ("name", "speed", "amplitude"),
    [("torino-rotary", "40 rad/s", "4 rad/s"), ("nasa-ballscrew", "30 rad/s", "3 rad/s")],
)
def test_the_speed_loop_of_both_models_agrees_to_the_end_of_the_low_step(
    drive, name, speed, amplitude
):
    """A slope of the command acts in the step that it is of."""
    actuator = Actuator.load(name).with_values({"drive.kind": drive})
    both = [
        frequency_response(
            actuator, "10 Hz", "100 Hz", amplitude, output="motor_speed", mode="speed", bias=speed,
            realisations=2, fidelity=fidelity,
        )
        for fidelity in ("high", "low")
    ]  # fmt: skip
    band = band_of(*both)
    assert band.fails_at is None
    assert band.holds_to == 100.0


@pytest.mark.long
def test_the_command_states_the_band(elevon_cli):  # noqa: F811
    options = ["--mode", "speed", "--output", "motor_speed", "--bias", "40 rad/s", "--from",
               "20 Hz", "--to", "80 Hz", "--amplitude", "4 rad/s", "--realisations", "2", "--set",
               "drive.kind=pwm", "--linear"]  # fmt: skip
    for fidelity in ("high", "low"):
        result = elevon_cli("response", "torino-rotary", *options, "--fidelity", fidelity, "--json")
        assert result.code == 0
        band = json.loads(result.out)["band"]
        assert band["holds_to_hz"] == pytest.approx(80.0)
        assert band["fails_at_hz"] is None
