"""Several files that change together: the new ones are written beside, one rename switches.

A folder has a description (a manifest) that names its files by their SHA-256. A new file waits
beside under a name that holds its SHA-256, until the new description has taken its name: from then
on it counts, whether or not it has got its own name yet. So a process killed at any moment leaves
the old files or the new ones, never some of both.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from elevon import files as disk
from elevon.errors import OutputError
from elevon.files import atomic_path, check_output, sync_folder
from elevon.worklog import digest

_NAME = re.compile(r"\.(.+)\.([0-9a-f]{64})\.next")

Files = Mapping[str, Mapping[str, Any]]


class Transaction:
    """New files of a folder, waiting for the description that names them.

    Parameters
    ----------
    folder : path
        Held by this process (`elevon.worklog.locked`).

    Attributes
    ----------
    files : dict
        Name to size and SHA-256 of what has been staged: for the new description.
    """

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.files: dict[str, dict[str, Any]] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[Path]:
        """Give a path to write a new file to; it waits beside the old one, forced to the disk."""
        check_output(self.folder / name, force=True)
        waiting = self.folder / f".{name}.next"
        with atomic_path(waiting, force=True) as temporary:
            yield temporary
            about = digest(temporary)
        self.files[name] = about
        _rename(waiting, _staged(self.folder, name, about))

    def stage_text(self, name: str, text: str) -> None:
        """Stage a text of UTF-8 with bare newlines."""
        with self.stage(name) as temporary:
            temporary.write_bytes(text.encode("utf-8"))

    def commit(self, describe: Callable[[], None]) -> None:
        """Write the description, the one step that switches, and give the files their names."""
        sync_folder(self.folder)
        describe()
        settle(self.folder, self.files)


def located(folder: Path, name: str, about: Mapping[str, object] | None) -> Path:
    """Return where the file of a name and SHA-256 is: waiting beside, or under its own name."""
    if about is not None:
        waiting = _staged(folder, name, about)
        if waiting.is_file():
            return waiting
    return folder / name


def is_staged(name: str) -> bool:
    """Return whether a file's name is one that a new file waits under."""
    return _NAME.fullmatch(name) is not None or re.fullmatch(r"\..+\.next", name) is not None


def settle(folder: Path, files: Files) -> list[str]:
    """End what a killed process began: give waiting files their names, drop those never described.

    Parameters
    ----------
    folder : path
        Held by this process.
    files : mapping
        The description's: name to size and SHA-256.

    Returns
    -------
    list of str
        Names of the files that have got their names.
    """
    done = []
    for name, about in files.items():
        waiting = _staged(folder, name, about)
        if waiting.is_file():
            check_output(folder / name, force=True)
            _rename(waiting, folder / name)
            done.append(name)
    for path in folder.glob(".*.next"):
        with suppress(OSError):
            disk.step("unlink", path)
            path.unlink()
    if done:
        sync_folder(folder)
    return done


def _rename(source: Path, target: Path) -> None:
    try:
        disk.step("rename", target)
        source.replace(target)
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error.strerror or error}") from error


def _staged(folder: Path, name: str, about: Mapping[str, Any]) -> Path:
    return folder / f".{name}.{about['sha256']}.next"
