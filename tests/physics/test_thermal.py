"""The thermal network: closed forms, both models, both actuators, limits, bad input."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import constant, run

NAME = "nasa-ballscrew"
STIFF = {
    "friction.static": 1e4,
    "friction.dynamic": 1e4,
    "inverter.hysteresis_band": 1e-9,
    "sensor.current.bandwidth": 0.0,
}
BARE = STIFF | {"thermal.emissivity": 0.0, "motor.temperature_coefficient": 0.0}
RECORD = "winding_temperature,surface_temperature,heat_copper,heat_air,energy_copper,"
RECORD += "energy_heat_stored,energy_air,current_q"


def under_torque(values: dict[str, Any], duration: float, torque: float = 15.0, **more: Any) -> Any:
    """A constant current on a locked shaft, low fidelity."""
    return elevon.simulate(
        elevon.Actuator.load(more.pop("name", NAME)).with_values(values),
        elevon.Scenario.from_dict(
            {
                "duration": duration,
                "command": {"mode": "torque", "terms": [constant(torque)]},
                **more,
            }
        ),
        fidelity="low",
        record=f"{RECORD}@1 Hz",
    )


def test_quasi_static_rise_is_one_exponential() -> None:
    """tau = m c (R_th + 1/(h A)), final rise P (R_th + 1/(h A))."""
    rec = under_torque(BARE | {"thermal.model": "quasi_static"}, 1500.0)
    whole = 0.2 + 1 / (12 * 0.17)
    power = 1.5 * 0.9 * rec["current_q"].values[-1] ** 2
    time = rec["winding_temperature"].time
    rise = power * whole * -np.expm1(-time / (3 * 385 * whole))
    assert rec["winding_temperature"].values - 293.15 == pytest.approx(rise, abs=2e-3)
    through = (rec["winding_temperature"].values - rec["surface_temperature"].values) / 0.2
    assert rec["heat_air"].values[1:] == pytest.approx(through[1:], rel=1e-9)


def test_a_light_housing_is_the_printed_form() -> None:
    """C_h -> 0 gives the surface without capacity."""
    printed = under_torque(STIFF | {"thermal.model": "quasi_static"}, 300.0)
    light = under_torque(STIFF | {"thermal.housing_capacity": 1e-3}, 300.0)
    for name in ("winding_temperature", "surface_temperature"):
        assert light[name].values[1:] == pytest.approx(printed[name].values[1:], abs=1e-3)


@pytest.mark.parametrize("model", ["quasi_static", "dynamic"])
@pytest.mark.parametrize("tick", ["10 ms", "1 s"])
def test_energy_closes_at_any_tick(model: str, tick: str) -> None:
    """What the copper gives is stored or gone, to rounding."""
    rec = under_torque(STIFF | {"thermal.model": model, "thermal.sample_time": tick}, 200.0)
    given = rec["energy_copper"].values
    kept = rec["energy_heat_stored"].values + rec["energy_air"].values
    assert kept == pytest.approx(given, abs=1e-9 * given[-1])


def test_resistance_follows_the_winding_and_flux_the_surface() -> None:
    """R (1 + alpha dT_w) in the heat, k (1 + alpha_k dT_s) in the torque."""
    rec = under_torque(STIFF, 900.0)
    winding = rec["winding_temperature"].values
    cold = 1.5 * 0.9 * rec["current_q"].values ** 2
    expected = cold * (1 + 0.00393 * (winding - 293.15))
    assert rec["heat_copper"].values[2:] == pytest.approx(expected[2:], rel=1e-4)
    hot = {
        "thermal.ambient": 393.15,
        "thermal.model": "quasi_static",
    }
    torque = [
        run(
            STIFF | more,
            duration=0.1,
            mode="torque",
            command=[constant(10.0)],
            record="motor_torque,current_q@1 kHz",
            fidelity="low",
            name=NAME,
        ).final["motor_torque"]
        for more in ({}, hot)
    ]
    assert torque[1] / torque[0] == pytest.approx(1 - 0.001 * 100, rel=1e-4)


def test_high_and_low_heat_alike() -> None:
    """The same sine under load: heat of the three phases within the relays' ripple."""
    scenario = elevon.Scenario.from_dict(
        {
            "duration": 2.0,
            "command": {"terms": [{"kind": "sine", "amplitude": "20 mm", "frequency": "0.5 Hz"}]},
            "load": {"output": {"terms": [constant(4500.0)]}},
        }
    )
    actuator = elevon.Actuator.load(NAME)
    energy = {}
    for fidelity in ("high", "low"):
        rec = elevon.simulate(actuator, scenario, fidelity=fidelity, record=f"{RECORD}@10 Hz")
        energy[fidelity] = rec.final["energy_copper"]
        kept = rec.final["energy_heat_stored"] + rec.final["energy_air"]
        assert kept == pytest.approx(rec.final["energy_copper"], rel=1e-6)
    assert energy["low"] == pytest.approx(energy["high"], rel=0.05)


