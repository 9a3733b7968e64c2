"""What was done to a live bench, from its start on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from elevon.bench.rig import moved
from elevon.errors import InputError
from elevon.live.scenario_text import Act, ScenarioWriter
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.live.unit import LiveUnit


_MOST = 2000  # entries: a slider that is moved for minutes
_QUIET = ("record", "save", "factor", "pause", "restart", "repeat")  # none acts on the actuator


def moved_command(given: Mapping[str, Any], start: float) -> dict[str, Any]:
    """Return a command with its instants moved to a start [s], as a note states it."""
    out = dict(given)
    if "terms" in given:
        out["terms"] = [moved(dict(term), start) for term in given["terms"]]
    if "steps" in given:
        out["steps"] = [
            {**step, "time": max(0.0, parse_quantity(step["time"], "s", "time") + start)}
            for step in given["steps"]
        ]
    return out


class Journal:
    """The acts on a unit with their instants, counted from its last start from rest.

    Parameters
    ----------
    unit : LiveUnit
        What runs.
    """

    def __init__(self, unit: LiveUnit) -> None:
        self._unit = unit
        self.begin()

    def begin(self) -> None:
        """Forget what was: the unit has begun from rest, with what stands."""
        unit = self._unit
        self.zero, self.mode = unit.time, unit.mode
        self._missed = 0
        self._entries: list[Act] = []
        standing = {
            "set": dict(unit.inputs),
            "fault": {
                name: {"severity": fault.severity, **fault.attributes}
                for name, fault in unit.faults.items()
            },
        }
        self.note({key: value for key, value in standing.items() if value})

    def note(self, done: Mapping[str, Any]) -> None:
        """Note what was done now."""
        acts = {key: value for key, value in done.items() if key not in _QUIET}
        if acts and len(self._entries) < _MOST:
            self._entries.append((round(self._unit.time - self.zero, 9), acts))
        elif acts:
            self._missed += 1

    def steps(self) -> list[dict[str, Any]]:
        """Return the acts, each with its instant [s]; what a bench takes to do them again."""
        return [{"time": 0.0, "mode": self.mode}, *({"time": t, **a} for t, a in self._entries)]

    def scenario(self) -> str:
        """Return a scenario file that does what was done; comments state what none can.

        Raises
        ------
        InputError
            Nothing was done that a scenario could hold.
        """
        if not self._entries:
            raise InputError("save: nothing was done yet")
        end = self._unit.time - self.zero
        writer = ScenarioWriter(self._unit, self.mode, self._entries, end)
        if self._missed:
            writer.remark(f"{self._missed} acts more than {_MOST} are not in here")
        return writer.text()
