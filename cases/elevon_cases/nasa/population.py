"""Healthy units: what differs between two articles, two reassemblies and two days.

None of these spreads is printed. Each is ASSUMED with its reason in `SPREADS`; a normal one is cut
at three deviations.
"""

from __future__ import annotations

import hashlib
import json
import math
import zlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, cast

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.data import read_table
from elevon.errors import OutputExistsError
from elevon.files import write_text

Kind = Literal["factor", "added", "vector", "range"]


@dataclass(frozen=True, slots=True)
class UnitSpread:
    """How one property differs between healthy units.

    Attributes
    ----------
    name : str
        The property.
    paths : tuple of str
        Parameters that share the draw.
    kind : str
        ``factor``: 1 + size n on the actuator file's values; ``added``: size n; ``vector``: the
        length of two of them at a right angle; ``range``: even between `size` and `upper`. n is
        normal.
    size : float
        Deviation (of a range its lower end), in the parameter's SI unit or as a share.
    reason : str
        Why this much: nothing of it is printed.
    upper : float
        Upper end of a range.
    """

    name: str
    paths: tuple[str, ...]
    kind: Kind
    size: float
    reason: str
    upper: float = 0.0

    def draw(self, rng: np.random.Generator) -> float:
        """Return one draw: a factor, or what is added, or the value itself."""
        if self.kind == "range":
            return float(rng.uniform(self.size, self.upper))
        normal, other = np.clip(rng.standard_normal(2), -3.0, 3.0)
        if self.kind == "vector":
            return self.size * float(np.hypot(normal, other))
        return self.size * float(normal) + (1.0 if self.kind == "factor" else 0.0)


FRICTION_COEFFICIENT = "friction coefficient of the screw"
AIR = "temperature of air and actuator"
GREASE_PER_KELVIN = 0.03
"""Share of the grease's viscosity lost per kelvin (ASSUMED: common greases halve in some 23 K)."""

SPREADS = tuple(
    UnitSpread(
        row["name"], tuple(row["paths"].split()), cast(Kind, row["kind"]), float(row["size"]),
        row["reason"], float(row["upper"]),
    )
    for row in read_table("nasa_spreads")
)  # fmt: skip
"""What differs between healthy units, all ASSUMED."""

NOISE = {
    "sensor.current.noise_deviation": 0.02,
    "sensor.current.noise_sample_time": 2.5e-4,
    "sensor.resolver.noise_deviation": 1e-4,
    "sensor.resolver.speed_noise_deviation": 0.05,
    "sensor.resolver.noise_sample_time": 2.5e-4,
}
"""Noise of every unit, held for a tick of the controller; ASSUMED."""
_NOISE_ROWS = (
    ("noise of the current sensors", "0.02", "A; 0.1 % of a 20 A sensor"),
    ("noise of the resolver's angle", "0.0001", "rad; a step of a converter of 16 bits"),
    ("noise of the resolver's speed", "0.05", "rad/s; 0.05 A behind the speed loop"),
)


def draw_units(actuator: Actuator, group: str, count: int, seed: int) -> list[Actuator]:
    """Return healthy units; the same group and seed give the same units.

    Parameters
    ----------
    actuator : Actuator
        The nominal one.
    group : str
        Name of the group: another name, other units.
    count : int
        How many.
    seed : int
        Not negative.
    """
    number = zlib.crc32(group.encode())
    return [
        actuator.with_values(_values(actuator, np.random.default_rng([seed, number, index])))
        for index in range(count)
    ]


def _values(actuator: Actuator, rng: np.random.Generator) -> dict[str, float]:
    value = actuator.parameters.value
    values: dict[str, float] = dict(NOISE)
    for spread in SPREADS:
        drawn = spread.draw(rng)
        for path in spread.paths:
            if spread.kind == "factor":
                values[path] = value(path) * drawn
            else:
                values[path] = drawn + (0.0 if spread.kind == "range" else value(path))
        if spread.name == FRICTION_COEFFICIENT:
            values |= _efficiencies(actuator, drawn)
        elif spread.name == AIR:
            thinner = math.exp(-GREASE_PER_KELVIN * (drawn - 293.15))
            values["friction.viscous"] = value("friction.viscous") * thinner
    return values


def _efficiencies(actuator: Actuator, factor: float) -> dict[str, float]:
    """Both efficiencies of a screw whose friction coefficient is so many times the file's."""
    value = actuator.parameters.value
    slope = 2.0 * value("screw.lead") / value("screw.pitch_diameter")
    eta, aiding = value("screw.efficiency"), value("screw.efficiency_aiding")
    driving = factor * (1.0 - eta) * slope / (eta + slope**2)
    back = factor * (1.0 - aiding) * slope / (1.0 + aiding * slope**2)
    return {
        "screw.efficiency": (1.0 - driving * slope) / (1.0 + driving / slope),
        "screw.efficiency_aiding": (1.0 - back / slope) / (1.0 + back * slope),
    }


def spread_rows() -> list[dict[str, object]]:
    """Return the spreads as rows of a report: property, deviation and reason."""
    rows: dict[str, dict[str, Any]] = {}
    for spread in SPREADS:
        if spread.kind == "range":
            size = f"{spread.size:g} to {spread.upper:g}"
        else:
            size = f"{100 * spread.size:g} %" if spread.kind == "factor" else f"{spread.size:g}"
        row = {"property": spread.name, "deviation": size, "reason": spread.reason}
        rows.setdefault(spread.name, row)
    noise = [
        dict(zip(("property", "deviation", "reason"), row, strict=True)) for row in _NOISE_ROWS
    ]
    return [*rows.values(), *noise]


def made_of(actuator: Actuator) -> dict[str, str]:
    """Return what else decides a cell: the actuator's numbers and the program."""
    import elevon

    return {"parameter_hash": actuator.parameters.hash, "version": elevon.__version__}


def work_key(**facts: object) -> str:
    """Return digits that tell one piece of work from any other: equal facts, equal digits."""
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class CellStore:
    """Arrays by name in ``runs.json``, written whole after every cell.

    Parameters
    ----------
    folder : Path or None
        None keeps them in memory only.
    key : str
        Of the work (`work_key`): cells of another one are not used.

    Raises
    ------
    OutputExistsError
        ``runs.json`` cannot be read.
    """

    def __init__(self, folder: Path | None, key: str) -> None:
        self._path = None if folder is None else folder / "runs.json"
        self._key = key
        self._cells: dict[str, list[Any]] = {}
        if self._path is not None and self._path.is_file():
            self._cells = self._read(self._path)

    def _read(self, path: Path) -> dict[str, list[Any]]:
        try:
            content = json.loads(path.read_text("utf-8"))
            same = content["work"] == self._key
            return dict(content["cells"]) if same else {}
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise OutputExistsError(
                f"{path}: cannot be read ({error}); remove it to begin again"
            ) from error

    def get(self, name: str) -> Floats | None:
        """Return a finished cell, None where it is not there."""
        values = self._cells.get(name)
        return None if values is None else np.array(values, dtype=float)

    def put(self, name: str, values: Floats) -> None:
        """Keep a finished cell."""
        self._cells[name] = values.tolist()
        if self._path is not None:
            content = {"work": self._key, "cells": self._cells}
            write_text(self._path, json.dumps(content) + "\n", force=True)
