"""The laws of the dry friction on a shaft, in both fidelities."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.physics.rig import FREE_SHAFT, INERTIA, PWM, constant, run, term, values

STATIC, DYNAMIC = 0.40, 0.30
RUBBING = FREE_SHAFT | {"friction.static": STATIC, "friction.dynamic": DYNAMIC}
FIDELITIES = ["high", "low"]


def shaft(*terms: dict[str, Any]) -> dict[str, Any]:
    """A scenario with these signed torques on the motor shaft."""
    return {"load": {"shaft": {"terms": list(terms)}}}


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize(("exponent", "start"), [(2.0, 12.0), (1.0, -7.0)])
def test_stribeck_brakes_by_its_curve(fidelity: str, exponent: float, start: float) -> None:
    """Coasting: the recorded friction is F_d + (F_s - F_d) exp(-(|w|/v)^delta) at each speed, and
    the deceleration is that over J.
    """
    v = 5.0
    law = {
        "friction.law": "stribeck",
        "friction.stribeck_speed": v,
        "friction.stribeck_exponent": exponent,
    }
    rec = run(
        RUBBING | law,
        duration=0.03,
        record="motor_speed,friction_torque@2 kHz",
        scenario={"initial": {"motor_speed": start}},
        fidelity=fidelity,
    )
    time = rec["motor_speed"].time
    speed, friction = values(rec, "motor_speed", "friction_torque")
    expected = DYNAMIC + (STATIC - DYNAMIC) * np.exp(-((np.abs(speed) / v) ** exponent))
    mean = 0.5 * (expected[1:] + expected[:-1])
    slope = np.diff(np.abs(speed)) / np.diff(time)
    assert slope == pytest.approx(-mean / INERTIA, rel=2e-3)
    if fidelity == "high":
        assert np.sign(start) * friction == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("law", ["stribeck", "load_dependent"])
@pytest.mark.parametrize("sign", [1, -1])
def test_laws_without_bristles_stick_exactly(fidelity: str, law: str, sign: int) -> None:
    """No motion at all at 0.99 of the limit, motion at 1.01; a load alone adds K_e + K_es of it."""
    external = 0.1 if law == "load_dependent" else 0.0
    settings = RUBBING | {"friction.law": law}
    if law == "load_dependent":
        settings |= {"friction.load_external": 0.06, "friction.load_external_stribeck": 0.04}
    limit = STATIC / (1 - external)
    for share in (0.99, 1.01):
        rec = run(
            settings,
            duration=0.2,
            record="motor_position@1 kHz",
            scenario=shaft(constant(-sign * share * limit)),
            fidelity=fidelity,
        )
        position = rec["motor_position"].values
        assert np.all(position == 0.0) if share < 1 else sign * position[-1] > 0.0


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("load", [1.5, -1.5, 0.0])
def test_load_dependent_friction_knows_motor_and_load(fidelity: str, load: float) -> None:
    """At steady speed: F_d + |K_m T + K_e L|, T itself being what that friction requests."""
    k_m, k_e = 0.05, 0.2
    rec = run(
        RUBBING
        | PWM
        | {
            "friction.law": "load_dependent",
            "friction.stribeck_speed": 0.5,
            "friction.load_motor": k_m,
            "friction.load_external": k_e,
            "friction.load_motor_quadratic": 0.3,
            "friction.load_external_quadratic": 0.3,
            "control.speed_gain": 0.2,
            "control.integral_time": 0.05,
        },
        duration=1.5,
        mode="speed",
        command=[constant(20.0)],
        record="motor_torque,friction_torque,motor_speed@1 kHz",
        scenario=shaft(constant(load)),
        fidelity=fidelity,
    )
    late = rec["motor_torque"].time > 1.0
    torque, friction, speed = (
        x[late].mean() for x in values(rec, "motor_torque", "friction_torque", "motor_speed")
    )
    assert speed == pytest.approx(20.0, rel=1e-3)
    assert friction == pytest.approx(DYNAMIC + abs(k_m * torque + k_e * load), rel=1e-3)
    assert torque - load == pytest.approx(friction, rel=2e-3)


LUGRE = {"friction.law": "lugre", "friction.stribeck_speed": 1.0}


@pytest.mark.parametrize("fidelity", FIDELITIES)
@pytest.mark.parametrize("stiffness", [100.0, 1e4, 1e7])
def test_bristles_hold_as_a_spring_up_to_the_static_limit(fidelity: str, stiffness: float) -> None:
    """A slow ramp to 0.9 F_s: theta from T / sigma_0 (a little more: they yield before they slide);
    to 1.1 F_s: it runs away. Any stiffness runs at either step.
    """
    settings = RUBBING | LUGRE | {"friction.bristle_stiffness": stiffness}
    for share in (0.9, 1.1):
        rec = run(
            settings,
            duration=0.6,
            record="motor_position,friction_torque@1 kHz",
            scenario=shaft(term("ramp", slope=-share * STATIC / 0.5, start=0.0, end=0.5)),
            fidelity=fidelity,
        )
        position, friction = values(rec, "motor_position", "friction_torque")
        if share > 1:
            assert position[-1] > 10 * STATIC / stiffness
            continue
        early = rec["motor_position"].time < 0.06
        ramp = 0.9 * STATIC / 0.5 * rec["motor_position"].time
        assert friction[early][-1] == pytest.approx(ramp[early][-1], rel=0.02)
        assert position[early][-1] * stiffness == pytest.approx(ramp[early][-1], rel=0.1)
        assert friction[-1] == pytest.approx(0.9 * STATIC, rel=1e-3)
        assert 0.9 * STATIC <= position[-1] * stiffness < 4 * STATIC


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_bristles_slide_on_stribecks_curve(fidelity: str) -> None:
    """Steady sliding against a viscous torque: T = g(w) + C w, slow and fast."""
    viscous = 0.05
    for torque in (0.55, 1.5):
        rec = run(
            RUBBING | LUGRE | {"friction.viscous": viscous},
            duration=1.0,
            record="motor_speed,friction_torque@1 kHz",
            scenario=shaft(constant(-torque)),
            fidelity=fidelity,
        )
        speed = rec.final["motor_speed"]
        sliding = DYNAMIC + (STATIC - DYNAMIC) * math.exp(-(speed**2))
        assert sliding + viscous * speed == pytest.approx(torque, rel=1e-4)
        assert rec["friction_torque"].values[-1] == pytest.approx(torque, rel=1e-4)


def test_bristles_leave_a_hysteresis_that_both_fidelities_share() -> None:
    """A slow sine below the limit: the loop of torque over angle costs the same in both."""
    frequency, areas = 2.0, []
    for fidelity in FIDELITIES:
        rec = run(
            RUBBING | LUGRE,
            duration=1.5,
            record="motor_position,friction_torque@2 kHz",
            scenario=shaft(term("sine", amplitude=0.8 * STATIC, frequency=frequency)),
            fidelity=fidelity,
        )
        last = rec["motor_position"].time >= 1.0 - 1e-9
        position, friction = (x[last] for x in values(rec, "motor_position", "friction_torque"))
        areas.append(float(np.trapezoid(friction, position)))
    assert areas[0] > 0.05 * (0.8 * STATIC) ** 2 / 100.0
    assert areas[1] == pytest.approx(areas[0], rel=0.05)


def test_energy_closes_on_bristles() -> None:
    """Work of the load against friction (what the bristles hold included) and kinetic energy."""
    names = "energy_load,energy_friction,energy_kinetic"
    rec = run(
        RUBBING | LUGRE | {"friction.viscous": 1e-3},
        duration=0.5,
        record=f"{names}@1 kHz",
        scenario=shaft(term("sine", amplitude=0.9, frequency=5.0)),
    )
    load, friction, kinetic = values(rec, *names.split(","))
    assert load + friction + kinetic == pytest.approx(0.0, abs=1e-6 * friction[-1] + 1e-9)


@pytest.mark.parametrize("name", ["torino-rotary", "nasa-ballscrew"])
@pytest.mark.parametrize("law", ["stribeck", "lugre", "load_dependent"])
@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_every_law_carries_a_growth_of_friction(name: str, law: str, fidelity: str) -> None:
    """The fault doubles the moving friction under each law, by what its terms say."""
    found = []
    for grown in (0.0, 1.0):
        rec = run(
            {
                "friction.law": law,
                "friction.viscous": 0.0,
                "friction.static": STATIC,
                "friction.dynamic": DYNAMIC,
                "friction.stribeck_speed": 0.5,
                "gear.efficiency": 1.0,
                "gear.efficiency_aiding": 1.0,
                "drive.kind": "off",
            },
            name=name,
            duration=0.01,
            mode="speed",
            record="friction_torque@1 kHz",
            scenario={
                "initial": {"motor_speed": 20.0},
                "fault": [{"kind": "friction", "place": "transmission", "severity": grown}],
            },
            fidelity=fidelity,
        )
        found.append(float(rec["friction_torque"].values[-1]))
    assert found[1] - found[0] == pytest.approx(DYNAMIC, rel=0.35)
