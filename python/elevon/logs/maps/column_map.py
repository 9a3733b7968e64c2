"""A column map: what the columns of a foreign log are, told by the user in a TOML file."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, field_validator

from elevon.documents import read_toml, validated
from elevon.errors import did_you_mean, nearest
from elevon.logs.maps.signals import SIGNALS
from elevon.recording.names import check_name

__all__ = ["ColumnEntry", "ColumnMap", "read_column_map"]


class ColumnEntry(BaseModel):
    """One column: where it stands in the file and what it means.

    Attributes
    ----------
    name : str
        Header in the file, or ``column_3`` for a file without headers.
    signal : str
        Channel name; ``time`` for the time base.
    unit : str or None
        Unit in the file; None: the file's own, else SI.
    sign : int
        -1 where the file's positive direction is the other one.
    scale : float
        Factor on the file's value, before the unit.
    shaft : str or None
        ``fast`` or ``slow``: the shaft the file refers it to; None: the signal's own.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    name: str = Field(min_length=1)
    signal: str
    unit: str | None = None
    sign: Literal[1, -1] = 1
    scale: float = Field(default=1.0, gt=0.0)
    shaft: Literal["fast", "slow"] | None = None

    @field_validator("signal")
    @classmethod
    def _known(cls, value: str) -> str:
        if value == "time" or value in SIGNALS:
            return value
        if nearest(value, SIGNALS):
            raise ValueError(f"unknown signal {value!r}{did_you_mean(value, SIGNALS)}")
        return check_name(value)


class ColumnMap(BaseModel):
    """The map of a whole file.

    Attributes
    ----------
    gear_ratio : float or None
        Fast over slow; needed where a shaft is stated.
    current : str or None
        Convention of the drive's currents and voltage: ``rms`` or ``peak``.
    column : tuple of ColumnEntry
        One table ``[[column]]`` each.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, allow_inf_nan=False)

    gear_ratio: float | None = Field(default=None, gt=0.0)
    current: Literal["rms", "peak"] | None = None
    column: tuple[ColumnEntry, ...] = ()

    @field_validator("column")
    @classmethod
    def _once(cls, value: tuple[ColumnEntry, ...]) -> tuple[ColumnEntry, ...]:
        for what in ("name", "signal"):
            names = [getattr(entry, what) for entry in value]
            for name in names:
                if names.count(name) > 1:
                    raise ValueError(f"{what} {name!r} stands twice")
        return value


def read_column_map(path: str | Path) -> ColumnMap:
    """Read a column map.

    Raises
    ------
    InputError
        No such file, not TOML, unknown keys or signals, values out of range.
    """
    document = read_toml(path)
    return validated(ColumnMap, document.data, document)
