"""Values derived from a design by the rules: each looked up among what is given, else derived."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace

from elevon.errors import InputError
from elevon.parameters.design.quantities import LINEAR, Given, quantities
from elevon.parameters.design.rule import Rule, rules
from elevon.parameters.parameter import Parameter
from elevon.parameters.records import records


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
    from elevon.parameters.design.limits import check

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
