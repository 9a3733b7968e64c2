"""Recordings as comma-separated text, for eyes, spreadsheets and other programs.

The table is plain: a line of names with units (``time [s],output_position [rad]``), then numbers
with the digits that give back every bit (a NaN comes back as the plain one). Everything else, and
the SHA-256 of the table's bytes, stands in a file beside it (`elevon.recording.csv`).

A table holds ONE clock. A recording of several becomes one table a clock: ``run.csv`` is written as
``run.drive.csv`` and ``run.load_cell.csv``, each a recording of its own, and loading ``run.csv``
joins them.

A table without the file beside it is read as well, in any units, with a warning, without meta.
"""

from __future__ import annotations

import hashlib
import json
import re
import warnings
from collections.abc import Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from glob import escape
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import DamageError, FormatError, InputError, UncheckedWarning
from elevon.files import atomic_path, check_output, journal, publish, read_regular, write_text
from elevon.recording.channel import Clock, in_si
from elevon.recording.contents import Contents, check_size, header_bytes, rebuild
from elevon.recording.header import Header
from elevon.units import check_kind, to_si

if TYPE_CHECKING:
    from elevon.recording.recording import Recording


_WHAT = "Elevon recording"
_LARGEST = 256 * 2**20


@dataclass(frozen=True)
class TableDescription:
    """What the file beside a CSV table says.

    Attributes
    ----------
    sha256 : str
        Of the table's bytes.
    header : Header
        Description of the one clock in the table.
    of : str
        SHA-256 of the whole recording, the same beside the tables of all its clocks.
    files : list of str
        Names of the tables of all clocks, in order.
    """

    sha256: str
    header: Header
    of: str
    files: list[str]


def description_path(table: Path) -> Path:
    """Return the path of the description: ``run.csv.json`` beside ``run.csv``."""
    return table.with_name(f"{table.name}.json")


