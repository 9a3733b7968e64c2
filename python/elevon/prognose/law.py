"""A degradation law: how fast a fault's severity grows with use, and how evenly."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.data import packaged_toml
from elevon.errors import RangeError, unknown

Rate = Callable[[Floats, Mapping[str, Floats], Mapping[str, Any]], Floats]

#: What one repetition of a mission does to the actuator: name to unit and text.
DRIVERS: dict[str, tuple[str, str]] = {
    "hours": ("h", "time in use"),
    "friction_work": ("J", "work that friction turned into heat"),
    "shaft_travel": ("rad", "sliding distance of the motor shaft"),
    "torque_cubic_mean": (
        "N m",
        "cubic mean of the motor torque over the shaft's sliding distance",
    ),
    "winding_temperature": ("K", "winding temperature that ages as the whole mission does"),
    "surface_temperature": ("K", "mean temperature of the motor's surface"),
}


def _same(values: Floats) -> Floats:
    return values


@dataclass(frozen=True)
class Coefficient:
    """A number of a law.

    Attributes
    ----------
    value : float
        In `unit`.
    unit : str
        SI, but for hours.
    source : str
        Where it comes from; ``ASSUMED:`` and the reason where nowhere.
    spread : float
        Deviation of its logarithm from unit to unit; the filter then carries the unit's own value.
        What only scales the whole rate belongs in the law's `spread` instead.
    """

    value: float
    unit: str
    source: str
    spread: float = 0.0


@dataclass(frozen=True)
class Law:
    """Growth of one fault.

    A law has one state, the *damage*. Its mean growth in one repetition of the mission is ``rate``
    times a factor that belongs to the unit and that histories show; about the mean it grows as a
    gamma process, which never heals. `severity` turns damage into the fault's severity.

    Attributes
    ----------
    name, text, source : str
        Name, meaning, and who found the law.
    kind, place, unit : str
        The fault it drives, of the catalogue; the severity's unit.
    rate : callable
        Damage, shape (n,), drivers of the mission by name, shape (n,) each, and coefficients by
        name (numbers; of shape (n,) where they differ from unit to unit), to damage a repetition,
        shape (n,), never negative.
    drivers : tuple of str
        Keys of `DRIVERS` that it reads.
    coefficients : mapping of str to Coefficient
        Its numbers.
    spread : float
        Deviation of the logarithm of the unit's own factor before anything is known of it.
    form_spread : float
        Of the exponent f in (1 + severity / (highest / 4))^f, by which a unit's growth hastens as
        the fault grows beyond what the law says: f is the magnitude of a normal number of this
        deviation. One-sided, since what a law leaves out (debris, impacts, heat) feeds growth;
        ASSUMED.
    grain : float
        Scale of the gamma process [damage]: growth by D has the variance D times `grain`.
    start : float
        Damage of a new unit. What a unit starts from spreads about it by `start_spread`.
    start_spread : float
        Deviation of the damage at the start (never below zero damage).
    dormant : float
        Share of new units in which the fault is not there and does not grow; it may begin to, at
        `start` (`ONSET` of `elevon.prognose.process`).
    whole : bool
        Whether the fault comes in whole numbers: tables have those; between them growth is what
        leads to the next.
    severity, damage : callable
        Damage to severity and back, shape (n,) to (n,), both rising.
    highest : float
        Greatest severity that predictions look at [unit].
    only : bool
        Whether the fault grows by this law alone: no other way of growth is tried beside it.
    trust : float
        Probability that growth follows the law, before a history says more; else its rate is free.
        0: there is no law, and its rate says only how long lives are.
    life : float
        Use of a life at a free rate, as a fleet's file has it; 0: as the law has it.
    form : tuple of (float, float)
        Share of the severity at the end of life, and share of the life after which a unit of the
        fleet has it, at a free rate; empty: in proportion.
    """

    name: str
    text: str
    source: str
    kind: str
    place: str
    unit: str
    rate: Rate
    drivers: tuple[str, ...]
    coefficients: Mapping[str, Coefficient]
    highest: float
    spread: float = 0.8
    form_spread: float = 0.3
    grain: float = 0.0
    start: float = 0.0
    start_spread: float = 0.0
    dormant: float = 0.0
    only: bool = False
    trust: float = 0.85
    life: float = 0.0
    form: tuple[tuple[float, float], ...] = ()
    whole: bool = False
    severity: Callable[[Floats], Floats] = field(default=_same)
    damage: Callable[[Floats], Floats] = field(default=_same)

    def __post_init__(self) -> None:
        for name in self.drivers:
            if name not in DRIVERS:
                raise unknown("driver", name, DRIVERS, f"law {self.name}")
        for name in ("spread", "form_spread", "grain", "start", "start_spread"):
            _not_negative(f"law {self.name}: {name}", getattr(self, name))
        for name, item in self.coefficients.items():
            _not_negative(f"law {self.name}: spread of {name}", item.spread)
        if not 0.0 <= self.dormant <= 1.0:
            raise RangeError(f"law {self.name}: dormant = {self.dormant:g} is outside 0 to 1")
        if not 0.0 <= self.trust <= 1.0:
            raise RangeError(f"law {self.name}: trust = {self.trust:g} is outside 0 to 1")
        if not self.highest > 0.0:
            raise RangeError(f"law {self.name}: highest = {self.highest:g} must be above 0")

    @property
    def key(self) -> str:
        """``KIND@PLACE`` of its fault."""
        return f"{self.kind}@{self.place}"

    @property
    def highest_damage(self) -> float:
        """Damage at the greatest severity that predictions look at."""
        return float(self.damage(np.array([self.highest]))[0])

    @property
    def spreading(self) -> tuple[str, ...]:
        """Coefficients that differ from unit to unit."""
        return tuple(name for name, item in self.coefficients.items() if item.spread > 0.0)

    def growth(
        self,
        damage: Floats,
        drivers: Mapping[str, Floats],
        factors: Mapping[str, Floats] | None = None,
    ) -> Floats:
        """Return the mean growth of the damage in one repetition, shape (n,).

        Parameters
        ----------
        damage, drivers
            As `rate` takes them.
        factors : mapping of str to ndarray, shape (n,), optional
            Factors of units on coefficients.
        """
        values: dict[str, Any] = {name: item.value for name, item in self.coefficients.items()}
        for name, factor in (factors or {}).items():
            values[name] = values[name] * factor
        return np.maximum(self.rate(damage, drivers, values), 0.0)

    def with_values(
        self,
        values: Mapping[str, float],
        *,
        place: str | None = None,
        source: str = "given",
        **fields: Any,
    ) -> Law:
        """Return the law with other coefficients, place, spread, grain, start, ...

        Raises
        ------
        UnknownNameError
            It has no coefficient of that name.
        """
        numbers = dict(self.coefficients)
        for name, value in values.items():
            if name not in numbers:
                raise unknown("coefficient", name, numbers, f"law {self.name}")
            numbers[name] = replace(numbers[name], value=float(value), source=source)
        return replace(self, coefficients=numbers, place=place or self.place, **fields)


def _not_negative(name: str, value: float) -> None:
    if not (np.isfinite(value) and value >= 0.0):
        raise RangeError(f"{name} = {value:g} must be a finite number, 0 or more")


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
