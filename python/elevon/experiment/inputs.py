"""What drives a run: the command, the loads, where it begins."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.scenario import Scenario

#: Instants from the run's beginning [s] and values there; straight lines between.
Table = tuple[Floats, Floats]

_EMPTY: Mapping[str, Any] = {"kind": "table", "times": [0.0, 1.0], "values": [0.0, 0.0]}


@dataclass(frozen=True, eq=False)
class Inputs:
    """Inputs of a run, SI.

    Attributes
    ----------
    duration : float
        s.
    mode : str
        What is commanded: ``position``, ``speed``, ``gear``, ...
    command : (ndarray, ndarray) or None
        In the unit of the mode.
    actions : tuple of (float, str)
        Instants and actions, where those are commanded.
    loads : mapping of str to (ndarray, ndarray)
        Port (``brake``, ``output``, ``rig_speed``, ...) to what acts there.
    initial : mapping of str to float or str
        Signal to where it starts.
    """

    duration: float
    mode: str
    command: Table | None = None
    actions: tuple[tuple[float, str], ...] = ()
    loads: Mapping[str, Table] = field(default_factory=dict)
    initial: Mapping[str, float | str] = field(default_factory=dict)

    def scenario(self) -> Scenario:
        """Return the test with empty tables: their arrays are put in when all else is checked."""
        command: dict[str, Any] = {"mode": self.mode}
        if self.command is not None:
            command["terms"] = [_EMPTY]
        if self.actions:
            command["steps"] = [{"time": time, "action": name} for time, name in self.actions]
        document = {
            "duration": self.duration,
            "command": command,
            "load": {port: {"terms": [_EMPTY]} for port in self.loads},
            "initial": dict(self.initial),
        }
        return Scenario.from_dict(document)

    def tables(self, name: str) -> dict[str, Table]:
        """Return the arrays by port.

        Raises
        ------
        InputError
            Instants that do not increase, or what is no finite number; `name` is the log's.
        """
        tables = dict(self.loads)
        if self.command is not None:
            tables["command"] = self.command
        return {port: checked(table, f"{name}: {port}") for port, table in tables.items()}


def checked(table: Table, place: str) -> Table:
    """Return a table as the core takes it; errors as `Inputs.tables`."""
    times, values = (np.ascontiguousarray(x, dtype=np.float64) for x in table)
    if len(times) != len(values) or not (np.isfinite(times).all() and np.isfinite(values).all()):
        raise InputError(f"{place}: a sample is missing or no finite number")
    if not np.all(np.diff(times) > 0.0):
        raise InputError(f"{place}: time does not increase")
    return times, values
