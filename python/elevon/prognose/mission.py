"""The mission file: what a repetition of the use is, what must hold, and what grows by it."""

from __future__ import annotations

import os
from collections.abc import Container, Mapping
from dataclasses import dataclass, field
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
    field_validator,
    model_validator,
)

from elevon.documents import Document, read_toml, validated
from elevon.errors import InputError
from elevon.prognose.law import Law, find_law
from elevon.prognose.requirement import Requirement
from elevon.scenario import Scenario
from elevon.units import parse_quantity

Quantity = StrictInt | StrictFloat | StrictStr
_NUMBERS = ("spread", "form_spread", "grain", "start", "start_spread", "dormant")
UNITS_OF_USE = ("flights", "landings", "cycles", "hours")


class _Frozen(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)


class FaultGrowth(_Frozen):
    """A law that acts on the unit, and what of it differs from the package's.

    Attributes
    ----------
    law : str
        Name of the law.
    place : str, optional
        Another place of the same kind of fault.
    spread, form_spread, grain, start, start_spread, dormant, highest : float, optional
        As in `elevon.prognose.law.Law`.
    only : bool
        Whether the law is kept alone: other ways of growth are not tried beside it. Of a
        mission's single law.
    coefficients : mapping of str to quantity
        Other values.
    """

    law: StrictStr
    place: StrictStr | None = None
    spread: StrictFloat | StrictInt | None = None
    form_spread: StrictFloat | StrictInt | None = None
    grain: StrictFloat | StrictInt | None = None
    start: StrictFloat | StrictInt | None = None
    start_spread: StrictFloat | StrictInt | None = None
    dormant: StrictFloat | StrictInt | None = None
    highest: Quantity | None = None
    only: StrictBool = False
    coefficients: dict[str, Quantity] = Field(default_factory=dict)

    def resolved(self, laws: Mapping[str, Law], place: str) -> Law:
        """Return the law with its changes."""
        law = laws[self.law] if self.law in laws else find_law(self.law, place)
        values = {}
        for name, given in self.coefficients.items():
            unit = law.coefficients[name].unit if name in law.coefficients else "1"
            known = unit if "h" not in unit.split("/") else ""
            values[name] = (
                parse_quantity(given, known, f"{place}.{name}") if known else float(given)
            )
        fields = {
            name: float(value) for name in _NUMBERS if (value := getattr(self, name)) is not None
        }
        if self.highest is not None:
            fields["highest"] = parse_quantity(self.highest, law.unit, f"{place}.highest")
        return law.with_values(
            values, place=self.place, source="mission file", only=self.only, **fields
        )


class Usage(_Frozen):
    """How the future use may differ from the mission as it stands.

    Attributes
    ----------
    load : float
        Median factor on the loads of the scenario.
    load_spread : float
        Deviation of its logarithm from one future to another.
    """

    load: StrictFloat | StrictInt = 1.0
    load_spread: StrictFloat | StrictInt = 0.0

    @model_validator(mode="after")
    def _sane(self) -> Self:
        if not self.load > 0.0:
            raise ValueError(f"load = {self.load} must be above 0")
        if not 0.0 <= self.load_spread <= 1.0:
            raise ValueError(f"load_spread = {self.load_spread} is outside 0 to 1")
        return self


@dataclass(frozen=True)
class CountedUse:
    """What is counted where no mission says it: the unit of use, loads as they were."""

    unit: str
    usage: Usage = field(default_factory=Usage)


class Mission(_Frozen):
    """A mission, repeated until the end of life.

    Attributes
    ----------
    unit : str
        One of `UNITS_OF_USE`: what is counted.
    hours : float
        Time in use that one of them takes [h].
    repeats : float
        How often the scenario is done in one of them.
    temperature : quantity, optional
        Of the air; sets ``thermal.ambient``, and the winding's where no thermal model runs.
    scenario : dict
        Command, loads, parameters, duration: the grammar of scenario files.
    requirement : tuple of Requirement
        What must hold; the first that does not ends the life.
    growth : tuple of FaultGrowth
        Laws that act.
    usage : Usage
        Of the future.
    """

    name: StrictStr = ""
    text: StrictStr = ""
    unit: Literal["flights", "landings", "cycles", "hours"] = "flights"
    hours: StrictFloat | StrictInt = 1.0
    repeats: StrictFloat | StrictInt = 1.0
    temperature: Quantity | None = None
    scenario: dict[str, Any]
    requirement: tuple[Requirement, ...]
    growth: tuple[FaultGrowth, ...]
    usage: Usage = Usage()

    @field_validator("hours", "repeats")
    @classmethod
    def _positive(cls, value: float) -> float:
        if not value > 0.0:
            raise ValueError(f"{value} must be above 0")
        return value

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if not self.requirement:
            raise ValueError("a mission needs at least one [[requirement]]")
        if not self.growth:
            raise ValueError("a mission needs at least one [[growth]]")
        if len(self.growth) > 1 and any(item.only for item in self.growth):
            raise ValueError("only = true keeps a law alone: the mission has several [[growth]]")
        names = [item.name for item in self.requirement]
        twice = next((name for name in names if names.count(name) > 1), None)
        if twice is not None:
            raise ValueError(f"requirement {twice!r} is given twice")
        if self.unit == "hours" and self.hours != 1.0:
            raise ValueError("a mission counted in hours takes 1 hour: leave `hours` out")
        return self

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Mission:
        """Read a mission file (TOML).

        Raises
        ------
        InputError
            Every finding with file, line, key and the nearest names.
        """
        from elevon.scenario.scenario import located

        document = read_toml(Path(path))
        data = located(document.data, document.folder)
        mission = validated(cls, data, document)
        mission.scenarios(document)
        return mission

    @classmethod
    def from_dict(cls, data: Mapping[str, object], place: str = "mission") -> Mission:
        """Build a mission from nested mappings of the file's form; errors as `load`."""
        document = Document(place, "", {})
        mission = validated(cls, data, document)
        mission.scenarios(document)
        return mission

    def scenarios(
        self, document: Document | None = None, known: Container[str] | None = None
    ) -> Scenario:
        """Return the mission's scenario, with its temperature.

        Parameters
        ----------
        document : Document, optional
            Where it stands, for messages.
        known : container of str, optional
            Parameter paths of the actuator; the temperature sets those of them that it concerns.
        """
        document = document or Document(self.name or "mission", "", {})
        scenario = validated(Scenario, self.scenario, document.within(("scenario",)))
        if scenario.fault:
            raise InputError(
                f"{document.place(('scenario', 'fault'))}: a mission's faults grow by [[growth]]"
            )
        if self.temperature is None:
            return scenario
        kelvin = parse_quantity(self.temperature, "K", document.place(("temperature",)))
        paths = ["thermal.ambient", "motor.winding_temperature"]
        values = {path: kelvin for path in paths if known is None or path in known}
        if not values:
            place = document.place(("temperature",))
            raise InputError(f"{place}: the actuator has neither {' nor '.join(paths)}")
        return scenario.replaced(parameters={**values, **scenario.parameters})

    def laws(self, more: Mapping[str, Law] | None = None) -> tuple[Law, ...]:
        """Return the laws that act.

        Raises
        ------
        InputError
            A law is unknown, or two drive the same fault.
        """
        known = dict(more or {})
        laws = tuple(item.resolved(known, f"growth[{k}]") for k, item in enumerate(self.growth))
        keys = [law.key for law in laws]
        twice = next((key for key in keys if keys.count(key) > 1), None)
        if twice is not None:
            raise InputError(f"two laws drive {twice}; one fault grows by one law")
        return laws
