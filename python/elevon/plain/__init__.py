"""Records as JSON's own types and back: one mechanism, driven by the annotated fields."""

from elevon.plain.fields import REMAINDER, STORED, WORKING, As, in_unit, key
from elevon.plain.read import read_plain
from elevon.plain.record import Plain, fields_of, keys_of, plain, units_of

__all__ = [
    "REMAINDER",
    "STORED",
    "WORKING",
    "As",
    "Plain",
    "fields_of",
    "in_unit",
    "key",
    "keys_of",
    "plain",
    "read_plain",
    "units_of",
]
