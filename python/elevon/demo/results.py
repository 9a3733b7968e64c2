"""Results of the demonstration's steps in a form that can be kept."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated

from elevon.plain import Plain, key
from elevon.report.checks import Check
from elevon.reproduce.backlash.campaign import BacklashResult, RowResult


@dataclass(frozen=True)
class Step(Plain):
    """A step of the demonstration.

    Attributes
    ----------
    name : str
        What was done.
    seconds : float
        Time it took now.
    reused : str
        What of it was kept from an interrupted run; empty where nothing was.
    """

    COMPUTED = ("resumed",)

    name: str
    seconds: float
    reused: Annotated[str, key("kept")] = ""

    @property
    def resumed(self) -> bool:
        """Whether some of it was kept."""
        return bool(self.reused)


@dataclass(frozen=True)
class Backlashes(Plain):
    """The recomputed backlash table, without its traces."""

    rows: tuple[RowResult, ...]
    checks: tuple[Check, ...]

    @classmethod
    def of(cls, result: BacklashResult) -> Backlashes:
        """Take the table from the whole result."""
        return cls(tuple(result.rows), tuple(result.checks))