def sha256_of(path: Path) -> str:
    """Return the SHA-256 of a file's bytes."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def write_description(table: Path, about: TableDescription, *, keep_old: bool) -> Path:
    """Write a description; `keep_old`: with the one it replaces, until the table is replaced."""
    content = _content(about)
    if keep_old:
        with suppress(InputError, OSError):
            old = _parsed(description_path(table))
            old.pop("replaces", None)
            content["replaces"] = _matching(table) or old
    with journal():  # the table is what was written, not this
        return write_text(description_path(table), json.dumps(content, indent=1) + "\n", force=True)


def describes(path: Path) -> bool:
    """Whether a file begins as a description of a CSV recording."""
    try:
        with path.open("rb") as stream:
            return _WHAT.encode() in stream.read(64)
    except OSError:
        return False


def read_description(table: Path) -> TableDescription | None:
    """Return the description that belongs to a table; None where no file stands beside it.

    Raises
    ------
    DamageError
        Neither the description nor the one it replaces is that of these bytes.
    FormatError
        The file beside the table is no description.
    """
    if not description_path(table).exists():
        return None
    content = _matching(table)
    if content is None:
        raise DamageError(
            f"{table}: damaged or changed: not the bytes that {description_path(table).name} "
            "describes (SHA-256); without that file the table is read as it is, with a warning"
        )
    try:
        header = Header.from_json(json.dumps(content["recording"]), str(description_path(table)))
        names = content["files"]
        if not isinstance(names, list) or not all(isinstance(name, str) for name in names):
            raise TypeError("files must be names")
        return TableDescription(str(content["sha256"]), header, str(content["of"]), names)
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        raise FormatError(f"{description_path(table)}: damaged: {error!r}") from error


def _content(about: TableDescription) -> dict[str, Any]:
    return {
        "what": _WHAT,
        "sha256": about.sha256,
        "of": about.of,
        "files": about.files,
        "recording": json.loads(about.header.to_json()),
    }


def _matching(table: Path) -> dict[str, Any] | None:
    """Return the description, or the one it replaces, whose SHA-256 is that of the table."""
    content = _parsed(description_path(table))
    present = sha256_of(table)
    for entry in (content, content.get("replaces")):
        if isinstance(entry, Mapping) and entry.get("sha256") == present:
            return dict(entry)
    return None


def _parsed(path: Path) -> dict[str, Any]:
    text = read_regular(path, _LARGEST)
    try:
        content = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: damaged: {error!r}") from error
    if not isinstance(content, dict) or content.get("what") != _WHAT:
        raise FormatError(f"{path}: damaged, or no description of a recording")
    return content


OLD_MARK = "# elevon "
"""How a table began that had its description in the first line."""
_COLUMN = re.compile(r'\s*"?\s*([A-Za-z][A-Za-z0-9_]*)\s*\[\s*([^\[\],"]*?)\s*\]\s*"?\s*')
_LONGEST_LINE = 64 * 2**20
_EXPANSION = 4
"""A number of two characters, with its comma, takes eight bytes in memory."""


def tables(path: Path, clocks: Iterable[str]) -> list[Path]:
    """Return the table of each clock: `path` for one, ``run.CLOCK.csv`` for each of several."""
    names = list(clocks)
    if len(names) == 1:
        return [path]
    return [path.with_name(f"{path.stem}.{name}{path.suffix}") for name in names]


def check(path: Path, clocks: Iterable[str], *, force: bool) -> None:
    """Refuse, before any work, outputs that cannot be written; errors as `check_output`.

    A description without a table, left by a save that was killed, hinders nothing.
    """
    names = list(clocks)
    if not names:
        raise InputError(f"{path}: a .csv file holds a clock, the recording has none")
    check_output(path, force=force)
    for table in tables(path, names):
        check_output(table, force=force)
        left_over = not table.exists() and describes(description_path(table))
        check_output(description_path(table), force=force or left_over)


def save(recording: Recording, path: Path, *, force: bool) -> None:
    """Write the tables and the file beside each."""
    check(path, recording.clocks, force=force)
    paths = tables(path, recording.clocks)
    if len(paths) == 1:
        whole = Header.sealed(recording).sha256
        _save_one(recording, path, whole, [path.name], force=force)
        return
    _save_several(recording, paths, force=force)
    for old in (path, description_path(path)):  # the tables of the clocks replace it
        old.unlink(missing_ok=True)


def _save_several(recording: Recording, paths: list[Path], *, force: bool) -> None:
    """Write the tables of several clocks: all wait beside before the first one gets its name.

    So whatever cuts this short, either no table is new, or the new ones are all there.
    """
    whole, files = Header.sealed(recording).sha256, [table.name for table in paths]
    switched = False
    _drop_waiting(paths)
    try:
        for table, clock in zip(paths, recording.clocks, strict=True):
            part, place = recording.select(clock=clock), _waiting(table, whole)
            with journal(), atomic_path(place, force=True) as temporary:
                _write(part, temporary)
                about = TableDescription(sha256_of(temporary), Header.sealed(part), whole, files)
            write_description(place, about, keep_old=False)
        for table in paths:
            _switch(table, whole, force=force)
            switched = True
    except BaseException:
        if not switched:
            _drop_waiting(paths)
        raise


def _switch(table: Path, whole: str, *, force: bool) -> None:
    """Give a table that waits beside, and its description, their names."""
    place = _waiting(table, whole)
    about, replaced = read_description(place), table.exists()
    assert about is not None
    try:
        write_description(table, about, keep_old=replaced)
        publish(place, table, force=force)
    except BaseException:
        if not table.exists():
            description_path(table).unlink(missing_ok=True)
        raise
    if replaced:
        write_description(table, about, keep_old=False)
    description_path(place).unlink(missing_ok=True)


def _waiting(table: Path, whole: str) -> Path:
    """Return where a table of a recording of that SHA-256 waits for its name."""
    return table.with_name(f".{table.name}.{whole}.next")


def _drop_waiting(paths: Iterable[Path]) -> None:
    for table in paths:
        for left in table.parent.glob(f".{escape(table.name)}.*.next*"):
            left.unlink(missing_ok=True)


def _save_one(
    recording: Recording, table: Path, whole: str, files: list[str], *, force: bool
) -> None:
    replaced = table.exists()
    try:
        with atomic_path(table, force=force) as temporary:
            _write(recording, temporary)
            about = TableDescription(sha256_of(temporary), Header.sealed(recording), whole, files)
            write_description(table, about, keep_old=replaced)
    except BaseException:
        if not table.exists():
            description_path(table).unlink(missing_ok=True)
        raise
    if replaced:
        write_description(table, about, keep_old=False)


def _write(recording: Recording, path: Path) -> None:
    channels = recording.channels
    heads = ["time [s]", *(f"{c.name} [{c.unit}]" for c in channels)]
    columns = [recording.clock().time, *(c.values for c in channels)]
    with path.open("wb") as stream:
        stream.write(f"{','.join(heads)}\n".encode())
        if find_spec("pyarrow") is None:
            _write_plain(columns, stream)
        else:
            _write_arrow(columns, heads, stream)


def _write_arrow(columns: list[Floats], heads: list[str], stream: Any) -> None:
    import pyarrow as pa
    from pyarrow import csv

    table = pa.Table.from_arrays([pa.array(column) for column in columns], heads)
    csv.write_csv(table, stream, csv.WriteOptions(include_header=False, quoting_style="none"))


def _write_plain(columns: list[Floats], stream: Any) -> None:
    """Write without pyarrow: Python's own shortest text of a number, which gives back every bit."""
    for row in zip(*(column.tolist() for column in columns), strict=True):
        stream.write(f"{','.join(map(repr, row))}\n".encode())


