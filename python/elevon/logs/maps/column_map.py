"""A column map: what the columns of a log are, in a TOML file of yours or of this package."""

from __future__ import annotations

import re
from collections.abc import Collection, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from elevon.data import packaged_toml
from elevon.documents import read_toml, validated
from elevon.errors import FormatError, InputError, did_you_mean, nearest, quoted
from elevon.logs.formats.table import RawTable, existing_file
from elevon.recording.channel import check_name
from elevon.strict import Strict
from elevon.units import parse_unit


@dataclass(frozen=True, slots=True)
class LogSignal:
    """A signal's SI units, its own shaft (``fast``, ``slow`` or none) and what it is.

    `scaled` says how a value on the motor shaft becomes one on the slow shaft: ``angle`` divides by
    the gear ratio, ``torque`` multiplies. `drive_current`: the drive may log it as rms.
    """

    units: tuple[str, ...]
    shaft: str = ""
    scaled: str = ""
    drive_current: bool = False
    role: str = ""


_TABLES = packaged_toml("elevon.logs", "hints.toml")
_TORQUES = ("motor_torque", "brake_torque", "load_torque")  # on the motor shaft
_OF_THE_DRIVE = ("current_ref", "torque_current", "direct_current", "torque_voltage")
#: What only logs have: a measured command of torque or force in any unit that is no current's.
_EFFORT = LogSignal(("1", "V", "N m", "N"), role="effort")


@lru_cache(maxsize=1)
def known_roles() -> Mapping[str, LogSignal]:
    """Return what a signal in each role is; ``time`` and ``effort`` among them."""
    from elevon import _core

    roles = {
        role["name"]: LogSignal(
            tuple(role["units"]),
            _TABLES["shafts"].get(role["name"], ""),
            "angle" if role["name"] in _TABLES["shafts"] else "",
            role["name"] in _OF_THE_DRIVE,
            role["name"],
        )
        for role in _core.roles()
    }
    return {"time": LogSignal(("s",)), **roles, "effort": _EFFORT}


@lru_cache(maxsize=1)
def known_signals() -> Mapping[str, LogSignal]:
    """Return every signal that a wiring can record or a log may hold, by its channel's name."""
    from elevon import _core

    roles, known = known_roles(), {"time": LogSignal(("s",))}
    for wiring in _core.wirings():
        for fidelity in wiring["fidelities"]:
            for item in _core.signals(wiring["name"], fidelity):
                torque = ("fast", "torque") if item["name"] in _TORQUES else ("", "")
                plain = LogSignal((item["unit"] or "1",), *torque)
                known.setdefault(item["name"], roles.get(item["role"] or "", plain))
    return known | {name: roles[role] for name, role in _TABLES["of_logs"].items()}


def drive_unit(text: str, units: Collection[str]) -> str:
    """Return a unit as drives write it in the package's spelling.

    ``U/min`` is rpm. Where a speed of a shaft is expected, turns stand without their name:
    ``1/min`` is rpm, ``Hz`` and ``1/s`` are rev/s.

    Parameters
    ----------
    text : str
        As the file states it.
    units : collection of str
        SI units that the quantity may have.
    """
    spelt: str = _TABLES["spellings"].get(text.strip().lower().replace(" ", ""), text.strip())
    try:
        dimension, size = parse_unit(spelt).dimension, parse_unit(spelt).factor
    except InputError:
        return text.strip()
    turning = parse_unit("rad/s").dimension
    if dimension == parse_unit("1/s").dimension and any(
        parse_unit(unit).dimension == turning for unit in units
    ):
        return "rev/s" if size == 1.0 else "rpm" if abs(60.0 * size - 1.0) < 1e-9 else spelt
    return spelt


def unit_among(units: tuple[str, ...], stated: str | None, place: str) -> str:
    """Return the SI unit, of those a signal may have, that a stated unit is of; the first if none.

    Raises
    ------
    InputError
        A unit of another kind, or none that is known.
    """
    if not stated:
        return units[0]
    dimension = parse_unit(stated, place).dimension
    for unit in units:
        if parse_unit(unit).dimension == dimension:
            return unit
    raise InputError(f"{place}: unit {stated!r}; expected {' or '.join(units)}, or the like")


