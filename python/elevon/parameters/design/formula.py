"""Formulas of the rules: sums, products, powers and roots of named numbers, written as text."""

from __future__ import annotations

import ast
import math
import operator
from collections.abc import Callable, Mapping
from functools import cache
from typing import Any

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
