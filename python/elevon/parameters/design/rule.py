"""The rules: from the numbers of a design to every value of an actuator that a size changes.

Currents are peak values of the phase, EMF constants peak of the phase per mechanical rad/s, as in
the model. A rule that rests on a number nobody gave says so in its text (ASSUMED).
"""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache
from typing import Any, Protocol

from elevon.data import packaged_toml
from elevon.parameters.relations import copper_loss, torque_constant

_OPERATIONS: Mapping[type[ast.operator], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.Sub: operator.sub,
    ast.Mult: operator.mul,
    ast.Div: operator.truediv,
    ast.Pow: operator.pow,
}


def evaluate(formula: str, named: Callable[[str], float]) -> float:
    """Return the value of a formula such as ``50 * lead`` or ``sqrt(power / 1000)``.

    Parameters
    ----------
    formula : str
        Numbers, names (with dots), ``+ - * / **``, parentheses, ``sqrt``.
    named : callable
        Name to its number.

    Raises
    ------
    ValueError
        Anything else in it.
    """
    return float(_value(_parsed(formula), named))


@cache
def _parsed(formula: str) -> ast.expr:
    return ast.parse(formula, mode="eval").body


def _value(node: ast.expr, named: Callable[[str], float]) -> Any:
    match node:
        case ast.Constant(value=int() | float() as number):
            return number
        case ast.Name() | ast.Attribute():
            return named(ast.unparse(node))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_value(operand, named)
        case ast.BinOp(left=left, op=sign, right=right) if type(sign) in _OPERATIONS:
            return _OPERATIONS[type(sign)](_value(left, named), _value(right, named))
        case ast.Call(func=ast.Name(id="sqrt"), args=[argument]):
            return math.sqrt(_value(argument, named))
    raise ValueError(f"{ast.unparse(node)!r} has no place in a formula of a rule")


ROOT3 = math.sqrt(3.0)
MOTOR_EFFICIENCY = 0.8
_RESERVE = 0.9
RISE = 80.0
_COPPER = 3.93e-3


class DesignNumbers(Protocol):
    """What a rule reads: numbers by name, whether the output is linear, choices."""

    linear: bool

    def __call__(self, name: str) -> float:
        """Return one number in SI."""
        ...

    def has(self, name: str) -> bool:
        """Whether a number of the design is given."""
        ...

    def word(self, name: str, default: str) -> str:
        """Return a choice of the design."""
        ...


def turns_per_output(v: DesignNumbers) -> float:
    """Return motor radians per radian or metre of the output."""
    return v("gear.ratio") * (2.0 * math.pi / v("lead") if v.linear else 1.0)


def load_name(v: DesignNumbers) -> str:
    """Return how the design calls its rated load."""
    return "thrust" if v.linear else "torque"


def phase_share(v: DesignNumbers) -> float:
    """Return a phase's share of what a data sheet states between two terminals."""
    return 1.0 / 1.5 if v.word("motor.kind", "brushless") == "dc" else 0.5


def phase_emf(v: DesignNumbers) -> float:
    """Return the EMF constant of a data sheet's torque constant."""
    share = {"brushless": 1.0 / ROOT3, "servo": math.sqrt(2.0) / 3.0, "dc": 1.0 / 1.5}
    return v("motor.torque_constant") * share[v.word("motor.kind", "brushless")]


def phase_current(v: DesignNumbers, name: str) -> float:
    """Return the phase current, peak, whose torque a data sheet's current gives."""
    return v("motor.torque_constant") * v(name) / torque_constant(v("motor.emf_constant"))


def phase_voltage(v: DesignNumbers) -> float:
    """Return the largest voltage of a phase, peak, that a bridge makes of its link."""
    return v("inverter.supply_voltage") / ROOT3


def total_inertia(v: DesignNumbers) -> float:
    """Return the inertia on the motor's shaft, the load's share included."""
    load = v("load.mass" if v.linear else "load.inertia")
    return v("motor.inertia") + load / turns_per_output(v) ** 2


