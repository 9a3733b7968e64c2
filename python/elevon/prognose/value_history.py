"""Histories of a measured value without an actuator: cracks, bearings, batteries, anything.

A CSV file has the columns ``use``, ``severity``, ``sd`` and, where a sighting is not certain,
``p``; their heads may name a unit: ``severity [mm]``. An empty severity is an inspection that saw
nothing, its ``sd`` a third of what could be seen. The life ends at a limit.
"""

from __future__ import annotations

import csv
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from elevon.arrays import Floats
from elevon.errors import FormatError, InputError, unknown
from elevon.files import read_regular
from elevon.prognose.law import Coefficient, Law
from elevon.prognose.observation import DETECTED, Inspection, Seen
from elevon.prognose.predict import check_order
from elevon.prognose.requirement import Requirement
from elevon.prognose.response import Grid, ResponseTables

VALUE = "value@part"
"""``KIND@PLACE`` of what is measured."""
_COLUMNS = ("use", "severity", "sd", "p")
_NEEDED = ("use", "severity", "sd")
_HEAD = re.compile(r"\s*(\w+)\s*(?:\[\s*([^\]]*?)\s*\])?\s*")
_QUANTITY = re.compile(r"\s*([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(\S.*?)?\s*")
_LEAST = 0.02  # of the way to the limit: the least growth that says how long lives are
_ABSENT = 0.05  # probability that nothing grows, before anything was seen; ASSUMED
_MOST = 1.5  # limits that predictions look at
_LARGEST = 2**24  # bytes of a file


@dataclass(frozen=True)
class ValueHistory:
    """Measurements of one value of one unit.

    Attributes
    ----------
    name : str
        Of its file.
    inspections : tuple of Inspection
        In the order of use; severities are shares of the way from `start` to `limit`.
    start, limit : float
        Value of a new unit, and that at which life ends, in `unit`.
    unit, unit_of_use : str
        Of the values, and of use.
    """

    name: str
    inspections: tuple[Inspection, ...]
    start: float
    limit: float
    unit: str
    unit_of_use: str

    def life(self) -> float:
        """Return about how long a life is, as far as the last measurement tells."""
        for item in reversed(self.inspections):
            seen = item.seen[VALUE]
            if seen.severity is not None and item.usage > 0.0:
                return item.usage / max(seen.severity, _LEAST)
        last = self.inspections[-1].usage
        return last / _LEAST if last > 0.0 else 1.0


def read_value_history(path: str | os.PathLike[str], limit: str) -> ValueHistory:
    """Read a CSV file of measurements.

    Parameters
    ----------
    path : path
        The file.
    limit : str
        Value at which life ends, with a unit where the file's values have one.

    Raises
    ------
    FormatError
        No such columns, a value that is no number, or outside what it can be.
    InputError
        Use that goes back, a limit that is no value or that a new unit has reached.
    """
    place = Path(path).expanduser()
    units, rows = _table(place)
    if not rows:
        raise FormatError(f"{place}: has no measurement")
    end = _limit(limit, units["severity"], place)
    start = next((row["severity"] for row in rows if row["use"] == 0.0), 0.0) or 0.0
    if end == start:
        raise InputError(f"--limit {limit}: a new unit is at {start:g}: no life lies between")
    inspections = tuple(
        Inspection(row["use"] or 0.0, {VALUE: _seen(row, start, end)}, name=f"use {row['use']:g}")
        for row in rows
    )
    check_order(inspections)
    return ValueHistory(
        place.stem, inspections, start, end, units["severity"], units["use"] or "uses"
    )


def _limit(text: str, unit: str, place: Path) -> float:
    """Return a limit in the unit of the file's values."""
    match = _QUANTITY.fullmatch(text)
    if match is None:
        raise InputError(f"--limit {text!r}: is not a value such as '49.8 mm'")
    if match[2] and match[2] != unit:
        known = f"in {unit}" if unit else "without a unit (head it 'severity [UNIT]')"
        raise InputError(f"--limit {text!r}: the severities of {place} are {known}")
    return float(match[1])


