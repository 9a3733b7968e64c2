"""Currents, voltages and torque of the star against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import fsolve

from tests.physics.rig import (
    FREE_SHAFT,
    HYSTERESIS,
    LOCKED,
    MOTOR,
    K,
    L,
    P,
    R,
    constant,
    run,
    term,
    values,
)

DRIVEN = FREE_SHAFT | HYSTERESIS | {"motor.electrical_offset": math.pi / 2}


def step_current(step: float, duration: float, supply: float) -> tuple[np.ndarray, np.ndarray]:
    """Time and i_a of a locked rotor at theta_e = 90 deg whose relays hold a high, b and c low."""
    rec = run(
        DRIVEN | LOCKED | {"inverter.supply_voltage": supply, "solver.step": step},
        duration=duration,
        mode="torque",
        command=[constant(1.5 * K * 20.0)],
        record="current_a@2 kHz",
    )
    return rec["current_a"].time, rec["current_a"].values


def exact_current(time: np.ndarray, supply: float) -> np.ndarray:
    """(2/3 V / R)(1 - exp(-t R / L)): the star sees two thirds of the link on phase a."""
    return 2 / 3 * supply / R * (1 - np.exp(-time * R / L))


def test_rl_step_response() -> None:
    """Five time constants. Euler's own error, dt R / (2 L e) = 1.7e-5 of the final value, sets the
    limit.
    """
    time, current = step_current(1e-6, 0.055, 30.0)
    assert np.max(np.abs(current - exact_current(time, 30.0))) < 3e-5 * 2 / 3 * 30.0 / R
    assert current[-1] > 0.98 * 2 / 3 * 30.0 / R


def test_rl_step_converges_at_first_order() -> None:
    """Halving the step halves the error."""
    errors = []
    for step in (4e-6, 2e-6, 1e-6):
        time, current = step_current(step, 0.02, 30.0)
        errors.append(np.max(np.abs(current - exact_current(time, 30.0))))
    assert 1.9 < errors[0] / errors[1] < 2.1
    assert 1.9 < errors[1] / errors[2] < 2.1


def test_phase_currents_sum_to_zero_and_obey_the_star() -> None:
    """Closed loop at every step: sum i = 0 to rounding, sum of v - R i - e = 0, L di/dt = v - R i
    - e.
    """
    rec = run(
        MOTOR | HYSTERESIS | {"motor.electrical_offset": math.pi / 2},
        duration=0.05,
        record="@every",
        command=[term("sine", amplitude="7 deg", frequency="2 Hz")],
    )
    currents = np.stack(values(rec, "current_a", "current_b", "current_c"))
    volts = np.stack(values(rec, "voltage_a", "voltage_b", "voltage_c"))
    assert np.max(np.abs(currents)) > 1.0
    assert np.max(np.abs(currents.sum(axis=0))) < 1e-12 * 50_000
    speed, position = values(rec, "motor_speed", "motor_position")
    shifts = P * position + math.pi / 2 - 2 * math.pi / 3 * np.arange(3)[:, None]
    emf = K * np.sin(shifts) * speed
    rate = np.diff(currents, axis=1) / 1e-6
    voltage = (volts - R * currents - emf) / L
    ahead = np.max(np.abs(rate - voltage[:, 1:]))
    behind = np.max(np.abs(rate - voltage[:, :-1]))
    assert min(ahead, behind) < 1e-2 * np.max(np.abs(rate)), (
        "neither sample pairing obeys L di/dt = v - R i - e"
    )


def test_steady_torque_is_three_halves_k_iq() -> None:
    """Constant speed against a constant shaft torque.

    T = 1.5 k i_q holds at each instant for healthy sinusoidal coefficients; its mean balances the
    load; and the mean quadrature current stays within the relay band of its reference.
    """
    load = 2.0
    rec = run(
        DRIVEN,
        duration=1.0,
        mode="speed",
        command=[constant(30.0)],
        record="motor_torque,current_q,current_ref,motor_speed,load_torque@20 kHz",
        scenario={"load": {"shaft": {"terms": [constant(load)]}}},
    )
    time = rec["current_q"].time
    torque, current, reference = (
        x[time > 0.5] for x in values(rec, "motor_torque", "current_q", "current_ref")
    )
    assert np.max(np.abs(torque - 1.5 * K * current)) < 1e-9 * np.max(np.abs(torque))
    assert np.mean(torque) == pytest.approx(load, rel=5e-3)
    assert abs(np.mean(current) - np.mean(reference)) < 0.5
    assert np.max(np.abs(current - reference)) < 2 * 0.5 * 1.2


def phasor_solution(
    volts: float, reference: float, band: float, viscous: float
) -> tuple[float, float, float]:
    """Speed, i_q, i_d of square-wave operation: every leg follows the sign of its current error.

    The voltage's fundamental, 2 V / pi, points along the error (I - i_q, -i_d), but for what the
    band delays and the ripple hastens: at a leg's own switching instant the harmonics of orders
    5, 7, 11, 13, ... all push its current the same way, by V1 / (w_e L) times the sum of 1 / n^2,
    pi^2 / 9 - 1. So it lags by asin((band - ripple) / error).
    v_q = R i_q + P w L i_d + k w, v_d = R i_d - P w L i_q, 1.5 k i_q = C w.
    """
    peak = 2 * volts / math.pi

    def residual(x: np.ndarray) -> list[float]:
        w, iq, i_d = x
        error = math.hypot(reference - iq, i_d)
        ripple = (math.pi**2 / 9 - 1) * peak / (P * w * L)
        # i_j = i_q sin a - i_d cos a: positive i_d lags; a voltage lagging by g has v_d = v sin g.
        angle = math.atan2(-i_d, reference - iq) + math.asin((band - ripple) / error)
        vq, vd = peak * math.cos(angle), peak * math.sin(angle)
        return [
            R * iq + P * w * L * i_d + K * w - vq,
            R * i_d - P * w * L * iq - vd,
            1.5 * K * iq - viscous * w,
        ]

    w, iq, i_d = fsolve(residual, [peak / K, 0.1, 0.1])
    return float(w), float(iq), float(i_d)


@pytest.mark.parametrize("direction", [1, -1])
def test_speed_at_the_voltage_limit_is_the_phasor_solution(direction: int) -> None:
    """Torque that cannot be reached: six-step legs, and the speed settles where phasors say.

    Viscous friction loads the motor, so i_q > 0 and i_d lags. Half a percent for the speed, one
    for the currents: the resistance in the harmonics' path is left out.
    """
    viscous, supply = 0.02, 60.0
    rec = run(
        DRIVEN | {"friction.viscous": viscous, "inverter.supply_voltage": supply},
        duration=2.0,
        mode="torque",
        command=[constant(direction * 1.5 * K * 20.0)],
        record="motor_speed,current_q,current_d@20 kHz",
    )
    late = rec["motor_speed"].time > 1.5
    speed, iq, i_d = (
        np.mean(x[late]) for x in values(rec, "motor_speed", "current_q", "current_d")
    )
    w, q, d = phasor_solution(supply, 20.0, 0.5, viscous)
    assert d > 0.1, "the case must have a lagging direct current to be worth testing"
    assert speed == pytest.approx(direction * w, rel=0.005)
    assert iq == pytest.approx(direction * q, rel=0.01)
    assert i_d == pytest.approx(d, rel=0.01)


def test_torque_saturates_at_the_flux_limit() -> None:
    """motor.torque_limit takes of the flux, not of the current."""
    limit = 1.0
    rec = run(
        DRIVEN | LOCKED | {"motor.torque_limit": limit},
        duration=0.05,
        mode="torque",
        command=[constant(5.0)],
        record="motor_torque,current_q@20 kHz",
    )
    torque, current = values(rec, "motor_torque", "current_q")
    assert np.max(torque) == pytest.approx(limit, rel=1e-12)
    assert 1.5 * K * np.max(current) > 4.0


def test_resistance_follows_the_winding_temperature() -> None:
    """R(T) = R20 (1 + alpha (T - 20 C)), copper: the locked current at full voltage falls
    accordingly.
    """
    cold = step_current(1e-6, 0.1, 30.0)[1][-1]
    hot = run(
        DRIVEN
        | LOCKED
        | {
            "inverter.supply_voltage": 30.0,
            "motor.winding_temperature": 373.15,
            "motor.reference_temperature": 293.15,
            "motor.temperature_coefficient": 3.93e-3,
        },
        duration=0.1,
        mode="torque",
        command=[constant(1.5 * K * 20.0)],
        record="current_a@2 kHz",
    )["current_a"].values[-1]
    assert cold / hot == pytest.approx(1 + 3.93e-3 * 80.0, rel=2e-4)