def copper_heat(
    fidelity: str, name: str, values: dict[str, Any], torque: float, speed: float
) -> float:
    """Mean copper heat over 0.4 s of a steady speed against a torque on the motor shaft, W."""
    actuator = elevon.Actuator.load(name).with_values({"thermal.model": "dynamic", **values})
    rec = elevon.simulate(
        actuator,
        elevon.Scenario.from_dict(
            {
                "duration": 0.6,
                "command": {"mode": "speed", "terms": [constant(speed)]},
                "load": {"shaft": {"terms": [constant(torque)]}},
                "initial": {"motor_speed": speed},
            }
        ),
        fidelity=fidelity,
        record="energy_copper@100 Hz",
    )
    energy = rec["energy_copper"].values
    return float(energy[-1] - energy[20]) / 0.4


@pytest.mark.parametrize(
    ("name", "band", "torque", "speed"),
    [
        ("torino-rotary", 0.5, 0.4, 5.0),
        ("torino-rotary", 0.5, 0.4, 40.0),
        ("torino-rotary", 0.5, 1.0, 5.0),
        ("torino-rotary", 0.5, 1.0, 40.0),
        ("torino-rotary", 0.5, 1.0, 100.0),
        ("torino-rotary", 0.5, 3.0, 5.0),
        ("torino-rotary", 0.5, 3.0, 40.0),
        ("torino-rotary", 0.25, 1.0, 40.0),
        ("nasa-ballscrew", 0.2, 5.0, 10.0),
        ("nasa-ballscrew", 0.4, 1.0, 40.0),
    ],
)
def test_the_ripple_of_the_relays_heats_the_winding(
    name: str, band: float, torque: float, speed: float
) -> None:
    """Copper heat of both models at several loads, speeds and bands, within 10 %: without the
    ripple the reduced-order model has 0.3, 0.7 and 0.97 of it at 0.4, 1 and 3 N m.
    """
    values = {"inverter.hysteresis_band": band}
    high, low = (copper_heat(f, name, values, torque, speed) for f in ("high", "low"))
    assert low == pytest.approx(high, rel=0.1)


def test_relays_at_rest_leave_no_ripple() -> None:
    """Nothing is commanded: no relay switches, and nothing heats."""
    rec = elevon.simulate(
        elevon.Actuator.load(NAME),
        elevon.Scenario.from_dict({"duration": 0.1}),
        fidelity="low",
        record=f"{RECORD}@100 Hz",
    )
    assert rec.final["energy_copper"] == 0.0


def test_circulating_current_of_a_short_heats_the_winding() -> None:
    """Its I^2 R and that of the contact are part of the heat, and counted apart."""
    rec = run(
        {"motor.short_model": "loop", "motor.short_contact_resistance": 0.5},
        duration=0.5,
        mode="speed",
        command=[constant(37.7)],
        record="heat_loop,heat_contact,current_a,loop_current_a,energy_copper,energy_contact,"
        "energy_heat_stored,energy_air@100 kHz",
        scenario={"fault": ["short@motor.phase_a=0.2"]},
        name=NAME,
    )
    # The tick that begins at a sample shows the mean of the 10 ms before it.
    inside = rec["loop_current_a"].values[:-1]
    through = rec["current_a"].values[:-1] - inside
    loop, contact = np.mean(inside**2) * 0.2 * 0.9, np.mean(through**2) * 0.5
    assert np.mean(rec["heat_loop"].values[1000::1000]) == pytest.approx(loop, rel=0.01)
    assert np.mean(rec["heat_contact"].values[1000::1000]) == pytest.approx(contact, rel=0.01)
    assert loop > 1.0
    assert contact > 1.0
    kept = rec.final["energy_heat_stored"] + rec.final["energy_air"]
    lost = rec.final["energy_copper"] + rec.final["energy_contact"]
    assert kept == pytest.approx(lost, rel=1e-9)


