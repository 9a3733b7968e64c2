"""A carrier's edges within a step: duties, dead time, diodes, counts at steps of 1 to 25 us."""

from __future__ import annotations

import math
from functools import cache
from typing import Any

import numpy as np
import pytest

import elevon
from tests.physics.rig import (
    FREE_SHAFT,
    LOCKED,
    MOTOR,
    PWM,
    SUPPLY,
    K,
    R,
    actuator,
    constant,
    make_scenario,
    run,
    term,
    values,
)

CARRIER = PWM["pwm.frequency"]
TORQUE = 4.0
CURRENT = TORQUE / (1.5 * K)
STEPS = (1e-6, 5e-6, 12.5e-6, 25e-6)
NAMES = "current_q,voltage_q_ref,voltage_a,motor_torque,leg_transitions"
#: Phase a carries I, b and c -I/2.
AT_90 = {"motor.electrical_offset": math.pi / 2}


def means(rec: Any, step: float, *names: str) -> list[float]:
    """Means over whole carrier periods of the second half."""
    late = np.flatnonzero(rec["current_q"].time > 0.05 - 1e-9)
    period = round(1.0 / CARRIER / step)
    kept = late[1 : 1 + (late.size - 1) // period * period]
    return [float(np.mean(rec[name].values[kept])) for name in names]


@cache
def locked(step: float, dead: float = 0.0, drop: float = 0.0) -> Any:
    """Torque command on a locked rotor, recorded at each step."""
    extra = {"inverter.dead_time": dead, "inverter.diode_drop": drop, "solver.step": step}
    return run(
        FREE_SHAFT | PWM | LOCKED | AT_90 | extra,
        duration=0.1,
        mode="torque",
        command=[constant(TORQUE)],
        record=f"{NAMES}@{round(1 / step)} Hz",
    )


@cache
def turning(step: float, dead: float) -> Any:
    """The same on a heavy rotor: the currents turn through whole periods."""
    extra = {"inverter.dead_time": dead, "solver.step": step, "motor.inertia": 10.0}
    return run(
        FREE_SHAFT | PWM | extra,
        duration=0.05 + math.tau / (20.0 * 4),
        mode="torque",
        command=[constant(TORQUE)],
        record=f"{NAMES}@{round(1 / step)} Hz",
        scenario={"initial": {"motor_speed": 20.0}},
    )


@pytest.mark.parametrize("step", STEPS)
def test_the_mean_voltage_is_the_set_point(step: float) -> None:
    """Locked and settled: set point v_q, mean phase voltage and R i agree; edges on whole steps
    were wrong by 0.1 V at 1 us and by 8 V at 12.5 us.
    """
    current, volts, phase = means(locked(step), step, "current_q", "voltage_q_ref", "voltage_a")
    assert current == pytest.approx(CURRENT, abs=1e-3)
    assert volts == pytest.approx(R * current, abs=7e-5)
    assert phase == pytest.approx(R * current, abs=7e-5)


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("dead", [1e-6, 4e-6])
def test_dead_time_costs_its_share_of_the_link_each_period(step: float, dead: float) -> None:
    """Every leg loses t_d f V against its current: 4/3 of it in phase a of a locked star with
    (+, -, -), in the mean over a turn (4/pi) t_d f V of the quadrature voltage.
    """
    lost = dead * CARRIER * SUPPLY
    for kind, share in (
        (lambda d: locked(step, d), 4.0 / 3.0),
        (lambda d: turning(step, d), 4.0 / math.pi),
    ):
        ideal, real = (means(kind(d), step, "voltage_q_ref")[0] for d in (0.0, dead))
        assert real - ideal == pytest.approx(share * lost, rel=0.01)


@pytest.mark.parametrize("step", [1e-6, 12.5e-6])
def test_diodes_conduct_for_the_dead_time_alone(step: float) -> None:
    """Each leg's diode drop counts for one dead time of two a period (the other dead time finds
    its leg where its current holds it, the diode conducting as well): 2 t_d f V_d against the
    current, 4/3 of it in phase a.
    """
    dead, drop = 4e-6, 20.0
    plain, lossy = (means(locked(step, dead, d), step, "voltage_q_ref")[0] for d in (0.0, drop))
    assert lossy - plain == pytest.approx(4.0 / 3.0 * 2.0 * dead * CARRIER * drop, rel=0.01)


@pytest.mark.parametrize("step", STEPS)
def test_each_leg_turns_twice_a_period(step: float) -> None:
    """Six transitions a carrier period at any step."""
    count = locked(step)["leg_transitions"].values
    periods = 0.05 * CARRIER
    assert count[-1] - count[count.size // 2] == pytest.approx(6.0 * periods, abs=6.0)


@pytest.mark.parametrize("step", [1e-6, 12.5e-6])
def test_the_energy_balance_closes(step: float) -> None:
    """What the supply gives is copper, bridge, shaft and what is stored."""
    names = [f"energy_{x}" for x in ("supply", "copper", "inverter", "load", "kinetic", "magnetic")]
    names += ["energy_friction", "energy_brake", "energy_impact"]
    rec = run(
        MOTOR
        | PWM
        | {
            "inverter.dead_time": 2e-6,
            "inverter.on_resistance": 0.1,
            "inverter.diode_drop": 1.0,
            "solver.step": step,
        },
        duration=0.2,
        mode="speed",
        command=[constant(40.0)],
        record=",".join(names) + "@1 kHz",
        scenario={"load": {"brake": {"terms": [constant(2.0)]}}},
    )
    given, *taken = values(rec, *names)
    assert given[-1] > 5.0
    # What the sampled speed makes of a step's work is of first order in the step.
    assert sum(x[-1] for x in taken) == pytest.approx(given[-1], rel=1e-4 * max(1.0, step / 1e-6))


@pytest.mark.parametrize("fault", ["open_switch", "short"])
def test_faults_converge_with_the_step(fault: str) -> None:
    """A switch that stays open (its leg's current ends with a step), and missing turns: the mean
    torque at 12.5 us is that at 1 us.
    """
    place, severity = {"open_switch": ("inverter.a_high", 1), "short": ("motor.phase_a", 0.2)}[
        fault
    ]

    def torque(step: float) -> float:
        rec = run(
            FREE_SHAFT | PWM | {"motor.inertia": 10.0, "solver.step": step},
            duration=0.2,
            mode="torque",
            command=[constant(TORQUE)],
            record="motor_torque@40 kHz",
            scenario={
                "initial": {"motor_speed": 50.0},
                "fault": [{"kind": fault, "place": place, "severity": severity}],
            },
        )
        return float(
            np.mean(rec["motor_torque"].values[rec["motor_torque"].time > 0.2 - math.tau / 50])
        )

    assert torque(12.5e-6) == pytest.approx(torque(1e-6), rel=5e-3)


def test_without_a_tick_the_derivative_filter_takes_long_steps() -> None:
    """Its update is exact: steps of 12.5 us pass its pole at 10 us, the motion is that of 1 us."""

    def motion(step: float) -> np.ndarray:
        rec = run(
            MOTOR
            | PWM
            | {
                "control.derivative_time": 0.01,
                "control.derivative_filter": 1000.0,
                "solver.step": step,
            },
            duration=0.3,
            record="output_position@1 kHz",
            command=[term("sine", amplitude="5 deg", frequency="3 Hz")],
        )
        return np.asarray(rec["output_position"].values)

    fine, coarse = motion(1e-6), motion(12.5e-6)
    assert np.max(np.abs(coarse - fine)) < 2e-3 * np.max(np.abs(fine))


def test_a_step_beyond_half_a_carrier_period_is_refused() -> None:
    """Three edges of a leg would fall into it."""
    slow = {"solver.step": 125e-6, "pwm.frequency": 8000.0}
    with pytest.raises(elevon.ElevonError, match="carrier: half its period"):
        elevon.simulate(
            actuator(MOTOR | PWM | slow), make_scenario(duration=0.01), record=["current_q@1 kHz"]
        )
