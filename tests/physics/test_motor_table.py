"""The published motor table of torino-rotary: whether it agrees with itself, and the model with it.

Static 5.0 N m at 2.55 A (+60 K), 6.0 N m at 3.15 A (+100 K); rated 2000 rpm, 5.3 N m, 3.0 A
(+100 K), 90 %, 380 V; thermal time constant 30 min; 121 V per 1000 rpm, line to line, rms, at 20 C.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import elevon

MOTOR = elevon.Actuator.load("torino-rotary")
AIR = 313.15  # IEC 60034-1: rises hold for air of 40 C
COLD = 293.15  # of the printed resistance
RATED = 2000 * math.pi / 30
EFFICIENCY, TORQUE, CURRENT, VOLTS = 0.90, 5.3, 3.0, 380.0
STATIC = ((5.0, 2.55, 60.0), (6.0, 3.15, 100.0))  # N m, A rms, K


def value(path: str) -> float:
    return MOTOR.parameters.value(path)


def copper(current: float, winding: float) -> float:
    """Three-phase heat [W] of an rms current at a winding temperature [K]."""
    warm = 1.0 + value("motor.temperature_coefficient") * (winding - COLD)
    return 3.0 * current**2 * value("motor.winding_resistance") * warm


def to_air(surface: float) -> float:
    """Heat from the surface to the air [W]."""
    area = value("thermal.area")
    radiated = 5.670374419e-8 * value("thermal.emissivity") * (surface**4 - AIR**4)
    return area * (value("thermal.convection") * (surface - AIR) + radiated)


def rise(current: float, seconds: float) -> float:
    """Rise of the winding [K] by an integration of its own, from cold."""
    capacity = value("thermal.winding_mass") * value("thermal.winding_heat")
    resistance, housing = value("thermal.winding_to_surface"), value("thermal.housing_capacity")

    def slope(_: float, x: np.ndarray) -> list[float]:
        through = (x[0] - x[1]) / resistance
        return [
            (copper(current, x[0]) - through) / capacity,
            (through - to_air(x[1])) / housing,
        ]

    done = solve_ivp(slope, (0.0, seconds), [AIR, AIR], method="LSODA", rtol=1e-9, atol=1e-9)
    return float(done.y[0, -1]) - AIR


@pytest.mark.parametrize(("torque", "current", "rise_k"), STATIC)
def test_both_static_points_are_steady_states(torque: float, current: float, rise_k: float) -> None:
    """The same heat comes from the copper, goes to the surface and leaves it."""
    heat = copper(current, AIR + rise_k)
    surface = AIR + rise_k - heat * value("thermal.winding_to_surface")
    assert to_air(surface) == pytest.approx(heat, rel=1e-4)


def test_the_time_constant_is_the_published_one() -> None:
    assert rise(3.15, 1800.0) / rise(3.15, 1e5) == pytest.approx(1.0 - math.exp(-1.0), abs=5e-4)


def test_the_rated_losses_agree_with_the_static_ones() -> None:
    """At +100 K the frame gives away what it does at standstill: 11 W are left for iron and air."""
    output = TORQUE * RATED
    whole = copper(3.15, AIR + 100.0)
    other = whole - copper(CURRENT, AIR + 100.0)
    assert other == pytest.approx(11.2, abs=0.05)
    assert output / (output + whole) == pytest.approx(EFFICIENCY, abs=0.005)


def test_no_single_torque_constant_gives_both_static_points() -> None:
    """5.0 N m takes 2.62 A of the warm constant, 2.7 % more than printed: 64 K, not 60."""
    (cool, less, _), (hot, more, _) = STATIC
    constant = math.sqrt(2.0) * 1.5 * value("motor.emf_constant")
    assert (cool / less) / (hot / more) == pytest.approx(1.029, abs=0.001)
    assert hot / more == pytest.approx(constant, rel=0.004)
    assert cool / constant == pytest.approx(2.618, abs=0.001)
    assert rise(cool / constant, 1e5) == pytest.approx(63.8, abs=0.1)
    assert rise(hot / constant, 1e5) == pytest.approx(99.3, abs=0.1)


def needed() -> float:
    """Amplitude of the phase voltage at the rated point [V], current in the q axis."""
    electric = value("motor.pole_pairs") * RATED
    amplitude = CURRENT * math.sqrt(2.0)
    resistance = copper(1.0, AIR + 100.0) / 3.0
    along = value("motor.emf_constant") * RATED + resistance * amplitude
    return math.hypot(along, electric * value("motor.winding_inductance") * amplitude)


def test_380_v_is_the_line_not_the_link() -> None:
    """The rated point needs 233 V a phase: more than a 380 V link has, less than a rectified line.

    Without a third harmonic a link gives half its volts to a phase, with it 1/sqrt(3).
    """
    assert needed() == pytest.approx(232.6, abs=0.1)
    assert needed() > VOLTS / math.sqrt(3.0)
    rectified = VOLTS * 3.0 * math.sqrt(2.0) / math.pi
    assert rectified == pytest.approx(513.2, abs=0.1)
    assert VOLTS / 2.0 < needed() < rectified / 2.0


def under_load(link: float) -> float:
    """Speed reached [rpm] at 2000 rpm commanded under 5.3 N m on the motor shaft, with PWM."""
    values = {
        "inverter.supply_voltage": link,
        "control.speed_limit": "3000 rpm",
        "friction.static": 0.0,
        "friction.dynamic": 0.0,
        "friction.viscous": 0.0,
        "motor.winding_temperature": AIR + 100.0,
        "stop.upper": 1e6,
        "stop.lower": -1e6,
        "drive.kind": "pwm",
    }
    scenario = elevon.Scenario.from_dict(
        {
            "duration": "1.5 s",
            "command": {"mode": "speed", "terms": [{"kind": "constant", "value": "2000 rpm"}]},
            "load": {"brake": {"terms": [{"kind": "constant", "value": "5.3 N m"}]}},
        }
    )
    run = elevon.simulate(
        MOTOR.with_values(values), scenario, fidelity="high", record="motor_speed@1 kHz"
    )
    return float(run.final["motor_speed"]) * 30.0 / math.pi


def test_the_rated_point_is_reached_on_the_rectified_line_alone() -> None:
    """On 380 V of link the load's current takes all the voltage there is, in the q axis."""
    assert under_load(513.2) == pytest.approx(2000.0, rel=0.005)
    constant = value("motor.emf_constant")
    current, resistance = 5.3 / (1.5 * constant), copper(1.0, AIR + 100.0) / 3.0
    across = value("motor.pole_pairs") * value("motor.winding_inductance") * current
    roots = np.roots(
        [
            constant**2 + across**2,
            2.0 * resistance * current * constant,
            (resistance * current) ** 2 - VOLTS**2 / 3.0,
        ]
    )
    assert under_load(VOLTS) == pytest.approx(max(roots) * 30.0 / math.pi, rel=2e-3)