def _seen(row: Mapping[str, float | None], start: float, end: float) -> Seen:
    """Return a measurement as a share of the way from a new unit to the limit."""
    value, deviation = row["severity"], (row["sd"] or 0.0) / abs(end - start)
    if value is None:
        return Seen(None, deviation, deviation, detectable=DETECTED * deviation)
    p = row.get("p")
    share = (value - start) / (end - start)
    return Seen(share, deviation, deviation, probability=1.0 if p is None else p)


def _table(place: Path) -> tuple[dict[str, str], list[dict[str, float | None]]]:
    """Return the unit of each column, and the rows as numbers; None where a cell is empty."""
    try:
        text = read_regular(place, _LARGEST).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(f"{place}: is no text: {error}") from error
    lines = [line for line in text.splitlines() if line.strip() and not line.startswith("#")]
    table = list(csv.reader(lines))
    if not table:
        raise FormatError(f"{place}: is empty")
    heads = [_HEAD.fullmatch(head) for head in table[0]]
    names = [match[1] if match else head for match, head in zip(heads, table[0], strict=True)]
    for name in names:
        if name not in _COLUMNS:
            raise FormatError(str(unknown("column", name, _COLUMNS, str(place))))
    lacking = next((name for name in _NEEDED if name not in names), None)
    if lacking is not None:
        raise FormatError(f"{place}: has no column {lacking!r}; needed: {', '.join(_NEEDED)}")
    units = {n: (m[2] or "") if m else "" for n, m in zip(names, heads, strict=True)}
    rows = [_row(f"{place}:{k}", names, cells) for k, cells in enumerate(table[1:], start=2)]
    return units, rows


def _row(place: str, names: Sequence[str], cells: Sequence[str]) -> dict[str, float | None]:
    if len(cells) != len(names):
        raise FormatError(f"{place}: has {len(cells)} values, the head {len(names)}")
    out: dict[str, float | None] = {}
    for name, cell in zip(names, cells, strict=True):
        try:
            out[name] = float(cell) if cell.strip() else None
        except ValueError as error:
            raise FormatError(f"{place}: {name} = {cell!r} is not a number") from error
        value = out[name]
        if value is not None and not np.isfinite(value):
            raise FormatError(f"{place}: {name} = {cell} is not finite")
    if out["use"] is None or not 0.0 <= out["use"] <= 1e12:
        raise FormatError(f"{place}: use = {out['use']} is not a number from 0 to 1e12")
    if out["sd"] is None or not out["sd"] > 0.0:
        raise FormatError(f"{place}: sd = {out['sd']} must be above 0")
    p = out.get("p")
    if p is not None and not 0.0 <= p <= 1.0:
        raise FormatError(f"{place}: p = {p:g} is outside 0 to 1")
    return out


def value_tables(history: ValueHistory, life: float | None = None) -> ResponseTables:
    """Return tables of a value that ends a life at its limit and grows by no law.

    Parameters
    ----------
    history : ValueHistory
        What was measured.
    life : float, optional
        Use of an average life; default: as the last measurement has it.
    """
    kind, _, place = VALUE.partition("@")
    law = Law(
        name="no law",
        text="a value that grows at a rate of its own",
        source="none",
        kind=kind,
        place=place,
        unit="1",
        rate=_even,
        drivers=("hours",),
        coefficients={"rate": Coefficient(1.0 / (life or history.life()), "1", "the history")},
        highest=_MOST,
        trust=0.0,
        dormant=_ABSENT,
    )
    need = Requirement(name="limit", measure="severity", fault=VALUE, limit=1.0)
    return ResponseTables(
        (law,), (need,), (1.0,), ("1",), Grid((np.array([0.0, _MOST]),)),
        {"hours": np.ones(2)}, np.zeros((2, 1)), 0, "none",
    )  # fmt: skip


def _even(damage: Floats, _drivers: object, c: Mapping[str, float | Floats]) -> Floats:
    return np.full(len(damage), float(np.asarray(c["rate"]).ravel()[0]))
