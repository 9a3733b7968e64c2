"""Flight data: what is needed of a recorded flight, and its CSV file."""

import csv
import io
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import cast

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError, InputError, Interrupted, RangeError, unknown
from elevon.files import read_regular
from elevon.loads.atmosphere import AIRSPEED_KINDS, AirspeedKind
from elevon.progress import Progress
from elevon.units import check_kind, to_si

Array = npt.NDArray[np.float64]

_LONGEST = 2**28
"""Bytes of a flight: a day of ten columns at 20 Hz has some 160 MB."""

_AIRSPEEDS = {
    "true_airspeed": "true",
    "equivalent_airspeed": "equivalent",
    "calibrated_airspeed": "calibrated",
    "mach": "mach",
}
_UNITS = {
    "time": "s",
    "altitude": "m",
    "angle_of_attack": "rad",
    "deflection": "rad",
    "true_airspeed": "m/s",
    "equivalent_airspeed": "m/s",
    "calibrated_airspeed": "m/s",
    "mach": "1",
    "air_density": "kg/m3",
}
REPORT = 1000
"""Lines between two reports of progress."""
_NEEDED = ("time", "altitude", "angle_of_attack", "deflection")


@dataclass(frozen=True)
class FlightData:
    """A flight, as far as a control surface's actuator feels it.

    Attributes
    ----------
    time : ndarray, shape (n,), n >= 2
        s, strictly increasing.
    altitude : ndarray, shape (n,)
        m, geopotential (pressure altitude).
    airspeed : ndarray, shape (n,)
        m/s, or the Mach number; at least 0.
    airspeed_kind : {"true", "equivalent", "calibrated", "mach"}
    angle_of_attack, deflection : ndarray, shape (n,)
        rad, each within +-90 deg.
    air_density : ndarray, shape (n,), optional
        kg/m3, above 0, as measured: it takes the place of the standard atmosphere's, and the
        temperature follows from it at the altitude's pressure.

    Raises
    ------
    InputError, RangeError
        Lengths that differ, time that does not increase, values not finite or out of range. A
        missing sample is not filled in: cut or repair the data first.
    """

    time: Array
    altitude: Array
    airspeed: Array
    airspeed_kind: AirspeedKind
    angle_of_attack: Array
    deflection: Array
    air_density: Array | None = None

    def __post_init__(self) -> None:
        if self.airspeed_kind not in AIRSPEED_KINDS:
            raise unknown("kind of airspeed", str(self.airspeed_kind), AIRSPEED_KINDS)
        names = ["time", "altitude", "airspeed", "angle_of_attack", "deflection"]
        if self.air_density is not None:
            names.append("air_density")
        for name in names:
            values = np.array(getattr(self, name), dtype=np.float64)
            self._check_column(name, values)
            values.setflags(write=False)
            object.__setattr__(self, name, values)
        steps = np.flatnonzero(np.diff(self.time) <= 0.0)
        if steps.size:
            at = int(steps[0]) + 1
            raise InputError(
                f"time: sample {at} ({self.time[at]:g} s) does not come after sample {at - 1} "
                f"({self.time[at - 1]:g} s)"
            )

    def _check_column(self, name: str, values: Array) -> None:
        if values.ndim != 1 or values.size != np.size(self.time) or values.size < 2:
            raise InputError(
                f"{name}: shape {values.shape}; every column is a series of the same length, "
                f"at least 2 (time has {np.size(self.time)})"
            )
        limit = {
            "airspeed": (0.0, np.inf),
            "angle_of_attack": (-np.pi / 2, np.pi / 2),
            "air_density": (np.finfo(float).tiny, np.inf),
        }
        low, high = limit.get(
            "angle_of_attack" if name == "deflection" else name, (-np.inf, np.inf)
        )
        wrong = ~((values >= low) & (values <= high) & np.isfinite(values))
        if wrong.any():
            index = int(np.flatnonzero(wrong)[0])
            raise RangeError(
                f"{name}: {values[index]:g} at sample {index} must be finite and in "
                f"[{low:.4g}, {high:.4g}]"
            )


