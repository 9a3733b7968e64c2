"""Anti-windup: each scheme does what its definition says, seen from the torque reference of a
stuck shaft.

A shaft that cannot move makes the speed error equal to the command, so the integral part x of the
torque reference is known in closed form. The reference itself is limited, so x is read after the
command has stepped to a value that brings it back inside the limits: T_ref = Kp e2 + x + Ki e2 (t
- t_step).
"""

from __future__ import annotations

import math

import pytest

from tests.physics.rig import FREE_SHAFT, HYSTERESIS, LOCKED, K, constant, run, term

KP, TI, SPEED = 0.2, 0.05, 10.0
KI = KP / TI
NONE = {
    "control.conditional_integration": "off",
    "control.anti_windup_rest": "off",
    "control.anti_windup_error": "off",
    "control.anti_windup_back_calculation": 0.0,
}
STUCK = (
    FREE_SHAFT
    | HYSTERESIS
    | LOCKED
    | NONE
    | {
        "control.speed_gain": KP,
        "control.integral_time": TI,
        "control.derivative_time": 0.0,
    }
)
FEW_STEPS = 5 * KI * SPEED * 1e-6  # what five solver steps of integration add


def integral(
    scheme: dict[str, object], limit: float, expected: float, duration: float = 1.0
) -> float:
    """x after `duration` at a constant error; `limit` in N m; `expected` only chooses the step
    that reveals it.
    """
    second = -expected / KP
    settings = {**STUCK, "control.current_limit": limit / (1.5 * K), **scheme}
    rec = run(
        settings,
        duration=duration + 1e-4,
        mode="speed",
        record="torque_ref@100 kHz",
        command=[term("step", initial=SPEED, final=second, time=duration)],
    )
    time, torque = rec["torque_ref"].time[-5], rec["torque_ref"].values[-5]
    assert abs(torque) < limit, "the second command must bring the reference back inside its limits"
    return float(torque - KP * second - KI * second * (time - duration))


def test_without_a_scheme_the_integral_runs_away() -> None:
    """x = Ki e t, eight times the limit after one second."""
    assert integral({}, 5.0, KI * SPEED) == pytest.approx(KI * SPEED, rel=1e-4)
    assert KI * SPEED == 8 * 5.0


def test_conditional_integration_holds_at_the_limit() -> None:
    """The integral stops where T_ref reaches the limit: x = limit - Kp e."""
    expected = 5.0 - KP * SPEED
    found = integral({"control.conditional_integration": "on"}, 5.0, expected)
    assert found == pytest.approx(expected, abs=20 * FEW_STEPS)


def test_rest_scheme_never_integrates_on_a_stuck_shaft() -> None:
    """Scheme 1: speed zero for more than one step freezes the integral after its first step."""
    assert integral({"control.anti_windup_rest": "on"}, 100.0, 0.0) == pytest.approx(
        0.0, abs=FEW_STEPS
    )


@pytest.mark.parametrize("duration", [0.08, 0.15, 1.0])
def test_back_calculation_approaches_its_balance(duration: float) -> None:
    """Scheme 3: past the limit x' = Ki e + g (T_sat - T_ref): first order, 1/g, towards limit - Kp
    e + Ki e / g.
    """
    gain, limit = 20.0, 5.0
    start = (limit - KP * SPEED) / (KI * SPEED)
    settled = limit - KP * SPEED + KI * SPEED / gain
    expected = settled + (limit - KP * SPEED - settled) * math.exp(-gain * (duration - start))
    found = integral({"control.anti_windup_back_calculation": gain}, limit, expected, duration)
    assert found == pytest.approx(expected, abs=50 * FEW_STEPS)


def test_schemes_combine() -> None:
    """Rest and back calculation together: the stricter one, rest, decides on a stuck shaft."""
    both = {"control.anti_windup_rest": "on", "control.anti_windup_back_calculation": 20.0}
    assert integral(both, 5.0, 0.0) == pytest.approx(0.0, abs=FEW_STEPS)


@pytest.mark.parametrize(
    ("sense", "error", "frozen"),
    [
        ("below", 0.001, True),
        ("below", 0.01, False),
        ("above", 0.001, False),
        ("above", 0.01, True),
    ],
)
def test_position_scheme_in_both_printed_senses(sense: str, error: float, frozen: bool) -> None:
    """Scheme 2 freezes on the position error's threshold, below it (T2) or above it (T3)."""
    settings = STUCK | {
        "control.anti_windup_error": sense,
        "control.anti_windup_threshold": 0.004,
        "control.position_gain": 1000.0,
        "control.current_limit": 1e3,
    }
    rec = run(settings, duration=0.2, command=[constant(error)], record="torque_ref@1 kHz")
    grown = rec["torque_ref"].values[-1] - KP * 1000.0 * error
    expected = 0.0 if frozen else KI * 1000.0 * error * rec["torque_ref"].time[-1]
    assert grown == pytest.approx(expected, rel=1e-3, abs=FEW_STEPS)
