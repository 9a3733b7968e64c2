"""Rules for loops, carrier, step, encoder."""

from __future__ import annotations

import math
from collections.abc import Mapping

from elevon.parameters.design.rule import (
    Rule,
    peak_current,
    total_inertia,
    turns_per_output,
)
from elevon.parameters.relations import torque_constant

CONTROL: Mapping[str, tuple[Rule, ...]] = {
    "control.current_limit": (
        Rule(
            "peak-current",
            lambda v: peak_current(v, "motor.peak_current"),
            "of the data sheet",
            ("motor.torque_constant", "motor.peak_current"),
        ),
        Rule(
            "rated-current",
            lambda v: v("current"),
            "ASSUMED: the drive never exceeds the rated current",
        ),
    ),
    "control.torque_constant": (
        Rule(
            "known-motor",
            lambda v: torque_constant(v("motor.emf_constant")),
            "the drive knows its motor, 1.5 k",
        ),
    ),
    "control.speed_limit": (
        Rule("rated-speed", lambda v: v("motor_speed"), "rated speed of the motor", unit="rpm"),
    ),
    "control.position_gain": (
        Rule(
            "gains-from-bandwidth",
            lambda v: 2 * math.pi * v("bandwidth") * turns_per_output(v),
            "bandwidth of the position loop times the ratio",
        ),
    ),
    "control.speed_gain": (
        Rule(
            "gains-from-bandwidth",
            lambda v: 10 * math.pi * v("bandwidth") * total_inertia(v),
            "the speed loop is five times as fast as the position loop: times the inertia",
        ),
    ),
    "control.integral_time": (
        Rule(
            "gains-from-bandwidth",
            lambda v: 5 / (10 * math.pi * v("bandwidth")),
            "five time constants of the speed loop",
        ),
    ),
    "pwm.proportional_gain": (
        Rule(
            "current-loop",
            lambda v: v("motor.winding_inductance") * 2 * math.pi * v("pwm.frequency") / 20,
            "a twentieth of the pulse frequency: L 2 pi f/20",
        ),
    ),
    "pwm.integral_gain": (
        Rule(
            "current-loop",
            lambda v: v("motor.winding_resistance") * 2 * math.pi * v("pwm.frequency") / 20,
            "the zero cancels the winding's pole: R 2 pi f/20",
        ),
    ),
    "pwm.inductance": (
        Rule(
            "known-motor",
            lambda v: v("motor.winding_inductance"),
            "the drive knows its motor",
            unit="mH",
        ),
    ),
    "pwm.emf_constant": (
        Rule("known-motor", lambda v: v("motor.emf_constant"), "the drive knows its motor"),
    ),
    "pwm.frequency": (
        Rule("usual-pulses", lambda _: 20e3, "beyond hearing", unit="kHz", assumed=True),
    ),
    "pwm.sample_time": (
        Rule(
            "half-period",
            lambda v: 0.5 / v("pwm.frequency"),
            "peaks and valleys of the carrier",
            unit="us",
        ),
    ),
    "solver.step": (
        Rule(
            "quarter-period",
            lambda v: 0.25 / v("pwm.frequency"),
            "half a sample of the current loop",
            unit="us",
        ),
    ),
    "control.sample_time": (
        Rule(
            "usual-tick",
            lambda v: 5 / v("pwm.frequency"),
            "every tenth sample of the current loop",
            unit="us",
        ),
    ),
    "inverter.hysteresis_band": (
        Rule("band", lambda v: 0.05 * v("current"), "ASSUMED: 5 % of the rated current"),
    ),
    "sensor.current.full_scale": (
        Rule("range", lambda v: 2 * v("control.current_limit"), "ASSUMED: twice the current limit"),
    ),
    "sensor.encoder.edges": (
        Rule("edges", lambda _: 4.0, "every edge of both channels counts", assumed=True),
    ),
    "sensor.encoder.pulses": (
        Rule(
            "counts-per-turn",
            lambda v: v("encoder") / 4 * turns_per_output(v) / (2 * math.pi),
            "counts per turn of the motor, over four edges, per metre of the ram",
            form="ballscrew",
        ),
        Rule(
            "counts-per-turn",
            lambda v: v("encoder") / 4,
            "counts per turn of the motor over four edges",
            form="rotary",
        ),
    ),
    "sensor.encoder.wheel_ratio": (
        Rule("motor-encoder", lambda v: v("gear.ratio"), "it turns with the motor", form="rotary"),
    ),
}
