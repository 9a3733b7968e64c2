"""One PID from the position error to the torque, beside the linear loop it makes of a free mass."""

from __future__ import annotations

import numpy as np
import pytest

from elevon import Actuator, Scenario, simulate
from elevon.simulate import Run, simulate_batch

#: Torque of a metre's error, N m/m; s; s; of the filter.
GAIN, INTEGRAL, DERIVATIVE, FILTER = 9000.0, 0.15, 0.02, 10.0
FREE = {
    "control.structure": "pid", "control.pid_gain": GAIN, "control.pid_integral_time": INTEGRAL,
    "control.pid_derivative_time": DERIVATIVE, "control.pid_derivative_filter": FILTER,
    "control.position_feedback": "output", "control.current_limit": 1e3,
    "control.sample_time": 0.0, "drive.kind": "pwm", "friction.static": 0.0,
    "friction.dynamic": 0.0, "friction.viscous": 0.0, "screw.preload": 0.0, "load.friction": 0.0,
    "load.damping": 0.0, "screw.efficiency": 1.0, "screw.efficiency_aiding": 1.0,
    "backlash.total": 0.0, "inverter.supply_voltage": 600.0, "thermal.model": "off",
}  # fmt: skip
STEP = {"low": {"low.step": 1e-4}, "high": {"solver.step": 2e-6}}
SCENARIO = Scenario.from_dict(
    {
        "duration": 0.6,
        "command": {
            "mode": "position",
            "terms": [{"kind": "sine", "amplitude": 0.004, "frequency": "4 Hz"}],
        },
    }
)
RECORD = "output_position,current_ref@1 kHz"


def actuator(fidelity: str, changes: dict[str, str | float] | None = None) -> Actuator:
    values = {**FREE, **STEP[fidelity], **(changes or {})}
    return Actuator.load("nasa-ballscrew").with_values(values)


def linear(free: Actuator, time: np.ndarray) -> np.ndarray:
    """Position of the closed loop J s2 x = K (1 + 1/(T_i s) + T_d s/(1 + T_d s/N)) (r - x)."""
    from scipy.signal import lsim

    value = free.parameters.value
    lead = value("screw.lead")
    mass = (value("motor.inertia") + value("screw.inertia")) / lead + value("load.mass") * lead
    lag, current = (
        DERIVATIVE / FILTER,
        value("motor.winding_inductance") / value("pwm.proportional_gain"),
    )
    # K (1 + 1/(T_i s) + T_d s/(1 + lag s)) over T_i s (1 + lag s), and the current loop's lag.
    above = GAIN * np.array([INTEGRAL * (lag + DERIVATIVE), INTEGRAL + lag, 1.0])
    below = mass * INTEGRAL * np.polymul([lag, 1.0, 0.0, 0.0, 0.0], [current, 1.0])
    command = 0.004 * np.sin(8.0 * np.pi * time)
    return lsim((above, np.polyadd(above, below)), command, time)[1]


@pytest.mark.parametrize(("fidelity", "limit"), [("low", 2e-3), ("high", 1e-2)])
def test_the_loop_is_that_of_the_textbook(fidelity: str, limit: float) -> None:
    """Within the current loop's own lag and the step; of the range."""
    free = actuator(fidelity)
    done = simulate(free, SCENARIO, fidelity=fidelity, record=RECORD)
    position = done["output_position"]
    expected = linear(free, position.time)
    assert np.abs(position.values - expected).max() < limit * np.ptp(expected)
    assert np.ptp(expected) > 0.009  # it overshoots: the zeros are complex


def test_batches_have_the_bits_of_single_runs() -> None:
    changes = [{"control.pid_gain": gain} for gain in (3000.0, 9000.0, 12000.0)]
    runs = [Run(actuator("low", change), SCENARIO) for change in changes]
    together = simulate_batch(runs, fidelity="low", record=RECORD)
    for run, item in zip(runs, together, strict=True):
        alone = simulate(run.actuator, SCENARIO, fidelity="low", record=RECORD)
        assert np.array_equal(alone["output_position"].values, item["output_position"].values)


@pytest.mark.parametrize("fidelity", ["low", "high"])
def test_at_rest_the_error_is_the_load_over_the_gain(fidelity: str) -> None:
    """Under a constant load and without integral action."""
    changes = {"control.pid_integral_time": 0.0, "load.constant": 900.0, "load.damping": 3e4}
    zero = Scenario.from_dict({"duration": 0.6, "command": {"mode": "position", "terms": []}})
    loaded = actuator(fidelity, changes)
    done = simulate(loaded, zero, fidelity=fidelity, record=RECORD)
    expected = -900.0 * loaded.parameters.value("screw.lead") / GAIN
    assert done["output_position"].values[-1] == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize("fidelity", ["low", "high"])
def test_dry_friction_of_each_direction(fidelity: str) -> None:
    """Mean current of a steady sweep there and back: the friction over the torque constant."""
    changes = {
        "friction.static": 2.0, "friction.dynamic": 2.0, "friction.reverse_scale": 1.6,
        "control.speed_gain": 1.6, "control.integral_time": 0.0,
    }  # fmt: skip
    swept = Scenario.from_dict(
        {
            "duration": 1.0,
            "command": {
                "mode": "speed",
                "terms": [{"kind": "rectangle", "low": -8.0, "high": 8.0, "period": 1.0}],
            },
        }
    )
    values = {**FREE, **STEP[fidelity], **changes}
    kept = {path: value for path, value in values.items() if "pid" not in str((path, value))}
    loaded = Actuator.load("nasa-ballscrew").with_values(kept)
    done = simulate(loaded, swept, fidelity=fidelity, record="motor_torque,motor_speed@1 kHz")
    torque, speed = done["motor_torque"], done["motor_speed"].values
    steady = (torque.time % 0.5) > 0.3
    forth, back = torque.values[steady & (speed > 0)], torque.values[steady & (speed < 0)]
    assert np.mean(forth) == pytest.approx(2.0, rel=0.02)
    assert np.mean(back) == pytest.approx(-3.2, rel=0.02)
