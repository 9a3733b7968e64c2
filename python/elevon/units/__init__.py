"""Quantities at the door: text with a unit in, SI floats inside, and back for display.

A unit is a product of symbols: ``kg cm2``, ``N m s/rad``, ``W/(m K)``. Exponents follow the symbol
(``m2``, ``s-1``, ``m^2``). The symbols stand in one table
(`elevon.units.unit`); those of the SI take the prefixes p, n, u, m, k, M and G.

The angle counts as a dimension of its own. So Hz is never taken for rad/s, nor a stiffness in
N m/rad for a torque in N m, which the SI alone cannot tell apart. A temperature in ``degC`` or
``degF`` has an offset when it stands alone, and is an interval inside a product (``W/degC``).

Decimal text and decimal units are combined exactly: ``"7.7 kg cm2"`` is the float ``7.7e-4``.
"""

from elevon.units.quantity import (
    ambiguous,
    check_kind,
    convert,
    display_unit,
    format_quantity,
    is_ambiguous,
    kind_name,
    known_units,
    parse_quantity,
    si_unit,
    split_quantity,
    to_display,
    to_si,
)
from elevon.units.unit import Unit, parse_unit

__all__ = [
    "Unit",
    "ambiguous",
    "check_kind",
    "convert",
    "display_unit",
    "format_quantity",
    "is_ambiguous",
    "kind_name",
    "known_units",
    "parse_quantity",
    "parse_unit",
    "si_unit",
    "split_quantity",
    "to_display",
    "to_si",
]
