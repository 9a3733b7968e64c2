"""Values derived from a design by the rules: each looked up among what is given, else derived."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from types import MappingProxyType
from typing import Any

from elevon.data import packaged_toml
from elevon.documents import Document
from elevon.errors import InputError, unknown
from elevon.parameters.design.rule import (
    Rule,
    load_name,
    phase_voltage,
    rules,
    turns_per_output,
    useful,
)
from elevon.parameters.records import Record, records
from elevon.parameters.relations import torque_constant
from elevon.parameters.set import Confidence, Parameter
from elevon.units import format_quantity, parse_quantity

#: Wirings that the rules know; the value: whether the output moves along a line.
LINEAR: Mapping[str, bool] = MappingProxyType({"ballscrew": True, "rotary": False})

KINDS = ("brushless", "servo", "dc")


@lru_cache(maxsize=4)
def quantities(wiring: str) -> Mapping[str, Record]:
    """Return what ``[design]`` may hold for a wiring, by name; empty where no rules are."""
    if wiring not in LINEAR:
        return MappingProxyType({})
    table = packaged_toml("elevon.parameters.design", "quantities.toml")
    rows = table["both"] | table["linear" if LINEAR[wiring] else "rotary"]
    return MappingProxyType({name: _record(name, **row) for name, row in rows.items()})


def _record(name: str, unit: str, text: str, *, whole: bool = False, zero: bool = False) -> Record:
    return Record(
        path=f"design.{name}",
        symbol="",
        unit=unit,
        minimum=0.0,
        maximum=1.0 if name == "efficiency" else math.inf,
        minimum_open=not zero,
        maximum_open=False,
        text=text,
        register="plant",
        default=None,
        choices=KINDS if name == "motor.kind" else None,
        whole=whole,
    )


@dataclass(frozen=True)
class Given:
    """What the files of a chain state in ``[design]``: names to values, and the place of each."""

    values: Mapping[str, Parameter]
    places: Mapping[str, str]

    def over(self, below: Given) -> Given:
        """Return these over those of the base."""
        return Given({**below.values, **self.values}, {**below.places, **self.places})


def read_design(document: Document, wiring: str) -> Given:
    """Read a file's ``[design]``.

    Raises
    ------
    InputError
        Everything that is wrong with it: unknown names with the nearest, units, ranges.
    """
    table = document.data.get("design", {})
    known = quantities(wiring)
    if not known:
        raise InputError(f"{document.place(('design',))}: no rules for the wiring {wiring!r}")
    source = table.get("source")
    if source is not None and not (isinstance(source, str) and source.strip()):
        raise InputError(f"{document.place(('design', 'source'))}: is no text that names a source")
    values: dict[str, Parameter] = {}
    places: dict[str, str] = {}
    errors: list[InputError] = []
    for name, raw in _named(table):
        place = document.place(("design", *name.split(".")))
        try:
            if name not in known:
                raise unknown("number of a design", name, known, place)
            values[name] = read_number(known[name], raw, place, source)
            places[name] = place
        except InputError as error:
            errors.append(error)
    if len(errors) == 1:
        raise errors[0]
    if errors:
        raise InputError("\n".join(str(error) for error in errors))
    return Given(values, places)


def _named(table: Mapping[str, Any]) -> list[tuple[str, Any]]:
    motor = table.get("motor", {})
    inner = motor.items() if isinstance(motor, Mapping) else [("", motor)]
    plain = [(name, raw) for name, raw in table.items() if name not in ("source", "motor")]
    return [*plain, *((f"motor.{name}", raw) for name, raw in inner)]


def read_number(record: Record, raw: object, place: str, source: str | None) -> Parameter:
    """Read one number of a design; a text has a unit where the quantity has one."""
    if isinstance(raw, bool) or not isinstance(raw, (int, float, str)):
        raise InputError(f"{place}: write a number with its unit, such as '28 V'")
    text = raw if isinstance(raw, str) else repr(raw)
    if ":" in text:
        raise InputError(f"{place}: {text!r} is not a number; a ratio is written like 4")
    if record.choices is None and record.unit != "1" and _is_bare(text):
        raise InputError(
            f"{place}: {text} has no unit; write it like '{text} {record.unit}' ({record.text})"
        )
    turned = _lead(text, place) if record.path == "design.lead" else None
    value = record.read(text if turned is None else turned, place)
    unit = "" if record.choices else text.strip().lstrip("+-.0123456789eE").strip()
    confidence: Confidence = "unknown" if source is None else "published"
    return Parameter(record.path, value, unit, source or "given", record.text, confidence)


def _is_bare(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


def _lead(text: str, place: str) -> float | None:
    """Read a lead written per turn, ``2 mm/rev``; None where it is a length."""
    if "/" not in text:
        return None
    return 2.0 * math.pi * parse_quantity(text, "m/rad", place)


def design_scenario(design: Mapping[str, Parameter]) -> Mapping[str, object]:
    """Return a sine over a fifth of the stroke whose peak rate is half the rated speed.

    Parameters
    ----------
    design : mapping
        Name to `Parameter`, derived ones included.

    Returns
    -------
    mapping
        In the form of a scenario file: three cycles.
    """
    unit = "m" if "lead" in design else "rad"
    stroke, speed = (float(design[name].value) for name in ("stroke", "speed"))
    amplitude = 0.1 * stroke
    frequency = 0.5 * speed / (2.0 * math.pi * amplitude)
    sine = {"kind": "sine", "amplitude": f"{amplitude!r} {unit}", "frequency": f"{frequency!r} Hz"}
    return {"duration": f"{3.0 / frequency!r} s", "command": {"mode": "position", "terms": [sine]}}


_CLOSE = 1.0 + 1e-6


def check(v: Values) -> None:
    """Refuse a design that has too few numbers or some that contradict each other.

    Raises
    ------
    InputError
        Names the place, the value, the limit.
    """
    _enough(v)
    _motor(v)
    _power(v)
    _speeds(v)
    _voltage(v)
    _current(v)
    _bandwidth(v)


def _refuse(v: Values, name: str, text: str) -> None:
    raise InputError(f"{v.given.places.get(name, v.place)}: {text}")


def _enough(v: Values) -> None:
    needed = ["supply", *(["lead"] if v.linear else [])]
    missing = [name for name in needed if not v.has(name)]
    motor = v.has("motor.torque_constant") and v.has("motor.current")
    load = load_name(v)
    if not (v.has("power") or v.has(load) or motor):
        missing.append(f"power (or {load} and speed, or motor.torque_constant and motor.current)")
    if missing:
        raise InputError(f"{v.place}: [design] lacks {', '.join(missing)}")


def _motor(v: Values) -> None:
    for name in ("motor.current", "motor.peak_current"):
        if v.has(name) and not v.has("motor.torque_constant"):
            _refuse(v, name, "needs motor.torque_constant: which torque this current gives")
    if v.has("motor.inductance_q") and v.has("motor.inductance"):
        _refuse(v, "motor.inductance", "is given beside motor.inductance_q: one of them")
    if v.has("motor.inductance_d") and not v.has("motor.inductance_q"):
        _refuse(v, "motor.inductance_d", "needs motor.inductance_q: the other axis")
    if v.has("motor.peak_current") and v("control.current_limit") < v("current"):
        least = _text(v, "motor.current") if v.has("motor.current") else f"{v('current'):.4g} A"
        _refuse(
            v,
            "motor.peak_current",
            f"{_text(v, 'motor.peak_current')} is below the rated current, {least}",
        )


def _power(v: Values) -> None:
    load = load_name(v)
    if not all(v.has(name) for name in ("power", "speed", load)):
        return
    needed = v(load) * v("speed")
    if needed > useful(v) * _CLOSE:
        _refuse(
            v,
            "power",
            f"{_text(v, load)} at {_text(v, 'speed')} are {needed:.4g} W; {_text(v, 'power')} at "
            f"the motor's shaft leave {useful(v):.4g} W (efficiency {v('efficiency'):g}, a tenth "
            "to accelerate)",
        )


def _speeds(v: Values) -> None:
    if not all(v.has(name) for name in ("speed", "motor_speed", "gear")):
        return
    needed = v("speed") * turns_per_output(v)
    if needed > v("motor_speed") * _CLOSE:
        most = v("motor_speed") / turns_per_output(v)
        _refuse(
            v,
            "speed",
            f"{_text(v, 'speed')} takes {format_quantity(needed, 'rpm', 4)} of the motor, beyond "
            f"{_text(v, 'motor_speed')}: at most {_out(v, most)}",
        )


def _voltage(v: Values) -> None:
    """A given motor whose speed the supply does not give."""
    if not v.has("motor.torque_constant"):
        return
    current = v("current")
    drop, emf = v("motor.winding_resistance") * current, v("motor.emf_constant")
    coupling = v("motor.pole_pairs") * v("motor.winding_inductance") * current
    limit = phase_voltage(v)
    if drop >= limit:
        _refuse(
            v,
            "motor.resistance",
            f"the rated current takes {drop:.4g} V of a phase, the supply gives {limit:.4g} V",
        )
    speed = v("motor_speed")
    out = turns_per_output(v)
    needed = math.hypot(drop + emf * speed, coupling * speed)
    if needed > limit * _CLOSE:
        a, b, c = emf**2 + coupling**2, drop * emf, drop**2 - limit**2
        most = (-b + math.sqrt(b * b - a * c)) / a
        _refuse(
            v,
            "speed" if v.has("speed") else "motor_speed",
            f"{format_quantity(speed, 'rpm', 4)} of the motor take {needed:.4g} V of a phase, the "
            f"supply gives {limit:.4g} V: at most {format_quantity(most, 'rpm', 4)}, "
            f"{_out(v, most / out)}",
        )


def _current(v: Values) -> None:
    if not v.has("motor.current"):
        return
    needed = v("power") / v("motor_speed") / torque_constant(v("motor.emf_constant"))
    if needed > v("current") * _CLOSE:
        name = next(name for name in (load_name(v), "power", "motor.current") if v.has(name))
        _refuse(
            v,
            name,
            f"the rating takes {needed / v('current'):.4g} times the continuous current, "
            f"{_text(v, 'motor.current')}",
        )


def _bandwidth(v: Values) -> None:
    limit = v("pwm.frequency") / 20.0 / 20.0
    if v("bandwidth") > limit:
        _refuse(
            v,
            "bandwidth",
            f"{v('bandwidth'):.4g} Hz; at most {limit:.4g} Hz: the speed loop, five times as fast, "
            "must stay below a quarter of the current loop",
        )


def _text(v: Values, name: str) -> str:
    return f"{name} = {v.given.values[name].text}"


def _out(v: Values, value: float) -> str:
    return format_quantity(value, "mm/s" if v.linear else "deg/s", 4)


@dataclass(frozen=True)
class Derivation:
    """What a design has become.

    Attributes
    ----------
    design : mapping
        Name to `Parameter`: the numbers given, then the assumed and derived ones.
    parameters : mapping
        Path to `Parameter`: what the rules derive; what a file states itself is not among them.
    """

    design: Mapping[str, Parameter]
    parameters: Mapping[str, Parameter]


class Values:
    """Numbers by name or path, SI: given, else by the first rule whose needs are given."""

    def __init__(
        self, wiring: str, given: Given, stated: Mapping[str, Parameter], place: str
    ) -> None:
        self.wiring, self.place = wiring, place
        self.linear = LINEAR[wiring]
        self.given = given
        self.stated = stated
        self.derived: dict[str, Parameter] = {}
        self._open: list[str] = []

    def has(self, name: str) -> bool:
        """Whether a number of the design is given."""
        return name in self.given.values

    def word(self, name: str, default: str) -> str:
        """Return a choice of the design."""
        return str(self.given.values[name].value) if self.has(name) else default

    def __call__(self, name: str) -> float:
        """Return one number in SI."""
        known = self.stated.get(name) or self.given.values.get(name) or self.derived.get(name)
        if known is None:
            known = self.derived[name] = self._derive(name)
        assert isinstance(known.value, float)
        return known.value

    def rule(self, name: str) -> Rule | None:
        """Return the rule that derives a number here."""
        known = (rule for rule in rules().get(name, ()) if rule.form in ("", self.wiring))
        return next((rule for rule in known if all(self.has(each) for each in rule.given)), None)

    def _derive(self, name: str) -> Parameter:
        rule = self.rule(name)
        if rule is None or name in self._open:
            raise InputError(f"{self.place}: {_missing(self.linear)}")
        self._open.append(name)
        value = float(rule.work(self))
        self._open.pop()
        if not math.isfinite(value):
            raise InputError(f"{self.place}: the rule {rule.name} gives {value} for {name}")
        return _derived(name, value, rule, self.wiring)


def derive(wiring: str, given: Given, stated: Mapping[str, Parameter], place: str) -> Derivation:
    """Derive every parameter that the rules of a wiring know and no file states.

    Parameters
    ----------
    wiring : str
        One of `LINEAR`.
    given : Given
        The design.
    stated : mapping
        Path to what the files state themselves; the rules follow it.
    place : str
        Named in errors: the file.

    Raises
    ------
    InputError
        Too few numbers, or numbers that contradict each other; names the limit.
    """
    values = Values(wiring, given, stated, place)
    check(values)
    known = records(wiring)
    names = quantities(wiring)
    for name in (*known, *names, "current"):
        if name not in stated and (values.has(name) or values.rule(name) is not None):
            values(name)
    known_values = {**values.derived, **given.values}
    return Derivation(
        {
            name: known_values[name]
            for name in (*names, "current")
            if name in known_values and (name not in known or values.has(name))
        },
        {
            path: replace(known_values[path], path=path)
            for path in known
            if path in known_values and path not in stated
        },
    )


def _derived(name: str, value: float, rule: Rule, wiring: str) -> Parameter:
    path = name if name in records(wiring) else f"design.{name}"
    record = records(wiring).get(name) or quantities(wiring).get(name)
    unit = rule.unit or ("" if record is None or record.unit == "1" else record.unit)
    if record is not None:
        record.check(value, f"{path} (rule {rule.name})")
    if rule.assumed:
        return Parameter(path, value, unit, f"ASSUMED: {rule.text}", f"rule {rule.name}", "assumed")
    return Parameter(path, value, unit, f"derived: {rule.name}", rule.text, "derived")


def _missing(linear: bool) -> str:
    load = "thrust and speed" if linear else "torque and speed"
    more = " and lead" if linear else ""
    return (
        f"[design] has too few numbers: it needs supply{more}, and power, or {load}, or the "
        "motor's torque_constant and current"
    )
