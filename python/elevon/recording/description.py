"""The file beside a CSV recording: its description, and the SHA-256 of the CSV's bytes.

``run.csv`` is a plain table; ``run.csv.json`` says the rest. The description takes its name first,
the table after it: a table that is there always has one. When a recording is replaced, the new
description carries the old one until the new table has its name, so that a process killed at any
moment leaves a table with the description that belongs to it.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elevon.errors import DamageError, FormatError, InputError
from elevon.files import journal, read_regular, write_text
from elevon.recording.header import Header

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
