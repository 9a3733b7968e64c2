"""Recordings as MATLAB version 5 files: ``s = load('x.mat'); plot(s.main.time, s.main.command)``.

One struct for each clock, named as the clock, with column vectors ``time`` and the channels; a
struct ``units`` (channel name to unit) and the text ``elevon``, the description (`Header`).

SciPy writes files that MATLAB cannot read when they pass 2 GB: this is checked here. MATLAB 7.3
files are HDF5, another format.
"""

import struct
import zlib
from pathlib import Path
from typing import IO, Any

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError, InputError
from elevon.recording.assemble import check_size, header_bytes, rebuild
from elevon.recording.header import Header
from elevon.recording.names import check_name
from elevon.recording.recording import Recording

__all__ = ["check", "read", "write"]

_LIMIT = 2**31 - 1
_DAMAGE = (
    ValueError,
    TypeError,
    LookupError,
    ArithmeticError,
    AttributeError,
    EOFError,
    MemoryError,
    NameError,
    NotImplementedError,
    SystemError,
    struct.error,
    zlib.error,
)
_HEADER = 128
_COMPRESSED = 15
_PER_CHANNEL = 256
"""Upper bound of the bytes that a version 5 file spends on a vector beside its numbers."""


def check(recording: Recording) -> None:
    """Refuse what version 5 cannot hold: a clock of more than 2 GB, names it has no room for."""
    for clock in recording.clocks.values():
        check_name(clock.name, "clock")
        columns = 1 + len(recording.on_clock(clock.name))
        size = columns * (8 * len(clock) + _PER_CHANNEL)
        if size > _LIMIT:
            raise InputError(
                f"clock {clock.name!r}: {size / 2**30:.2f} GiB; MATLAB version 5 files hold less "
                "than 2 GiB a variable; save as .parquet or .nc, or select fewer channels"
            )


def write(recording: Recording, path: Path) -> None:
    """Write the structs."""
    from scipy.io import savemat

    content: dict[str, Any] = {"elevon": Header.of(recording).to_json()}
    content["units"] = {channel.name: channel.unit for channel in recording.channels}
    for clock in recording.clocks.values():
        columns = {"time": clock.time}
        columns |= {channel.name: channel.values for channel in recording.on_clock(clock.name)}
        content[clock.name] = columns
    savemat(path, content, appendmat=False, format="5", oned_as="column", do_compression=False)


def read(path: Path, max_bytes: int) -> Recording:
    """Read the description, then the structs it names."""
    from scipy.io import loadmat
    from scipy.io.matlab import MatReadError

    _scan(path, max_bytes)
    try:
        text = loadmat(path, variable_names=["elevon"], chars_as_strings=True).get("elevon")
        if not isinstance(text, np.ndarray) or text.dtype.kind != "U" or text.size != 1:
            raise FormatError(f"{path}: is a MATLAB file, but no recording (no text 'elevon')")
        header = Header.from_json(str(text.item()), str(path))
        check_size(str(path), header_bytes(header), max_bytes)
        names = [clock.name for clock in header.clocks]
        content = loadmat(path, variable_names=names)
        return rebuild(header, lambda name: _struct(path, content.get(name), name), str(path))
    except (*_DAMAGE, MatReadError) as error:
        if isinstance(error, FormatError):
            raise
        raise FormatError(f"{path}: is not a readable MATLAB file: {error}") from error


def _struct(path: Path, value: Any, name: str) -> dict[str, npt.NDArray[np.float64]]:
    """Return the column vectors of one clock's struct."""
    if not isinstance(value, np.ndarray) or value.dtype.names is None or value.size != 1:
        raise FormatError(f"{path}: {name!r} is not a struct")
    columns = {}
    for field in value.dtype.names:
        data = value[field].item()
        if not isinstance(data, np.ndarray) or data.dtype != np.float64:
            raise FormatError(f"{path}: {name}.{field} is not a vector of doubles")
        columns[field] = data.reshape(-1)
    return columns


def _scan(path: Path, max_bytes: int) -> None:
    """Check the kind of the file, and what its compressed parts would grow to."""
    with path.open("rb") as stream:
        head = stream.read(_HEADER)
        if head.startswith((b"MATLAB 7.3", b"\x89HDF")):
            raise FormatError(f"{path}: is a MATLAB 7.3 file (HDF5); save it with -v7")
        order = {b"IM": "<", b"MI": ">"}.get(head[126:128])
        if len(head) < _HEADER or order is None:
            raise FormatError(f"{path}: is not a MATLAB version 5 file")
        total = 0
        while tag := stream.read(8):
            if len(tag) < 8:
                raise FormatError(f"{path}: ends in the middle of a variable")
            kind, size = struct.unpack(f"{order}II", tag)
            if kind == _COMPRESSED:
                total += _unpacked(path, stream, order, size)
            else:
                total += size
                stream.seek(size, 1)
            check_size(str(path), total, max_bytes)


def _unpacked(path: Path, stream: IO[bytes], order: str, size: int) -> int:
    """Return what one compressed variable says it grows to."""
    raw = stream.read(size)
    try:
        tag = zlib.decompressobj().decompress(raw[:4096], 8)
    except zlib.error as error:
        raise FormatError(f"{path}: a compressed variable is damaged") from error
    if len(tag) < 8:
        raise FormatError(f"{path}: a compressed variable is damaged")
    return int(struct.unpack(f"{order}II", tag)[1])
