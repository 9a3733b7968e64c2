"""The plan file: what varies, how, and how the runs are split (grammar: ``docs/batch.md``)."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal, Self

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    StrictBool,
    StrictFloat,
    StrictInt,
    StrictStr,
    model_validator,
)

from elevon.documents import Document, read_toml, validated

__all__ = ["Axis", "Case", "Draw", "Plan", "Random", "load_plan"]

Quantity = StrictInt | StrictFloat | StrictStr
Number = StrictInt | StrictFloat


class _Strict(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class Target(_Strict):
    """What one axis or draw changes: exactly one of `parameter`, `fault` and `scenario`.

    Attributes
    ----------
    parameter : str
        Path of a parameter.
    fault : str
        ``KIND@PLACE``; the values are severities. `attributes` and `profile` go with it.
    scenario : str
        Place in the scenario, such as ``command.terms[0].amplitude`` or ``duration``.
    """

    parameter: StrictStr | None = None
    fault: StrictStr | None = None
    scenario: StrictStr | None = None
    attributes: dict[str, Quantity] = Field(default_factory=dict)
    profile: StrictStr | dict[str, Any] | None = None

    @model_validator(mode="after")
    def _one(self) -> Self:
        given = [name for name in ("parameter", "fault", "scenario") if getattr(self, name)]
        if len(given) != 1:
            raise ValueError("give exactly one of 'parameter', 'fault' and 'scenario'")
        if self.fault is None and (self.attributes or self.profile is not None):
            raise ValueError("'attributes' and 'profile' belong to a fault")
        if self.fault is not None and (self.fault.count("@") != 1 or "=" in self.fault):
            raise ValueError(f"fault = {self.fault!r} is not of the form KIND@PLACE")
        return self

    @property
    def name(self) -> str:
        """The name of the varied quantity in tables."""
        return self.parameter or self.fault or self.scenario or ""


class Axis(Target):
    """One axis of the grid: a list of values, or `count` of them from one to another."""

    values: tuple[Any, ...] | None = None
    start: Quantity | None = Field(None, alias="from")
    stop: Quantity | None = Field(None, alias="to")
    count: StrictInt | None = Field(None, ge=1)
    spacing: Literal["linear", "log"] = "linear"

    @model_validator(mode="after")
    def _values_or_range(self) -> Self:
        ranged = [value is not None for value in (self.start, self.stop, self.count)]
        if (self.values is not None) == any(ranged) or (any(ranged) and not all(ranged)):
            raise ValueError("give either 'values', or 'from', 'to' and 'count'")
        return self


class Draw(Target):
    """One random quantity: from a range, or one of `values`.

    Attributes
    ----------
    probability : float
        Of a fault being there at all.
    """

    values: tuple[Any, ...] | None = None
    start: Quantity | None = Field(None, alias="from")
    stop: Quantity | None = Field(None, alias="to")
    spacing: Literal["linear", "log"] = "linear"
    probability: Number = Field(1.0, ge=0.0, le=1.0)

    @model_validator(mode="after")
    def _values_or_range(self) -> Self:
        ranged = [value is not None for value in (self.start, self.stop)]
        if (self.values is not None) == any(ranged) or (any(ranged) and not all(ranged)):
            raise ValueError("give either 'values', or 'from' and 'to'")
        if self.values is not None and not self.values:
            raise ValueError("'values' is empty")
        if self.probability < 1.0 and self.fault is None:
            raise ValueError("'probability' belongs to a fault")
        return self


class Random(_Strict):
    """Random draws, all quantities together."""

    count: StrictInt = Field(ge=0)
    method: Literal["latin_hypercube", "sobol", "halton", "uniform"] = "latin_hypercube"
    seed: StrictInt = Field(0, ge=0)
    draw: tuple[Draw, ...] = Field(min_length=1)


class Case(_Strict):
    """A named variant that changes several things at once; the cases are one axis."""

    name: StrictStr = Field(min_length=1)
    faults: tuple[StrictStr | dict[str, Any], ...] = ()
    parameters: dict[str, Any] = Field(default_factory=dict)
    scenario: dict[str, Any] = Field(default_factory=dict)


class Plan(_Strict):
    """A batch plan.

    The runs are all combinations of the cases, the axes, the random draws and the seeds. What a
    run sets where it cannot act is an error, unless `allow_not_acting` makes it a warning.
    """

    name: StrictStr = "batch"
    text: StrictStr = ""
    actuator: StrictStr
    fidelity: StrictStr = "high"
    scenario: StrictStr | dict[str, Any] | None = None
    parameters: dict[str, Any] = Field(default_factory=dict)
    record: StrictStr | tuple[StrictStr, ...] | None = None
    seeds: tuple[StrictInt, ...] = (0,)
    case: tuple[Case, ...] | None = None
    vary: tuple[Axis, ...] = ()
    random: Random | None = None
    split: dict[str, Number] = Field(default_factory=dict)
    split_seed: StrictInt = Field(0, ge=0)
    allow_not_acting: StrictBool = False
    runs_per_file: StrictInt = Field(50, ge=1, le=50)

    @model_validator(mode="after")
    def _split_adds_up(self) -> Self:
        shares = self.split.values()
        if self.split and (min(shares) < 0.0 or abs(sum(shares) - 1.0) > 1e-9):
            raise ValueError(f"split: the shares are {list(shares)}; they must add up to 1")
        names = [case.name for case in self.case or ()]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise ValueError(f"case {name!r} is given twice")
        return self


def load_plan(path: str | os.PathLike[str]) -> tuple[Plan, Document]:
    """Read a plan file (TOML).

    Returns
    -------
    Plan, Document
        The checked plan, and the document it came from.

    Raises
    ------
    InputError
        Every finding with file, line, key and the nearest names.
    """
    document = read_toml(Path(path))
    return validated(Plan, _plain(document.data), document), document


def _plain(data: Mapping[str, Any]) -> dict[str, Any]:
    """Let ``[parameters]`` hold dotted keys, which TOML nests."""
    return {key: _flat(value) if key == "parameters" else value for key, value in data.items()}


def _flat(table: Any) -> Any:
    if not isinstance(table, dict):
        return table
    flat: dict[str, Any] = {}
    for key, value in table.items():
        if isinstance(value, dict):
            flat.update({f"{key}.{name}": item for name, item in _flat(value).items()})
        else:
            flat[key] = value
    return flat
