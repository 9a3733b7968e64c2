"""Stick, slip, brake and load-dependent friction on a shaft whose inverter is off."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.physics.rig import FREE_SHAFT, INERTIA, constant, run, values

STATIC, DYNAMIC = 0.12, 0.06
RUBBING = FREE_SHAFT | {"friction.static": STATIC, "friction.dynamic": DYNAMIC}


def shaft(torque: float) -> dict[str, object]:
    """A scenario with a constant signed torque on the motor shaft."""
    return {"load": {"shaft": {"terms": [constant(torque)]}}}


@pytest.mark.parametrize("sign", [1, -1])
def test_stuck_exactly_just_below_the_static_limit(sign: int) -> None:
    """0.99 FSJ for 2 s: zero motion, not a small one."""
    rec = run(
        RUBBING,
        duration=2.0,
        record="motor_position,motor_speed,friction_torque@1 kHz",
        scenario=shaft(sign * 0.99 * STATIC),
    )
    position, speed, friction = values(rec, "motor_position", "motor_speed", "friction_torque")
    assert np.all(position == 0.0)
    assert np.all(speed == 0.0)
    assert friction[-1] == pytest.approx(-sign * 0.99 * STATIC, rel=1e-12)


@pytest.mark.parametrize("sign", [1, -1])
def test_moving_just_above_the_static_limit(sign: int) -> None:
    """1.01 FSJ breaks away and then accelerates with the excess over the dynamic friction."""
    rec = run(
        RUBBING, duration=0.1, record="motor_speed@1 kHz", scenario=shaft(sign * 1.01 * STATIC)
    )
    expected = -sign * (1.01 * STATIC - DYNAMIC) / INERTIA * 0.1
    assert rec.final["motor_speed"] == pytest.approx(expected, rel=1e-4)


def test_coasting_stops_when_the_dry_friction_says_and_stays() -> None:
    """w(t) = w0 - F t / J, then exactly zero."""
    start = 20.0
    stop = INERTIA * start / DYNAMIC
    rec = run(
        RUBBING,
        duration=2 * stop,
        record="motor_speed,motor_position@1 kHz",
        scenario={"initial": {"motor_speed": start}},
    )
    time = rec["motor_speed"].time
    speed, position = values(rec, "motor_speed", "motor_position")
    assert speed[time < stop - 1e-3] == pytest.approx(
        start - DYNAMIC / INERTIA * time[time < stop - 1e-3], abs=1e-6
    )
    assert np.all(speed[time > stop + 1e-3] == 0.0)
    assert position[-1] == pytest.approx(start**2 * INERTIA / (2 * DYNAMIC), rel=1e-4)


@pytest.mark.parametrize("sign", [1, -1])
def test_brake_resists_whichever_way_and_never_drives(sign: int) -> None:
    """A brake of B stops the shaft B/J faster for either direction and then holds 0.9 B of shaft
    torque.
    """
    brake, start = 1.0, 20.0
    stop = INERTIA * start / (DYNAMIC + brake)
    scenario = {
        "load": {"brake": {"terms": [constant(brake)]}},
        "initial": {"motor_speed": sign * start},
    }
    rec = run(RUBBING, duration=2 * stop, record="motor_speed@10 kHz", scenario=scenario)
    time, speed = rec["motor_speed"].time, rec["motor_speed"].values
    assert np.all(speed[time > stop + 1e-4] == 0.0)
    assert abs(speed[time < stop - 1e-4][-1]) > 0.0
    sticking = run(
        RUBBING,
        duration=1.0,
        record="motor_position@1 kHz",
        scenario={
            "load": {
                "brake": {"terms": [constant(brake)]},
                "shaft": {"terms": [constant(sign * 0.9 * brake)]},
            }
        },
    )
    assert np.all(sticking["motor_position"].values == 0.0)


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("load", [50.0, -50.0])
def test_load_dependent_friction_opposing_and_aiding(direction: int, load: float) -> None:
    """Output load T: the shaft feels T/i plus (1/eta - 1)|T|/i opposing or (1 - eta')|T|/i aiding.

    Efficiencies of the published lever example; 20 ms of coasting, compared as a mean deceleration.
    """
    opposing, aiding = 0.9000, 0.8911
    settings = RUBBING | {"gear.efficiency": opposing, "gear.efficiency_aiding": aiding}
    start, duration = direction * 60.0, 0.02
    scenario = {"load": {"output": {"terms": [constant(load)]}}, "initial": {"motor_speed": start}}
    rec = run(settings, duration=duration, record="motor_speed@1 kHz", scenario=scenario)
    added = (1 / opposing - 1) if load * direction > 0 else (1 - aiding)
    torque = -load / 124 - direction * (DYNAMIC + added * abs(load) / 124)
    assert rec.final["motor_speed"] - start == pytest.approx(torque / INERTIA * duration, rel=1e-4)


@pytest.mark.parametrize("method", ["explicit", "semi_implicit"])
def test_second_order_rotor_converges_at_first_order(method: str) -> None:
    """Rotor on a spring with viscous friction: J w' = -C w - (k / i^2) theta, released from 10 rad.

    Halving the step halves the error (ratio between 1.9 and 2.1), and the finest run is close to
    the exact one.
    """
    stiffness, viscous, theta = 2000.0, 0.01, 10.0
    stiff = stiffness / 124**2
    sigma = viscous / (2 * INERTIA)
    omega = math.sqrt(stiff / INERTIA - sigma**2)
    duration = 0.3
    exact = (
        theta
        * math.exp(-sigma * duration)
        * (math.cos(omega * duration) + sigma / omega * math.sin(omega * duration))
    )
    errors = []
    for step in (8e-5, 4e-5, 2e-5):
        settings = FREE_SHAFT | {
            "friction.viscous": viscous,
            "load.stiffness": stiffness,
            "solver.step": step,
            "solver.method": method,
        }
        rec = run(
            settings,
            duration=duration,
            record="motor_position@500 Hz",
            scenario={"initial": {"motor_position": theta}},
        )
        errors.append(abs(rec.final["motor_position"] - exact))
    assert errors[-1] < 2e-3 * theta
    assert 1.9 < errors[0] / errors[1] < 2.1
    assert 1.9 < errors[1] / errors[2] < 2.1
