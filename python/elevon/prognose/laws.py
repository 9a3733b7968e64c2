"""The degradation laws that come with the package.

Forms are those of the literature; where the numbers of a law come from is stated beside each of
them. Most are ASSUMED, since no published set of an actuator's growth rates exists: they set the
scale of a life, the diagnoses of the unit then say its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import unknown
from elevon.prognose.law import Coefficient, Law

Drivers = Mapping[str, Floats]
Values = Mapping[str, float | Floats]
_DORMANT = 0.3  # ASSUMED: in as many units a fault does not grow to be seen


def _arrhenius(
    activation: float | Floats, reference: float | Floats, temperature: Floats
) -> Floats:
    """Pace of a thermally activated process over that at a reference [K]."""
    return np.exp(activation * (1.0 / reference - 1.0 / np.maximum(temperature, 1.0)))


def _archard(_damage: Floats, drivers: Drivers, c: Values) -> Floats:
    return c["wear"] * drivers["friction_work"]


def _lubricant(_damage: Floats, drivers: Drivers, c: Values) -> Floats:
    hot = np.maximum(drivers["surface_temperature"] - c["threshold"], 0.0)
    return c["loss"] * drivers["friction_work"] * 2.0 ** (hot / c["halving"])


def _insulation(damage: Floats, drivers: Drivers, c: Values) -> Floats:
    hot = drivers["winding_temperature"] + c["own_heat"] * _shorted(damage)
    ageing = _arrhenius(c["activation"], c["index_temperature"], hot)
    pace = np.where(damage < 1.0, 1.0, c["after_contact"])
    return pace * ageing * drivers["hours"] / c["index_life"]


_FIRST_TURN = 0.01  # share of a phase's turns; ASSUMED: one turn of a winding of about a hundred


def _shorted(damage: Floats) -> Floats:
    """Damage 1 is the first contact; from there each e-fold of turns is one more."""
    grown = _FIRST_TURN * np.exp(np.minimum(damage - 1.0, 50.0))
    return np.where(damage < 1.0, 0.0, np.minimum(grown, 1.0))


def _short_damage(severity: Floats) -> Floats:
    with np.errstate(divide="ignore"):
        grown = 1.0 + np.log(np.maximum(severity, 1e-300) / _FIRST_TURN)
    return np.where(severity < _FIRST_TURN, 0.0, grown)


def _magnets(damage: Floats, drivers: Drivers, c: Values) -> Floats:
    pace = _arrhenius(c["activation"], c["reference_temperature"], drivers["winding_temperature"])
    return c["loss"] * drivers["hours"] * pace * np.maximum(1.0 - damage, 0.0)


def _bearing(damage: Floats, drivers: Drivers, c: Values) -> Floats:
    return c["wear"] * drivers["shaft_travel"] * (1.0 + c["pull"] * damage)


def _relaxing(damage: Floats, drivers: Drivers, c: Values) -> Floats:
    return c["wear"] * drivers["hours"] * np.maximum(1.0 - damage, 0.0)


def _spall(damage: Floats, drivers: Drivers, c: Values) -> Floats:
    turns = drivers["shaft_travel"] / (2.0 * np.pi)
    load = (drivers["torque_cubic_mean"] / c["reference_torque"]) ** 3
    size = np.maximum(damage, c["seed"]) / c["seed"]
    return c["growth"] * turns * load * size ** (0.5 * c["exponent"])


_WEAR = Law(
    name="gear_wear",
    text="backlash of the gear from the friction work done in it",
    source="Archard 1953: worn volume is proportional to load times sliding distance, hence to "
           "friction work",
    kind="backlash", place="transmission", unit="rad",
    rate=_archard, drivers=("friction_work",), highest=0.03,
    coefficients={
        "wear": Coefficient(
            2e-10, "rad/J",
            "ASSUMED: 5e-16 m3/(N m) of a lubricated steel pair (Archard, Rabinowicz: 1e-16 to "
            "1e-14), friction 0.1, flanks of 6 cm2 at 44 mm from the axis",
        )
    },
    grain=2e-5,
    dormant=_DORMANT,
)  # fmt: skip

LAWS: dict[str, Law] = {
    "gear_wear": _WEAR,
    "screw_wear": Law(
        name="screw_wear",
        text="backlash of the screw and its nut from the friction work done in them",
        source=_WEAR.source,
        kind="backlash", place="transmission", unit="m",
        rate=_archard, drivers=("friction_work",), highest=1e-3,
        coefficients={
            "wear": Coefficient(
                2e-11, "m/J",
                "ASSUMED: 1e-15 m3/(N m), friction 0.05, balls and grooves of 10 cm2",
            )
        },
        grain=1.5e-6, dormant=_DORMANT,
    ),
    "lubricant_loss": Law(
        name="lubricant_loss",
        text="dry friction that grows as the lubricant is worked out and ages",
        source="loss by work: ASSUMED (friction work shears and drives out the grease); ageing: "
               "grease life halves for each 15 K above 70 C (bearing makers' rule)",
        kind="friction", place="transmission", unit="1",
        rate=_lubricant, drivers=("friction_work", "surface_temperature"), highest=6.0,
        coefficients={
            "loss": Coefficient(2e-8, "1/J", "ASSUMED: friction doubles in 35 MJ of friction work"),
            "threshold": Coefficient(343.15, "K", "bearing makers' rule: 70 C"),
            "halving": Coefficient(15.0, "K", "bearing makers' rule"),
        },
        grain=2e-3, dormant=_DORMANT,
    ),
    "insulation": Law(
        name="insulation",
        text="insulation ages with the winding's temperature (damage 0 to 1); from the first "
             "turn-to-turn contact on the short grows, faster by its own heat",
        source="Dakin 1948 (Arrhenius), Montsinger 1930 (10 K rule); growth after contact ASSUMED "
               "exponential in the shorted turns",
        kind="short", place="motor.phase_a", unit="1",
        rate=_insulation, drivers=("hours", "winding_temperature"), highest=0.6,
        coefficients={
            "index_life": Coefficient(20000.0, "h", "IEC 60216: the thermal index is at 20 000 h"),
            "index_temperature": Coefficient(428.15, "K", "IEC 60085: class F, 155 C"),
            "activation": Coefficient(
                12700.0, "K", "life halves for 10 K at 155 C: ln 2 (428 K)2 / 10 K (1.09 eV)"
            ),
            "after_contact": Coefficient(
                20.0, "1", "ASSUMED: a short of a low-voltage winding that takes weeks, not minutes"
            ),
            "own_heat": Coefficient(
                40.0, "K",
                "ASSUMED: rise of the spot's temperature per unit of shorted share; what carries "
                "it off differs from spot to spot by a third",
                spread=0.3,
            ),
        },
        # What feeds growth is in the law, its own heat with a spread: ASSUMED to leave little out.
        form_spread=0.1, grain=3e-3, start=0.0, start_spread=0.3, dormant=_DORMANT,
        severity=_shorted, damage=_short_damage,
    ),
    "demagnetisation": Law(
        name="demagnetisation",
        text="magnets lose flux by heat",
        source="thermally activated, irreversible loss (Street and Woolley 1949), as a constant "
               "rate at a temperature: ASSUMED",
        kind="demagnetisation", place="motor", unit="1",
        rate=_magnets, drivers=("hours", "winding_temperature"), highest=0.4,
        coefficients={
            "loss": Coefficient(1e-6, "1/h", "ASSUMED: 2 % in 20 000 h at 120 C"),
            "reference_temperature": Coefficient(393.15, "K", "ASSUMED: 120 C"),
            "activation": Coefficient(11600.0, "K", "ASSUMED: 1 eV"),
        },
        grain=3e-4, dormant=_DORMANT,
    ),
    "bearing_wear": Law(
        name="bearing_wear",
        text="clearance of the bearings, and the rotor out of centre in it",
        source="Archard 1953, with the sliding distance at constant load; the magnets' pull adds "
               "to the load in proportion to the eccentricity",
        kind="eccentricity_static", place="motor", unit="1",
        rate=_bearing, drivers=("shaft_travel",), highest=0.6,
        coefficients={
            "wear": Coefficient(1e-9, "1/rad", "ASSUMED: a tenth of the air gap in 1e8 rad"),
            "pull": Coefficient(3.0, "1", "ASSUMED: the pull at contact is three times the weight"),
        },
        grain=5e-4, dormant=_DORMANT,
    ),
    "spall": Law(
        name="spall",
        text="spall of the outer ring, from a seed",
        source="Paris and Erdogan 1963: growth a cycle as a power of the stress intensity, which "
               "goes with load and root of length; load cubed as in the life of ball bearings "
               "(Lundberg and Palmgren 1947)",
        kind="bearing", place="bearing.outer", unit="m",
        rate=_spall, drivers=("shaft_travel", "torque_cubic_mean"), highest=4e-3,
        coefficients={
            "growth": Coefficient(2e-11, "m", "ASSUMED: a seed doubles in 2.5 million turns"),
            "reference_torque": Coefficient(1.0, "N m", "ASSUMED: where `growth` is given"),
            "seed": Coefficient(5e-5, "m", "ASSUMED: smallest spall that is not closed again"),
            "exponent": Coefficient(2.0, "1", "ASSUMED: Paris exponents of steel are 2 to 4"),
        },
        start=5e-5, start_spread=2e-5, grain=4e-6, dormant=_DORMANT,
    ),
}  # fmt: skip
"""Name to law."""

_SPALL = LAWS["spall"]
_OF_WORK = ("friction_work",)


def _by_work(
    name: str, text: str, source: str, *, fault: tuple[str, str, str], pace: tuple[float, str],
    highest: float, grain: float, **fields: Any,
) -> Law:  # fmt: skip
    """Return a law whose damage grows in proportion to the friction work; `pace` is ASSUMED."""
    kind, place, unit = fault
    of_work = "1/J" if unit == "1" else f"{unit}/J"
    return Law(
        name, text, source, kind, place, unit, _archard, _OF_WORK,
        {"wear": Coefficient(pace[0], of_work, f"ASSUMED: {pace[1]}")},
        highest, grain=grain, dormant=_DORMANT, **fields,
    )  # fmt: skip


def _used_up(damage: Floats, drivers: Drivers, c: Values) -> Floats:
    """What is left goes in proportion to itself."""
    return c["wear"] * drivers["friction_work"] * np.maximum(1.0 - damage, 0.0)


_WORK = "in proportion to the friction work: ASSUMED, as Archard's wear"

#: Of the ball screw and of the landing gear; the rotary's that fit them serve as well.
_OTHERS = (
    *(
        replace(
            _SPALL, name=name, kind="spall", place=place, text=text,
            source=f"{_SPALL.source}; screw: N 6.1",
        )
        for name, place, text in (
            ("nut_spall", "screw.nut", "spall of the nut, from a seed"),
            ("ball_spall", "screw.ball", "spall of a ball, from a seed"),
        )
    ),
    replace(
        _by_work(
            "screw_lubricant", "lubricant of the screw worked out of it", f"N 6.1; {_WORK}",
            fault=("lubrication_loss", "screw", "1"),
            pace=(2e-8, "two thirds gone in 50 MJ"), highest=0.95, grain=1e-3,
        ),
        rate=_used_up,
    ),
    _by_work(
        "screw_contamination", "wear debris that gathers in the screw's grease", f"N 6.1; {_WORK}",
        fault=("contamination", "screw", "1"),
        pace=(5e-10, "2.5 % of the grease in 50 MJ"), highest=0.05, grain=5e-5,
    ),
    _by_work(
        "return_jam", "return channels that clog, one after the other", f"N 4.2; {_WORK}",
        fault=("return_jam", "screw.return_channel", "1"),
        pace=(2e-8, "a channel in 50 MJ"), highest=3.0, grain=0.1,
        whole=True,
    ),
    _by_work(
        "preload_loss", "gap of a nut that has lost its preload by wear", f"N 6.1; {_WORK}",
        fault=("adapter_gap", "adapter", "m"),
        pace=(1e-11, "0.5 mm in 50 MJ"), highest=1e-3, grain=1.5e-6,
    ),
    _by_work(
        "leg_screw_friction", "friction of the landing gear's screw as it wears and dries",
        f"N 6.1 (wear of the screw); {_WORK}",
        fault=("friction_growth", "screw", "N"),
        pace=(2e-4, "1 kN in 5 MJ"), highest=2000.0, grain=2.0,
    ),
    _by_work(
        "leg_screw_efficiency", "efficiency that the landing gear's screw loses by wear",
        f"N 5.3; {_WORK}",
        fault=("efficiency_loss", "screw", "1"),
        pace=(2e-8, "a tenth in 5 MJ"), highest=0.3, grain=3e-4,
    ),
    _by_work(
        "leg_motor_bearing", "drag of the motor's bearings", f"T3 Table 1.1; {_WORK}",
        fault=("bearing_wear", "motor.bearing", "N m"),
        pace=(2e-8, "0.1 N m in 5 MJ"), highest=0.4, grain=4e-4,
    ),
    Law(
        "lock_spring", "spring of the down-lock that relaxes", "ASSUMED: with the time in use",
        "lock_spring_weak", "lock", "1", _relaxing, ("hours",),
        {"wear": Coefficient(2e-5, "1/h", "ASSUMED: a third of the force in 20 000 h")},
        0.9, grain=1e-3, dormant=_DORMANT,
    ),
    Law(
        "brake_wear", "holding torque that the brake loses", "ASSUMED: with the time in use",
        "brake_slipping", "brake", "1", _relaxing, ("hours",),
        {"wear": Coefficient(2e-5, "1/h", "ASSUMED: a third of the torque in 20 000 h")},
        0.9, grain=1e-3, dormant=_DORMANT,
    ),
)  # fmt: skip
LAWS.update({law.name: law for law in _OTHERS})


def laws_of(wiring: str) -> dict[str, Law]:
    """Return the laws whose fault an actuator of a wiring has, in its unit."""
    from elevon.faults import catalogue

    there = {(r.kind, place, r.unit) for r in catalogue(wiring) for place in r.places}
    return {n: law for n, law in LAWS.items() if (law.kind, law.place, law.unit) in there}


def find_law(name: str, place: str = "law") -> Law:
    """Return a law of the package.

    Raises
    ------
    UnknownNameError
        None of that name; the nearest are named.
    """
    if name not in LAWS:
        raise unknown("law", name, LAWS, place)
    return LAWS[name]
