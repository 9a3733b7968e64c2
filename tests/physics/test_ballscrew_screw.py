"""Screw, spall and load side of the ballscrew actuator against closed forms."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import constant, run, term

NAME = "nasa-ballscrew"
LEAD = 0.010 / (2 * math.pi)
#: Stops far away.
AFAR = {"stop.upper": 10.0, "stop.lower": -10.0}
#: The motor is turned by torques on its shaft; nothing rubs but what a test adds.
FREE = {
    "drive.kind": "off", "friction.static": 0.0, "friction.dynamic": 0.0, "friction.viscous": 0.0,
    "screw.preload": 0.0, "load.friction": 0.0, "load.damping": 0.0, "thermal.model": "off",
    "backlash.model": "operator", "backlash.total": 0.0,
}  # fmt: skip
ROTOR = 102e-4 + 3.2e-4 + 60.0 * LEAD**2


def eta_of(mu: float, aiding: bool = False) -> float:
    """Inclined plane with the lead angle of 10 mm on 32 mm."""
    t = 0.010 / (math.pi * 0.032)
    return (1 - mu / t) / (1 + mu * t) if aiding else (1 - mu * t) / (1 + mu / t)


def mu_of(eta: float, aiding: bool = False) -> float:
    """The friction coefficient behind an efficiency."""
    t = 0.010 / (math.pi * 0.032)
    return (1 - eta) * t / (1 + eta * t * t) if aiding else (1 - eta) * t / (eta + t * t)


def free(
    values: dict[str, Any], load: float, speed: float, duration: float = 0.02, **options: Any
) -> Any:
    """The shaft turns at `speed` against `load` N at the ram, undriven."""
    return run(
        FREE | values,
        duration=duration,
        record="motor_speed,friction_torque@1 kHz"
        if options
        else "motor_speed,motor_position,"
        "friction_torque,screw_efficiency,screw_efficiency_aiding,spall_torque,ram_position@50 kHz",
        scenario={
            "load": {"output": {"terms": [constant(load)]}},
            "initial": {"motor_speed": speed},
        },
        name=NAME,
        **options,
    )


@pytest.mark.parametrize(("load", "speed"), [(4000.0, 30.0), (-4000.0, 30.0), (4000.0, -30.0)])
def test_deceleration_follows_the_efficiencies(load: float, speed: float) -> None:
    """F r / eta opposes, F r eta' aids; the rest accelerates rotor, screw and mass."""
    rec = free({}, load, speed, 0.01)
    opposes = load * speed > 0
    torque = -load * LEAD * (1 / 0.9 if opposes else 0.889)
    expected = speed + torque / ROTOR * 0.01
    assert rec.final["motor_speed"] == pytest.approx(expected, rel=1e-6)


@pytest.mark.signature("return_jam", "screw")
@pytest.mark.parametrize("blocked", [1, 2, 3, 4])
def test_blocked_circuits_lower_the_efficiency(blocked: int) -> None:
    """mu grows by b/n of the way to sliding; the table of docs/explanation/theory/ballscrew.md."""
    fault = {"kind": "return_jam", "place": "screw.return_channel", "severity": blocked}
    rec = run(FREE, duration=1e-3, record="screw_efficiency,screw_efficiency_aiding@1 kHz",
              scenario={"fault": [fault]}, name=NAME)  # fmt: skip
    for aiding, name in ((False, "screw_efficiency"), (True, "screw_efficiency_aiding")):
        healthy = mu_of(0.889 if aiding else 0.9, aiding)
        expected = eta_of(healthy + blocked / 4 * (0.10 - healthy), aiding)
        assert rec.final[name] == pytest.approx(expected, rel=1e-12)