def joined_tables(path: Path) -> list[Path]:
    """Return the tables, one a clock, of a recording saved as `path`; none where there are none.

    Raises
    ------
    DamageError
        One of them is missing.
    """
    if path.exists():
        return []
    for near in sorted(path.parent.glob(f"{escape(path.stem)}.*{path.suffix}.json")):
        table = near.with_suffix("")
        about = read_description(table) if table.is_file() and describes(near) else None
        if about is None or len(about.files) < 2 or table.name not in about.files:
            continue
        present = [path.with_name(Path(name).name) for name in about.files]
        clocks = [
            name.removeprefix(f"{path.stem}.").removesuffix(path.suffix) for name in about.files
        ]
        if present != tables(path, clocks):
            continue
        for table in present:
            if not table.is_file() and not _waiting(table, about.of).is_file():
                raise DamageError(
                    f"{path}: {table.name} is missing, the table of one of its clocks"
                )
        return present
    return []


def read(path: Path, max_bytes: int) -> Contents:
    """Read a table, or the tables of the clocks that were saved as `path`."""
    parts = joined_tables(path)
    if not parts:
        return _read(path, max_bytes)[0]
    read = _of_one_recording(path, parts, max_bytes)
    first = read[0][0]
    return replace(
        first,
        channels=[channel for contents, _ in read for channel in contents.channels],
        clocks=[clock for contents, _ in read for clock in contents.clocks],
        old=sorted({name for contents, _ in read for name in contents.old}),
    )


def _of_one_recording(path: Path, parts: list[Path], max_bytes: int) -> list[tuple[Contents, str]]:
    """Return the tables of all clocks; where a save was cut short, those that it had written."""
    read = [_read(part, max_bytes) if part.is_file() else None for part in parts]
    for whole in dict.fromkeys(item[1] for item in read if item is not None):
        places = [_waiting(part, whole) for part in parts]
        if all(
            (item is not None and item[1] == whole) or place.is_file()
            for item, place in zip(read, places, strict=True)
        ):
            return [
                item if item is not None and item[1] == whole else _read(place, max_bytes)
                for item, place in zip(read, places, strict=True)
            ]
    raise DamageError(f"{path}: its tables are not of one recording: a save was cut short")


