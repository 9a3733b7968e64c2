"""Saliency, saturation, iron loss, field weakening, derating: closed forms, energy accounts."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

import elevon
from elevon.errors import InputError
from tests.physics.rig import (
    FREE_SHAFT,
    HYSTERESIS,
    INERTIA,
    LOCKED,
    PWM,
    SUPPLY,
    K,
    L,
    P,
    R,
    actuator,
    constant,
    make_scenario,
    run,
    term,
)

FIDELITIES = pytest.mark.parametrize("fidelity", ["high", "low"])
LOCATED = HYSTERESIS | {"inverter.relay_crossing": "located"}
LIMIT = SUPPLY / math.sqrt(3)
#: A buried magnet whose iron saturates within the current limit.
SALIENT = {"motor.saliency": 0.6}
SATURATED = {"motor.saturation_current": 8.0, "motor.saturation_bias": 3.0}
#: With a current limit at which relays still have a step to act in.
BOUNDED = {"control.current_limit": 12.0}


def late(rec: Any, name: str, count: int = 400) -> float:
    """Mean of the last samples."""
    return float(np.mean(rec[name].values[-count:]))


def linkage(
    i_d: float, i_q: float, *, saturated: bool, saliency: float = 1.0
) -> tuple[float, float]:
    """Flux of both axes without the magnets', written from the coenergy's definition."""
    size, bias = (8.0, 3.0) if saturated else (math.inf, 0.0)
    bend = 1 / math.sqrt(1 + (i_q**2 + saliency * (i_d + bias) ** 2) / size**2)
    at_zero = 1 / math.sqrt(1 + saliency * bias**2 / size**2)
    return saliency * L * (bend * (i_d + bias) - at_zero * bias), L * bend * i_q


def torque(i_d: float, i_q: float, **map_: Any) -> float:
    """3/2 p (psi_d i_q - psi_q i_d) with the magnets' k/p."""
    psi_d, psi_q = linkage(i_d, i_q, **map_)
    return 1.5 * P * ((K / P + psi_d) * i_q - psi_q * i_d)


@FIDELITIES
@pytest.mark.parametrize(
    ("motor", "map_"),
    [
        (SALIENT, {"saturated": False, "saliency": 0.6}),
        (SATURATED, {"saturated": True}),
        (SALIENT | SATURATED, {"saturated": True, "saliency": 0.6}),
    ],
)
def test_torque_of_both_axes(fidelity: str, motor: dict[str, float], map_: dict[str, Any]) -> None:
    """A held rotor with a direct and a quadrature current: saliency's and saturation's torque."""
    rec = run(
        FREE_SHAFT | PWM | LOCKED | motor | {"control.direct_current": -4.0},
        duration=0.3,
        mode="torque",
        command=[constant(6.0)],
        fidelity=fidelity,
        record="motor_torque,current_q@2 kHz",
    )
    i_q = late(rec, "current_q")
    assert i_q == pytest.approx(6.0 / (1.5 * K), rel=5e-3)
    assert late(rec, "motor_torque") == pytest.approx(torque(-4.0, i_q, **map_), rel=5e-3)


def test_a_salient_motor_turns_at_the_phasor_solution() -> None:
    """Torque balance and voltages of both axes at a steady speed, solved apart from the program."""
    drag, i_d = 0.02, -3.0
    rec = run(
        FREE_SHAFT
        | PWM
        | SALIENT
        | SATURATED
        | {"control.direct_current": i_d, "friction.viscous": drag, "control.speed_gain": 2.0},
        duration=1.0,
        mode="speed",
        command=[constant(120.0)],
        record="motor_speed,current_q,current_d,voltage_q_meas@2 kHz",
    )
    speed = late(rec, "motor_speed")
    i_q = brentq(lambda i: torque(i_d, i, saturated=True, saliency=0.6) - drag * speed, 0.1, 15.0)
    psi_d, _ = linkage(i_d, i_q, saturated=True, saliency=0.6)
    assert late(rec, "current_q") == pytest.approx(i_q, rel=5e-3)
    assert late(rec, "current_d") == pytest.approx(i_d, rel=5e-3)
    voltage = R * i_q + speed * (K + P * psi_d)
    assert late(rec, "voltage_q_meas") == pytest.approx(voltage, rel=5e-3)


