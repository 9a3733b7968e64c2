"""Results of the demonstration's steps in a form that can be kept: to JSON and back, to the bit."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from elevon.report.checks import Check
from elevon.reproduce.backlash import BacklashResult
from elevon.reproduce.backlash.campaign import RowResult
from elevon.reproduce.backlash.table import BacklashRow


@dataclass(frozen=True)
class Step:
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

    name: str
    seconds: float
    reused: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "name": self.name,
            "seconds": self.seconds,
            "resumed": bool(self.reused),
            "kept": self.reused,
        }


@dataclass(frozen=True)
class Backlashes:
    """The recomputed backlash table, without its traces."""

    rows: tuple[RowResult, ...]
    checks: tuple[Check, ...]

    @classmethod
    def of(cls, result: BacklashResult) -> Backlashes:
        """Take the table from the whole result."""
        return cls(tuple(result.rows), tuple(result.checks))

    def to_json(self) -> dict[str, Any]:
        """Return plain types."""
        return {
            "rows": [asdict(row) for row in self.rows],
            "checks": [asdict(check) for check in self.checks],
        }

    @classmethod
    def from_json(cls, data: Any) -> Backlashes:
        """Return the table again."""
        rows = (RowResult(**{**r, "measured": BacklashRow(**r["measured"])}) for r in data["rows"])
        return cls(tuple(rows), tuple(Check(**check) for check in data["checks"]))
