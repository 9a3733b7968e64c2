"""The link's capacitor behind an open connector, and the drive's losses, under load."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import (
    FREE_SHAFT,
    HYSTERESIS,
    INERTIA,
    LOCKED,
    MOTOR,
    PWM,
    SUPPLY,
    L,
    R,
    actuator,
    constant,
    make_scenario,
    run,
    term,
)

CAPACITANCE = 2e-3
LINK = {"inverter.link_capacitance": CAPACITANCE, "inverter.source_resistance": 0.5}
DRIVES = {"hysteresis": HYSTERESIS, "pwm": PWM}
SPEED = {"control.speed_gain": 1.0, "control.integral_time": 0.1, "control.torque_constant": 1.1}


def opened(time: float = 0.0) -> list[dict[str, Any]]:
    """The connector opens at a time."""
    profile = {"kind": "step", "time": time}
    return [{"kind": "connector_open", "place": "supply", "severity": 1, "profile": profile}]


def test_the_capacitor_rings_down_into_the_winding() -> None:
    """Locked, legs (+, -, -) held by a reference out of reach: C, 1.5 L and 1.5 R in series."""
    values = FREE_SHAFT | HYSTERESIS | LOCKED | LINK
    values |= {"motor.electrical_offset": math.pi / 2, "inverter.supply_voltage": 60.0}
    rec = run(
        values | {"control.current_limit": 1e3},
        duration=0.02,
        mode="torque",
        command=[constant(1e3)],
        record="supply_voltage,current_a@10 kHz",
        scenario={"fault": opened()},
    )
    time, volts = rec["supply_voltage"].time, rec["supply_voltage"].values
    damping = R / (2 * L)
    omega = math.sqrt(1 / (1.5 * L * CAPACITANCE) - damping**2)
    exact = np.exp(-damping * time) * (
        np.cos(omega * time) + damping / omega * np.sin(omega * time)
    )
    assert volts == pytest.approx(60.0 * exact, abs=0.05)
    assert volts[-1] < 50.0


@pytest.mark.signature("connector_open", "supply")
@pytest.mark.filterwarnings("ignore::elevon.errors.NotActingWarning")
@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize("drive", DRIVES)
def test_at_constant_power_the_square_of_the_voltage_falls_straight(
    drive: str, fidelity: str
) -> None:
    """50 rad/s against 3 N m: (v0^2 - v^2) C / 2 is the energy that shaft and copper take, with
    the change of the kinetic one.
    """
    rec = run(
        FREE_SHAFT | DRIVES[drive] | LINK | SPEED,
        duration=0.7,
        mode="speed",
        command=[constant(50.0)],
        record="supply_voltage,motor_speed,motor_torque,current_q@2 kHz",
        scenario={"fault": opened(0.4), "load": {"brake": {"terms": [constant(3.0)]}}},
        fidelity=fidelity,
    )
    time = rec["supply_voltage"].time
    after = (time > 0.42) & (time < 0.69)
    volts, speed, torque, current = (
        rec[name].values[after]
        for name in ("supply_voltage", "motor_speed", "motor_torque", "current_q")
    )
    power = torque * speed + 1.5 * R * current**2
    taken = float(np.trapezoid(power, time[after]))
    released = 0.5 * CAPACITANCE * (volts[0] ** 2 - volts[-1] ** 2)
    assert released == pytest.approx(taken, rel=0.03)
    assert volts[-1] < 0.8 * SUPPLY
    straight = np.polyval(np.polyfit(time[after], volts**2, 1), time[after])
    assert volts**2 == pytest.approx(straight, rel=0.01)


@pytest.mark.filterwarnings("ignore::elevon.errors.NotActingWarning")
@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize("drive", DRIVES)
def test_a_braking_motor_charges_an_open_link(drive: str, fidelity: str) -> None:
    """From 60 rad/s to rest with 4 A, connector open: the link rises by what the kinetic energy
    leaves after the copper.
    """
    rec = run(
        FREE_SHAFT
        | DRIVES[drive]
        | LINK
        | SPEED
        | {"gear.inertia": 0.02, "control.current_limit": 4.0},
        duration=0.55,
        mode="speed",
        command=[term("step", initial=60.0, final=0.0, time=0.2)],
        record="supply_voltage,motor_speed,current_q@2 kHz",
        scenario={"initial": {"motor_speed": 60.0}, "fault": opened(0.19)},
        fidelity=fidelity,
    )
    time = rec["supply_voltage"].time
    after = time >= 0.195
    volts, speed, current = (
        rec[name].values[after] for name in ("supply_voltage", "motor_speed", "current_q")
    )
    kinetic = 0.5 * (INERTIA - 1.905e-3 + 0.02) * (speed[0] ** 2 - speed[-1] ** 2)
    copper = float(np.trapezoid(1.5 * R * current**2, time[after]))
    gained = 0.5 * CAPACITANCE * (volts[-1] ** 2 - volts[0] ** 2)
    assert gained > 5.0
    assert gained == pytest.approx(kinetic - copper, rel=0.05)


@pytest.mark.parametrize("drive", DRIVES)
def test_the_books_close_with_capacitor_source_and_switching_losses(drive: str) -> None:
    """Connector on, then open: what the source gave is in an account."""
    sinks = ("copper", "inverter", "friction", "brake", "load", "impact", "source")
    stores = ("kinetic", "magnetic", "link")
    names = [f"energy_{name}" for name in ("supply", *sinks, *stores)]
    rec = run(
        MOTOR | DRIVES[drive] | LINK | {"inverter.switching_time": 4e-7},
        duration=0.5,
        command=[term("sine", amplitude="7 deg", frequency="2 Hz")],
        record=",".join(names) + "@1 kHz",
        scenario={"fault": opened(0.3), "load": {"brake": {"terms": [constant(1.0)]}}},
    )
    change = {name: rec[name].values[-1] - rec[name].values[0] for name in names}
    given = change.pop("energy_supply")
    assert change["energy_link"] < -1.0
    assert change["energy_inverter"] > 0.01
    assert abs(given - sum(change.values())) < 1e-3 * sum(map(abs, change.values()))


def test_switching_losses_are_those_of_the_law_and_heat_the_drive() -> None:
    """A locked carrier drive: two transitions a period and leg, V |i| t_sw / 2 each."""
    time = 2e-7
    rec = run(
        FREE_SHAFT
        | PWM
        | LOCKED
        | {"motor.electrical_offset": math.pi / 2}
        | {"inverter.switching_time": time, "thermal.model": "dynamic"},
        duration=0.4,
        mode="torque",
        command=[constant(4.4)],
        record="energy_inverter,heat_drive,drive_temperature,current_q@1 kHz",
    )
    late = rec["energy_inverter"].time > 0.1
    spent = rec["energy_inverter"].values[late]
    power = (spent[-1] - spent[0]) / (
        rec["energy_inverter"].time[late][-1] - rec["energy_inverter"].time[late][0]
    )
    current = float(np.mean(rec["current_q"].values[late]))
    # Phases carry i, i/2 and i/2.
    assert power == pytest.approx(2 * 4000 * 0.5 * SUPPLY * 2 * current * time, rel=0.05)
    assert rec.final["heat_drive"] == pytest.approx(power, rel=0.05)
    warmth = rec.final["drive_temperature"] - 293.15
    assert 500.0 * warmth == pytest.approx(rec.final["energy_inverter"], rel=0.02)


def test_a_stiff_link_and_ideal_switches_are_the_drive_without_them() -> None:
    """The neutral values give the same bits, whatever stands beside them."""
    plain, neutral = (
        run(
            MOTOR | PWM | values,
            duration=0.05,
            command=[term("sine", amplitude="7 deg", frequency="2 Hz")],
            record="current_a@1 kHz",
        )
        for values in ({}, {"inverter.link_capacitance": 0.0, "inverter.switching_time": 0.0})
    )
    assert plain.final == neutral.final


#: A shaft that a load drives at 300 W, held by the motor: what the copper leaves comes back.
BLOCKED = (
    FREE_SHAFT
    | SPEED
    | LINK
    | {
        "motor.inertia": 0.02,
        "inverter.source_regeneration": "block",
        "inverter.link_capacitance": 2e-4,
    }
)


def held_back(fidelity: str, drive: str, values: dict[str, Any]) -> Any:
    """A link whose source takes nothing back, at 100 rad/s under -3 N m; tripped or not."""
    extra = {"initial": {"motor_speed": 100.0}, "load": {"shaft": {"terms": [constant(-3.0)]}}}
    scenario = make_scenario(duration=0.3, mode="speed", command=[constant(100.0)], extra=extra)
    return elevon.simulate(
        actuator(BLOCKED | DRIVES[drive] | values),
        scenario,
        fidelity=fidelity,
        record="supply_voltage,motor_speed,tripped@2 kHz",
    )


@pytest.mark.filterwarnings("ignore:inverter.link_capacitance")
@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize("drive", DRIVES)
def test_a_blocked_link_without_limits_rises(fidelity: str, drive: str) -> None:
    """Some 75 J go into 0.2 mF: almost a thousand volts, and nothing trips."""
    rec = held_back(fidelity, drive, {})
    assert rec.meta["status"] == "ok"
    assert rec["supply_voltage"].values.max() > 800.0


@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize("drive", DRIVES)
def test_over_voltage_trips_the_drive(fidelity: str, drive: str) -> None:
    """At 450 V the bridge opens: the link keeps that voltage, and the load drives the shaft on."""
    rec = held_back(fidelity, drive, {"inverter.over_voltage_trip": 450.0})
    assert rec.meta["status"] == "tripped"
    assert "inverter.over_voltage_trip = 450 V" in rec.meta["message"]
    voltage = rec["supply_voltage"].values
    # Above: what the windings hold, and a step of 0.5 ms at 300 W.
    assert 450.0 < voltage.max() < 460.0
    assert voltage[-1] == pytest.approx(voltage.max(), rel=1e-6)
    assert rec["motor_speed"].values[-1] > 110.0
    assert rec["tripped"].values[-1] == 1.0


@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize("drive", DRIVES)
def test_a_brake_chopper_holds_the_link(fidelity: str, drive: str) -> None:
    """200 ohm take 1 kW at 450 V, more than the load gives: the link stays at 430 to 450 V."""
    rec = held_back(fidelity, drive, {"inverter.chopper_resistance": 200.0})
    assert rec.meta["status"] == "ok"
    voltage = rec["supply_voltage"].values
    reached = voltage[int(np.argmax(voltage > 449.0)) :]
    # The reduced-order model switches the chopper at its steps: 0.7 kW of 0.5 ms are 4 V.
    assert len(reached) > 300
    assert 426.0 < reached.min() < 435.0
    assert 445.0 < reached.max() < 454.0


@pytest.mark.filterwarnings("ignore:inverter.chopper_voltage")
def test_the_chopper_decays_the_link_exponentially_and_its_heat_is_counted() -> None:
    """A link at rest above the chopper's voltage: exp(-t/(R C)) down to where it goes off."""
    values = (
        FREE_SHAFT
        | LINK
        | {
            "inverter.source_regeneration": "block",
            "inverter.chopper_resistance": 20.0,
            "inverter.chopper_voltage": 350.0,
            "inverter.chopper_band": 100.0,
            "inverter.supply_voltage": SUPPLY,
        }
    )
    rec = run(
        values,
        duration=0.02,
        scenario={"fault": opened()},
        record="supply_voltage,energy_source,energy_link@10 kHz",
    )
    voltage, time = rec["supply_voltage"].values, rec["supply_voltage"].time
    exact = np.maximum(SUPPLY * np.exp(-time / (20.0 * CAPACITANCE)), 250.0)
    assert voltage == pytest.approx(exact, rel=1e-3)
    lost = rec.final["energy_source"]
    assert lost == pytest.approx(-rec.final["energy_link"], rel=1e-9)


@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_under_voltage_trips_the_drive(fidelity: str) -> None:
    """Behind an open connector the bridge empties the link: at 200 V it stops."""
    values = (
        FREE_SHAFT
        | SPEED
        | HYSTERESIS
        | LINK
        | {
            "inverter.link_capacitance": 2e-4,
            "inverter.under_voltage_trip": 200.0,
            "motor.inertia": 0.02,
        }
    )
    scenario = make_scenario(
        duration=0.3, mode="speed", command=[constant(100.0)], extra={"fault": opened()}
    )
    rec = elevon.simulate(
        actuator(values), scenario, fidelity=fidelity, record="supply_voltage@2 kHz"
    )
    assert rec.meta["status"] == "tripped"
    assert "below inverter.under_voltage_trip = 200 V" in rec.meta["message"]
    assert rec["supply_voltage"].values[-1] > 150.0
