"""Recordings as MATLAB version 5 files: ``s = load('x.mat'); plot(s.main.time, s.main.command)``.

One struct for each clock, named as the clock, with column vectors ``time`` and the channels; a
struct ``units`` (channel name to unit) and the text ``elevon``, the description (`Header`).

SciPy writes files that MATLAB cannot read when they pass 2 GB: this is checked here. MATLAB 7.3
files are HDF5, another format.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.arrays import Floats
from elevon.containers.mat5 import Variable, variables
from elevon.errors import FormatError, InputError
from elevon.recording.channel import check_name
from elevon.recording.contents import Contents, check_size, header_bytes, rebuild
from elevon.recording.header import Header

if TYPE_CHECKING:
    from elevon.recording.recording import Recording

_Value = Floats | str | dict[str, Floats]

_LIMIT = 2**31 - 1
_TEXT = b"MATLAB 5.0 MAT-file, written by Elevon"
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
    check(recording)
    content: dict[str, Any] = {"elevon": Header.sealed(recording).to_json()}
    content["units"] = {channel.name: channel.unit for channel in recording.channels}
    for clock in recording.clocks.values():
        columns = {"time": clock.time}
        columns |= {channel.name: channel.values for channel in recording.on_clock(clock.name)}
        content[clock.name] = columns
    write_structs(path, content)


def write_structs(path: Path, content: dict[str, object]) -> None:
    """Write structs; their header has no time of day, so the same content is the same bytes."""
    from scipy.io import savemat

    savemat(path, content, appendmat=False, format="5", oned_as="column", do_compression=False)
    with path.open("r+b") as stream:
        stream.write(_TEXT.ljust(116))


def read(path: Path, max_bytes: int) -> Contents:
    """Read the description, then the structs it names."""
    content = _content(path, max_bytes)
    text = content.get("elevon")
    if not isinstance(text, str):
        raise FormatError(f"{path}: is a MATLAB file, but no recording (no text 'elevon')")
    header = Header.from_json(text, str(path))
    check_size(str(path), header_bytes(header), max_bytes)
    return rebuild(header, lambda name: _struct(path, content, name), str(path))


def _content(path: Path, max_bytes: int) -> dict[str, _Value]:
    """Return the real arrays, texts and structs of a file; those of other kinds are passed over."""
    check_size(str(path), path.stat().st_size, max_bytes)
    content: dict[str, _Value] = {}
    for variable in variables(path, lambda size: check_size(str(path), size, max_bytes)):
        value = _value(variable)
        if value is None:
            continue
        if variable.name in content:
            raise FormatError(f"{path}: is damaged: two variables are named {variable.name!a}")
        content[variable.name] = value
    return content


def _value(variable: Variable) -> _Value | None:
    if variable.kind == "text":
        return variable.text()
    if variable.kind == "struct" and variable.count == 1:
        return {field.name: field.numbers() for field in variable.fields() if _is_real(field)}
    return variable.numbers() if _is_real(variable) else None


def _is_real(variable: Variable) -> bool:
    return variable.kind == "numbers" and not variable.is_complex


def _struct(path: Path, content: dict[str, _Value], name: str) -> dict[str, Floats]:
    """Return the vectors of one clock's struct."""
    value = content.get(name)
    if not isinstance(value, dict):
        raise FormatError(f"{path}: {name!r} is not a struct")
    return value
