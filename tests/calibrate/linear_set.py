"""What a datasheet says of the foreign linear actuator, as a set of the ballscrew's wiring."""

import numpy as np

from elevon import Actuator
from elevon.calibrate.stages.closed_loop import loop_log
from elevon.logs.log import Log
from tests.calibrate.linear import Linear

#: What the datasheet gives of the moving mass and of the inertia: not the truth.
MASS, INERTIA = 5.0, 2e-5


def datasheet(bench: Linear) -> Actuator:
    """Motor, gearbox and screw as printed; friction and the loops are first guesses.

    A direct-current motor of constant k and resistance R as the quadrature circuit: 1.5 times the
    phase's constant is k, and the power 1.5 v i makes R and the supply two thirds of theirs.
    """
    constant, ratio = bench.torque_constant, 5.0
    values: dict[str, str | float] = {
        "motor.emf_constant": constant / 1.5, "control.torque_constant": constant,
        "motor.winding_resistance": bench.resistance / 1.5, "motor.inertia": INERTIA,
        "motor.winding_inductance": bench.inductance / 1.5, "motor.torque_limit": 100.0,
        "pwm.proportional_gain": 0.9, "pwm.inductance": bench.inductance / 1.5,
        "pwm.emf_constant": constant / 1.5, "drive.kind": "pwm", "thermal.model": "off",
        "inverter.supply_voltage": 24.0 / 1.5 * np.sqrt(3.0),
        "gear.ratio": ratio, "screw.lead": ratio / bench.per_metre, "screw.inertia": 0.0,
        "screw.preload": 0.0, "screw.efficiency": 1.0, "screw.efficiency_aiding": 1.0,
        "load.mass": MASS, "load.damping": 0.0, "load.friction": 0.0, "backlash.total": 0.0,
        "friction.static": 0.03, "friction.dynamic": 0.03, "friction.viscous": 5e-5,
        "control.position_feedback": "output", "control.speed_feedforward": 0.0,
        "control.conditional_integration": "on", "control.anti_windup_back_calculation": 0.0,
        "control.speed_gain": 1e-3, "control.speed_limit": 450.0, "control.current_limit": 6.0,
        "motor.temperature_coefficient": 0.0, "motor.flux_temperature_coefficient": 0.0,
        "stop.upper": 1.0, "stop.lower": -1.0,
    }  # fmt: skip
    return Actuator.load("nasa-ballscrew").with_values(values)


def loop(name: str, columns: dict[str, np.ndarray]) -> Log:
    """The columns of a log in SI, as an import makes them."""
    time = 1e-3 * (columns["time"] - columns["time"][0])
    channels = {
        "command": 1e-3 * columns["demand"],
        "output_position": 1e-3 * columns["position"],
        "output_speed": 1e-3 * columns["speed"],
        "torque_current": columns["current"],
    }
    return loop_log(Log(name, time, channels))


def truth(bench: Linear) -> dict[str, float]:
    """What the calibration is to find, where its own model has a name for it, SI."""
    inertia = bench.inertia + bench.mass / bench.per_metre**2
    return {
        "whole inertia": inertia,
        "motor.inertia": inertia - MASS / bench.per_metre**2,
        "control.pid_gain": bench.gain * bench.torque_constant,
        "control.pid_integral_time": bench.gain / bench.integral,
        "control.pid_derivative_time": bench.derivative / bench.gain,
        "control.current_limit": bench.current_limit,
    }