@pytest.mark.signature("lubrication_loss", "screw")
@pytest.mark.parametrize("lost", [0.3, 1.0])
def test_lost_lubricant_leaves_dry_asperities(lost: float) -> None:
    """Their share is exp(-3 s) of a film s, 0 of a whole one; at the end the nut slides dry."""
    fault = {"kind": "lubrication_loss", "place": "screw", "severity": lost}
    rec = run(FREE, duration=1e-3, record="screw_efficiency@1 kHz",
              scenario={"fault": [fault]}, name=NAME)  # fmt: skip
    dry = elevon.Actuator.load(NAME).parameters.value("screw.friction_dry")
    share = (math.exp(-3 * (1 - lost)) - math.exp(-3)) / (1 - math.exp(-3))
    expected = eta_of(mu_of(0.9) + share * (dry - mu_of(0.9)))
    assert rec.final["screw_efficiency"] == pytest.approx(expected, rel=1e-12)


@pytest.mark.signature("contamination", "screw")
@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_debris_scatters_the_dry_friction(fidelity: str) -> None:
    """The friction coefficient gains half the mass fraction; its deviation is the root of it."""
    debris = 0.01
    fault = {"kind": "contamination", "place": "screw", "severity": debris}
    values = FREE | {"friction.static": 0.3, "friction.dynamic": 0.3, "motor.inertia": 1e6}
    rec = run(values, duration=1.0, record="friction_torque,screw_efficiency@1 kHz",
              fidelity=fidelity, seed=3, name=NAME,
              scenario={"initial": {"motor_speed": 20.0}, "fault": [fault]})  # fmt: skip
    torque = rec["friction_torque"].values[1:]
    assert rec.final["screw_efficiency"] == pytest.approx(eta_of(mu_of(0.9) + 0.5 * debris))
    # The deviation of n draws is known to 1/sqrt(2 n); four of them.
    draws = len(np.unique(torque))
    assert draws > 100
    assert torque.std() / torque.mean() == pytest.approx(
        math.sqrt(debris), rel=4 / math.sqrt(2 * draws)
    )


def test_preload_rubs_by_its_two_halves() -> None:
    """T = F_pr r (1/eta - eta'), 0.155 N m for 437.5 N, on a shaft without load."""
    rec = free({"screw.preload": 437.5, "friction.static": 1e-9}, 0.0, 30.0)
    expected = 437.5 * LEAD * (1 / 0.9 - 0.889)
    assert rec["friction_torque"].values == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize("split", [0.0, 0.2, 0.38, 0.7, 1.0])
def test_a_load_relieves_one_half_of_a_preloaded_nut(split: float, fidelity: str) -> None:
    """Halves of (1 +- u)^(3/2) preloads (Hertz): their difference is the load, each rubs as borne.

    At rest with itself both bear 437.5 N; from 2^(3/2) preloads on one bears all.
    """
    bearing, relieved = (437.5 * (1 + sign * split) ** 1.5 for sign in (1, -1))
    load = bearing - relieved
    values = {"screw.preload": 437.5, "friction.static": 1e-9}
    rec = free(values, load, 30.0, 2e-3, fidelity=fidelity)
    expected = LEAD * ((1 / 0.9 - 1) * bearing + (1 - 0.889) * relieved)
    assert rec["friction_torque"].values[0] == pytest.approx(expected, rel=1e-4)
    rec = free(values, -load, 30.0, 2e-3, fidelity=fidelity)
    expected = LEAD * ((1 - 0.889) * bearing + (1 / 0.9 - 1) * relieved)
    assert rec["friction_torque"].values[0] == pytest.approx(expected, rel=1e-4)


@pytest.mark.parametrize("load", [500.0, 8500.0])
def test_preload_drag_and_load_friction_do_not_add(load: float) -> None:
    """500 N: 0.163 instead of 0.243 N m; 8500 N: the load's alone."""
    rec = free({"screw.preload": 437.5, "friction.static": 1e-9}, load, 30.0)
    alone = LEAD * (1 / 0.9 - 1) * load
    expected = {500.0: 0.1633, 8500.0: alone}[load]
    assert rec["friction_torque"].values[0] == pytest.approx(expected, rel=2e-4)