def test_a_resistor_at_the_terminals_heats_no_winding() -> None:
    """It stands outside the motor: its heat is its own."""
    rec = run(
        {},
        duration=0.1,
        mode="speed",
        command=[constant(20.0)],
        record="energy_tap,energy_copper,energy_heat_stored,energy_air@1 kHz",
        scenario={"fault": ["resistor_short@motor.phase_a=0.5"]},
        name=NAME,
    )
    assert rec.final["energy_tap"] > 1.0
    kept = rec.final["energy_heat_stored"] + rec.final["energy_air"]
    assert kept == pytest.approx(rec.final["energy_copper"], rel=1e-6)


@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_trip_ends_the_run_and_names_the_temperature(fidelity: str) -> None:
    """A winding near its limit: warning first, then the end."""
    values = STIFF | {"inverter.hysteresis_band": 0.2, "thermal.winding_mass": 1e-3}
    rec = elevon.simulate(
        elevon.Actuator.load(NAME).with_values(values),
        elevon.Scenario.from_dict(
            {"duration": 5.0, "command": {"mode": "torque", "terms": [constant(30.0)]}}
        ),
        fidelity=fidelity,
        record="winding_temperature,thermal_warning@200 Hz",
    )
    assert rec.meta["status"] == "tripped"
    assert "thermal.trip" in rec.meta["message"]
    assert rec.meta["sim_s"] < 5.0
    winding, warned = rec["winding_temperature"].values, rec["thermal_warning"].values
    assert winding[-1] == pytest.approx(428.15, abs=3.0)
    assert np.array_equal(warned > 0, winding > 403.15)


def test_it_serves_the_rotary_actuator_too() -> None:
    """The same numbers on another motor: the same closed form."""
    values = {
        "thermal.model": "quasi_static", "thermal.winding_mass": 1.0, "thermal.winding_heat": 385.0,
        "thermal.winding_to_surface": 0.5, "thermal.convection": 10.0, "thermal.area": 0.1,
        "thermal.emissivity": 0.0, "motor.temperature_coefficient": 0.0, "friction.static": 1e3,
        "friction.dynamic": 1e3, "inverter.hysteresis_band": 1e-9,
    }  # fmt: skip
    rec = under_torque(values, 600.0, 3.0, name="torino-rotary")
    resistance = elevon.Actuator.load("torino-rotary").parameters.value("motor.winding_resistance")
    power, whole = 1.5 * resistance * rec["current_q"].values[-1] ** 2, 1.5
    rise = power * whole * -math.expm1(-600.0 / (385 * whole))
    assert rec.final["winding_temperature"] - 293.15 == pytest.approx(rise, abs=5e-3)


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"thermal.convection": 0.0, "thermal.emissivity": 0.0}, ["thermal.convection", "no path"]),
        ({"thermal.trip": "400 K"}, ["thermal.trip", "400", "403.15"]),
        ({"thermal.warning": "290 K"}, ["thermal.warning", "290", "293.15"]),
        ({"thermal.emissivity": 1.2}, ["thermal.emissivity", "1"]),
        ({"thermal.winding_mass": 0.0}, ["thermal.winding_mass", "0"]),
        ({"thermal.ambient": -3.0}, ["thermal.ambient"]),
        ({"thermal.sample_time": 3e-6}, ["thermal.sample_time", "solver.step"]),
    ],
)
def test_impossible_temperatures_are_refused(values: dict[str, Any], words: list[str]) -> None:
    """Path, value and limit."""
    with pytest.raises(elevon.InputError) as caught:
        run(values, duration=1e-3, record="output_position@1 kHz", name=NAME)
    for word in words:
        assert word in str(caught.value)
