"""What a session was not told at its start may be announced while it runs."""

import pytest

from elevon import Session
from elevon.errors import InputError, UnknownNameError

SINE = {"kind": "sine", "amplitude": "7 deg", "frequency": "2 Hz"}
SIGNALS = ("output_position", "motor_speed", "motor_position")


def _moved(faults=(), signals=()):
    session = Session("torino-rotary", seed=1, faults=faults, signals=signals)
    session.set(command=SINE)
    session.advance("20 ms")
    return session


@pytest.mark.parametrize(
    ("fault", "severity"),
    [
        ("open_phase@motor.phase_a", 1.0),
        ("unbalance@motor.rotor", 1e-3),
        ("tooth_wear@gear", "0.3 deg"),
        ("dropout@sensor.resolver", 1.0),
        ("gain@sensor.current_b", 0.3),
        ("eccentricity_dynamic@motor", 0.4),
    ],
)
def test_a_fault_announced_on_the_way_acts_as_one_announced_at_the_start(fault, severity):
    late, early = _moved(), _moved(faults=[fault])
    with pytest.raises(InputError, match="announce"):
        late.set_fault(fault, severity)
    late.announce(faults=[fault])
    for session in (late, early):
        session.advance("1 ms")  # a sensor that holds its last reading has read once by then
        session.set_fault(fault, severity)
        session.advance("20 ms")
    assert late.read(*SIGNALS) == early.read(*SIGNALS)
    healthy = _moved()
    healthy.advance("21 ms")
    assert late.read(*SIGNALS) != healthy.read(*SIGNALS)


def test_announcing_moves_nothing():
    announced, other = _moved(), _moved()
    announced.announce(faults=["unbalance@motor.rotor"], tunable=["motor.cogging_torque"])
    for session in (announced, other):
        session.advance("20 ms")
    assert announced.read(*SIGNALS) == other.read(*SIGNALS)


def test_a_signal_is_read_once_it_is_announced():
    session = _moved()
    with pytest.raises(InputError, match="announce"):
        session.read("current_q_meas")
    session.announce(signals=["current_q_meas"])
    session.advance("50 ms")
    always = _moved(signals=["current_q_meas"])
    always.advance("50 ms")
    # A filter of 100 Hz that began 20 ms later: five of its time constants have passed since.
    assert session["current_q_meas"] == pytest.approx(always["current_q_meas"], abs=0.05)


def test_many_runs_are_announced_together():
    from elevon import Run

    scenario = {"duration": 1, "command": {"terms": [SINE]}}
    session = Session([Run("torino-rotary", scenario, seed) for seed in (1, 2)])
    session.advance("20 ms")
    session.announce(faults=["unbalance@motor.rotor"])
    session.set_fault("unbalance@motor.rotor", [1e-3, 0.0])
    session.advance("20 ms")
    assert session.read("motor_speed")["motor_speed"][1] == pytest.approx(
        float(_two(scenario)), abs=0.0
    )


def _two(scenario):
    alone = Session("torino-rotary", scenario, seed=2)
    alone.advance("40 ms")
    return alone["motor_speed"]


def test_what_does_not_exist_cannot_be_announced():
    with pytest.raises(UnknownNameError, match="backlash"):
        _moved().announce(faults=["backlsh@transmission"])
