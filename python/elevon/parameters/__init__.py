"""Parameters of an actuator: every value with its unit, source, note and confidence."""

from elevon.parameters.load import SetFile, find_set, load_set, set_errors, set_names
from elevon.parameters.model import json_schema
from elevon.parameters.records import Record, records
from elevon.parameters.set import Parameter, ParameterSet
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