def read_flight(path: str | os.PathLike[str], *, progress: Progress | None = None) -> FlightData:
    """Read flight data from a CSV file.

    Parameters
    ----------
    path : path
        UTF-8, comma separated. The first line that is not empty and not a comment (``#``) names the
        columns with their units: ``time [s],altitude [ft],calibrated_airspeed [kt],
        angle_of_attack [deg],deflection [deg]``. Exactly one airspeed column: `true_airspeed`,
        `equivalent_airspeed`, `calibrated_airspeed` or `mach [1]`. `air_density [kg/m3]` may be
        given. Order free, no other columns.
    progress : callable, optional
        Takes the fraction read; returns False to stop.

    Returns
    -------
    FlightData
        In SI units.

    Raises
    ------
    FormatError
        Not such a file: no header, a row of another length, not a number. Names the line.
    Interrupted
        `progress` returned False.
    UnknownNameError, UnitError, InputError, RangeError
        Unknown or missing column, wrong unit, impossible values. Names the file.
    """
    source = Path(path).expanduser()
    lines = _read_lines(source)
    if not lines:
        raise FormatError(f"{source}: no header line")
    columns = _header(source, lines[0][1])
    table = _numbers(source, lines[1:], len(columns), progress)
    values = {name: to_si(table[:, i], unit) for i, (name, unit) in enumerate(columns)}
    airspeed = next(name for name in values if name in _AIRSPEEDS)
    try:
        return FlightData(
            time=values["time"],
            altitude=values["altitude"],
            airspeed=values[airspeed],
            airspeed_kind=cast("AirspeedKind", _AIRSPEEDS[airspeed]),
            angle_of_attack=values["angle_of_attack"],
            deflection=values["deflection"],
            air_density=values.get("air_density"),
        )
    except InputError as error:
        raise type(error)(f"{source}: {error}") from error


def _read_lines(source: Path) -> list[tuple[int, list[str]]]:
    raw = read_regular(source, _LONGEST)
    try:
        reader = csv.reader(io.StringIO(raw.decode("utf-8-sig"), newline=""), skipinitialspace=True)
        return [
            (reader.line_num, row)
            for row in reader
            if any(cell.strip() for cell in row) and not row[0].lstrip().startswith("#")
        ]
    except (UnicodeDecodeError, csv.Error) as error:
        raise FormatError(f"{source}: is not a UTF-8 CSV file: {error}") from error


def _header(source: Path, cells: Sequence[str]) -> list[tuple[str, str]]:
    columns: list[tuple[str, str]] = []
    for cell in cells:
        name, bracket, unit_text = cell.strip().partition("[")
        name, unit = name.strip(), unit_text.strip().removesuffix("]").strip()
        if name not in _UNITS:
            # Not every file given is a flight: what is no name is not printed.
            given = name if name.isidentifier() and len(name) < 32 else f"number {len(columns) + 1}"
            raise unknown("column", given, _UNITS, str(source))
        if name in dict(columns):
            raise FormatError(f"{source}: column {name!r} is given twice")
        if not bracket or not unit_text.strip().endswith("]"):
            raise FormatError(
                f"{source}: column {cell.strip()!r} has no unit; write '{name} [unit]'"
            )
        check_kind(unit, _UNITS[name], f"{source}: {name}")
        columns.append((name, unit))
    names = [name for name, _ in columns]
    missing = [name for name in _NEEDED if name not in names]
    if missing:
        raise FormatError(f"{source}: missing column {', '.join(missing)}")
    speeds = [name for name in names if name in _AIRSPEEDS]
    if len(speeds) != 1:
        raise FormatError(
            f"{source}: exactly one airspeed column is needed ({', '.join(_AIRSPEEDS)}), "
            f"got {', '.join(speeds) or 'none'}"
        )
    return columns


def _numbers(
    source: Path,
    lines: Sequence[tuple[int, list[str]]],
    width: int,
    progress: Progress | None = None,
) -> Array:
    if len(lines) < 2:
        raise FormatError(f"{source}: {len(lines)} rows of data; at least 2 are needed")
    table = np.empty((len(lines), width))
    for row, (number, cells) in enumerate(lines):
        if progress is not None and row % REPORT == 0 and not progress(row / len(lines)):
            raise Interrupted(f"{source}: interrupted at line {number}")
        if len(cells) != width:
            raise FormatError(f"{source}:{number}: {len(cells)} cells, the header has {width}")
        for column, cell in enumerate(cells):
            try:
                table[row, column] = float(cell)
            except ValueError as error:
                raise FormatError(f"{source}:{number}: {cell.strip()!r} is not a number") from error
    return table