def test_the_nut_is_heated_by_its_friction() -> None:
    """T = T_a + P R (1 - exp(-t/(R C))), P half of the friction's power; nothing while it rests."""
    values = {"thermal.model": "dynamic", "thermal.ambient": 300.0, "motor.inertia": 1e6,
              "screw.nut_capacity": 2.0, "screw.nut_to_air": 1.5}  # fmt: skip
    rec = run(
        FREE | values, duration=2.0, record="nut_temperature,heat_nut,winding_temperature@10 Hz",
        scenario={"load": {"output": {"terms": [constant(4000.0)]}},
                  "initial": {"motor_speed": 10.0}},
        name=NAME,
    )  # fmt: skip
    power = 0.5 * LEAD * (1 / 0.9 - 1) * 4000.0 * 10.0
    assert rec.final["heat_nut"] == pytest.approx(power, rel=1e-3)
    rise = power * 1.5 * (1 - np.exp(-rec["nut_temperature"].time / 3.0))
    assert rec["nut_temperature"].values == pytest.approx(300.0 + rise, abs=0.02 * power)
    assert rec["winding_temperature"].values[0] == pytest.approx(300.0)


def test_a_return_jam_shows_in_the_nuts_temperature() -> None:
    """Twice the friction coefficient and more: the nut warms as the efficiency says."""
    warm = {}
    for fault in ([], [{"kind": "return_jam", "place": "screw.return_channel", "severity": 2}]):
        rec = run(
            {}, duration=20.0, record="nut_temperature@1 Hz", fidelity="low", name=NAME,
            command=[term("sine", amplitude="50 mm", frequency="0.19 Hz")],
            scenario={"load": {"output": {"terms": [constant(4500.0)]}}, "fault": fault},
        )  # fmt: skip
        warm[len(fault)] = rec.final["nut_temperature"] - 293.15
    # Mean of driving and aiding: (1/eta - eta') of 0.222 and 1.125.
    assert warm[1] / warm[0] == pytest.approx(1.125 / 0.222, rel=0.05)


@pytest.mark.parametrize(("place", "passes"), [("groove", 8.552), ("nut", 6.448), ("ball", 4.940)])
def test_the_accelerometer_shows_the_passes_through_its_resonance(
    place: str, passes: float
) -> None:
    """Far below the resonance the housing follows the force: lines at multiples of the passes."""
    rec = run(
        FREE | {f"screw.spall_{place}": 2e-3, "motor.inertia": 1e6, "vibration.model": "resonance"},
        duration=1.0, record="vibration,motor_position@20 kHz", name=NAME,
        scenario={"load": {"output": {"terms": [constant(4500.0)]}},
                  "initial": {"motor_speed": 20.0}},
    )  # fmt: skip
    angle, vibration = rec["motor_position"].values, rec["vibration"].values
    window = np.hanning(angle.size)
    lines = np.arange(4.0, 40.0, 0.05)
    size = np.array([abs(np.mean(vibration * window * np.exp(-1j * k * angle))) for k in lines])
    peak = lines[int(np.argmax(size))]
    assert abs(peak / passes - round(peak / passes)) < 0.03


def shaken(values: dict[str, Any], speed: float, **options: Any) -> Any:
    """An accelerometer on a shaft that turns freely 30 times."""
    return run(
        FREE | {"motor.inertia": 1e6, "vibration.model": "resonance"} | AFAR | values,
        duration=30 * 2 * math.pi / speed, record="vibration,motor_position,motor_torque@20 kHz",
        name=NAME, scenario={"initial": {"motor_speed": speed}}, **options,
    )  # fmt: skip


def lines(rec: Any, orders: list[float]) -> list[float]:
    """Amplitude of the accelerometer at orders of the shaft, from the fifth turn on."""
    late = rec["motor_position"].values > 5 * 2 * math.pi
    angle, vibration = rec["motor_position"].values[late], rec["vibration"].values[late]
    window = np.hanning(angle.size)
    return [
        2.0 * abs(np.sum(window * vibration * np.exp(-1j * k * angle))) / window.sum()
        for k in orders
    ]


def answered(force: float, frequency: float) -> float:
    """Acceleration of the mode, 5 kg and 1200 Hz with 5 % damping, under a sine of the force."""
    r = 2 * math.pi * frequency / (2 * math.pi * 1200.0)
    return force / 5.0 * r**2 / math.hypot(1 - r**2, 0.1 * r)