def rated_voltage(v: DesignNumbers) -> float:
    """Return the quadrature voltage at the rating, winding cold."""
    return v("motor.winding_resistance") * v("current") + v("motor.emf_constant") * v("motor_speed")


def rated_heat(v: DesignNumbers) -> float:
    """Return the copper's heat [W] at the rated current, winding warm."""
    return copper_loss(v("motor.winding_resistance"), v("current")) * (1.0 + _COPPER * RISE)


def useful(v: DesignNumbers) -> float:
    """Return the power [W] that the output gives at the rating."""
    return _RESERVE * v("efficiency") * v("power")


def load_efficiency(v: DesignNumbers) -> float:
    """Return the efficiency that is left for the load's own friction."""
    return 2.0 * v("efficiency") / (1.0 + v("efficiency"))


def supply_speed(v: DesignNumbers) -> float:
    """Return the speed at which a given motor takes nine tenths of the voltage at its current."""
    drop = v("motor.winding_resistance") * v("current")
    return (_RESERVE * phase_voltage(v) - drop) / v("motor.emf_constant")


def power_of_load(v: DesignNumbers) -> float:
    """Return the power [W] at the motor's shaft that a given load at its speed takes."""
    return v(load_name(v)) * v("speed") / (_RESERVE * v("efficiency"))


#: What a formula may name besides the numbers of a design and the paths of parameters.
TERMS: Mapping[str, Callable[[DesignNumbers], float]] = {
    "pi": lambda _: math.pi,
    "degree": lambda _: math.radians(1.0),
    "motor_efficiency": lambda _: MOTOR_EFFICIENCY,
    "rise": lambda _: RISE,
    "travel_per_radian": lambda v: v("lead") / (2 * math.pi) if v.linear else 1.0,
    "link_share": lambda v: ROOT3 / 1.5 if v.word("motor.kind", "") == "dc" else 1.0,
    "usual_pole_pairs": lambda v: 1.0 if v.word("motor.kind", "") == "dc" else 4.0,
    "load": lambda v: v(load_name(v)),
    "rated_current": lambda v: phase_current(v, "motor.current"),
    "peak_current": lambda v: phase_current(v, "motor.peak_current"),
    "torque_constant": lambda v: torque_constant(v("motor.emf_constant")),
    "turns_per_output": turns_per_output,
    "phase_share": phase_share,
    "phase_emf": phase_emf,
    "phase_voltage": phase_voltage,
    "total_inertia": total_inertia,
    "rated_voltage": rated_voltage,
    "rated_heat": rated_heat,
    "useful": useful,
    "load_efficiency": load_efficiency,
    "supply_speed": supply_speed,
    "power_of_load": power_of_load,
}


@dataclass(frozen=True)
class Rule:
    """One rule, as `rules.toml` states it.

    Attributes
    ----------
    name : str
        Printed as the source of what it derives.
    value : str
        Its formula, see `elevon.parameters.design.rule`.
    text : str
        The formula in words, and what is assumed.
    given : tuple of str
        DesignNumbers of the design that must be given for it to serve.
    form : str
        The wiring it is for; empty: each.
    unit : str
        In which the value is printed.
    assumed : bool
        The value itself is assumed.
    """

    name: str
    value: str
    text: str
    given: tuple[str, ...] = ()
    form: str = ""
    unit: str = ""
    assumed: bool = False

    def work(self, v: DesignNumbers) -> float:
        """Return the SI value."""
        return evaluate(self.value, lambda name: TERMS[name](v) if name in TERMS else v(name))


@cache
def rules() -> Mapping[str, tuple[Rule, ...]]:
    """Return the rules by the number of a design or the path of the parameter that they derive."""
    table = packaged_toml("elevon.parameters.design", "rules.toml")
    return {
        name: tuple(Rule(**{**row, "given": tuple(row.get("given", ()))}) for row in rows)
        for name, rows in table.items()
    }
