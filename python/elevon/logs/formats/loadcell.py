"""Load cells: their files, and the torque they stand for.

The bench's load-cell file has two columns, time and value, on the load cell's own clock; its zero
is the trigger edge of the drive's trace.
"""

from __future__ import annotations

import io
import os
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import FormatError, InputError, RangeError, quoted
from elevon.files import write_bytes
from elevon.logs.formats.table import DEFAULT_LIMITS, Limits
from elevon.logs.formats.text import read_text_table
from elevon.units import check_kind, to_si

Notes = tuple[str, ...]
_UNITS = {"N": "N", "Nm": "N m", "N m": "N m", "kg": "kg", "g": "g"}
_GRAVITY = 9.80665


@dataclass(frozen=True, slots=True)
class LoadCellLog:
    """A load-cell file as read.

    Attributes
    ----------
    time : ndarray, shape (samples,)
        Seconds on the load cell's own clock.
    value : ndarray, shape (samples,)
        Force [N], or torque [N m] where the file says so.
    unit : str
        ``N`` or ``N m``.
    notes : tuple of str
        What was seen: units stated or assumed, text format.
    """

    time: Floats
    value: Floats
    unit: str
    notes: tuple[str, ...]


def write_loadcell(
    path: str | os.PathLike[str],
    time: npt.ArrayLike,
    value: npt.ArrayLike,
    *,
    unit: str = "N",
    force: bool = False,
) -> Path:
    """Write a load-cell file: ``time [s],value [N]``.

    Parameters
    ----------
    path : path
        The CSV file.
    time : array_like, shape (samples,)
        Seconds from the trigger, on the load cell's clock.
    value : array_like, shape (samples,)
        Force or torque.
    unit : str
        ``N`` or ``N m``.
    force : bool
        Whether an existing file may be replaced.

    Raises
    ------
    InputError
        Lengths that differ, values that are not finite, or another unit.
    """
    times, values = (np.asarray(a, dtype=np.float64) for a in (time, value))
    if unit not in {"N", "N m"}:
        raise InputError(f"load cell: unit {unit!r}; valid: 'N', 'N m'")
    if times.ndim != 1 or times.shape != values.shape:
        raise InputError(f"load cell: time has shape {times.shape}, value {values.shape}")
    if not (np.all(np.isfinite(times)) and np.all(np.isfinite(values))):
        raise RangeError("load cell: a value is not finite")
    text = io.StringIO()
    text.write(f"time [s],value [{unit}]\n")
    np.savetxt(text, np.column_stack((times, values)), "%.9g", ",")
    return write_bytes(path, text.getvalue().encode("utf-8"), force=force)


def read_loadcell(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> LoadCellLog:
    """Read a load-cell file: two columns, time and value, with or without a header.

    Time is in s unless the header says ms, or the sample spacing shows it can only be ms; the value
    is a force in N unless the header says otherwise.

    Raises
    ------
    FormatError
        Not two columns, missing cells, or time that runs backwards.
    """
    table = read_text_table(path, limits=limits, header=None)
    if len(table.columns) != 2:
        raise FormatError(
            f"{table.source}: a load-cell file has two columns, time and value; "
            f"this one has {len(table.columns)}"
        )
    (time_name, time), (value_name, value) = table.columns.items()
    for name, column in ((time_name, time), (value_name, value)):
        if np.isnan(column).any():
            row = int(np.argmax(np.isnan(column))) + 1
            raise FormatError(f"{table.source}, row {row}: no number for {quoted(name)}")
    scale, taken = _time_scale(table.units.get(time_name, ""), time_name, time)
    factor, unit, converted = _value_unit(table.source, table.units.get(value_name, ""))
    seconds = time * scale
    back = np.flatnonzero(np.diff(seconds) < 0.0)
    if back.size:
        raise FormatError(f"{table.source}, row {back[0] + 2}: time runs backwards")
    return LoadCellLog(seconds, value * factor, unit, (*table.notes, *taken, *converted))


def _time_scale(unit: str, name: str, time: Floats) -> tuple[float, Notes]:
    """Return seconds a unit of time, and what was taken for granted."""
    text = unit or ("ms" if name.strip().lower() in {"xms", "time_ms", "timems", "t_ms"} else "")
    if text:
        check_kind(text, "s", "load cell, time")
        return float(to_si(1.0, text)), ()
    # A load cell samples at 1 to 1000 Hz: a mean spacing of 1 or more can only be milliseconds,
    # one of 0.5 s or less in ms would be above 2 kHz, which no such converter reaches.
    spacing = float(time[-1] - time[0]) / max(len(time) - 1, 1)
    scale, taken = (1e-3, "ms") if spacing >= 1.0 else (1.0, "s")
    return scale, (f"load-cell time taken as {taken}: spacing {spacing:.4g}",)


def _value_unit(source: str, unit: str) -> tuple[float, str, Notes]:
    """Return factor and SI unit of the values, and what was taken for granted."""
    if not unit:
        return 1.0, "N", ("load-cell value taken as a force in N: the file states no unit",)
    if unit not in _UNITS:
        raise InputError(f"{source}: load-cell unit {quoted(unit)}; valid: {', '.join(_UNITS)}")
    if unit in {"kg", "g"}:
        note = f"load-cell value in {unit}: converted with g = {_GRAVITY} m/s2"
        return _GRAVITY * (1.0 if unit == "kg" else 1e-3), "N", (note,)
    return 1.0, _UNITS[unit], ()