PARTS = ["copper", "inverter", "friction", "load", "impact", "kinetic", "magnetic", "brake", "iron"]


@pytest.mark.parametrize(("drive", "limit"), [(PWM, 2e-5), (LOCATED, 2e-5), (HYSTERESIS, 2e-4)])
@pytest.mark.parametrize("load", [1.0, -1.0])
@pytest.mark.parametrize(
    "option",
    [
        SALIENT,
        SATURATED,
        SALIENT | SATURATED,
        {"motor.iron_loss": 11.0},
        SALIENT | SATURATED | {"inverter.dead_time": 2e-6, "inverter.diode_drop": 1.0},
    ],
)
def test_energy_closes_in_every_option(
    drive: dict[str, Any], limit: float, load: float, option: dict[str, float]
) -> None:
    """What the supply gives is found again, under load in both directions.

    Sampled relays are of first order in the step: a motor of one inductance closes within 1.2e-4.
    """
    names = [f"energy_{part}" for part in ("supply", *PARTS)]
    rec = run(
        FREE_SHAFT | drive | BOUNDED | option | {"friction.viscous": 0.01},
        duration=0.4,
        mode="torque",
        command=[constant(6.0)],
        scenario={"load": {"shaft": {"terms": [constant(load)]}}},
        record=",".join(names) + "@1 kHz",
    )
    supply, *others = (rec.final[name] for name in names)
    assert sum(others) == pytest.approx(supply, rel=limit)


def weakened(supply: float, load: float, speed: float, share: float = 0.95) -> float:
    """Direct current at which |v| is its share of V/sqrt 3, i_q from the torque."""
    i_q = load / (1.5 * K)

    def room(i_d: float) -> float:
        v_q = R * i_q + K * speed + P * speed * L * i_d
        v_d = R * i_d - P * speed * L * i_q
        return math.hypot(v_q, v_d) - share * supply / math.sqrt(3)

    return float(brentq(room, -K / (P * L), 0.0))


WEAKENED = {
    "control.field_weakening": "on",
    "control.field_weakening_current": 5.5,
    "control.speed_gain": 0.5,
    "control.integral_time": 0.2,
}


@FIDELITIES
@pytest.mark.parametrize(("supply", "load"), [(380.0, 0.5), (228.0, 1.0)])
def test_field_weakening_reaches_a_speed_beyond_the_voltage_limit(
    fidelity: str, supply: float, load: float
) -> None:
    """A speed beyond the voltage limit is held, with the direct current that it takes."""
    speed = 1.3 * supply / math.sqrt(3) / K
    rec = run(
        FREE_SHAFT | PWM | WEAKENED | {"inverter.supply_voltage": supply},
        duration=2.0,
        mode="speed",
        command=[constant(speed)],
        scenario={"load": {"shaft": {"terms": [constant(load)]}}},
        fidelity=fidelity,
        record="motor_speed,current_q,energy_copper"
        + (",current_d" if fidelity == "high" else "")
        + "@2 kHz",
    )
    assert late(rec, "motor_speed") == pytest.approx(speed, rel=5e-3)
    expected = weakened(supply, load, speed)
    if fidelity == "high":
        assert late(rec, "current_d") == pytest.approx(expected, rel=5e-3)
    # Copper of both axes: the only trace of the direct current in the reduced-order model.
    copper = rec["energy_copper"].values
    power = (copper[-1] - copper[-401]) / (400 / 2000.0)
    i_q = load / (1.5 * K)
    assert power == pytest.approx(1.5 * R * (i_q**2 + expected**2), rel=0.02)


