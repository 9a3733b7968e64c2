"""The degradation laws that come with the package.

Forms are those of the literature; where the numbers of a law come from is stated beside each of
them, in `laws.toml`. Most are ASSUMED, since no published set of an actuator's growth rates exists:
they set the scale of a life, the diagnoses of the unit then say its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.data import packaged_toml
from elevon.errors import unknown
from elevon.prognose.law import Coefficient, Law, Rate

Drivers = Mapping[str, Floats]
Values = Mapping[str, float | Floats]


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


def _used_up(damage: Floats, drivers: Drivers, c: Values) -> Floats:
    """What is left goes in proportion to itself."""
    return c["wear"] * drivers["friction_work"] * np.maximum(1.0 - damage, 0.0)


_RATES: Mapping[str, Rate] = {
    "archard": _archard,
    "lubricant": _lubricant,
    "insulation": _insulation,
    "magnets": _magnets,
    "bearing": _bearing,
    "spall": _spall,
    "used_up": _used_up,
    "relaxing": _relaxing,
}
#: Damage to severity and back, of laws whose damage is another number than the severity.
_SEVERITIES: Mapping[str, Mapping[str, Any]] = {
    "short": {"severity": _shorted, "damage": _short_damage}
}


def _law(name: str, entry: Mapping[str, Any]) -> Law:
    """Return a law of `laws.toml`."""
    fields = dict(entry)
    numbers = fields.pop("coefficients")
    return Law(
        name,
        rate=_RATES[fields.pop("rate")],
        drivers=tuple(fields.pop("drivers")),
        coefficients={key: Coefficient(**number) for key, number in numbers.items()},
        **_SEVERITIES.get(fields.pop("severity", ""), {}),
        **fields,
    )


LAWS: dict[str, Law] = {
    name: _law(name, entry) for name, entry in packaged_toml("elevon.prognose", "laws.toml").items()
}
"""Name to law."""


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
