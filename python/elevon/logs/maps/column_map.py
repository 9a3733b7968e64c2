"""A column map: what the columns of a log are, in a TOML file of yours or of this package."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from elevon.documents import read_toml, validated
from elevon.errors import FormatError, InputError, did_you_mean, nearest
from elevon.logs.formats.limits import existing_file
from elevon.logs.maps.signals import known_roles, known_signals
from elevon.recording.channel import check_name
from elevon.strict import Strict

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