@FIDELITIES
def test_field_weakening_ends_at_its_current(fidelity: str) -> None:
    """With all of its direct current the speed is that of the voltage limit."""
    values = WEAKENED | {"control.field_weakening_current": 4.0}
    rec = run(
        FREE_SHAFT | PWM | values,
        duration=4.0,
        mode="speed",
        command=[constant(900.0)],
        scenario={"load": {"shaft": {"terms": [constant(1.0)]}}},
        fidelity=fidelity,
        record="motor_speed@2 kHz",
    )
    i_q = 1.0 / (1.5 * K)

    def room(speed: float) -> float:
        v_q = R * i_q + K * speed - P * speed * L * 4.0
        v_d = -R * 4.0 - P * speed * L * i_q
        return math.hypot(v_q, v_d) - LIMIT

    assert late(rec, "motor_speed") == pytest.approx(brentq(room, 100.0, 900.0), rel=5e-3)


@FIDELITIES
def test_iron_loss_drags_as_stated(fidelity: str) -> None:
    """Coasting from speed under hysteresis and eddy currents alone: J w' = -(T_h + c w)."""
    loss, rated, eddy = 11.0, 200.0, 0.4
    values = {
        "motor.iron_loss": loss,
        "motor.iron_loss_speed": rated,
        "motor.iron_loss_eddy": eddy,
    }
    scenario = elevon.Scenario.from_dict(
        {
            "duration": "2 s",
            "command": {"mode": "torque", "terms": []},
            "initial": {"motor_speed": 180.0},
        }
    )
    rec = elevon.simulate(
        actuator(FREE_SHAFT | PWM | values),
        scenario,
        fidelity=fidelity,
        record="motor_speed,energy_iron,heat_iron@100 Hz",
    )
    dry, viscous = loss * (1 - eddy) / rated, loss * eddy / rated**2
    decay = math.exp(-viscous / INERTIA * 2.0)
    speed = (180.0 + dry / viscous) * decay - dry / viscous
    assert rec.final["motor_speed"] == pytest.approx(speed, rel=2e-3)
    lost = 0.5 * INERTIA * (180.0**2 - speed**2)
    assert rec.final["energy_iron"] == pytest.approx(lost, rel=2e-3)
    assert rec.final["heat_iron"] == pytest.approx((dry + viscous * speed) * speed, rel=2e-3)


WARM = {
    "thermal.model": "dynamic",
    "thermal.winding_mass": 0.01,
    "thermal.housing_capacity": 0.5,
    "thermal.emissivity": 0.0,
    "thermal.ambient": 293.15,
}


@FIDELITIES
def test_iron_loss_warms_the_surface(fidelity: str) -> None:
    """Heat of the iron enters at the surface and leaves to the air."""
    values = {"motor.iron_loss": 40.0, "motor.iron_loss_speed": 50.0, "control.speed_gain": 1.0}
    rec = run(
        FREE_SHAFT | PWM | WARM | values,
        duration=3.0,
        mode="speed",
        command=[constant(50.0)],
        fidelity=fidelity,
        record="surface_temperature,motor_speed,heat_iron,heat_copper,heat_air@10 Hz",
    )
    heat = rec.final["heat_iron"] + rec.final["heat_copper"]
    convection = 9.908 * 0.12
    time = (0.5 + 0.01 * 385.0) / convection
    rise = heat / convection * (1 - math.exp(-3.0 / time))
    assert rec.final["surface_temperature"] - 293.15 == pytest.approx(rise, rel=0.1)