def _read(path: Path, max_bytes: int) -> tuple[Contents, str]:
    """Return what a table holds and the recording it is of."""
    check_size(str(path), path.stat().st_size, max_bytes)
    with path.open("rb") as stream:
        first = _line(path, stream)
        if first.startswith(OLD_MARK):
            raise FormatError(
                f"{path}: has its description in the first line, as earlier versions wrote it; "
                "without that line it is read as a plain table (or save it anew from its source)"
            )
        about = read_description(path)
        needed = _EXPANSION * path.stat().st_size if about is None else header_bytes(about.header)
        check_size(str(path), needed, max_bytes)
        columns = _heads(path, first)
        arrays = _numbers(path, stream, list(columns))
    if about is None:
        contents = _undescribed(path, columns, arrays)
        warnings.warn(
            f"{path}: no {description_path(path).name} beside it, so no checksum: "
            "damage cannot be seen",
            UncheckedWarning,
            5,
        )
        return contents, ""
    if len(about.header.clocks) != 1:
        raise FormatError(f"{path}: describes {len(about.header.clocks)} clocks, a .csv holds one")
    described = {name: unit for name, (unit, _) in about.header.clocks[0].channels.items()}
    if columns != {"time": "s", **described}:
        raise FormatError(
            f"{path}: the column names do not agree with {description_path(path).name}"
        )
    return rebuild(about.header, lambda _: arrays, str(path)), about.of


def _line(path: Path, stream: Any) -> str:
    raw = stream.readline(_LONGEST_LINE)
    try:
        text: str = raw.decode("utf-8-sig").rstrip("\r\n")
    except UnicodeDecodeError as error:
        raise FormatError(f"{path}: is not UTF-8 text") from error
    return text


def _heads(path: Path, line: str) -> dict[str, str]:
    """Read the column names and units."""
    columns: dict[str, str] = {}
    for text in line.split(","):
        match = _COLUMN.fullmatch(text)
        if match is None:
            raise FormatError(f"{path}: the column {text[:60]!r} is not of the form 'name [unit]'")
        if match[1] in columns:
            raise FormatError(f"{path}: the column {match[1]!r} is there twice")
        columns[match[1]] = match[2] or "1"
    if next(iter(columns)) != "time":
        raise FormatError(f"{path}: the first column must be 'time [s]'")
    return columns


def _numbers(path: Path, stream: Any, names: list[str]) -> dict[str, Floats]:
    body = stream.read()
    if not body.strip():
        return {name: np.empty(0) for name in names}
    read = _read_plain if find_spec("pyarrow") is None else _read_arrow
    return read(path, body, names)


def _read_plain(path: Path, body: bytes, names: list[str]) -> dict[str, Floats]:
    """Read without pyarrow: strictly numbers with commas between them, one row a line."""
    rows = [line.split(b",") for line in body.splitlines() if line.strip()]
    wrong = next((k for k, row in enumerate(rows) if len(row) != len(names)), None)
    if wrong is not None:
        raise FormatError(
            f"{path}: line {wrong + 2} has {len(rows[wrong])} columns, expected {len(names)}"
        )
    try:
        table = np.array([[float(cell) for cell in row] for row in rows])
    except ValueError as error:
        raise FormatError(f"{path}: {error}") from error
    return {name: np.ascontiguousarray(table[:, k]) for k, name in enumerate(names)}


def _read_arrow(path: Path, body: bytes, names: list[str]) -> dict[str, Floats]:
    import pyarrow as pa
    from pyarrow import csv

    kinds = dict.fromkeys(names, pa.float64())
    try:
        table = csv.read_csv(
            pa.BufferReader(body),
            csv.ReadOptions(column_names=names),
            csv.ParseOptions(quote_char=False),
            csv.ConvertOptions(column_types=kinds, null_values=[], strings_can_be_null=False),
        )
    except (pa.ArrowException, ValueError) as error:
        raise FormatError(f"{path}: {error}") from error
    return {name: table.column(name).to_numpy() for name in names}


def _undescribed(path: Path, columns: dict[str, str], arrays: dict[str, Floats]) -> Contents:
    try:
        values = {name: arrays[name] for name in columns if name != "time"}
        units = {name: unit for name, unit in columns.items() if name != "time"}
        check_kind(columns["time"], "s", "time")
        time = arrays["time"]
        if columns["time"] != "s":
            time = to_si(time, columns["time"])
        base = Clock("main", time)
        return Contents([in_si(name, units[name], values[name], base) for name in values], [base])
    except InputError as error:
        raise FormatError(f"{path}: {error}") from error
