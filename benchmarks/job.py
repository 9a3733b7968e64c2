"""The common job (README.md) and its variants, as an actuator and a scenario of the public API."""

from __future__ import annotations

import math
from typing import Any

import elevon

KP, KI, KT = 0.3, 6.0, 1.1
COMMON: dict[str, Any] = {
    "solver.step": 1e-6,
    "solver.method": "semi_implicit",
    "drive.kind": "hysteresis",
    "motor.pole_pairs": 4,
    "motor.inertia": 7.7e-4,
    "motor.winding_resistance": 2.75,
    "motor.winding_inductance": 30.5e-3,
    "motor.emf_constant": KT / 1.5,
    "motor.torque_limit": 1e6,
    "motor.electrical_offset": "90 deg",
    "motor.temperature_coefficient": 0.0,
    "load.inertia": 0.0,
    "load.stiffness": 0.0,
    "gear.ratio": 124.0,
    "gear.inertia": 1.9e-3,
    "gear.efficiency": 1.0,
    "gear.efficiency_aiding": 1.0,
    "friction.static": 0.12,
    "friction.dynamic": 0.06,
    "friction.viscous": 1e-3,
    "friction.viscous_slope": 0.0,
    "backlash.model": "operator",
    "backlash.total": "0.2 deg",
    "stop.upper": "30 deg",
    "stop.lower": "-30 deg",
    "inverter.supply_voltage": 380.0,
    "inverter.hysteresis_band": 0.5,
    "inverter.on_resistance": 0.0,
    "inverter.diode_drop": 0.0,
    "inverter.dead_time": 0.0,
    "inverter.trip_current": 0.0,
    "control.position_gain": 20 * 124.0,
    "control.speed_gain": KP,
    "control.integral_time": KP / KI,
    "control.derivative_time": 0.0,
    "control.speed_limit": 1e6,
    "control.current_limit": 22.0 / KT,
    "control.torque_constant": KT,
    "control.anti_windup_rest": "off",
    "control.anti_windup_error": "off",
    "control.anti_windup_back_calculation": 0.0,
    "control.conditional_integration": "on",
    "control.sample_time": 0.0,
    "control.noise_deviation": 0.0,
    "control.position_feedback": "output",
    "sensor.current.noise_deviation": 0.0,
    "sensor.current.bits": 0,
}
# Every option of the high model at once: faults in winding and air gap, a lossy bridge,
# load-dependent friction,
# the second mass behind an elastic backlash, every branch of the controller, imperfect sensors that
# close the loop.
FULL: dict[str, Any] = {
    "motor.turns_a": 0.9,
    "motor.short_model": "loop",
    "motor.short_contact_resistance": 0.01,
    "motor.eccentricity_static": 0.05,
    "motor.eccentricity_dynamic": 0.05,
    "motor.temperature_coefficient": 3.93e-3,
    "motor.winding_temperature": 340.0,
    "gear.efficiency": 0.9,
    "gear.efficiency_aiding": 0.891,
    "friction.viscous_slope": -1e-4,
    "backlash.model": "elastic",
    "backlash.stiffness": 1e4,
    "backlash.damping": 5.0,
    "load.inertia": 0.05,
    "load.stiffness": 0.8,
    "inverter.on_resistance": 0.1,
    "inverter.diode_drop": 1.0,
    "inverter.dead_time": 2e-6,
    "inverter.trip_current": 40.0,
    "control.derivative_time": 0.002,
    "control.derivative_filter": 100.0,
    "control.anti_windup_rest": "on",
    "control.anti_windup_error": "below",
    "control.anti_windup_threshold": 1e-5,
    "control.anti_windup_back_calculation": 20.0,
    "control.noise_deviation": 1e-5,
    "control.position_feedback": "encoder",
    "sensor.current.gain_a": 1.01,
    "sensor.current.offset_b": 0.02,
    "sensor.current.noise_deviation": 0.01,
    "sensor.current.bits": 12,
    "sensor.resolver.mismatch": 0.01,
}
# The same loop behind a carrier; the current PI cancels the winding's pole.
TAU = 1 / (2 * math.pi * 200.0)
CARRIER: dict[str, Any] = {
    "drive.kind": "pwm",
    "control.sample_time": 125e-6,
    "pwm.frequency": 4000.0,
    "pwm.sample_time": 125e-6,
    "pwm.proportional_gain": 30.5e-3 / TAU,
    "pwm.integral_gain": 2.75 / TAU,
    "pwm.inductance": 30.5e-3,
    "pwm.emf_constant": KT / 1.5,
}
#: What a variant of the job sets beside the common values.
VARIANTS: dict[str, dict[str, Any]] = {
    "common": {},
    "full": FULL,
    "carrier": CARRIER,
    "located": {"inverter.relay_crossing": "located"},
    "thermal": {"thermal.model": "dynamic", "motor.temperature_coefficient": 3.93e-3},
    "dead_time": {
        "inverter.dead_time": 2e-6,
        "inverter.on_resistance": 0.1,
        "inverter.diode_drop": 1.0,
    },
    "lugre": {"friction.law": "lugre"},
}
RECORD = [
    "output_position,motor_position,motor_speed,current_a,current_b,current_c,motor_torque@400 Hz"
]
FULL_LOAD: dict[str, Any] = {
    "brake": {"terms": [{"kind": "sine", "amplitude": 0.2, "bias": 0.5, "frequency": 0.5}]},
    "output": {"terms": [{"kind": "triangle", "amplitude": 20.0, "frequency": 0.3}]},
}


def actuator(variant: str = "common", step: float = 1e-6) -> Any:
    """The loop of benchmark_job.c, or a variant of it, at a step of its own."""
    values = COMMON | VARIANTS[variant] | {"solver.step": step}
    if values["drive.kind"] == "pwm":
        del values["inverter.hysteresis_band"]
    return elevon.Actuator.load("torino-rotary").with_values(values)


def scenario(
    duration: float,
    amplitude_deg: float = 7.0,
    faults: list[dict[str, Any]] | None = None,
    variant: str = "common",
) -> Any:
    """Sine of 0.2 Hz from rest; with every option, loads on both shafts as well."""
    return elevon.Scenario.from_dict(
        {
            "duration": duration,
            "command": {
                "mode": "position",
                "terms": [
                    {"kind": "sine", "amplitude": math.radians(amplitude_deg), "frequency": 0.2}
                ],
            },
            "fault": faults or [],
            "load": FULL_LOAD if variant == "full" else {},
        }
    )