@pytest.mark.parametrize(("torque", "current", "rise_k"), STATIC)
def test_the_model_stays_at_both_static_points(
    torque: float, current: float, rise_k: float
) -> None:
    """Seconds from the steady state nothing moves; an error of 1 % in the heat would show."""
    surface = AIR + rise_k - copper(current, AIR + rise_k) * value("thermal.winding_to_surface")
    shaft = current * math.sqrt(2.0) * 1.5 * value("motor.emf_constant")
    values = {
        "thermal.model": "dynamic",
        "thermal.ambient": AIR,
        "friction.static": 1e4,
        "friction.dynamic": 1e4,
        "drive.kind": "pwm",
    }
    scenario = elevon.Scenario.from_dict(
        {
            "duration": "20 s",
            "command": {"mode": "torque", "terms": [{"kind": "constant", "value": shaft}]},
            "initial": {"winding_temperature": AIR + rise_k, "surface_temperature": surface},
        }
    )
    run = elevon.simulate(
        MOTOR.with_values(values),
        scenario,
        fidelity="low",
        record="winding_temperature,surface_temperature,thermal_warning@1 Hz",
    )
    assert run["winding_temperature"].values[-1] - AIR == pytest.approx(rise_k, abs=0.05)
    assert run["surface_temperature"].values[-1] == pytest.approx(surface, abs=0.02)
    assert not run["thermal_warning"].values.any()
