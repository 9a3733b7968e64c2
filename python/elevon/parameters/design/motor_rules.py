"""Rules for motor, supply and heat."""

from __future__ import annotations

import math
from collections.abc import Mapping

from elevon.parameters.design.rule import (
    MOTOR_EFFICIENCY,
    RISE,
    ROOT3,
    Rule,
    phase_emf,
    phase_share,
    phase_voltage,
    rated_heat,
    rated_voltage,
)
from elevon.parameters.relations import torque_constant

MOTOR: Mapping[str, tuple[Rule, ...]] = {
    "inverter.supply_voltage": (
        Rule(
            "supply",
            lambda v: v("supply") * (ROOT3 / 1.5 if v.word("motor.kind", "") == "dc" else 1.0),
            "as given; of a dc motor times sqrt 3/1.5, whose phase voltage then is U/1.5",
        ),
    ),
    "motor.emf_constant": (
        Rule(
            "constant-of-sheet",
            phase_emf,
            "torque constant k: k/sqrt 3 (brushless), k sqrt 2/3 (servo), k/1.5 (dc)",
            ("motor.torque_constant",),
        ),
        Rule(
            "constant-from-supply",
            lambda v: 0.85 * MOTOR_EFFICIENCY * phase_voltage(v) / v("motor_speed"),
            "ASSUMED: 0.85 of the voltage, supply/sqrt 3, at the rated speed; motor efficiency 0.8",
        ),
    ),
    "motor.winding_resistance": (
        Rule(
            "resistance-of-sheet",
            lambda v: v("motor.resistance") * phase_share(v),
            "half of that between terminals; dc: over 1.5",
            ("motor.resistance",),
        ),
        Rule(
            "resistance-from-efficiency",
            lambda v: v("power") * (1 / MOTOR_EFFICIENCY - 1) / 1.5 / v("current") ** 2,
            "ASSUMED: the copper takes what a motor efficiency of 0.8 leaves",
        ),
    ),
    "motor.winding_inductance": (
        Rule(
            "inductance-of-sheet",
            lambda v: v("motor.inductance") * phase_share(v),
            "half of that between terminals; dc: over 1.5",
            ("motor.inductance",),
            unit="mH",
        ),
        Rule(
            "inductance-from-voltage",
            lambda v: (
                0.25 * rated_voltage(v) / (v("motor.pole_pairs") * v("motor_speed") * v("current"))
            ),
            "ASSUMED: at the rating the inductance takes a quarter of the quadrature voltage",
            unit="mH",
        ),
    ),
    "motor.inertia": (
        Rule(
            "inertia-from-torque",
            lambda v: 0.03 * v("power") / v("motor_speed") ** 2,
            "ASSUMED: the rated torque brings the rotor to its rated speed in 30 ms",
            unit="kg cm2",
        ),
    ),
    "motor.pole_pairs": (
        Rule(
            "usual-pole-pairs",
            lambda v: 1.0 if v.word("motor.kind", "") == "dc" else 4.0,
            "4 are usual for a servo motor; 1 stands for a direct-current one",
            assumed=True,
        ),
    ),
    "motor.torque_limit": (
        Rule(
            "saturation",
            lambda v: 1.5 * torque_constant(v("motor.emf_constant")) * v("control.current_limit"),
            "ASSUMED: the iron saturates half beyond the current limit",
        ),
    ),
    "thermal.winding_mass": (
        Rule(
            "copper-from-power",
            lambda v: (v("power") / 1000.0) ** 0.75,
            "ASSUMED: 1 kg at 1 kW, by its power 3/4",
        ),
    ),
    "thermal.housing_capacity": (
        Rule(
            "housing-from-power",
            lambda v: 4600.0 * (v("power") / 1000.0) ** 0.75,
            "ASSUMED: 10 kg of steel at 1 kW, by its power 3/4",
        ),
    ),
    "thermal.area": (
        Rule(
            "area-from-power",
            lambda v: 0.12 * math.sqrt(v("power") / 1000.0),
            "ASSUMED: 0.12 m2 at 1 kW, by its root",
        ),
    ),
    "thermal.winding_to_surface": (
        Rule(
            "thermal-from-rating",
            lambda v: 0.375 * RISE / rated_heat(v),
            "ASSUMED: the rated current warms the winding by 80 K, 30 K of it inside",
        ),
    ),
    "thermal.convection": (
        Rule(
            "thermal-from-rating",
            lambda v: rated_heat(v) / (0.625 * RISE * v("thermal.area")),
            "ASSUMED: the rated current warms the winding by 80 K, 50 K of it to the air",
        ),
    ),
}
