"""Cogging, bearings, magnetic pull and teeth on the shaft of a servo, in both fidelities."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tests.physics.rig import FREE_SHAFT, INERTIA, RATIO, constant, run, values

FIDELITIES = ["high", "low"]
BOTH = pytest.mark.parametrize("fidelity", FIDELITIES)
# The defaults of the bearing and of the pinion.
BALLS, BALL, PITCH, TEETH = 8, 5.95e-3, 25e-3, 20
ORDERS = {
    "outer": BALLS / 2 * (1 - BALL / PITCH),
    "inner": BALLS / 2 * (1 + BALL / PITCH),
    "ball": PITCH / BALL * (1 - (BALL / PITCH) ** 2),
    "cage": (1 - BALL / PITCH) / 2,
}


def fault(kind: str, place: str, severity: float, **attributes: Any) -> dict[str, Any]:
    """A scenario with one fault."""
    return {"fault": [{"kind": kind, "place": place, "severity": severity, **attributes}]}


def coasting(
    settings: dict[str, Any],
    scenario: dict[str, Any],
    fidelity: str,
    *,
    speed: float,
    duration: float,
    record: str,
) -> Any:
    """A free shaft that starts at a speed."""
    initial = {"initial": {"motor_speed": speed}}
    return run(
        FREE_SHAFT | settings,
        duration=duration,
        record=record,
        scenario=scenario | initial,
        fidelity=fidelity,
    )


def spectrum(angle: np.ndarray, signal: np.ndarray, turns: int) -> tuple[np.ndarray, np.ndarray]:
    """Amplitude over the order of the shaft, from whole turns resampled in equal angles."""
    grid = np.arange(turns * 512) * 2 * math.pi / 512
    even = np.interp(grid, angle, signal)
    amplitude = 2 * np.abs(np.fft.rfft(even - even.mean())) / len(even)
    return np.arange(len(amplitude)) / turns, amplitude


@BOTH
def test_cogging_swings_the_rotor_at_its_own_frequency(fidelity: str) -> None:
    """A small swing about a place of rest: w^2 = A N / J; its energy stays."""
    amplitude, cycles = 0.05, 24
    omega = math.sqrt(amplitude * cycles / INERTIA)
    method = {"solver.method": "semi_implicit"} if fidelity == "high" else {}
    rec = run(
        FREE_SHAFT | {"motor.cogging_torque": amplitude} | method,
        duration=4 * 2 * math.pi / omega,
        record="motor_position,cogging_torque@5 kHz"
        if fidelity == "high"
        else "motor_position,cogging_torque@2 kHz",
        scenario={"initial": {"motor_position": 1e-3}},
        fidelity=fidelity,
    )
    time, angle, torque = (
        rec["motor_position"].time,
        *values(rec, "motor_position", "cogging_torque"),
    )
    assert torque == pytest.approx(-amplitude * np.sin(cycles * angle), abs=1e-15)
    falls = np.flatnonzero((angle[:-1] > 0) & (angle[1:] <= 0))
    crossings = time[falls] + np.diff(time)[falls] * angle[falls] / (
        angle[falls] - angle[falls + 1]
    )
    # The friction rule stops a reversing rotor for a step: twice half a step a period.
    step = 1e-6 if fidelity == "high" else 5e-4
    assert np.diff(crossings) == pytest.approx(2 * math.pi / omega, rel=1e-4, abs=step)
    assert np.max(angle[-len(angle) // 4 :]) == pytest.approx(1e-3, rel=0.01)


def test_cogging_does_no_work_over_a_turn() -> None:
    """It takes and gives: the energy account closes, and the load's share returns to zero."""
    names = "energy_load,energy_kinetic,motor_position"
    rec = coasting(
        {"motor.cogging_torque": 0.2},
        {},
        "high",
        speed=20.0,
        duration=0.4,
        record=f"{names}@10 kHz",
    )
    load, kinetic, angle = values(rec, *names.split(","))
    start = 0.5 * INERTIA * 20.0**2
    assert load + kinetic == pytest.approx(start, rel=1e-5)
    assert load == pytest.approx(0.2 / 24 * (1 - np.cos(24 * angle)), abs=2e-4)


@pytest.mark.signature("bearing", "bearing")
@pytest.mark.parametrize("place", ["outer", "inner", "ball"])
@BOTH
def test_bearing_defect_shows_at_its_shaft_order(fidelity: str, place: str) -> None:
    """The speed of a coasting shaft ripples at the order of the geometry, and it slows down."""
    turns = 60
    rec = coasting(
        {},
        fault("bearing", f"bearing.{place}", 2e-3),
        fidelity,
        speed=60.0,
        duration=8.0,
        record="motor_position,motor_speed@2 kHz",
    )
    angle, speed = values(rec, "motor_position", "motor_speed")
    assert angle[-1] > turns * 2 * math.pi
    order, amplitude = spectrum(
        angle, speed - np.polyval(np.polyfit(angle, speed, 3), angle), turns
    )
    searched = order > 1.5
    found = order[searched][np.argmax(amplitude[searched])]
    nearest = round(found / ORDERS[place])
    assert nearest in (1, 2)
    assert found == pytest.approx(nearest * ORDERS[place], abs=1.5 / turns)
    assert speed[-1] < 60.0


