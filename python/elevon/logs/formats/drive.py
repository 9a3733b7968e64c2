"""The drive's trace file: writing one exactly as the reader takes it."""

from __future__ import annotations

import io
import os
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError, RangeError, did_you_mean
from elevon.files import write_bytes
from elevon.logs.maps.column_map import drive_columns
from elevon.units import to_display

_STAND_INS = {"motor_position": "resolver_position", "resolver_speed": "motor_speed"}


@dataclass(frozen=True, slots=True)
class DriveFormat:
    r"""How a drive trace is written.

    Attributes
    ----------
    position_unit : str
        ``deg`` or ``rad``: not printed anywhere for the real bench, degrees ASSUMED (its plots and
        commands are in degrees).
    encoder_shaft : str
        ``fast`` (test-bench thesis) or ``slow`` (transmission thesis).
    gear_ratio : float
        Fast over slow, for the encoder on the motor shaft.
    current_convention : str
        ``rms`` (ASSUMED, as catalogue currents are) or ``peak``: r76, r77, r78 and r1733.
    delimiter : str
        ``,`` ``;`` or a tab.
    decimal_comma : bool
        Only with another delimiter than the comma.
    encoding : str
        ``utf-8``, ``utf-8-sig`` (byte-order mark) or ``latin-1``.
    line_end : str
        ``\n`` or ``\r\n``.
    digits : int
        Significant digits.
    """

    position_unit: str = "deg"
    encoder_shaft: str = "fast"
    gear_ratio: float = 124.0
    current_convention: str = "rms"
    delimiter: str = ","
    decimal_comma: bool = False
    encoding: str = "utf-8"
    line_end: str = "\n"
    digits: int = 9

    def __post_init__(self) -> None:
        _choice("position_unit", self.position_unit, ("deg", "rad"))
        _choice("encoder_shaft", self.encoder_shaft, ("fast", "slow"))
        _choice("current_convention", self.current_convention, ("rms", "peak"))
        _choice("delimiter", self.delimiter, (",", ";", "\t"))
        _choice("encoding", self.encoding, ("utf-8", "utf-8-sig", "latin-1"))
        _choice("line_end", self.line_end, ("\n", "\r\n"))
        if self.decimal_comma and self.delimiter == ",":
            raise InputError(
                "drive format: decimal comma and comma delimiter cannot be distinguished"
            )


def write_drive_csv(
    path: str | os.PathLike[str],
    signals: Mapping[str, npt.ArrayLike],
    *,
    layout: DriveFormat | None = None,
    force: bool = False,
) -> Path:
    """Write a drive trace from SI signals.

    Parameters
    ----------
    path : path
        The CSV file.
    signals : mapping of str to array_like, shape (samples,)
        By recording name: ``time`` [s] and any of the drive's signals: positions [rad] each on its
        own shaft (``encoder_position`` at the output, ``resolver_position`` at the motor),
        ``speed_ref``, ``motor_speed`` [rad/s], currents and ``voltage_q_ref`` [A, V peak],
        ``trigger``. Columns that are not given are left out. A simulation's ``motor_position`` and
        ``resolver_speed`` stand in for ``resolver_position`` and ``motor_speed`` where those lack.
    layout : DriveFormat, optional
        How to write it.
    force : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    InputError
        Unknown signal, no time, lengths that differ, a value that is not finite.
    OutputExistsError
        The file exists and `force` is false.
    """
    layout = layout or DriveFormat()
    known = [entry.channel for entry in drive_columns().values()]
    signals = dict(signals)
    for given, wanted in _STAND_INS.items():
        if given in signals:
            values = signals.pop(given)
            signals.setdefault(wanted, values)
    for name in signals:
        if name not in known:
            raise InputError(f"drive trace: no column for {name!r}{did_you_mean(name, known)}")
    if "time" not in signals:
        raise InputError("drive trace: the signal 'time' is missing")
    arrays = {name: np.asarray(values, dtype=np.float64) for name, values in signals.items()}
    _check_arrays(arrays)
    columns = {key: c for key, c in drive_columns().items() if c.channel in arrays}
    scaled = [arrays[c.channel] * _factor(key, layout) for key, c in columns.items()]
    text = io.StringIO()
    np.savetxt(
        text, np.column_stack(scaled), f"%.{layout.digits}g", layout.delimiter, layout.line_end
    )
    rows = text.getvalue().replace(".", ",") if layout.decimal_comma else text.getvalue()
    head = layout.delimiter.join(c.name for c in columns.values()) + layout.line_end
    return write_bytes(path, (head + rows).encode(layout.encoding), force=force)


def _factor(key: str, layout: DriveFormat) -> float:
    """Factor from SI to what the file holds."""
    if key in {"r4820", "r4821"}:
        shaft = layout.gear_ratio if key == "r4821" and layout.encoder_shaft == "fast" else 1.0
        return shaft * to_display(1.0, layout.position_unit)
    if key in {"r76", "r77", "r78", "r1733"}:
        return float(np.sqrt(0.5)) if layout.current_convention == "rms" else 1.0
    unit = drive_columns()[key].unit
    return to_display(1.0, unit) if unit else 1.0


def _check_arrays(arrays: Mapping[str, Floats]) -> None:
    rows = arrays["time"].shape
    for name, values in arrays.items():
        if values.ndim != 1 or values.shape != rows:
            raise InputError(f"drive trace: {name} has shape {values.shape}, time has {rows}")
        if not np.all(np.isfinite(values)):
            raise RangeError(f"drive trace: {name} holds a value that is not finite")


def _choice(name: str, value: str, valid: tuple[str, ...]) -> None:
    if value not in valid:
        raise InputError(f"drive format: {name} = {value!r}{did_you_mean(value, valid)}")
