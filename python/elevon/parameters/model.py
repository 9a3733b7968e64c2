"""What an actuator file may hold (checked by pydantic before anything is computed)."""

from __future__ import annotations

import math
from typing import Any, Literal

from pydantic import (
    Field,
    StrictStr,
    field_validator,
)

from elevon.parameters.records import Record, records
from elevon.strict import Number, Strict


class Citation(Strict):
    """A publication the sources point to."""

    key: StrictStr = Field(min_length=1, description="Short name used in the sources")
    text: StrictStr = Field(min_length=1, description="The full citation")


class ParameterEntry(Strict):
    """One parameter as written in the file."""

    value: Number | StrictStr = Field(description="The number, or the name of a choice")
    unit: StrictStr = Field("", description="Unit of value, old and interval")
    source: StrictStr = Field(description="Where the number comes from; 'ASSUMED: reason' is legal")
    note: StrictStr = Field("", description="Derivation, or what to know before using it")
    confidence: Literal["published", "derived", "assumed", "calibrated", "unknown"]
    old: Number | StrictStr | None = Field(None, description="The value before calibration")
    interval: tuple[Number, Number] | None = Field(
        None, description="Interval of the calibrated value"
    )

    @field_validator("source")
    @classmethod
    def _not_silent(cls, source: str) -> str:
        if not source.strip() or source.strip().rstrip(":") == "ASSUMED":
            raise ValueError("a source is needed: a reference, or 'ASSUMED: ' with the reason")
        return source


class ControllerLaw(Strict):
    """A drive's law of position as it was identified: effort from command and measured motion."""

    structure: StrictStr = Field(description="`P-P`, `P-PI`, `PID`, ...")
    effort: StrictStr = Field(description="Role of the effort that it sets")
    scale: Number = Field(gt=0.0, description="Torque at the motor for one unit of effort [N m]")
    gains: dict[str, Number] = Field(description="Effort for a unit of each term")
    constant: Number = Field(0.0, description="Effort that is always added")
    speed: StrictStr = Field(description="`difference`, `mean`, `filtered` or `measured`")
    lag: Number = Field(0.0, ge=0.0, description="Samples of the filter of a filtered speed")
    delay: int = Field(0, ge=0, description="Samples from what it reads to the effort")
    period: Number = Field(gt=0.0, description="Seconds between two samples")
    limit: Number | None = Field(None, description="Largest effort")


class ValidationLimits(Strict):
    """What an actuator file promises of its agreement with a log."""

    transient: Number = Field(10.0, ge=0.0, description="Seconds left out at a log's beginning")
    limits: dict[str, Number] = Field(
        default_factory=dict,
        description="Signal to the largest RMS error, in percent of the signal's range",
    )
    offsets: dict[str, Number] = Field(
        default_factory=dict,
        description="Signal to the constant offset [SI] its sensor adds, taken off a log",
    )
    law: ControllerLaw | None = Field(
        None, description="The drive's law of position, where calibration identified it"
    )


class Compare(Strict):
    """What `elevon compare` runs when it is given nothing else."""

    after: Number = Field(0.0, ge=0.0, description="Seconds left out at the beginning")
    load: Number | StrictStr | None = Field(
        None, description="Size of the opposing and aiding load at the output [N or N m]"
    )
    scenario: dict[str, Any] = Field(description="In the form of a scenario file")


class ActuatorHeader(Strict):
    """The keys of an actuator file that are not parameters."""

    name: StrictStr | None = Field(
        None, pattern=r"^[A-Za-z0-9][A-Za-z0-9._-]*$", description="Of the file if absent"
    )
    title: StrictStr = ""
    wiring: StrictStr | None = Field(
        None, description="Which wiring of the core; from the base if absent"
    )
    base: StrictStr | None = Field(
        None, description="Name of the actuator, or file, that this one overrides"
    )
    references: tuple[Citation, ...] = ()
    scenario: dict[str, Any] | None = Field(None, description="What runs when none is given")
    compare: Compare | None = Field(
        None, description="What `elevon compare` runs; without it, the scenario above"
    )
    validation: ValidationLimits | None = Field(None, description="Thresholds of `elevon validate`")
    design: dict[str, Any] | None = Field(
        None, description="Few numbers from which rules derive the rest (elevon new)"
    )


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