def test_the_accelerometer_shows_an_unbalance_once_a_turn() -> None:
    """The centrifugal force J_x 22.94 1/m w^2 through the mode, and nothing between the orders."""
    speed = 100.0
    once, between = lines(shaken({"motor.unbalance_inertia": 7.27e-4}, speed), [1.0, 1.5])
    force = 7.27e-4 * 22.94 * speed**2
    assert once == pytest.approx(answered(force, speed / (2 * math.pi)), rel=0.01)
    assert between < 0.01 * once


def test_the_accelerometer_shows_the_mesh_of_a_gear() -> None:
    """`gear_ripple` times the motor's torque at the order of the teeth."""
    teeth, speed = 17.0, 60.0
    values = {"vibration.gear_teeth": teeth, "vibration.gear_ripple": 30.0, "motor.inertia": 1e3}
    driven = {"drive.kind": "hysteresis"}
    rec = shaken(values | driven, speed, command=[constant(2.0)], mode="torque")
    torque = float(np.mean(rec["motor_torque"].values))
    mesh, between = lines(rec, [teeth, teeth + 0.5])
    assert torque == pytest.approx(2.0, rel=0.05)
    assert mesh == pytest.approx(answered(30.0 * torque, teeth * speed / (2 * math.pi)), rel=0.01)
    assert between < 0.02 * mesh


@pytest.mark.parametrize(
    ("values", "once"),
    [
        ({"motor.eccentricity_dynamic": 0.97}, 200.0 * math.hypot(1.0, 0.2)),
        ({"motor.eccentricity_static": 0.97}, 0.0),
    ],
)
def test_the_accelerometer_shows_a_rub_that_turns_with_the_shaft(
    values: dict[str, float], once: float
) -> None:
    """sqrt(1 + mu^2) N once a turn under a dynamic eccentricity; a static one presses one way."""
    speed = 100.0
    line = lines(shaken(values, speed), [1.0])[0]
    full = answered(200.0 * math.hypot(1.0, 0.2), speed / (2 * math.pi))
    assert line == pytest.approx(answered(once, speed / (2 * math.pi)), rel=0.01, abs=1e-3 * full)


def test_starved_grease_drags_less_and_rubs_more() -> None:
    """Viscous torque times (1 - s); the efficiency falls as the film thins."""
    values = {"friction.viscous": 0.002}
    lost = free(values | {"screw.lubricant_lost": 0.5}, 0.0, 40.0)
    assert lost["friction_torque"].values[0] == pytest.approx(0.5 * 0.002 * 40.0, rel=1e-9)
    share = (math.exp(-1.5) - math.exp(-3)) / (1 - math.exp(-3))
    mu = mu_of(0.9)
    assert lost.final["screw_efficiency"] == pytest.approx(eta_of(mu + share * (0.05 - mu)))


def spalled(length: float, load: float, place: str = "groove", **more: Any) -> Any:
    """Slow turning over a spall, undriven, the load held by a torque on the shaft."""
    return free({f"screw.spall_{place}": length, "motor.inertia": 1e6} | more, load, 20.0, 1.0)


@pytest.mark.signature("spall", "screw")
@pytest.mark.parametrize(("place", "passes"), [("groove", 8.552), ("nut", 6.448), ("ball", 4.940)])
def test_spall_strikes_at_the_ball_passes(place: str, passes: float) -> None:
    """The strongest line about the first pass stands at the passes per turn of the geometry."""
    rec = spalled(2e-3, 4500.0, place)
    # Means of ten samples: 5 kHz stand far above some thirty passes a second.
    angle, torque = (rec[n].values[1:].reshape(-1, 10).mean(axis=1)
                     for n in ("motor_position", "spall_torque"))  # fmt: skip
    lines = np.arange(0.6 * passes, 1.5 * passes, 0.01)
    size = [abs(np.mean(torque * np.hanning(angle.size) * np.exp(-1j * k * angle))) for k in lines]
    assert lines[int(np.argmax(size))] == pytest.approx(passes, abs=0.03)