def safe_name(foreign: str, used: set[str]) -> str:
    """Return a channel name for a foreign column: ASCII, at most 31 characters, not yet used."""
    text = re.sub(r"[^A-Za-z0-9]+", "_", foreign).strip("_") or "column"
    text = text if text[0].isalpha() else f"column_{text}"
    stem = f"extra_{text}"[:27].rstrip("_")
    name, number = stem, 2
    while name.lower() in {other.lower() for other in used}:
        name, number = f"{stem}_{number}", number + 1
    return name


_MOST_BYTES = 1_000_000
Text = Annotated[str, Field(min_length=1, max_length=200)]


class ColumnEntry(Strict):
    """One column: where it stands in the file and what it is to the actuator.

    Attributes
    ----------
    name : str
        Header in the file, or ``column_3`` for a file without headers.
    match : str or None
        In the package's own maps: the drive's parameter by which headers are recognised.
    role : str or None
        What it is (``motor_speed``); ``time`` for the time base.
    signal : str or None
        Channel name; None: the role's.
    unit : str or None
        Unit in the file; None: the file's own, else SI.
    sign : int
        -1 where the file's positive direction is the other one.
    scale : float
        Factor on the file's value, before the unit.
    shaft : str or None
        ``fast`` or ``slow``: the shaft the file refers it to; None: the signal's own.
    subtract_from : str or None
        Another column, in the same unit: the signal is that column less this one.
    text : str
        A line for the reader.
    """

    name: Text
    match: Text | None = None
    role: Text | None = None
    signal: Text | None = None
    unit: Text | None = None
    sign: Literal[1, -1] = 1
    scale: float = Field(default=1.0, gt=0.0)
    shaft: Literal["fast", "slow"] | None = None
    subtract_from: Text | None = None
    text: str = Field(default="", max_length=1000)

    @field_validator("role")
    @classmethod
    def _known_role(cls, value: str | None) -> str | None:
        if value is not None and value not in known_roles():
            raise ValueError(f"unknown role {value!r}{did_you_mean(value, known_roles())}")
        return value

    @model_validator(mode="after")
    def _named(self) -> Self:
        if self.role is None and self.signal is None:
            raise ValueError(f"column {self.name!r}: needs a role or a signal")
        name, known = self.channel, known_signals()
        if self.role is None and name not in known and nearest(name, known):
            raise ValueError(f"unknown signal {name!r}{did_you_mean(name, known)}")
        if name not in known:
            check_name(name)
        return self

    @property
    def channel(self) -> str:
        """Name of the channel."""
        return self.signal or self.role or ""

    @property
    def role_name(self) -> str:
        """The role; empty where it has none."""
        if self.role is not None:
            return self.role
        known = known_signals().get(self.signal or "")
        return known.role if known else ""


class ColumnMap(Strict):
    """The map of a whole file.

    Attributes
    ----------
    text : str
        A line for the reader.
    gear_ratio : float or None
        Motor over output, both angles; needed where a shaft is stated.
    travel_per_turn : str or None
        Travel of a linear output for one turn of the motor, with its unit: ``"5 mm"``.
    current : str or None
        Convention of the drive's currents and voltage: ``rms`` or ``peak``.
    column : tuple of ColumnEntry
        One table ``[[column]]`` each.
    """

    text: str = Field(default="", max_length=1000)
    gear_ratio: float | None = Field(default=None, gt=0.0)
    travel_per_turn: Text | None = None
    current: Literal["rms", "peak"] | None = None
    column: Annotated[tuple[ColumnEntry, ...], Field(max_length=256)] = ()

    @field_validator("travel_per_turn")
    @classmethod
    def _length(cls, value: str | None) -> str | None:
        if value is not None and not _metres(value) > 0.0:
            raise ValueError(f"{value!r} must be above 0")
        return value

    @field_validator("column")
    @classmethod
    def _once(cls, value: tuple[ColumnEntry, ...]) -> tuple[ColumnEntry, ...]:
        for what in ("name", "channel", "role_name"):
            names = [getattr(entry, what) for entry in value]
            for name in names:
                if name and names.count(name) > 1:
                    raise ValueError(f"{what} {name!r} stands twice")
        return value

    @property
    def travel(self) -> float | None:
        """Travel of a linear output for one turn of the motor [m]."""
        return None if self.travel_per_turn is None else _metres(self.travel_per_turn)


