"""End stops: what they hold, how they let go, what they cost, in every method and fidelity."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.physics.rig import FREE_SHAFT, HYSTERESIS, INERTIA, RATIO, constant, run, term, values

STOP = math.radians(2.0)
STATIC, DYNAMIC, TORQUE, STIFFNESS = 0.12, 0.06, 1.0, 6e5
SHAFT = FREE_SHAFT | {
    "friction.static": STATIC,
    "friction.dynamic": DYNAMIC,
    "stop.upper": STOP,
    "stop.lower": -STOP,
}
ELASTIC = {
    "backlash.model": "elastic",
    "backlash.total": math.radians(0.4),
    "backlash.stiffness": STIFFNESS,
    "backlash.damping": 3e3,
    "load.inertia": 0.05,
}
WAYS: dict[str, dict[str, Any]] = {
    "explicit": {"solver.method": "explicit"},
    "semi_implicit": {"solver.method": "semi_implicit"},
    "bristles": {
        "friction.law": "lugre",
        "friction.bristle_stiffness": 1e5,
        "friction.stribeck_speed": 1e-3,
    },
}
CASES = [(way, "high") for way in WAYS] + [("explicit", "low"), ("bristles", "low")]


def shaft(*terms: dict[str, Any]) -> dict[str, Any]:
    """A scenario with these torques on the motor shaft, positive driving forwards."""
    return {"load": {"shaft": {"terms": list(terms)}}}


@pytest.mark.parametrize("sign", [1, -1])
@pytest.mark.parametrize(("way", "fidelity"), CASES)
def test_the_reaction_cancels_what_pushes_outwards(way: str, fidelity: str, sign: int) -> None:
    """From its arrival on the shaft stands exactly at the stop, at exactly no speed; the reaction
    is the torque less what friction holds (on bristles: less what they held when it arrived).
    """
    rec = run(
        SHAFT | WAYS[way],
        duration=1.0,
        record="motor_position,motor_speed,stop_torque,friction_torque@1 kHz",
        scenario=shaft(constant(-sign * TORQUE)),
        fidelity=fidelity,
    )
    position, speed, reaction, friction = values(
        rec, "motor_position", "motor_speed", "stop_torque", "friction_torque"
    )
    late = rec["motor_position"].time > 0.5
    assert np.all(position[late] == sign * STOP * RATIO)
    assert np.all(speed[late] == 0.0)
    assert reaction[late] == pytest.approx(sign * TORQUE - friction[late], rel=1e-12)
    if way != "bristles":
        assert reaction[late] == pytest.approx(sign * (TORQUE - STATIC), rel=1e-12)


@pytest.mark.parametrize(("way", "fidelity"), CASES)
def test_the_shaft_leaves_as_soon_as_the_torque_turns_inwards(way: str, fidelity: str) -> None:
    """theta = stop - (T - F_d) t^2 / (2 J) from the moment of the step on."""
    rec = run(
        SHAFT | WAYS[way],
        duration=0.56,
        record="motor_position@1 kHz",
        scenario=shaft(term("step", initial=-TORQUE, final=TORQUE, time="0.5 s")),
        fidelity=fidelity,
    )
    time, position = rec["motor_position"].time, rec["motor_position"].values
    gone = time > 0.51
    fallen = 0.5 * (TORQUE - DYNAMIC) / INERTIA * (time[gone] - 0.5) ** 2
    step = 1e-6 if fidelity == "high" else 5e-4
    slack = 2 * step * (TORQUE / INERTIA * 0.06)
    assert STOP * RATIO - position[gone] == pytest.approx(fallen, abs=slack, rel=1e-3)


@pytest.mark.parametrize("way", list(WAYS))
def test_anti_windup_at_rest_freezes_at_a_stop(way: str) -> None:
    """Scheme 1 commands a speed of exactly zero: the torque reference stays where it arrived."""
    settings = (
        SHAFT
        | HYSTERESIS
        | WAYS[way]
        | {
            "control.speed_gain": 0.2,
            "control.integral_time": 0.05,
            "control.conditional_integration": "off",
            "control.current_limit": 100.0,
        }
    )
    found = []
    for scheme in ("off", "on"):
        rec = run(
            settings | {"control.anti_windup_rest": scheme},
            duration=1.2,
            mode="speed",
            command=[constant(10.0)],
            record="torque_ref,motor_position@1 kHz",
        )
        time, torque = rec["torque_ref"].time, rec["torque_ref"].values
        assert rec.final["motor_position"] == STOP * RATIO
        found.append(float(torque[-1] - torque[time > 0.7][0]))
    assert found[0] == pytest.approx(0.2 / 0.05 * 10.0 * 0.5, rel=0.01)
    assert found[1] == 0.0


@pytest.mark.parametrize("method", ["explicit", "semi_implicit"])
@pytest.mark.parametrize("sign", [1, -1])
def test_an_elastic_output_stops_where_the_stop_stands(method: str, sign: int) -> None:
    """The second mass never passes; the motor comes to rest on the contact, half the backlash and
    T i / K further.
    """
    start = {"motor_position": sign * STOP * RATIO, "output_position": 0.999 * sign * STOP}
    rec = run(
        SHAFT | ELASTIC | {"solver.method": method},
        duration=1.0,
        record=[
            "motor_position,motor_speed,output_position@2 kHz",
            "output_speed,stop_torque,friction_torque@2 kHz",
        ],
        scenario=shaft(constant(-sign * TORQUE)) | {"initial": start},
    )
    motor, speed, output, output_speed, reaction, friction = values(
        rec,
        "motor_position",
        "motor_speed",
        "output_position",
        "output_speed",
        "stop_torque",
        "friction_torque",
    )
    assert np.max(sign * output) == STOP
    late = rec["motor_position"].time > 0.8
    assert np.all(output[late] == sign * STOP)
    assert np.all(output_speed[late] == 0.0)
    assert np.all(speed[late] == 0.0)
    through = (sign * TORQUE - friction[late]) * RATIO
    assert reaction[late] * RATIO == pytest.approx(through, rel=1e-9)
    beyond = motor[late] / RATIO - output[late]
    assert beyond == pytest.approx(sign * math.radians(0.2) + through / STIFFNESS, rel=1e-9)


@pytest.mark.parametrize("elastic", [False, True])
@pytest.mark.parametrize("way", list(WAYS))
def test_the_energy_account_closes_over_the_impact(way: str, elastic: bool) -> None:
    """The work of the load (negative: it drives) is friction, impact and kinetic energy."""
    names = "energy_load,energy_friction,energy_impact,energy_kinetic"
    rec = run(
        SHAFT | WAYS[way] | (ELASTIC if elastic else {}),
        duration=0.4,
        record=f"{names}@1 kHz",
        scenario=shaft(constant(-TORQUE)),
    )
    load, friction, impact, kinetic = values(rec, *names.split(","))
    assert impact[-1] > 0.5 * (TORQUE - STATIC) * STOP * RATIO
    assert load + friction + impact + kinetic == pytest.approx(0.0, abs=1e-3 * impact[-1])
    if not elastic:
        assert impact[-1] == impact[rec["energy_impact"].time > 0.3][0]
