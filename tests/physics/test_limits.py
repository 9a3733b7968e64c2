"""Drive and plant at their limits, both fidelities: voltage, link, copper, torque, stops, gear."""

from __future__ import annotations

import math
import warnings
from typing import Any

import numpy as np
import pytest

import elevon
from elevon.errors import ElevonWarning
from tests.physics.rig import (
    FREE_SHAFT,
    HYSTERESIS,
    INERTIA,
    LOCKED,
    PWM,
    RATIO,
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


def late(rec: Any, name: str) -> float:
    """Mean of the last fifth of a second, recorded at 2 kHz."""
    return float(np.mean(rec[name].values[-400:]))


def speed_at_limit(supply: float, torque: float) -> float:
    """Speed at which the voltage of the torque's current is all that a min-max bridge has.

    (R i + k w)^2 + (p w L i)^2 = V^2 / 3 with i_d = 0.
    """
    i = torque / (1.5 * K)
    a, b, c = K**2 + (P * L * i) ** 2, 2 * R * i * K, (R * i) ** 2 - supply**2 / 3
    return (-b + math.sqrt(b**2 - 4 * a * c)) / (2 * a)


@FIDELITIES
@pytest.mark.parametrize(("supply", "load"), [(228.0, 0.0), (228.0, 1.0), (380.0, 4.0)])
def test_at_the_voltage_limit_no_direct_current_takes_the_voltage(
    fidelity: str, supply: float, load: float
) -> None:
    """A carrier drive that cannot reach its set point turns as fast as its voltage lets it."""
    rec = run(
        FREE_SHAFT | PWM | {"control.speed_gain": 2.0, "inverter.supply_voltage": supply},
        duration=1.5,
        mode="speed",
        command=[constant(400.0)],
        scenario={"load": {"shaft": {"terms": [constant(load)]}}},
        fidelity=fidelity,
        record="motor_speed" + (",current_d" if fidelity == "high" else "") + "@2 kHz",
    )
    assert late(rec, "motor_speed") == pytest.approx(speed_at_limit(supply, load), rel=2e-3)
    if fidelity == "high":
        assert abs(late(rec, "current_d")) < 1e-2


@FIDELITIES
@pytest.mark.parametrize(
    ("supply", "load", "speed"), [(380.0, 0.0, 239.7), (380.0, 1.0, 234.0), (228.0, 0.0, 144.0)]
)
def test_the_bench_at_its_voltage_limit(
    fidelity: str, supply: float, load: float, speed: float
) -> None:
    """The shipped set, stops away, a step to 250 rad/s: what voltage and friction leave."""
    values = {
        "drive.kind": "pwm",
        "stop.upper": 1e6,
        "stop.lower": -1e6,
        "control.speed_limit": 1000.0,
        "inverter.supply_voltage": supply,
    }
    rec = elevon.simulate(
        elevon.Actuator.load("torino-rotary").with_values(values, request=False),
        make_scenario(
            duration=2.0,
            mode="speed",
            command=[term("step", final=250.0, time=0.0)],
            extra={"load": {"shaft": {"terms": [constant(load)]}}},
        ),
        fidelity=fidelity,
        record="motor_speed@2 kHz",
    )
    assert late(rec, "motor_speed") == pytest.approx(speed, rel=2e-3)


@pytest.mark.parametrize("drive", [PWM, HYSTERESIS])
def test_an_open_phase_has_its_emf_in_the_quadrature_voltage(drive: dict[str, Any]) -> None:
    """Phase-to-neutral voltages, the open one's too: R i_q + k w + p w L i_d in the mean."""
    values = {"control.speed_gain": 0.05, "motor.open_a": 1.0, "friction.viscous": 0.01}
    recordings = {}
    for fidelity in ("high", "low"):
        direct = ",current_d" if fidelity == "high" else ""
        recordings[fidelity] = run(
            FREE_SHAFT | drive | values,
            duration=1.0,
            mode="speed",
            command=[constant(60.0)],
            fidelity=fidelity,
            record=f"voltage_q_meas,motor_speed,current_q{direct}@2 kHz",
        )
    speed, i_q, i_d = (
        recordings["high"][n].values[-400:] for n in ("motor_speed", "current_q", "current_d")
    )
    expected = float(np.mean(R * i_q + K * speed + P * speed * L * i_d))
    voltage = late(recordings["high"], "voltage_q_meas")
    assert voltage == pytest.approx(expected, rel=0.01)
    # The mean legs of the relays are the reduced-order model's own.
    assert late(recordings["low"], "voltage_q_meas") == pytest.approx(voltage, rel=0.03)


@FIDELITIES
def test_copper_is_counted_without_a_thermal_network(fidelity: str) -> None:
    """A held torque: 3/2 R i^2 for as long as it is held, all of it from the link."""
    rec = run(
        FREE_SHAFT | PWM | LOCKED,
        duration=0.5,
        mode="torque",
        command=[constant(2.2)],
        fidelity=fidelity,
        record="energy_copper,energy_supply,heat_copper@1 kHz",
    )
    power = 1.5 * R * (2.2 / (1.5 * K)) ** 2
    assert rec.final["heat_copper"] == pytest.approx(power, rel=1e-4)
    assert rec.final["energy_copper"] == pytest.approx(power * 0.5, rel=0.01)
    # What the windings' field holds is not much.
    field = 0.75 * L * (2.2 / (1.5 * K)) ** 2
    expected = rec.final["energy_copper"] + field
    assert rec.final["energy_supply"] == pytest.approx(expected, rel=2e-3)


@pytest.mark.parametrize(
    "drive", [PWM, HYSTERESIS, HYSTERESIS | {"inverter.relay_crossing": "located"}]
)
def test_a_saturated_flux_keeps_the_energy(drive: dict[str, Any]) -> None:
    """motor.torque_limit takes as much of the EMF as of the torque: the accounts close."""
    parts = ["copper", "inverter", "friction", "load", "impact", "kinetic", "magnetic", "brake"]
    names = [f"energy_{part}" for part in ("supply", *parts)]
    rec = run(
        FREE_SHAFT | drive | {"motor.torque_limit": 3.0, "friction.viscous": 0.01},
        duration=0.4,
        mode="torque",
        command=[constant(8.0)],
        record=",".join(["motor_torque", *names]) + "@1 kHz",
    )
    assert max(rec["motor_torque"].values) == pytest.approx(3.0, rel=1e-6)
    supply, *others = (rec.final[name] for name in names)
    assert sum(others) == pytest.approx(supply, rel=2e-5)


def test_a_saturated_flux_gives_the_low_model_the_same_speed() -> None:
    """Torque at its limit, and the supply's energy that of copper, field, shaft and drag."""
    rec = run(
        FREE_SHAFT | PWM | {"motor.torque_limit": 3.0, "friction.viscous": 0.01},
        duration=0.4,
        mode="torque",
        command=[constant(8.0)],
        fidelity="low",
        record="energy_supply,energy_copper,motor_torque,motor_speed@2 kHz",
    )
    speed = rec["motor_speed"].values
    decay = 1 - math.exp(-0.01 / INERTIA * 0.4)
    assert speed[-1] == pytest.approx(3.0 / 0.01 * decay, rel=5e-3)
    shaft = 0.5 * INERTIA * speed[-1] ** 2 + 0.01 * np.trapezoid(speed**2, dx=5e-4)
    field = 0.75 * L * (8.0 / (1.5 * K)) ** 2
    expected = rec.final["energy_copper"] + shaft + field
    assert rec.final["energy_supply"] == pytest.approx(expected, rel=5e-3)


@FIDELITIES
@pytest.mark.parametrize("damping", [0.0, 8e3])
def test_an_end_stop_that_gives_way(fidelity: str, damping: float) -> None:
    """A rotor at 98 rad/s: half a swing of its stop's stiffness, w sqrt(J K) at most, then back."""
    stiffness = 2e7
    values = {"stop.upper": 0.05, "stop.stiffness": stiffness, "stop.damping": damping}
    scenario = elevon.Scenario.from_dict(
        {
            "duration": "0.075 s",
            "command": {"mode": "torque", "terms": []},
            "initial": {"motor_speed": 98.0},
        }
    )
    rec = elevon.simulate(
        actuator(FREE_SHAFT | values),
        scenario,
        fidelity=fidelity,
        record="motor_speed,stop_torque@every",
    )
    reflected = stiffness / RATIO**2
    zeta = damping / RATIO**2 / (2 * math.sqrt(INERTIA * reflected))
    turn = math.sqrt(1 - zeta**2)
    end = math.pi - math.atan2(2 * zeta * turn, 1 - 2 * zeta**2)
    angle = end / turn
    left = math.exp(-zeta * angle) * (math.cos(end) - zeta / turn * math.sin(end))
    assert rec.final["motor_speed"] == pytest.approx(98.0 * left, rel=5e-3)
    if damping == 0.0:
        # The reduced-order model takes a dozen instants of the swing.
        peak = 98.0 * math.sqrt(INERTIA * reflected)
        assert max(rec["stop_torque"].values) == pytest.approx(
            peak, rel=1e-4 + 0.03 * (fidelity == "low")
        )


def test_what_a_stop_takes_is_in_the_accounts() -> None:
    """Kinetic energy and what the stop has taken stay those of the start."""
    values = {"stop.upper": 0.05, "stop.stiffness": 2e7, "stop.damping": 8e3}
    scenario = elevon.Scenario.from_dict(
        {
            "duration": "0.075 s",
            "command": {"mode": "torque", "terms": []},
            "initial": {"motor_speed": 98.0},
        }
    )
    rec = elevon.simulate(
        actuator(FREE_SHAFT | values), scenario, record="energy_kinetic,energy_impact@1 kHz"
    )
    total = rec.final["energy_kinetic"] + rec.final["energy_impact"]
    assert total == pytest.approx(0.5 * INERTIA * 98.0**2, rel=2e-5)


ELASTIC = {
    "backlash.model": "elastic",
    "backlash.total": 0.01511,
    "backlash.stiffness": 1045.0,
    "backlash.damping": 2.0,
}
#: Teeth and stiffnesses of the set: b and 1/K of each mesh at the output, by its kinematics.
WOLFROM = {"gear.model": "wolfrom"}


@pytest.mark.filterwarnings("ignore::elevon.errors.NotActingWarning")
@FIDELITIES
@pytest.mark.parametrize("gear", [ELASTIC, WOLFROM])
def test_lost_motion_holds_what_the_gear_gives_way(fidelity: str, gear: dict[str, Any]) -> None:
    """+-10 N m on a held motor: the backlash, and twice the torque over the stiffness."""
    ends = []
    for load in (10.0, -10.0):
        rec = run(
            FREE_SHAFT | gear | LOCKED | {"load.inertia": 0.05, "solver.method": "semi_implicit"},
            duration=1.0,
            mode="torque",
            scenario={"load": {"output": {"terms": [constant(load)]}}},
            fidelity=fidelity,
            record="output_position@2 kHz",
        )
        ends.append(late(rec, "output_position"))
    expected = 0.01511 + 20.0 / 1045.0 if gear is ELASTIC else wolfrom_lost_motion(20.0)
    assert ends[1] - ends[0] == pytest.approx(expected, rel=1e-3)


def wolfrom_lost_motion(torque: float) -> float:
    """Displacement of the output ring per displacement of each mesh, by Willis' equation."""
    gear = numbers("gear")
    a, s, c = gear["sun_teeth"], gear["planet_teeth"], gear["fixed_ring_teeth"]
    t, b = gear["output_planet_teeth"], gear["output_ring_teeth"]

    def output(mesh: list[float]) -> float:
        # Sun fixed: unknown carrier and planet angles from two meshes, then the output ring.
        rows = [[-(1 + s / a), s / a], [1 - s / c, s / c]]
        carrier, planet = np.linalg.solve(rows, mesh[:2])
        return float((1 - t / b) * carrier + t / b * planet - mesh[2])

    per = [abs(output([float(i == j) for i in range(3)])) for j in range(3)]
    gap = sum(p * gear[f"mesh_backlash_{j + 1}"] for j, p in enumerate(per))
    return gap + torque * sum(p**2 / gear[f"mesh_stiffness_{j + 1}"] for j, p in enumerate(per))


def numbers(group: str) -> dict[str, float]:
    """The numbers of a group of the rotary set with its gear of planets."""
    parameters = actuator(FREE_SHAFT | WOLFROM | {"load.inertia": 0.05}).parameters
    values = {path: parameters[path].value for path in parameters if path.startswith(f"{group}.")}
    return {p.split(".")[1]: float(v) for p, v in values.items() if not isinstance(v, str)}


@pytest.mark.parametrize("drive", ["hysteresis", "pwm"])
def test_shorted_turns_in_a_loop_act_alike_in_both_fidelities(drive: str) -> None:
    """20 % of a phase: mean sizes of position, current and torque under a sine within 3 %."""
    values = {"drive.kind": drive, "motor.short_model": "loop", "motor.turns_a": 0.8}
    sizes = {}
    for fidelity in ("high", "low"):
        rec = elevon.simulate(
            elevon.Actuator.load("torino-rotary").with_values(values, request=False),
            make_scenario(
                duration=0.6, command=[term("sine", amplitude="20 deg", frequency="2 Hz")]
            ),
            fidelity=fidelity,
            record="output_position,current_q,motor_torque@2 kHz",
        )
        sizes[fidelity] = [np.mean(np.abs(rec[name].values)) for name in rec.names]
    assert sizes["low"] == pytest.approx(sizes["high"], rel=0.03)


@FIDELITIES
def test_a_dump_resistor_below_the_trip_lets_the_gear_extend(fidelity: str) -> None:
    """A source that takes nothing back: the leg's weight brakes into the resistor."""
    gear = elevon.Actuator.load("pisa-landing-gear").with_values({"supply.regeneration": "block"})
    rec = elevon.simulate(gear, duration=9.0, fidelity=fidelity, record="locked@100 Hz")
    assert rec.meta["status"] == "ok", rec.meta["message"]
    assert rec.final["locked"] == 1.0


def findings(name: str, values: dict[str, Any]) -> list[str]:
    """What the core says of a set before it runs."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ElevonWarning)
        return [f["message"] for f in elevon.Actuator.load(name).with_values(values).findings()]


LINK = {"inverter.link_capacitance": 1e-3, "inverter.source_regeneration": "block"}
CHOPPER = LINK | {"inverter.chopper_resistance": 20.0}


@pytest.mark.parametrize(
    ("name", "values", "path"),
    [
        ("pisa-landing-gear", {"supply.regeneration": "block", "supply.dump_voltage": 36.0},
         "supply.dump_voltage"),
        ("pisa-landing-gear", {"supply.regeneration": "block", "supply.dump_voltage": 27.0},
         "supply.dump_voltage"),
        ("nasa-ballscrew", LINK, "inverter.link_capacitance"),
        ("nasa-ballscrew", CHOPPER | {"inverter.over_voltage_trip": 440.0},
         "inverter.chopper_voltage"),
        ("nasa-ballscrew", CHOPPER | {"inverter.chopper_voltage": 240.0},
         "inverter.chopper_voltage"),
        ("nasa-ballscrew", LINK | {"inverter.under_voltage_trip": 1e3},
         "inverter.under_voltage_trip"),
        ("nasa-ballscrew", LINK | {"inverter.over_voltage_trip": 100.0},
         "inverter.over_voltage_trip"),
    ],
)  # fmt: skip
def test_link_chopper_and_trips_are_checked_against_each_other(
    name: str, values: dict[str, Any], path: str
) -> None:
    """Before a run, by name, value and limit."""
    assert any(text.startswith(path) for text in findings(name, values)), findings(name, values)


def test_a_chopper_below_the_trip_is_not_warned_of() -> None:
    """What stands in order is no finding."""
    assert not findings("nasa-ballscrew", CHOPPER | {"inverter.over_voltage_trip": 500.0})


def test_the_current_cut_off_leaves_the_same_mean_in_a_stall() -> None:
    """A jammed gear: peaks at the cut-off, a fall through the diodes, many periods of rise."""
    seen = {}
    for fidelity in ("high", "low"):
        rec = elevon.simulate(
            elevon.Actuator.load("pisa-landing-gear"),
            duration=0.8,
            faults=["jam@screw=90 kN"],
            fidelity=fidelity,
            record="current_mean@1 kHz",
        )
        seen[fidelity] = late_half(rec, "current_mean")
    assert seen["low"] == pytest.approx(seen["high"], rel=0.02)


def late_half(rec: Any, name: str) -> float:
    """Mean of the later half."""
    values = rec[name].values
    return float(np.mean(values[len(values) // 2 :]))