def _metres(text: str) -> float:
    from elevon.units import parse_quantity

    try:
        return parse_quantity(text, "m")
    except InputError as error:
        raise ValueError(str(error)) from error


def read_column_map(path: str | Path) -> ColumnMap:
    """Read a column map.

    Raises
    ------
    InputError
        No such file, not TOML, unknown keys, roles or signals, values out of range; a file of more
        than 1 MB.
    """
    file = existing_file(path)
    if file.stat().st_size > _MOST_BYTES:
        raise FormatError(f"{file}: longer than {_MOST_BYTES} bytes; not a column map")
    document = read_toml(file)
    return validated(ColumnMap, document.data, document)


def find_map(given: str | Path) -> ColumnMap:
    """Return one of the package's maps by its name, or the map of a file; errors as the reader."""
    if str(given) in shipped_maps() and not Path(given).exists():
        return shipped_map(str(given))
    if not Path(given).expanduser().exists() and not Path(given).suffix:
        names = shipped_maps()
        raise InputError(f"--map {given}: no such file or map{did_you_mean(str(given), names)}")
    return read_column_map(given)


def shipped_maps() -> list[str]:
    """Return the names of the package's own maps."""
    return sorted(path.stem for path in Path(__file__).parent.glob("*.toml"))


@cache
def shipped_map(name: str) -> ColumnMap:
    """Return one of the package's own maps."""
    return read_column_map(Path(__file__).parent / f"{name}.toml")


_PARAMETER = re.compile(r"(?:^|[^a-z])r0*(\d{2,4})(?:\[(\d)\]|\.\d+)?$")
_TIME = {"xms", "x", "x[ms]", "time", "timems", "t", "tms", "zeit"}


def drive_columns() -> dict[str, ColumnEntry]:
    """Return the columns of the drive's trace by parameter (``r62``), ``time`` among them."""
    return {entry.match: entry for entry in shipped_map("torino").column if entry.match}


def find_drive_columns(table: RawTable, given: Collection[str] = ()) -> dict[str, str]:
    """Find the drive's columns by the parameter number in their headers.

    Case, blanks, the axis prefix and the trace prefix (``C0``, ``C1``) do not matter.

    Parameters
    ----------
    table : RawTable
        A log.
    given : collection of str
        Keys known already, from a column map.

    Returns
    -------
    dict of str to str
        Drive parameter (or ``time``) to the name of the column in the table.

    Raises
    ------
    FormatError
        No time column, no position column, or two columns of one parameter.
    """
    recognised: dict[str, str] = {}
    for name in table.columns:
        key = parameter_key(name)
        if key is None:
            continue
        if key in recognised:
            raise FormatError(
                f"{table.source}: columns {quoted(recognised[key])} and {quoted(name)} are both "
                f"{key}; name one of them in a column map"
            )
        recognised[key] = name
    _check_columns(table, {*recognised, *given})
    return recognised


def looks_like_drive(table: RawTable) -> bool:
    """Whether at least two columns carry numbers of the drive's parameters."""
    return sum(parameter_key(name) not in {None, "time"} for name in table.columns) >= 2


def parameter_key(name: str) -> str | None:
    """Return the drive's parameter that a header carries (``r62``), ``time``, or None."""
    text = re.sub(r"\s+", "", name).lower()
    if text in _TIME:
        return "time"
    match = _PARAMETER.search(text) or _PARAMETER.search(re.sub(r"(axis_\d+)", r"\1.", text))
    if match is None:
        return None
    number = match.group(1) + (match.group(2) or "")
    return f"r{number}" if f"r{number}" in drive_columns() else None


def _check_columns(table: RawTable, recognised: Collection[str]) -> None:
    names = ", ".join(quoted(name) for name in list(table.columns)[:12])
    if "time" not in recognised:
        raise FormatError(
            f"{table.source}: no time column (Xms){did_you_mean('Xms', table.columns)}; "
            f"columns: {names}"
        )
    if "r4820" not in recognised and "r4821" not in recognised:
        raise FormatError(
            f"{table.source}: neither the motor's position (r4820) nor the output's (r4821); "
            f"columns: {names}"
        )