def test_spall_torque_is_conservative_and_grows_with_size_and_load() -> None:
    """A passage gives back what it takes; deeper chord and more force, more torque."""
    peak = {}
    for length, load in ((1e-3, 4500.0), (2e-3, 4500.0), (2e-3, 8500.0)):
        rec = spalled(length, load)
        torque = rec["spall_torque"].values
        assert abs(np.mean(torque)) < 0.02 * np.max(np.abs(torque))
        peak[length, load] = float(np.max(np.abs(torque)))
    # E ~ w^2 while the chord is shallower than the spall, and its slope ~ 1/w.
    assert peak[2e-3, 4500.0] / peak[1e-3, 4500.0] == pytest.approx(2.0, rel=0.05)
    assert peak[2e-3, 8500.0] / peak[2e-3, 4500.0] == pytest.approx(8500 / 4500, rel=1e-3)


def test_groove_spall_is_felt_only_under_the_nut() -> None:
    """25 mm either side of its position."""
    rec = spalled(2e-3, 4500.0, **{"screw.spall_position": "0.04"})
    felt = np.abs(rec["spall_torque"].values) > 0
    assert not np.any(felt[rec["ram_position"].values < 0.015])
    assert np.any(felt[rec["ram_position"].values > 0.0155])


@pytest.mark.parametrize(
    ("values", "words"),
    [
        ({"screw.blocked_circuits": 1.5}, ["screw.blocked_circuits", "1 or 2"]),
        ({"screw.blocked_circuits": 5}, ["screw.blocked_circuits", "4"]),
        ({"screw.ball_diameter": "40 mm"}, ["screw.ball_diameter", "0.04", "0.032"]),
        ({"screw.efficiency_aiding": 0.95}, ["screw.efficiency_aiding", "0.95", "0.9"]),
        ({"screw.lead": 0.0}, ["screw.lead"]),
        ({"load.mass": 0.0}, ["load.mass"]),
        ({"stop.upper": "-120 mm"}, ["stop.lower", "stop.upper", " m"]),
    ],
)
def test_impossible_screws_are_refused(values: dict[str, Any], words: list[str]) -> None:
    """Path, value and limit are in the message."""
    with pytest.raises(elevon.InputError) as caught:
        run(values, duration=1e-3, record="output_position@1 kHz", name=NAME)
    for word in words:
        assert word in str(caught.value)


@pytest.mark.parametrize(("severity", "words"), [(1.5, "1 or 2"), (5, "of the 4")])
def test_a_jam_blocks_whole_circuits_that_exist(severity: float, words: str) -> None:
    """Refused with the two nearest whole numbers, or the number there is."""
    fault = {"kind": "return_jam", "place": "screw.return_channel", "severity": severity}
    with pytest.raises(elevon.InputError, match=words):
        run(
            {},
            duration=1e-3,
            record="output_position@1 kHz",
            scenario={"fault": [fault]},
            name=NAME,
        )


@pytest.mark.signature("adapter_gap", "adapter")
def test_gap_of_the_adapter_is_lost_motion_at_the_load() -> None:
    """The load lags the ram by half the gap on either side, plus the joint's deflection."""
    fault = {"kind": "adapter_gap", "place": "adapter", "severity": "1 mm"}
    rec = run(
        {},
        duration=2.0,
        command=[term("triangle", amplitude="20 mm", frequency="1 Hz")],
        record="ram_position,output_position,joint_force@5 kHz",
        scenario={"fault": [fault]},
        name=NAME,
    )
    late = rec["ram_position"].time > 1.0
    lag = (rec["ram_position"].values - rec["output_position"].values)[late]
    pressed = rec["joint_force"].values[late]
    beyond = np.abs(lag) - 0.51e-3
    assert np.max(beyond) == pytest.approx(np.max(np.abs(pressed)) / 5e7, abs=2e-5)
    # A steady stroke presses with guide friction and damping alone.
    assert np.median(np.abs(lag)) == pytest.approx(0.51e-3, abs=5e-6)
