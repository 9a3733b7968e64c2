"""Every sign of docs/explanation/theory/signs.md, by a simulation at both fidelities."""

from __future__ import annotations

from typing import Any

import pytest

from tests.physics.rig import FREE_SHAFT, PWM, SUPPLY, K, constant, run

BOTH = pytest.mark.parametrize("fidelity", ["high", "low"])


def final(
    mode: str, value: float, fidelity: str, drive: dict[str, Any] = PWM, **extra: Any
) -> dict[str, float]:
    """The end of 0.2 s."""
    rec = run(
        FREE_SHAFT | drive,
        duration=0.2,
        mode=mode,
        command=[constant(value)],
        record="motor_speed@100 Hz",
        fidelity=fidelity,
        scenario=extra,
    )
    return dict(rec.final)


@BOTH
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_positive_current_positive_torque_positive_motion(fidelity: str, sign: float) -> None:
    """A torque command: current, torque, speed, motor and output position share its sign."""
    end = final("torque", 0.2 * sign, fidelity)
    for name in ("current_q", "motor_torque", "motor_speed", "motor_position", "output_position"):
        assert end[name] * sign > 0, name
    assert end["motor_torque"] == pytest.approx(1.5 * K * end["current_q"], rel=1e-6)


@BOTH
@pytest.mark.parametrize("place", ["shaft", "output"])
def test_positive_load_opposes_positive_motion(fidelity: str, place: str) -> None:
    """Drive off: a positive load turns the shaft backwards."""
    load = {place: {"terms": [constant(0.05 if place == "shaft" else 5.0)]}}
    assert final("speed", 0.0, fidelity, {}, load=load)["motor_speed"] < 0


@BOTH
@pytest.mark.parametrize("speed", [-20.0, 20.0])
def test_brake_takes_speed_of_either_sign_and_never_gives_any(fidelity: str, speed: float) -> None:
    """Drive off, brake on: slower from both sides; at rest nothing moves."""
    load = {"brake": {"terms": [constant(0.1)]}}
    end = final("speed", 0.0, fidelity, {}, load=load, initial={"motor_speed": speed})
    assert 0 < end["motor_speed"] / speed < 1
    assert final("speed", 0.0, fidelity, {}, load=load)["motor_speed"] == 0.0


@BOTH
def test_error_is_command_less_measured(fidelity: str) -> None:
    """A command above the output commands positive speed."""
    end = final("position", 1.0, fidelity)
    assert end["speed_ref"] > 0
    assert end["output_position"] > 0


@BOTH
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_output_follows_on_the_trailing_side_of_the_backlash(fidelity: str, sign: float) -> None:
    """Moving forwards the output side lags by half the backlash, backwards it leads."""
    rec = run(
        FREE_SHAFT | PWM | {"backlash.total": 0.01},
        duration=0.3,
        mode="speed",
        command=[constant(20.0 * sign)],
        record="motor_speed@100 Hz",
        fidelity=fidelity,
    )
    lag = rec.final["motor_position"] / 124 - rec.final["output_position"]
    assert lag == pytest.approx(0.005 * sign, rel=1e-6)


@BOTH
def test_quadrature_voltage_has_the_sign_of_the_emf(fidelity: str) -> None:
    """At steady speed v_q = R i_q + k omega, and supply is positive."""
    end = final("speed", 30.0, fidelity, initial={"motor_speed": 30.0})
    assert end["voltage_q_ref"] == pytest.approx(K * end["motor_speed"], rel=0.1)
    assert end["supply_voltage"] == SUPPLY
