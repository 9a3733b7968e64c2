"""What an actuator file may hold (checked by pydantic before anything is computed)."""

from __future__ import annotations

from typing import Any, Literal

from pydantic import (
    Field,
    StrictStr,
    field_validator,
)

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
