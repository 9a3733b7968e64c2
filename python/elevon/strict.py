"""The base of the tables of our own files: no key unknown, no value changed, no infinity."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict, StrictFloat, StrictInt, StrictStr

Number = StrictInt | StrictFloat
#: A number in SI, or a text with its unit.
Quantity = Number | StrictStr


class Strict(BaseModel):
    """A table whose unknown keys are errors."""

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)
