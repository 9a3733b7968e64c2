"""JSON Schema of a wiring's actuator files: every path with its unit, range, default and text."""

from __future__ import annotations

import math
from typing import Any

from elevon.parameters.records import Record, records


def json_schema(wiring: str) -> dict[str, object]:
    """Return the JSON Schema (2020-12) of an actuator file of one wiring.

    Parameters
    ----------
    wiring : str
        The core's wiring.

    Returns
    -------
    dict
        Each entry carries ``x-unit`` (SI unit of the model), ``x-range`` and ``x-symbol``; the
        numbers of a file may be in any unit of the same kind, so no numeric limits are stated on
        ``value`` unless the parameter is a pure number.
    """
    from elevon.parameters.model import ActuatorHeader, ParameterEntry

    header = ActuatorHeader.model_json_schema()
    properties: dict[str, Any] = dict(header["properties"])
    for record in records(wiring).values():
        _insert(properties, record.path.split("."), _leaf(record))
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": f"Elevon actuator file, wiring {wiring}",
        "type": "object",
        "properties": properties,
        "additionalProperties": False,
        "$defs": {**header.get("$defs", {}), "Entry": ParameterEntry.model_json_schema()},
    }


def _insert(properties: dict[str, Any], parts: list[str], leaf: dict[str, Any]) -> None:
    for part in parts[:-1]:
        group = properties.setdefault(
            part, {"type": "object", "properties": {}, "additionalProperties": False}
        )
        properties = group["properties"]
    properties[parts[-1]] = leaf


def _leaf(record: Record) -> dict[str, Any]:
    leaf: dict[str, Any] = {
        "anyOf": [{"$ref": "#/$defs/Entry"}, {"type": ["number", "string"]}],
        "description": record.text,
        "x-symbol": record.symbol,
        "x-unit": record.unit,
        "x-range": record.range_text,
        "x-register": record.register,
    }
    if record.default is not None:
        leaf["x-default"] = record.default_value()
    if record.choices is not None:
        leaf["properties"] = {"value": {"enum": list(record.choices)}}
    elif record.unit in ("", "1"):
        leaf["properties"] = {"value": {"type": "number", **_limits(record)}}
    return leaf


def _limits(record: Record) -> dict[str, float]:
    limits: dict[str, float] = {}
    if math.isfinite(record.minimum):
        limits["exclusiveMinimum" if record.minimum_open else "minimum"] = record.minimum
    if math.isfinite(record.maximum):
        limits["exclusiveMaximum" if record.maximum_open else "maximum"] = record.maximum
    return limits
