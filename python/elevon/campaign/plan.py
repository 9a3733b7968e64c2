"""The plan file: what varies, how, and how the runs are split.

Grammar: ``docs/reference/campaigns.md``.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Self

from pydantic import Field, StrictBool, StrictInt, StrictStr, model_validator

from elevon.campaign.grammar import Axis, Case, Design, Population, Random
from elevon.documents import Document, read_toml, validated
from elevon.strict import Number, Strict


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
