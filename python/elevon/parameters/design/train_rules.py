"""Rules for gear, screw, friction, stops, load."""

from __future__ import annotations

import math
from collections.abc import Mapping

from elevon.parameters.design.rule import (
    Rule,
    load_efficiency,
)

TRAIN: Mapping[str, tuple[Rule, ...]] = {
    "gear.ratio": (Rule("gear", lambda v: v("gear"), "as given or derived"),),
    "screw.lead": (
        Rule(
            "lead", lambda v: v("lead") / (2 * math.pi), "as given", form="ballscrew", unit="mm/rev"
        ),
    ),
    "screw.efficiency": (
        Rule(
            "load-efficiency",
            load_efficiency,
            "2 eta/(1 + eta): half of the losses come with the load (ASSUMED), gear and screw",
            form="ballscrew",
        ),
    ),
    "screw.efficiency_aiding": (
        Rule(
            "equal-loss",
            lambda v: 2 - 1 / v("screw.efficiency"),
            "equal loss for either sign of load, 2 - 1/eta",
            form="ballscrew",
        ),
    ),
    "gear.efficiency": (
        Rule(
            "load-efficiency",
            load_efficiency,
            "2 eta/(1 + eta): half of the losses come with the load (ASSUMED)",
            form="rotary",
        ),
    ),
    "gear.efficiency_aiding": (
        Rule(
            "equal-loss",
            lambda v: 2 - 1 / v("gear.efficiency"),
            "equal loss for either sign of load, 2 - 1/eta",
            form="rotary",
        ),
    ),
    "friction.dynamic": (
        Rule(
            "friction-from-efficiency",
            lambda v: 0.3 * (1 - v("efficiency")) * v("power") / v("motor_speed"),
            "ASSUMED: three tenths of the losses at the rating are dry friction",
        ),
    ),
    "friction.static": (
        Rule(
            "usual-static",
            lambda v: 4 / 3 * v("friction.dynamic"),
            "ASSUMED: 4/3 of the dynamic friction",
        ),
    ),
    "friction.viscous": (
        Rule(
            "friction-from-efficiency",
            lambda v: 0.2 * (1 - v("efficiency")) * v("power") / v("motor_speed") ** 2,
            "ASSUMED: two tenths of the losses at the rating are viscous",
        ),
    ),
    "backlash.total": (Rule("backlash", lambda v: v("backlash"), "as given or assumed"),),
    "load.mass": (Rule("mass", lambda v: v("mass"), "as given or assumed", form="ballscrew"),),
    "load.inertia": (
        Rule("inertia", lambda v: v("inertia"), "as given or assumed", form="rotary"),
    ),
    "stop.upper": (Rule("stroke", lambda v: v("stroke") / 2, "half the stroke"),),
    "stop.lower": (Rule("stroke", lambda v: -v("stroke") / 2, "half the stroke"),),
    "rating.current": (Rule("rating", lambda v: v("current"), "rated current", form="ballscrew"),),
    "rating.load": (Rule("rating", lambda v: v("thrust"), "rated force", form="ballscrew"),),
}