@BOTH
def test_a_worn_cage_rubs_once_a_turn_of_the_cage(fidelity: str) -> None:
    """J (w0^2 - w^2)/2 = D/2 (theta + sin(c theta)/c): half the drag on average, modulated by c."""
    drag, order = 0.02, ORDERS["cage"]
    rec = coasting(
        {},
        fault("bearing", "bearing.cage", drag),
        fidelity,
        speed=60.0,
        duration=2.0,
        record="motor_position,motor_speed,friction_torque@2 kHz",
    )
    angle, speed, friction = values(rec, "motor_position", "motor_speed", "friction_torque")
    lost = 0.5 * INERTIA * (60.0**2 - speed**2)
    step = 1e-6 if fidelity == "high" else 5e-4
    expected = 0.5 * drag * (angle + np.sin(order * angle) / order)
    assert lost == pytest.approx(expected, rel=1e-5, abs=drag * 60.0 * step)
    if fidelity == "high":
        rubbed = 0.5 * drag * (1 + np.cos(order * angle))
        assert friction == pytest.approx(rubbed, abs=1e-12)


@BOTH
def test_magnetic_pull_rubs_in_the_bearing(fidelity: str) -> None:
    """Half of mu K e d_i brakes the shaft; without the pull an eccentric rotor does not."""
    rubbing = {"motor.magnetic_pull": 490.0, "bearing.friction_coefficient": 0.02}
    expected = 0.5 * 0.02 * 490.0 * 0.2 * 0.015 / INERTIA
    for settings, slowed in (({}, 0.0), (rubbing, expected)):
        rec = coasting(
            settings | {"motor.eccentricity_static": 0.2},
            {},
            fidelity,
            speed=20.0,
            duration=0.5,
            record="motor_speed@1 kHz",
        )
        assert 20.0 - rec.final["motor_speed"] == pytest.approx(0.5 * slowed, rel=1e-3, abs=1e-9)


@BOTH
@pytest.mark.parametrize(
    ("settings", "depth"),
    [
        ({"motor.eccentricity_dynamic": 0.94}, 0.0),
        ({"motor.eccentricity_dynamic": 0.97}, 0.02),
        ({"motor.eccentricity_static": 0.6, "motor.rub_filled": 0.37}, 0.02),
    ],
)
def test_a_closed_gap_brakes_the_shaft(
    fidelity: str, settings: dict[str, float], depth: float
) -> None:
    """Mu K (e + f - c) R, at any angle: the same whether it stands still or turns."""
    rec = coasting(settings, {}, fidelity, speed=20.0, duration=0.05, record="rub_force@1 kHz")
    torque = 0.2 * 1e4 * depth * 0.016
    assert values(rec, "rub_force")[0] == pytest.approx(1e4 * depth, abs=1e-9)
    slowed = 20.0 - rec.final["motor_speed"]
    assert slowed == pytest.approx(0.05 * torque / INERTIA, rel=1e-3, abs=1e-12)


@pytest.mark.signature("stator_rub", "motor")
@BOTH
def test_stator_rub_brakes_once_a_turn(fidelity: str) -> None:
    """What fills the gap lets static and dynamic eccentricity meet: one contact a turn.

    It lasts while |e| > c - f, for the share arccos((c'^2 - a^2 - b^2)/(2 a b))/pi of the turn.
    """
    a, b, filled = 0.2, 0.15, 0.65
    rec = coasting(
        {"motor.eccentricity_static": a, "motor.eccentricity_dynamic": b, "motor.inertia": 1e3},
        fault("stator_rub", "motor", filled),
        fidelity,
        speed=2 * math.pi,
        duration=4.0,
        record="rub_force,motor_position@2 kHz",
    )
    force, angle = values(rec, "rub_force", "motor_position")
    closed = 0.95 - filled
    share = math.acos((closed**2 - a**2 - b**2) / (2 * a * b)) / math.pi
    assert np.mean(force > 0.0) == pytest.approx(share, abs=2e-3)
    assert np.count_nonzero((force[1:] > 0.0) & (force[:-1] == 0.0)) == 4
    exact = np.hypot(a + b * np.cos(angle), b * np.sin(angle)) - closed
    assert force == pytest.approx(1e4 * np.maximum(exact, 0.0), abs=1e-6)
    assert [label["severity"] for label in rec.labels] == [filled]


