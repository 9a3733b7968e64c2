"""The tables of a plan file: targets, axes, draws, designs, populations, cases."""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Field,
    StrictBool,
    StrictInt,
    StrictStr,
    model_validator,
)

from elevon.documents import Document, read_toml, validated
from elevon.strict import Number, Quantity, Strict

Role = Literal["control", "nuisance"]


class Target(Strict):
    """What one axis or draw changes: exactly one of `parameter`, `fault` and `scenario`.

    Attributes
    ----------
    parameter : str
        Path of a parameter.
    fault : str
        ``KIND@PLACE``; the values are severities. `attributes` and `profile` go with it.
    scenario : str
        Place in the scenario, such as ``command.terms[0].amplitude`` or ``duration``.
    role : str
        ``control``: what the experimenter sets on purpose; ``nuisance``: what varies by itself.
    """

    parameter: StrictStr | None = None
    fault: StrictStr | None = None
    scenario: StrictStr | None = None
    role: Role = "control"
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


class Random(Strict):
    """Random draws, all quantities together; with a population anew for each unit and age."""

    count: StrictInt = Field(ge=0)
    method: Literal["latin_hypercube", "sobol", "halton", "uniform"] = "latin_hypercube"
    seed: StrictInt = Field(0, ge=0)
    draw: tuple[Draw, ...] = Field(min_length=1)


class Factor(Draw):
    """One factor of a design: two ends, or a list of levels.

    Attributes
    ----------
    letter : str
        Its name in generators and words; default A, B, C, ... in the order of the plan.
    """

    letter: StrictStr = ""


class Power(Strict):
    """The effect that the design is to show, for its power.

    Attributes
    ----------
    response : str
        Whose effect, for the reader.
    effect : float
        Difference of the response between the two ends of a factor.
    sd : float
        Standard deviation of the response between runs alike, in the response's unit.
    alpha : float
        Probability of calling an effect where there is none.
    terms : tuple of str
        Effects of interest, such as ``A`` or ``A:B``; default every factor.
    """

    response: StrictStr = ""
    effect: Number = Field(gt=0.0)
    sd: Number = Field(gt=0.0)
    alpha: Number = Field(0.05, gt=0.0, lt=1.0)
    terms: tuple[StrictStr, ...] = ()


class Blocking(Target):
    """A nuisance quantity that goes with the blocks: one value a block."""

    values: tuple[Any, ...] = Field(min_length=1)
    role: Role = "nuisance"


class Design(Strict):
    """A designed experiment over several factors.

    Attributes
    ----------
    kind : str
        Which design.
    generators : tuple of str
        Of a fractional factorial, such as ``E=ABCD``; instead of them `runs`, from the catalogue.
    runs : int
        Of a catalogued fraction or a Plackett-Burman design, before replication.
    count, seed : int
        Points and seed of a Latin hypercube, a Sobol sequence or random points.
    replicates : int
        How often every point is run, each time with random numbers of its own.
    randomise : bool
        Whether the runs stand in random order (within their blocks), by `order_seed`.
    blocks : int
        Number of blocks; a two-level design is split by `block_generators` (words such as
        ``ABC``), several replicates can be the blocks.
    centre : int
        Centre points of a two-level design, per replicate.
    file : str
        CSV of your own table: a line of letters or names, a row a point.
    """

    kind: Literal[
        "full_factorial",
        "fractional_factorial",
        "plackett_burman",
        "latin_hypercube",
        "sobol",
        "random",
        "table",
    ]
    factor: tuple[Factor, ...] = Field(min_length=1)
    generators: tuple[StrictStr, ...] = ()
    runs: StrictInt | None = Field(None, ge=1)
    count: StrictInt | None = Field(None, ge=0)
    seed: StrictInt = Field(0, ge=0)
    replicates: StrictInt = Field(1, ge=1)
    randomise: StrictBool = False
    order_seed: StrictInt = Field(0, ge=0)
    blocks: StrictInt = Field(1, ge=1)
    block_generators: tuple[StrictStr, ...] = ()
    blocking: Blocking | None = None
    centre: StrictInt = Field(0, ge=0)
    file: StrictStr | None = None
    power: Power | None = None


class Spread(Target):
    """How a quantity differs from unit to unit.

    Attributes
    ----------
    distribution : str
        ``normal`` and ``lognormal`` about the actuator's own value with `sd` (a quantity, or a
        fraction such as ``"3 %"``), cut at `cut` standard deviations; ``uniform`` from `start`
        to `stop`.
    """

    distribution: Literal["normal", "lognormal", "uniform"] = "normal"
    sd: Quantity | None = None
    cut: Number = Field(3.0, gt=0.0)
    start: Quantity | None = Field(None, alias="from")
    stop: Quantity | None = Field(None, alias="to")
    role: Role = "nuisance"

    @model_validator(mode="after")
    def _complete(self) -> Self:
        if self.parameter is None:
            raise ValueError("a spread is of a 'parameter'")
        ranged = self.start is not None and self.stop is not None
        if self.distribution == "uniform" and (not ranged or self.sd is not None):
            raise ValueError("a uniform spread needs 'from' and 'to', and no 'sd'")
        if self.distribution != "uniform" and (ranged or self.sd is None):
            raise ValueError(f"a {self.distribution} spread needs 'sd', not 'from' and 'to'")
        return self