@FIDELITIES
def test_derating_holds_the_winding_where_heat_and_limit_meet(fidelity: str) -> None:
    """A stall: 3/2 R i^2 through both resistances, i the limit's share at that temperature."""
    start, end, limit = 330.0, 380.0, 10.0
    values = {
        "control.derating": "on",
        "control.derating_start": start,
        "control.derating_end": end,
        "control.current_limit": limit,
        "thermal.winding_to_surface": 0.2,
        "thermal.convection": 100.0,
        "thermal.winding_mass": 2e-3,
        "thermal.housing_capacity": 0.2,
        "thermal.warning": 420.0,
        "thermal.trip": 425.0,
    }
    rec = run(
        FREE_SHAFT | PWM | LOCKED | WARM | values,
        duration=1.5,
        mode="torque",
        command=[constant(15.0)],
        fidelity=fidelity,
        record="winding_temperature,current_q@100 Hz",
    )
    resistance = 0.2 + 1 / (100.0 * 0.12)

    def balance(temperature: float) -> float:
        current = limit * min(1.0, (end - temperature) / (end - start))
        return temperature - 293.15 - resistance * 1.5 * R * current**2

    expected = brentq(balance, start, end)
    assert rec.final["winding_temperature"] == pytest.approx(expected, rel=2e-3)
    share = (end - expected) / (end - start)
    assert rec.final["current_q"] == pytest.approx(limit * share, rel=5e-3)


@pytest.mark.parametrize("drive", [PWM, HYSTERESIS])
@pytest.mark.parametrize("motor", [SALIENT, SATURATED, SALIENT | SATURATED])
def test_both_fidelities_follow_the_same_motion(
    drive: dict[str, Any], motor: dict[str, float]
) -> None:
    """A sine under load: speed and mean torque of a salient, saturating motor."""
    seen = {}
    for fidelity in ("high", "low"):
        rec = run(
            FREE_SHAFT
            | drive
            | motor
            | BOUNDED
            | {"control.speed_gain": 0.3, "friction.viscous": 0.01},
            duration=0.8,
            mode="speed",
            command=[term("sine", amplitude=60.0, frequency=2.5)],
            scenario={"load": {"shaft": {"terms": [constant(2.0)]}}},
            fidelity=fidelity,
            record="motor_speed,motor_torque@1 kHz",
        )
        seen[fidelity] = [rec[name].values[100:] for name in ("motor_speed", "motor_torque")]
    window = np.ones(20) / 20
    for pair, limit in zip(zip(*seen.values(), strict=True), (0.01, 0.04), strict=True):
        high, low = (np.convolve(x, window, "valid") for x in pair)
        error = math.sqrt(np.mean((high - low) ** 2)) / float(np.ptp(high))
        assert error < limit


def test_an_open_phase_of_a_salient_motor_carries_nothing() -> None:
    """The floating phase has the voltage at which its current does not change."""
    rec = run(
        FREE_SHAFT
        | HYSTERESIS
        | BOUNDED
        | SALIENT
        | SATURATED
        | {"motor.open_b": 1.0, "control.speed_gain": 0.1},
        duration=0.2,
        mode="speed",
        command=[constant(30.0)],
        record="current_a,current_b,current_c@1 kHz",
    )
    a, b, c = (rec[f"current_{phase}"].values for phase in "abc")
    assert np.all(b[5:] == 0.0)
    assert np.max(np.abs(a + c)) < 1e-9
    assert np.max(np.abs(a)) > 0.1


@pytest.mark.parametrize(
    ("values", "path"),
    [
        (SALIENT | {"motor.turns_a": 0.9}, "motor.saliency"),
        (SATURATED | {"motor.turns_a": 0.9, "motor.short_model": "loop"},
         "motor.saturation_current"),
        (PWM | WEAKENED | {"control.field_weakening_current": 25.0},
         "control.field_weakening_current"),
        (PWM | {"control.direct_current": -21.0}, "control.direct_current"),
        (WARM | {"control.derating": "on", "control.derating_end": 350.0},
         "control.derating_end"),
    ],
)  # fmt: skip
def test_what_cannot_be_is_refused_by_name(values: dict[str, Any], path: str) -> None:
    """Before a run, with value and limit."""
    with pytest.raises(InputError, match=path.replace(".", r"\.")):
        elevon.simulate(
            actuator(FREE_SHAFT | values),
            make_scenario(duration=0.01, mode="speed", command=[constant(1.0)]),
        )
