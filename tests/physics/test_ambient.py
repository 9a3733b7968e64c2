"""Friction against temperature, and the air's temperature over time: closed forms, both models."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import FREE_SHAFT, HYSTERESIS, INERTIA, MOTOR, constant, run, term

BOTH = pytest.mark.parametrize("fidelity", ["high", "low"])
SERVOS = pytest.mark.parametrize("name", ["torino-rotary", "nasa-ballscrew"])
REFERENCE = 293.15
BETA, DRY, LOSS = 0.04, 0.003, 0.002
GREASE = {
    "lubricant.viscosity_rate": BETA,
    "lubricant.dry_rate": DRY,
    "lubricant.loss_rate": LOSS,
}
RUBBING = FREE_SHAFT | {
    "friction.static": 0.2,
    "friction.dynamic": 0.1,
    "friction.viscous": 1e-3,
    "gear.efficiency": 0.9,
}


def factors(kelvin: Any) -> tuple[Any, Any, Any]:
    """Viscous friction (Reynolds, power 2/3), dry friction, losses 1/eta - 1."""
    colder = REFERENCE - np.asarray(kelvin)
    return np.exp(2.0 / 3.0 * BETA * colder), 1.0 + DRY * colder, 1.0 + LOSS * colder


def coasting(fidelity: str, values: dict[str, Any], seconds: float = 0.4, **more: Any) -> Any:
    """A free shaft that slows down from 50 rad/s, its drive off."""
    return run(
        RUBBING | values,
        duration=seconds,
        mode="speed",
        command=[constant(0.0)],
        record="motor_speed,friction_torque,surface_temperature,ambient_temperature@1 kHz",
        scenario={"initial": {"motor_speed": 50.0}, **more},
        fidelity=fidelity,
    )


@BOTH
@pytest.mark.parametrize("kelvin", [253.15, 273.15, 333.15])
def test_a_cold_shaft_slows_down_as_its_grease_says(fidelity: str, kelvin: float) -> None:
    """J dw/dt = -(D d + C v w): w = (w_0 + D d/(C v)) exp(-C v t/J) - D d/(C v), within what an
    explicit step leaves: its share of the time constant J/(C v).
    """
    rec = coasting(fidelity, GREASE | {"thermal.ambient": kelvin})
    viscous, dry, _ = factors(kelvin)
    drag, force = 1e-3 * viscous, 0.1 * dry
    time = rec["motor_speed"].time
    speed = (50.0 + force / drag) * np.exp(-drag * time / INERTIA) - force / drag
    step = elevon.Actuator.load("torino-rotary").parameters.value(
        "low.step" if fidelity == "low" else "solver.step"
    )
    assert rec["motor_speed"].values == pytest.approx(speed, rel=step * drag / INERTIA)
    assert rec["friction_torque"].values == pytest.approx(
        force + drag * rec["motor_speed"].values, rel=1e-12
    )


@BOTH
def test_cold_raises_the_losses_of_the_gear(fidelity: str) -> None:
    """Under a load T at the output an opposed shaft loses T/r (1/eta - 1) l more."""
    push = {"load": {"output": {"terms": [constant(5.0)]}}}
    rec = coasting(fidelity, GREASE | {"thermal.ambient": 253.15}, 0.1, **push)
    viscous, dry, loss = factors(253.15)
    lost = 5.0 / 124.0 * (1.0 / 0.9 - 1.0) * loss
    expected = 0.1 * dry + lost + 1e-3 * viscous * rec["motor_speed"].values
    assert rec["friction_torque"].values == pytest.approx(expected, rel=1e-12)


@BOTH
@SERVOS
def test_at_the_reference_or_without_rates_no_bit_changes(fidelity: str, name: str) -> None:
    """The healthy unit is the same at any temperature unless its grease knows one."""
    command = [term("sine", amplitude="2 mm" if "screw" in name else "2 deg", frequency="5 Hz")]

    def swing(values: dict[str, Any]) -> Any:
        record = "motor_speed,current_q,friction_torque@1 kHz"
        return run(values, duration=0.2, command=command, record=record, name=name,
                   fidelity=fidelity)  # fmt: skip

    plain = swing({})
    network = {"thermal.model": "off"}
    for same in (GREASE | network, {"thermal.ambient": 253.15} | network):
        other = swing(same)
        base = swing(network) if name == "nasa-ballscrew" else plain
        for signal in ("motor_speed", "current_q", "friction_torque"):
            assert np.array_equal(other[signal].values, base[signal].values)
    cold = swing(GREASE | {"thermal.ambient": 253.15} | network)
    assert np.mean(np.abs(cold["friction_torque"].values)) > 1.05 * np.mean(
        np.abs(base["friction_torque"].values)
    )


@BOTH
def test_a_cold_unit_moves_as_one_with_faults_of_friction(fidelity: str) -> None:
    """Why a diagnosis must know the temperature: 40 K colder is `friction` of 0.12 together with
    `lubrication` of exp(2/3 beta 40) - 1, to rounding.
    """
    command = [term("triangle", amplitude="2 deg", frequency="1 Hz")]

    def current(values: dict[str, Any], faults: list[str]) -> Any:
        return run(
            MOTOR | HYSTERESIS | {"backlash.total": 0.0} | values,
            duration=1.0,
            command=command,
            record="current_q,output_position@1 kHz",
            scenario={"fault": faults},
            fidelity=fidelity,
        )

    rates = {"lubricant.viscosity_rate": BETA, "lubricant.dry_rate": DRY}
    cold = current(rates | {"thermal.ambient": REFERENCE - 40.0}, [])
    thick = math.expm1(2.0 / 3.0 * BETA * 40.0)
    worn = current({}, [f"friction@transmission={DRY * 40.0!r}",
                        f"lubrication@transmission={thick!r}"])  # fmt: skip
    healthy = current({}, [])
    position = [rec["output_position"].values for rec in (cold, worn, healthy)]
    assert position[0] == pytest.approx(position[1], abs=1e-5 * np.ptp(position[2]))
    mean = [np.mean(np.abs(rec["current_q"].values)) for rec in (cold, worn, healthy)]
    assert mean[0] == pytest.approx(mean[1], rel=1e-3)
    assert mean[0] > 1.05 * mean[2]


@BOTH
def test_with_a_network_the_friction_follows_the_housing(fidelity: str) -> None:
    """A warm housing in cold air cools down, and the friction with it, tick by tick."""
    network = {
        "thermal.model": "dynamic",
        "thermal.ambient": 253.15,
        "thermal.housing_capacity": 5.0,
        "thermal.winding_to_surface": 100.0,
    }
    warm = {"initial": {"motor_speed": 50.0, "surface_temperature": 343.15}}
    rec = coasting(fidelity, GREASE | network, **warm)
    surface, speed = rec["surface_temperature"].values, rec["motor_speed"].values
    assert surface[0] == pytest.approx(343.15, abs=0.5)
    assert surface[-1] < 338.0
    viscous, dry, _ = factors(surface)
    assert rec["friction_torque"].values == pytest.approx(
        0.1 * dry + 1e-3 * viscous * speed, rel=1e-12
    )


@BOTH
def test_the_air_changes_during_a_run(fidelity: str) -> None:
    """A step acts at its instant; a slope is held over 10 ms; both reach the friction."""
    air = {
        "ambient": {"terms": [constant("20 degC"), term("step", final="-40 K", time="0.1034 s")]}
    }
    rec = coasting(fidelity, GREASE, **air)
    kelvin = np.where(rec["motor_speed"].time < 0.1034, REFERENCE, 253.15)
    assert rec["ambient_temperature"].values == pytest.approx(kelvin, abs=1e-9)
    viscous, dry, _ = factors(kelvin)
    expected = 0.1 * dry + 1e-3 * viscous * rec["motor_speed"].values
    assert rec["friction_torque"].values == pytest.approx(expected, rel=1e-9)
    slope = {"ambient": {"terms": [term("ramp", initial="20 degC", slope="-100 K/s")]}}
    falling = coasting(fidelity, GREASE, **slope)
    kelvin = REFERENCE - 100.0 * 0.01 * np.floor(falling["motor_speed"].time / 0.01 + 1e-6)
    assert falling["ambient_temperature"].values == pytest.approx(kelvin, abs=1e-9)


def test_without_copper_heat_the_network_follows_the_air() -> None:
    """Surface without capacity, no radiation: T_w goes to the new air by exp(-t/tau)."""
    values = {
        "drive.kind": "off",
        "thermal.model": "quasi_static",
        "thermal.emissivity": 0.0,
    }
    rec = elevon.simulate(
        elevon.Actuator.load("nasa-ballscrew").with_values(values),
        elevon.Scenario.from_dict(
            {
                "duration": "600 s",
                "command": {"mode": "speed", "terms": [constant(0.0)]},
                "ambient": {"terms": [term("step", initial="20 degC", final="-30 degC", time=1.0)]},
            }
        ),
        fidelity="low",
        record="winding_temperature,nut_temperature@1 Hz",
    )
    time = rec["winding_temperature"].time
    since = np.maximum(time - 1.0, 0.0)
    whole = 3 * 385 * (0.2 + 1 / (12 * 0.17))
    winding = REFERENCE - 50.0 * -np.expm1(-since / whole)
    assert rec["winding_temperature"].values == pytest.approx(winding, abs=2e-3)
    nut = REFERENCE - 50.0 * -np.expm1(-since / (700.0 * 1.2))
    assert rec["nut_temperature"].values == pytest.approx(nut, abs=2e-3)


@BOTH
def test_an_input_that_never_leaves_the_parameter_changes_no_bit(fidelity: str) -> None:
    """As a constant, and as a table that is evaluated anew all along."""
    plain = coasting(fidelity, GREASE)
    fixed = {"ambient": {"terms": [constant(REFERENCE)]}}
    moving = {
        "ambient": {"terms": [constant(REFERENCE), term("sine", amplitude=0.0, frequency=3.0)]}
    }
    for air in (fixed, moving):
        other = coasting(fidelity, GREASE, **air)
        for name in ("motor_speed", "friction_torque", "ambient_temperature"):
            assert np.array_equal(other[name].values, plain[name].values)


@BOTH
def test_lanes_and_sessions_have_airs_of_their_own(fidelity: str) -> None:
    """A batch of other airs gives each run its bits; a session sets the air by hand."""
    airs = [
        [],
        [constant(263.15)],
        [constant(273.15), term("sine", amplitude="20 K", frequency="3 Hz")],
        [term("ramp", initial=280.0, slope=-50.0)],
        [term("step", initial=290.0, final=250.0, time=0.03)],
    ]
    unit = elevon.Actuator.load("torino-rotary").with_values(GREASE)

    def scenario(air: list[dict[str, Any]]) -> Any:
        command = {"terms": [term("sine", amplitude="2 deg", frequency="8 Hz")]}
        return elevon.Scenario.from_dict(
            {"duration": 0.06, "command": command, "ambient": {"terms": air}}
        )

    runs = [elevon.Run(unit, scenario(air), 1, str(k)) for k, air in enumerate(airs)]
    record = "motor_speed,friction_torque,ambient_temperature@2 kHz"
    batch = elevon.simulate_batch(runs, fidelity=fidelity, record=record)
    for run_, together in zip(runs, batch, strict=True):
        alone = elevon.simulate(unit, run_.scenario, fidelity=fidelity, record=record)
        for name in ("motor_speed", "friction_torque", "ambient_temperature"):
            assert np.array_equal(alone[name].values, together[name].values)
    session = elevon.Session(unit, scenario([]), fidelity=fidelity)
    session.advance("10 ms")
    session.set(ambient="-20 degC")
    assert session["ambient_temperature"] == pytest.approx(253.15)
    with pytest.raises(elevon.InputError, match="ambient: -3"):
        session.set(ambient=-3.0)


def test_the_landing_gears_lubricant_has_the_airs_temperature() -> None:
    """Its friction is that of a unit at that temperature from the instant on, to the bit."""
    unit = elevon.Actuator.load("pisa-landing-gear")

    def extended(air: list[dict[str, Any]], **parameters: Any) -> Any:
        given = {"lubricant.dry_rate": 0.002} | {
            path.replace("__", "."): value for path, value in parameters.items()
        }
        return elevon.simulate(
            unit.with_values(given),
            elevon.Scenario.from_dict(
                {
                    "duration": 0.5,
                    "command": {"mode": "gear", "steps": [{"time": 0, "action": "extend"}]},
                    "ambient": {"terms": air},
                }
            ),
            fidelity="low",
            record="friction_force,motor_speed,ambient_temperature@1 kHz",
        )

    cold = extended([constant("-20 degC")])
    same = extended([], lubricant__temperature=253.15)
    for name in ("friction_force", "motor_speed", "ambient_temperature"):
        assert np.array_equal(cold[name].values, same[name].values)
    late = extended([term("step", initial=REFERENCE, final="-20 degC", time=0.4)])
    warm = extended([])
    before = warm["motor_speed"].time < 0.4
    speed = late["motor_speed"].values
    assert np.array_equal(speed[before], warm["motor_speed"].values[before])
    assert speed[-1] < warm["motor_speed"].values[-1]


def test_air_that_cannot_be_is_refused() -> None:
    """At or below 0 K."""
    with pytest.raises(elevon.InputError, match=r"ambient: 0\.0+ K at 0\.1"):
        coasting("low", GREASE, ambient={"terms": [term("ramp", initial=10.0, slope=-100.0)]})