class Growth(Target):
    """How a quantity grows over a unit's life: from `start` when new to `stop` at its end.

    value(age) = start + (stop - start) g(a), a = (age - onset)/(1 - onset) from 0 to 1, with
    g = a (linear), a^exponent (power) or (e^(k a) - 1)/(e^k - 1) (exponential, k = exponent).

    Attributes
    ----------
    onset : tuple of float
        Ages (0 to 1) between which each unit's growth begins, drawn uniformly.
    spread : float
        Standard deviation of the logarithm of each unit's growth (stop - start).
    probability : float
        Part of the units in which it grows at all.
    """

    start: Quantity = Field(alias="from")
    stop: Quantity = Field(alias="to")
    law: Literal["linear", "power", "exponential"] = "linear"
    exponent: Number = Field(2.0, gt=0.0)
    onset: tuple[Number, Number] = (0.0, 0.0)
    spread: Number = Field(0.0, ge=0.0)
    probability: Number = Field(1.0, ge=0.0, le=1.0)

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.scenario is not None:
            raise ValueError("what grows is a 'fault' or a 'parameter'")
        if not 0.0 <= self.onset[0] <= self.onset[1] < 1.0:
            raise ValueError(f"onset = {list(self.onset)} is not two ages from 0 to below 1")
        return self


class Population(Strict):
    """Units of one kind, each with parameters of its own, seen at some ages of its life.

    Attributes
    ----------
    ages : tuple of float
        From 0 (new) to 1 (end of life), or `points` of them, evenly.
    """

    units: StrictInt = Field(ge=1)
    seed: StrictInt = Field(0, ge=0)
    ages: tuple[Number, ...] = ()
    points: StrictInt | None = Field(None, ge=1)
    spread: tuple[Spread, ...] = ()
    growth: tuple[Growth, ...] = ()

    @model_validator(mode="after")
    def _rising(self) -> Self:
        if self.ages and self.points is not None:
            raise ValueError("give either 'ages' or 'points'")
        if any(not 0.0 <= age <= 1.0 for age in self.ages):
            raise ValueError(f"ages: {list(self.ages)} are not all from 0 to 1")
        if any(b <= a for a, b in zip(self.ages, self.ages[1:], strict=False)):
            raise ValueError(f"ages: {list(self.ages)} do not rise")
        return self


class Case(Strict):
    """A named variant that changes several things at once; the cases are one axis."""

    name: StrictStr = Field(min_length=1)
    faults: tuple[StrictStr | dict[str, Any], ...] = ()
    parameters: dict[str, Any] = Field(default_factory=dict)
    scenario: dict[str, Any] = Field(default_factory=dict)


class Plan(Strict):
    """A campaign plan.

    The runs are all combinations of units, ages, cases, axes, draws (or the points of the design)
    and seeds. What a run sets where it has no effect is an error, unless `allow_not_acting`.

    Attributes
    ----------
    features : str or tuple of str
        Computed while simulating, such as ``all@400 Hz``; with them `record` may be empty.
    responses : tuple of str
        What the campaign is about: signals or features, named for the reader and for `effects`.
    split_by : str
        ``unit`` (the default where there is a population) or ``draw``.
    runs_per_file : int
        Runs in one file; default: as many as make some 16 MB, at most 256.
    """

    name: StrictStr = "campaign"
    text: StrictStr = ""
    actuator: StrictStr
    fidelity: StrictStr = "high"
    scenario: StrictStr | dict[str, Any] | None = None
    parameters: dict[str, Any] = Field(default_factory=dict)
    record: StrictStr | tuple[StrictStr, ...] | None = None
    features: StrictStr | tuple[StrictStr, ...] = ()
    responses: tuple[StrictStr, ...] = ()
    seeds: tuple[Annotated[StrictInt, Field(ge=0, lt=2**63)], ...] = (0,)
    population: Population | None = None
    case: tuple[Case, ...] | None = None
    vary: tuple[Axis, ...] = ()
    random: Random | None = None
    design: Design | None = None
    split: dict[str, Number] = Field(default_factory=dict)
    split_seed: StrictInt = Field(0, ge=0)
    split_by: StrictStr | None = None
    allow_not_acting: StrictBool = False
    runs_per_file: StrictInt | None = Field(None, ge=1, le=4096)

    @model_validator(mode="after")
    def _split_adds_up(self) -> Self:
        shares = self.split.values()
        # Whole numbers beyond floats are compared before they are added to floats.
        if self.split and (min(shares) < 0.0 or max(shares) > 2.0 or abs(sum(shares) - 1.0) > 1e-9):
            raise ValueError(f"split: the shares are {list(shares)}; they must add up to 1")
        self._split_keeps_together()
        if self.random is not None and self.design is not None:
            raise ValueError("give either 'random' or 'design'")
        names = [case.name for case in self.case or ()]
        for index, name in enumerate(names):
            if name in names[:index]:
                raise ValueError(f"case {name!r} is given twice")
        return self

    def _split_keeps_together(self) -> None:
        if self.split_by is None:
            return
        if not self.split:
            raise ValueError("split_by: there is no 'split'")
        if self.split_by == "unit" and self.population is None:
            raise ValueError("split_by = 'unit': the plan has no 'population'")
        if self.split_by == "draw" and self.population is not None:
            raise ValueError("split_by = 'draw' would leak: runs of one unit stand in two parts")
        if self.split_by not in {"unit", "draw"}:
            raise ValueError(
                f"split_by = {self.split_by!r} would leak: runs alike stand in two parts; "
                "valid: 'unit', 'draw'"
            )


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
    return checked_plan(document), document


def checked_plan(document: Document) -> Plan:
    """Return the plan of a document that has been read; errors as `load_plan`."""
    return validated(Plan, _plain(document.data), document)


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
