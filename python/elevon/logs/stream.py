"""Samples read from a stream of lines as they come: CSV as a log file has it, or JSON by roles."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import FormatError, InputError, did_you_mean, quoted
from elevon.logs.command.note import CommandNote
from elevon.logs.formats.table import DEFAULT_LIMITS, RawTable
from elevon.logs.formats.text import LineReader, named_columns
from elevon.logs.importing import gear_ratio_of, settle_currents
from elevon.logs.maps.assign import Assignment, assign_columns
from elevon.logs.maps.column_map import ColumnMap, known_roles, known_signals
from elevon.logs.report import ImportReport

SOURCE = "standard input"
_LARGEST = 1e100  # nothing measured comes near, as in `RawTable`
_LATEST = 1e12  # s
_IN_A_ROW = 1000  # unreadable lines after which the stream is something else
_LINE_BYTES = 65536
_BY_SIGNAL = ("brake_torque",)  # read, and has no role
_NEW_DAY = {"event": "new_day"}


@dataclass(frozen=True)
class StreamPart:
    """What some lines say.

    Attributes
    ----------
    samples : mapping of str to ndarray, shape (n,)
        ``time`` and channels by role, SI.
    unreadable : int
        Lines among them that are no sample.
    why : str
        What is wrong with the first of those.
    new_day : bool
        Whether a day ends behind them.
    notes : tuple of str
        What the caller should know of the stream so far, each once.
    """

    samples: Mapping[str, Floats]
    unreadable: int = 0
    why: str = ""
    new_day: bool = False
    notes: tuple[str, ...] = ()


class StreamReader:
    """Reads bytes of a stream, in any portions.

    A first line that begins with ``{`` is JSON, one object a line, values by roles; anything else
    is the header of a CSV. A header that stands again, or the object ``{"event": "new_day"}``,
    ends the day.

    Parameters
    ----------
    column_map : ColumnMap, optional
        What the columns of a CSV are.
    note : CommandNote, optional
        For its convention of the currents.
    factors : mapping of str to float
        From columns to SI, for positions whose unit neither header nor map states: a stream cannot
        settle it, a log of the same columns has.
    """

    def __init__(
        self,
        column_map: ColumnMap | None = None,
        note: CommandNote | None = None,
        factors: Mapping[str, float] | None = None,
    ) -> None:
        self._map, self._note, self._factors = column_map, note, factors or {}
        self._cut_off = b""
        self._number = 0
        self._in_a_row = 0
        self._begun = False
        self._format: _Json | _Table | None = None
        self._text = LineReader(SOURCE, DEFAULT_LIMITS)
        self._again = False

    @property
    def heading(self) -> str:
        """What the stream began with: the header of a CSV, ``{`` of JSON, empty of nothing."""
        return "" if self._format is None else self._format.heading

    def go_on(self, heading: str) -> None:
        """Read on a stream that began with `heading`, which may stand again before the rest."""
        if heading:
            self._format, self._begun, self._again = self._opened(heading), True, True

    @property
    def cut_off(self) -> int:
        """Bytes behind the last line end: a line that is not whole."""
        return len(self._cut_off)

    def read(self, data: bytes) -> Iterator[StreamPart]:
        """Yield what the lines that became whole say.

        Raises
        ------
        FormatError
            The first lines are neither CSV nor JSON by roles, a line is longer than the limit, or
            too many in a row are no samples.
        InputError
            A map or header that states no usable table.
        """
        *lines, self._cut_off = (self._cut_off + data).split(b"\n")
        if max(map(len, (*lines, self._cut_off))) > _LINE_BYTES:
            raise FormatError(
                f"{SOURCE}, line {self._number + 1} or later: longer than {_LINE_BYTES} bytes"
            )
        batch: list[tuple[int, str]] = []
        for raw in lines:
            self._number += 1
            text = self._text.decode(raw, self._number).strip("\r")
            if not text.strip() or (self._format is None and self._text.preface(text)):
                continue
            if self._format is None:
                self._format = self._opened(text)
                again = True
            else:
                again, self._again = self._again, False
            if self._format.ends_day(text):
                if not again:
                    yield self._part(batch, new_day=True)
                    batch = []
            else:
                batch.append((self._number, text))
        if batch:
            yield self._part(batch)

    def _opened(self, text: str) -> _Json | _Table:
        if text.lstrip().startswith("{"):
            return _Json()
        names = self._text.begin(text, self._number, None)
        assigned, notes = self._assigned(names)
        return _Table(text, names, self._text, assigned, notes)

    def _part(self, batch: Sequence[tuple[int, str]], *, new_day: bool = False) -> StreamPart:
        assert self._format is not None
        rows: list[Sequence[float]] = []
        wrong: list[str] = []
        for number, text in batch:
            try:
                rows.append(self._format.row(number, text))
                self._in_a_row = 0
            except FormatError as error:
                wrong.append(str(error))
                self._in_a_row += 1
                # A stream whose first line is no sample is of another kind.
                if self._in_a_row >= _IN_A_ROW or not (rows or self._begun):
                    raise
        self._begun = self._begun or bool(rows)
        samples = self._format.samples(rows)
        why = wrong[0] if wrong else ""
        return StreamPart(samples, len(wrong), why, new_day, self._format.new_notes())

    def _assigned(self, names: Sequence[str]) -> tuple[dict[str, Assignment], list[str]]:
        """Return what the columns of a header are, each with its factor, and what to know."""
        columns, units = named_columns(list(names), np.zeros((0, len(names))))
        table = RawTable(SOURCE, columns, units)
        report = ImportReport(SOURCE, "csv")
        ratio = gear_ratio_of(None, self._map, table, "auto")
        assigned = assign_columns(table, self._map, ratio, report)
        for item in assigned.values():
            if item.factor is None:
                item.factor = self._settled(item)
        settle_currents(assigned, self._map, self._note, report)
        return assigned, [f"{f.place}: {f.text}" for f in report.findings]

    def _settled(self, item: Assignment) -> float:
        factor = self._factors.get(item.column)
        if factor is None:
            raise InputError(
                f"{SOURCE}: column {quoted(item.column)} ({item.signal}): neither header nor map "
                "states its unit, and a stream cannot settle it; state unit and shaft in a column "
                "map (--map), or give a baseline with the same columns"
            )
        return factor


class _Lines:
    """Lines of one format; what they show is noted once."""

    def __init__(self, heading: str, notes: Sequence[str] = ()) -> None:
        self.heading = heading
        self._notes = list(notes)

    def new_notes(self) -> tuple[str, ...]:
        """Return what was noted since this was asked last."""
        notes, self._notes = self._notes, []
        return tuple(notes)


class _Table(_Lines):
    """Lines of a CSV."""

    def __init__(
        self,
        heading: str,
        names: Sequence[str],
        lines: LineReader,
        assigned: Mapping[str, Assignment],
        notes: Sequence[str],
    ) -> None:
        super().__init__(heading, notes)
        self._lines, self._names, self._assigned = lines, list(names), assigned
        self._bare = bool(lines.drain())  # without a header: its first line is a row
        labels = list(named_columns(self._names, np.zeros((0, len(self._names))))[0])
        self._time = labels.index(self._assigned["time"].column)
        self._seconds = self._assigned["time"].factor or 1.0

    def ends_day(self, text: str) -> bool:
        """Whether it is the header again."""
        return text == self.heading and not self._bare

    def row(self, number: int, text: str) -> list[float]:
        """Return the numbers of a line."""
        try:
            self._lines.row(text, number, len(self._names))
        finally:
            row = self._lines.drain()
        _check_stamp(row[self._time] * self._seconds, number)
        for value in row:
            _check_size(value, number)
        return row

    def samples(self, rows: Sequence[Sequence[float]]) -> dict[str, Floats]:
        """Return rows by role."""
        data = np.array(rows).reshape(len(rows), len(self._names))
        table = RawTable(SOURCE, *named_columns(self._names, data))
        time = self._assigned["time"]
        out = {"time": time.values(table) * (time.factor or 1.0)}
        for signal, item in self._assigned.items():
            role = signal if signal in _BY_SIGNAL else item.role
            # As of a file: of the voltage only the set point is watched.
            if role and (role != "torque_voltage" or signal == "voltage_q_ref"):
                out[role] = item.values(table) * (item.factor or 1.0) + item.offset
        return out


class _Json(_Lines):
    """Lines of JSON objects."""

    def __init__(self) -> None:
        super().__init__("{")
        self._keys: tuple[str, ...] = ()
        self._extra: set[str] = set()

    def ends_day(self, text: str) -> bool:
        """Whether it says so."""
        return "event" in text and _loaded(text) == _NEW_DAY

    def row(self, number: int, text: str) -> list[float]:
        """Return the numbers of a line, in the order of the first one's keys."""
        place = f"{SOURCE}, line {number}"
        data = _loaded(text)
        if not isinstance(data, dict):
            raise FormatError(f"{place}: {quoted(text)} is no JSON object")
        if not self._keys:
            self._begin(data)
        values = [_value(data.get(key), number, key) for key in self._keys]
        _check_stamp(values[0], number)
        self._note_extra(data)
        return values

    def _begin(self, data: Mapping[str, Any]) -> None:
        known = (*known_roles(), *known_signals())
        read = [key for key in data if key in known and key != "time"]
        if "time" not in data or not read:
            names = ", ".join(quoted(key) for key in list(data)[:12]) or "none"
            raise InputError(
                f"{SOURCE}: a sample needs 'time' and channels by their roles; keys: {names}"
            )
        self._keys = ("time", *read)

    def _note_extra(self, data: Mapping[str, Any]) -> None:
        known = (*known_roles(), *known_signals())
        for key in data.keys() - {*self._keys, *self._extra}:
            if len(self._extra) < 100:  # a stream may bring any number
                self._extra.add(key)
                self._notes.append(f"{quoted(key)} is not read{did_you_mean(key, known)}")

    def samples(self, rows: Sequence[Sequence[float]]) -> dict[str, Floats]:
        """Return rows by role."""
        data = np.array(rows).reshape(len(rows), len(self._keys))
        return {key: data[:, k].copy() for k, key in enumerate(self._keys)}


def _loaded(text: str) -> Any:
    try:
        return json.loads(text)
    except (ValueError, RecursionError):
        return None


def _value(given: Any, number: int, key: str) -> float:
    """Return a number of JSON; null is a missing value."""
    if given is None:
        return math.nan
    if isinstance(given, bool) or not isinstance(given, (int, float)):
        raise FormatError(f"{SOURCE}, line {number}: {key} = {given!r:.60} is not a number")
    _check_size(given, number)
    return float(given)


def _check_size(value: float, number: int) -> None:
    missing = value != value  # noqa: PLR0124 - a whole number of JSON may be no float
    if not (missing or -_LARGEST < value < _LARGEST):
        raise FormatError(f"{SOURCE}, line {number}: no number that anything could measure")


def _check_stamp(stamp: float, number: int) -> None:
    if not abs(stamp) <= _LATEST:
        raise FormatError(f"{SOURCE}, line {number}: no time stamp, or one beyond {_LATEST:g} s")
