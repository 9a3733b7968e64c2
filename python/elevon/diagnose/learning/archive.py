"""The file of what was learnt: one NumPy archive of arrays and a JSON text, nothing executable."""

from __future__ import annotations

import io
import json
import os
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.errors import FormatError
from elevon.files import write_bytes

FORMAT, _VERSION = "elevon-learned", 1
_MOST_BYTES = 50_000_000
#: What a damaged archive raises, its members' headers included: they are Python literals.
_DAMAGED = (
    OSError, ValueError, KeyError, TypeError, EOFError, RuntimeError, MemoryError, SyntaxError,
    tokenize.TokenError, zipfile.BadZipFile, zlib.error,
)  # fmt: skip


def write_archive(
    path: str | os.PathLike[str],
    kind: str,
    about: Mapping[str, Any],
    arrays: Mapping[str, npt.NDArray[Any]],
    *,
    force: bool = False,
) -> Path:
    """Write arrays and what is said of them.

    Raises
    ------
    OutputExistsError, OutputError
        As `elevon.files.write_bytes`.
    """
    head = {"format": FORMAT, "version": _VERSION, "kind": kind, **about}
    text = np.frombuffer(json.dumps(head).encode(), dtype=np.uint8)
    stream = io.BytesIO()
    np.savez_compressed(stream, about=text, **arrays)  # type: ignore[arg-type]
    return write_bytes(path, stream.getvalue(), force=force)


def read_archive(
    path: str | os.PathLike[str],
) -> tuple[str, dict[str, Any], dict[str, npt.NDArray[Any]]]:
    """Read what `write_archive` wrote: its kind, what is said, the arrays.

    Raises
    ------
    FormatError
        The file is absent, damaged, of another version or something else.
    """
    try:
        if not Path(path).is_file():
            raise ValueError("is no regular file")
        with zipfile.ZipFile(path) as archive:
            if sum(item.file_size for item in archive.infolist()) > _MOST_BYTES:
                raise ValueError(f"more than {_MOST_BYTES} bytes")
        with np.load(path, allow_pickle=False) as stored:
            arrays = {name: stored[name] for name in stored.files}
        about = json.loads(bytes(arrays.pop("about")))
        if about.get("format") != FORMAT or about.get("version") != _VERSION:
            raise ValueError(f"format {about.get('format')!r}, version {about.get('version')!r}")
        return str(about["kind"]), about, arrays
    except _DAMAGED as error:
        raise FormatError(f"{path}: nothing that Elevon learnt: {error}") from error