@pytest.mark.signature("tooth_wear", "gear")
@BOTH
def test_tooth_wear_opens_the_backlash_over_each_mesh(fidelity: str) -> None:
    """Pushed forwards, the output lags by half the backlash and the wear's sin^2 of the mesh."""
    backlash, wear = 1e-3, 4e-4
    rec = coasting(
        {"backlash.total": backlash},
        fault("tooth_wear", "gear", wear),
        fidelity,
        speed=20.0,
        duration=1.0,
        record="motor_position,output_position@2 kHz",
    )
    motor, output = values(rec, "motor_position", "output_position")
    gone = motor > 0.5
    lag = motor / RATIO - output
    half = 0.5 * backlash + 0.5 * wear * np.sin(TEETH * motor / 2) ** 2
    assert lag[gone] == pytest.approx(half[gone], abs=1e-12)


@BOTH
def test_tooth_wear_ripples_the_torque_at_the_mesh_under_load(fidelity: str) -> None:
    """|T_output| dh/dtheta: the load's torque on the shaft varies at the order of the teeth."""
    load, wear = 50.0, 4e-4
    rec = coasting(
        {},
        {**fault("tooth_wear", "gear", wear), "load": {"output": {"terms": [constant(load)]}}},
        fidelity,
        speed=60.0,
        duration=0.3,
        record="motor_position,tooth_torque@2 kHz",
    )
    motor, torque = values(rec, "motor_position", "tooth_torque")
    slope = 0.25 * wear * TEETH * np.sin(TEETH * motor)
    assert torque == pytest.approx(load * slope, abs=1e-9)


@pytest.mark.signature("chipped_tooth", "gear")
@BOTH
def test_chipped_tooth_opens_the_backlash_once_a_turn(fidelity: str) -> None:
    """The lag is the backlash's but while the chipped tooth carries: a cos^2 over its mesh."""
    backlash, chip, angle = 1e-3, 2e-3, 1.0
    rec = coasting(
        {"backlash.total": backlash},
        fault("chipped_tooth", "gear", chip, angle=angle),
        fidelity,
        speed=20.0,
        duration=1.0,
        record="motor_position,output_position@2 kHz",
    )
    motor, output = values(rec, "motor_position", "output_position")
    lag = (motor / RATIO - output)[motor > 0.5]
    turned = (motor[motor > 0.5] - angle + math.pi) % (2 * math.pi) - math.pi
    away = np.abs(turned) > 2 * math.pi / TEETH
    assert lag[away] == pytest.approx(0.5 * backlash, abs=1e-12)
    opened = [
        lag[(motor[motor > 0.5] > k) & (motor[motor > 0.5] < k + 6)].max() for k in (1, 7, 13)
    ]
    assert opened == pytest.approx([0.5 * backlash + 0.5 * chip] * 3, rel=0.05)


@pytest.mark.parametrize("name", ["torino-rotary", "nasa-ballscrew"])
@pytest.mark.parametrize(
    ("kind", "place", "severity", "signal"),
    [
        ("bearing", "bearing.outer", 2e-3, "bearing_torque"),
        ("bearing", "bearing.cage", 0.05, "friction_torque"),
        ("tooth_wear", "gear", 1e-4, "tooth_torque"),
        ("chipped_tooth", "gear", 1e-4, "tooth_torque"),
    ],
)
def test_both_actuators_carry_them_under_load(
    name: str, kind: str, place: str, severity: float, signal: str
) -> None:
    """A turning shaft under load: the torque is there, of one size in both
    fidelities, and what rubs moves the final angle the same way.
    """
    load = 20.0 if name == "torino-rotary" else 500.0
    sizes, moved = [], []
    for fidelity in FIDELITIES:
        finals = []
        for faults in ({}, fault(kind, place, severity)):
            rec = run(
                {
                    "drive.kind": "off",
                    "friction.static": 0.0,
                    "friction.dynamic": 0.0,
                    "backlash.model": "operator",
                },
                name=name,
                duration=0.5,
                record=f"{signal},motor_position@2 kHz",
                scenario=faults
                | {
                    "load": {"output": {"terms": [constant(-load)]}},
                    "initial": {"motor_speed": 40.0},
                },
                fidelity=fidelity,
            )
            finals.append(rec)
        added = finals[1][signal].values[1:] - finals[0][signal].values[1:]
        sizes.append(float(np.mean(np.abs(added))))
        moved.append(finals[1].final["motor_position"] - finals[0].final["motor_position"])
    assert sizes[0] > 0
    assert sizes[1] == pytest.approx(sizes[0], rel=0.25)
    if kind == "bearing":
        assert moved[0] * moved[1] > 0
