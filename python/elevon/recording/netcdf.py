"""Recordings in NetCDF 4: a dimension for each clock, units as attributes.

The dimension and time variable are ``time`` for a single clock, ``time_NAME`` beside others. The
character variable ``elevon`` holds the description (`Header`); an attribute could not, HDF5 limits
those to 64 kB. Time and values are compressed without loss.

A file is read through h5py with every link, layout and type checked first: HDF5 files can refer to
other files on the disk, and those of strangers may.
"""

from __future__ import annotations

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.containers.hdf import dataset, opened, vector
from elevon.errors import FormatError
from elevon.recording.contents import Contents, check_size, header_bytes, rebuild
from elevon.recording.convert import time_name
from elevon.recording.header import Header

if TYPE_CHECKING:
    from elevon.recording.recording import Recording


def write(recording: Recording, path: Path) -> None:
    """Write the description, the times and the channels.

    The file is built in memory: the HDF5 library crashes the process when the disk is full.
    """
    import h5netcdf

    memory = io.BytesIO()
    text = np.frombuffer(Header.sealed(recording).to_json().encode("ascii"), dtype="S1")
    with h5netcdf.File(memory, "w") as file:
        file.dimensions = {"elevon_length": text.size}
        file.create_variable("elevon", ("elevon_length",), "S1", data=text)
        for clock in recording.clocks.values():
            dimension = time_name(recording, clock.name)
            # a length of zero would declare an unlimited dimension, which is empty as well
            file.dimensions[dimension] = len(clock) or None
            attributes: dict[str, Any] = {"units": "s", "clock": clock.name}
            if clock.rate is not None:
                attributes["rate_hz"] = clock.rate
            _variable(file, dimension, dimension, clock.time, attributes)
            for channel in recording.on_clock(clock.name):
                notes = {"units": channel.unit, "long_name": channel.text or channel.name}
                _variable(file, channel.name, dimension, channel.values, notes)
    path.write_bytes(memory.getbuffer())


def read(path: Path, max_bytes: int) -> Contents:
    """Read the description, then what it names."""
    with opened(path) as file:
        raw = _vector(path, file, "elevon", "S", max_bytes)
        header = Header.from_json(raw.tobytes(), str(path))
        check_size(str(path), header_bytes(header), max_bytes)
        several = len(header.clocks) > 1

        def columns(name: str) -> dict[str, Floats]:
            entry = next(clock for clock in header.clocks if clock.name == name)
            time = f"time_{name}" if several else "time"
            arrays = {"time": _vector(path, file, time, "f", max_bytes)}
            for channel in entry.channels:
                arrays[channel] = _vector(path, file, channel, "f", max_bytes)
            return arrays

        return rebuild(header, columns, str(path))


def _variable(
    file: Any,
    name: str,
    dimension: str,
    values: Floats,
    attributes: dict[str, Any],
) -> None:
    packing: dict[str, Any] = {"compression": "gzip", "compression_opts": 4, "shuffle": True}
    if not values.size:
        variable = file.create_variable(name, (dimension,), np.float64)
    else:
        variable = file.create_variable(name, (dimension,), np.float64, data=values, **packing)
    for key, value in attributes.items():
        variable.attrs[key] = value


def _vector(path: Path, file: Any, name: str, kind: str, max_bytes: int) -> npt.NDArray[Any]:
    """Read one vector stored in the file itself, of plain numbers or characters."""
    data = dataset(file, name)
    if data is None and name == "elevon":
        raise FormatError(f"{path}: is HDF5, but no recording (no variable 'elevon')")
    if data is None:
        raise FormatError(f"{path}: columns are missing: {name}")
    values = vector(data, kind, lambda size: check_size(str(path), size, max_bytes))
    if isinstance(values, str):
        raise FormatError(f"{path}: {name!r} refused: {values}")
    return values
