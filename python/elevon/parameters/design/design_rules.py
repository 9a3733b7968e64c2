"""Rules for what a design leaves out: speeds, power, load, bandwidth."""

from __future__ import annotations

import math
from collections.abc import Mapping

from elevon.parameters.design.rule import (
    Rule,
    load_name,
    peak_current,
    power_of_load,
    supply_speed,
    total_inertia,
    turns_per_output,
    useful,
)
from elevon.parameters.relations import torque_constant

DESIGN: Mapping[str, tuple[Rule, ...]] = {
    "efficiency": (
        Rule(
            "usual-efficiency",
            lambda _: 0.8,
            "a gear and a screw of rolling contacts",
            assumed=True,
        ),
    ),
    "gear": (
        Rule(
            "gear-from-speeds",
            lambda v: v("motor_speed") * v("lead") / (2 * math.pi * v("speed")),
            "rated speed of the motor over that of the screw",
            ("speed", "lead"),
            "ballscrew",
        ),
        Rule(
            "gear-from-speeds",
            lambda v: v("motor_speed") / v("speed"),
            "rated speed of the motor over that of the output",
            ("speed",),
            "rotary",
        ),
        *(
            Rule(
                "gear-from-speeds",
                lambda v: (
                    v("motor_speed") * (v("lead") / (2 * math.pi) if v.linear else 1.0) / v("speed")
                ),
                "rated speed of the motor over that behind the gear",
                ("power", load),
            )
            for load in ("thrust", "torque")
        ),
        Rule("no-gear", lambda _: 1.0, "no gear is given", assumed=True),
    ),
    "motor_speed": (
        Rule(
            "speed-through-gear",
            lambda v: v("speed") * turns_per_output(v),
            "rated speed of the output times the ratio",
            ("speed", "gear"),
        ),
        *(
            Rule(
                "speed-from-power",
                lambda v: v("speed") * turns_per_output(v),
                "rated speed of the output times the ratio",
                ("power", load, "gear"),
            )
            for load in ("thrust", "torque")
        ),
        Rule(
            "speed-from-supply",
            supply_speed,
            "the motor at its rated current and 0.9 of the voltage (ASSUMED: the rest regulates)",
            ("motor.torque_constant", "motor.resistance", "motor.current"),
            unit="rpm",
        ),
        Rule(
            "usual-speed",
            lambda _: 1000 * math.pi / 10,
            "3000 rpm, the usual rated speed of a servo motor, as no speed is given",
            unit="rpm",
            assumed=True,
        ),
    ),
    "speed": (
        *(
            Rule(
                "speed-from-power",
                lambda v: useful(v) / v(load_name(v)),
                "0.9 efficiency power over the rated load (ASSUMED: a tenth accelerates)",
                ("power", load),
            )
            for load in ("thrust", "torque")
        ),
        Rule(
            "speed-through-gear",
            lambda v: v("motor_speed") / turns_per_output(v),
            "rated speed of the motor over the ratio",
        ),
    ),
    "power": (
        *(
            Rule(
                "power-of-load",
                power_of_load,
                "load times speed over 0.9 efficiency (ASSUMED: a tenth of the torque accelerates)",
                (load,),
            )
            for load in ("thrust", "torque")
        ),
        Rule(
            "power-of-motor",
            lambda v: v("motor.torque_constant") * v("motor.current") * v("motor_speed"),
            "torque at the rated current times rated speed",
            ("motor.torque_constant", "motor.current"),
        ),
    ),
    "thrust": (
        Rule(
            "load-from-power",
            lambda v: useful(v) / v("speed"),
            "0.9 efficiency power over speed (ASSUMED: a tenth of the torque accelerates)",
            form="ballscrew",
        ),
    ),
    "torque": (
        Rule(
            "load-from-power",
            lambda v: useful(v) / v("speed"),
            "0.9 efficiency power over speed (ASSUMED: a tenth of the torque accelerates)",
            form="rotary",
        ),
    ),
    "current": (
        Rule(
            "current-of-sheet",
            lambda v: peak_current(v, "motor.current"),
            "peak of the phase that gives the torque of the data sheet's current",
            ("motor.torque_constant", "motor.current"),
            unit="A",
        ),
        Rule(
            "current-of-rating",
            lambda v: v("power") / v("motor_speed") / torque_constant(v("motor.emf_constant")),
            "rated torque over the torque constant, peak of a phase",
            unit="A",
        ),
    ),
    "encoder": (
        Rule("usual-encoder", lambda _: 4096.0, "1024 lines, every edge counts", assumed=True),
    ),
    "bandwidth": (
        Rule(
            "bandwidth-from-torque",
            lambda v: (
                0.6
                * torque_constant(v("motor.emf_constant"))
                * v("control.current_limit")
                / (total_inertia(v) * v("motor_speed"))
                / (2 * math.pi)
            ),
            "braking from the rated speed takes 0.6 of the largest torque (ASSUMED, no overshoot)",
        ),
    ),
    "stroke": (
        Rule(
            "usual-stroke",
            lambda v: 50 * v("lead"),
            "fifty turns of the screw",
            form="ballscrew",
            unit="mm",
            assumed=True,
        ),
        Rule(
            "usual-stroke",
            lambda _: 2 * math.pi,
            "one turn",
            form="rotary",
            unit="deg",
            assumed=True,
        ),
    ),
    "backlash": (
        Rule(
            "usual-backlash",
            lambda v: 0.01 * v("lead"),
            "a hundredth of the lead",
            form="ballscrew",
            unit="mm",
            assumed=True,
        ),
        Rule(
            "usual-backlash",
            lambda _: math.radians(0.1),
            "6 arcmin, a usual servo gear",
            form="rotary",
            unit="deg",
            assumed=True,
        ),
    ),
    "mass": (
        Rule(
            "small-load",
            lambda v: 0.01 * v("motor.inertia") * turns_per_output(v) ** 2,
            "a hundredth of the rotor's inertia as seen at the ram",
            form="ballscrew",
            assumed=True,
        ),
    ),
    "inertia": (
        Rule(
            "small-load",
            lambda v: 0.01 * v("motor.inertia") * turns_per_output(v) ** 2,
            "a hundredth of the rotor's inertia as seen at the output",
            form="rotary",
            assumed=True,
        ),
    ),
}
