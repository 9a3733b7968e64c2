"""Parameters of an actuator: every value with its unit, source, note and confidence."""

from elevon.parameters.find import find_set, set_names
from elevon.parameters.load import SetFile, load_set, set_errors
from elevon.parameters.parameter import Parameter
from elevon.parameters.records import Record, records
from elevon.parameters.schema import json_schema
from elevon.parameters.set import ParameterSet
from elevon.parameters.write import updated_set, write_set

__all__ = [
    "Parameter",
    "ParameterSet",
    "Record",
    "SetFile",
    "find_set",
    "json_schema",
    "load_set",
    "records",
    "set_errors",
    "set_names",
    "updated_set",
    "write_set",
]
