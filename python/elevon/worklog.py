"""Long work that survives being killed: what is finished is noted line by line in one file.

One mechanism for everything that fills a folder item by item (campaign, bench, demo): a lock that
dies with its process, a log of finished items with the SHA-256 of their files, and the sweep of
what a killed writer left behind. A line of the log counts only with its own checksum, so that a
line cut by a crash or a full disk is as if it had never been written.
"""

from __future__ import annotations

import hashlib
import json
import os
import re
import socket
import sys
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from elevon import files as disk
from elevon.errors import BusyError, FormatError, InputError, OutputError
from elevon.files import open_owned, owning, read_regular, write_text

LOCK = ".elevon.lock"
"""Name of the lock in a folder. A killed process leaves the file, but holds it no more."""

_LOG = "finished.log"

_LONGEST = 2**30
"""Bytes of a log: some millions of items."""

_FAR = 2**30
"""Where the byte stands that is locked on Windows."""

#: How `elevon.files.atomic_path` names what it writes to.
_PART = re.compile(r"\..*\.[0-9a-f]{12}\.part(\.[A-Za-z0-9]+)?")


@dataclass(frozen=True, slots=True)
class Item:
    """One finished piece of work.

    Attributes
    ----------
    name : str
        Its name within the work.
    files : dict of str to dict
        Path relative to the log's folder to ``{"bytes": ..., "sha256": ...}``.
    data : dict
        What else is known of it, in JSON's types.
    """

    name: str
    files: dict[str, dict[str, Any]]
    data: dict[str, Any]

    def intact(self, folder: Path) -> bool:
        """Whether every file is there, each as it was written (SHA-256)."""
        return not self.damaged(folder)

    def damaged(self, folder: Path) -> list[str]:
        """Return the files that are missing or not as they were written."""
        return [name for name, about in self.files.items() if not _same(folder / name, about)]


@dataclass
class WorkLog:
    """The log of one piece of long work.

    Attributes
    ----------
    path : Path
        The file; its folder is what the items' files are relative to.
    key : str
        Digits that tell this work from any other.
    items : dict of str to Item
        The finished ones, the last line of a name counting.
    cut : bool
        Whether a line is cut or damaged: it goes before the next one is written.
    """

    path: Path
    key: str
    items: dict[str, Item] = field(default_factory=dict)
    cut: bool = False

    @classmethod
    def begin(cls, path: Path, key: str) -> WorkLog:
        """Write the log of work that begins; an older one is replaced."""
        log = cls(path, key)
        log.rewrite()
        return log

    @classmethod
    def read(cls, path: Path) -> WorkLog | None:
        """Return the log that is there, None where there is none.

        Raises
        ------
        FormatError
            There is one and its first line, which says whose it is, is damaged.
        """
        if not os.path.lexists(path):
            return None
        try:
            text = read_regular(path, _LONGEST)
        except InputError as error:
            raise FormatError(str(error)) from error
        lines = [_open(line) for line in text.splitlines()]
        if not lines or lines[0] is None or not isinstance(lines[0].get("work"), str):
            raise FormatError(f"{path}: damaged: its first line does not say whose work it is")
        log = cls(path, lines[0]["work"])
        for line in lines[1:]:
            if line is not None and line.keys() == {"item", "files", "data"}:
                log.items[line["item"]] = Item(line["item"], line["files"], line["data"])
        log.cut = None in lines or not text.endswith(b"\n")
        return log

    def note(self, name: str, files: Iterable[Path], **data: object) -> Item:
        """Write down, durably, that an item is finished.

        Parameters
        ----------
        name : str
            The item.
        files : iterable of path
            Its files, below the log's folder; they must be written already.
        **data
            What else is to be known, in JSON's types.

        Raises
        ------
        OutputError
            A file is not there, or the line cannot be written; the log then is as before.
        """
        about = {self._relative(path): digest(path) for path in files}
        return self.add(Item(name, about, data))

    def add(self, item: Item) -> Item:
        """Write down an item whose digests are known; see `note`."""
        line = _sealed({"item": item.name, "files": item.files, "data": item.data})
        if self.cut:  # a reader leaves the line alone, which another process may be writing
            self.rewrite()
        try:
            _append(self.path, line)
        except OSError as error:
            raise OutputError(f"{self.path}: cannot be written: {error}") from error
        self.items[item.name] = item
        return item

    def intact(self, name: str) -> Item | None:
        """Return a finished item whose files are all there, each as it was written."""
        item = self.items.get(name)
        return item if item is not None and item.intact(self.path.parent) else None

    def _relative(self, path: Path) -> str:
        return path.relative_to(self.path.parent).as_posix()

    def rewrite(self) -> None:
        """Write the whole log anew."""
        lines = [_sealed({"work": self.key})]
        lines += [
            _sealed({"item": i.name, "files": i.files, "data": i.data}) for i in self.items.values()
        ]
        write_text(self.path, "".join(lines), force=True)
        self.cut = False


def digest(path: Path) -> dict[str, object]:
    """Return size and SHA-256 of a file.

    Raises
    ------
    OutputError
        It cannot be read: what was just written has gone.
    """
    try:
        return {"bytes": path.stat().st_size, "sha256": _sha(path)}
    except OSError as error:
        raise OutputError(f"{path}: has gone since it was written: {error.strerror}") from error


@contextmanager
def finished(folder: Path | None, work: str) -> Iterator[WorkLog | None]:
    """Hold a folder and give the log of what is finished there; None where there is no folder.

    Parameters
    ----------
    folder : path or None
        Made where it is missing.
    work : str
        Tells this work from any other; the log of other work, or of another version, is replaced.
    """
    from elevon import __version__

    if folder is None:
        yield None
        return
    key = f"{work} {__version__}"
    with locked(folder):
        log = WorkLog.read(folder / _LOG)
        yield log if log is not None and log.key == key else WorkLog.begin(folder / _LOG, key)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold a folder against other processes; a dead process holds nothing.

    Raises
    ------
    BusyError
        Another process works in the folder; it is named.
    OutputError
        The folder cannot be made or written, or its lock is a link or no file of its own.
    """
    path = folder / LOCK
    handle = _taken(folder, path)
    try:
        _sign(handle)
        with owning(folder):
            yield
    finally:
        if sys.platform == "win32":  # there an open file has a name that nobody can remove
            os.close(handle)
        with suppress(OSError):
            path.unlink()
        if sys.platform != "win32":
            os.close(handle)  # the lock goes with it


def _taken(folder: Path, path: Path) -> int:
    """Open a folder's lock and take it: the file that has the name when the lock is held."""
    while True:
        try:
            folder.mkdir(parents=True, exist_ok=True)
            disk.step("lock", path)
            handle = open_owned(path, os.O_RDWR | os.O_CREAT)
        except OutputError:
            raise
        except OSError as error:
            raise OutputError(f"{folder}: cannot be written: {error.strerror or error}") from error
        if not _take(handle):
            os.close(handle)
            raise BusyError(f"{folder}: another process works there{_holder(path)}")
        with suppress(OSError):
            if os.path.samestat(os.fstat(handle), path.stat()):
                return handle
        os.close(handle)  # whoever held it has removed it meanwhile: take the new one


def is_locked(folder: Path) -> bool:
    """Whether a living process works in a folder."""
    try:
        handle = open_owned(folder / LOCK, os.O_RDWR)
    except OSError:
        return False
    try:
        return not _take(handle)
    finally:
        os.close(handle)


def sweep(folder: Path) -> list[Path]:
    """Remove what writers that were killed left in a folder and below; call with the lock held.

    Returns
    -------
    list of Path
        The files removed: the temporary ones of `elevon.files.atomic_path`.
    """
    gone = []
    for path in folder.rglob(".*.part*"):
        if _PART.fullmatch(path.name):
            with suppress(OSError):
                path.unlink()
                gone.append(path)
    return gone


def _take(handle: int) -> bool:
    """Take the lock of an open file, or find it taken; either goes with the process."""
    if sys.platform == "win32":
        return _take_on_windows(handle)
    import fcntl

    try:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


def _take_on_windows(handle: int) -> bool:
    """Lock one byte far behind the signature: Windows lets nobody read a locked byte."""
    import msvcrt

    module: Any = msvcrt
    try:
        os.lseek(handle, _FAR, os.SEEK_SET)
        module.locking(handle, module.LK_NBLCK, 1)
    except OSError:
        return False
    return True


def _sign(handle: int) -> None:
    """Write who holds the lock, for the message of whoever finds it held."""
    signature = {
        "pid": os.getpid(),
        "host": socket.gethostname(),
        "since": time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime()),
    }
    with suppress(OSError):
        os.ftruncate(handle, 0)
        os.lseek(handle, 0, os.SEEK_SET)
        os.write(handle, json.dumps(signature).encode())


def _holder(path: Path) -> str:
    with suppress(OSError, ValueError, KeyError, TypeError):
        who = json.loads(path.read_text("utf-8"))
        return f" (process {who['pid']} on {who['host']} since {who['since']})"
    return ""


def _same(path: Path, about: Mapping[str, Any]) -> bool:
    try:
        return bool(path.stat().st_size == about["bytes"] and _sha(path) == about["sha256"])
    except OSError:
        return False


def _sha(path: Path) -> str:
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def _sealed(content: Mapping[str, Any]) -> str:
    """Return a line with its own checksum."""
    body = json.dumps(content, separators=(",", ":"))
    return f"{hashlib.sha256(body.encode()).hexdigest()[:16]} {body}\n"


def _open(line: bytes) -> dict[str, Any] | None:
    """Return the content of a line, None where it is not as it was written."""
    seal, _, body = line.partition(b" ")
    if hashlib.sha256(body).hexdigest()[:16].encode() != seal:
        return None
    content = json.loads(body)
    return content if isinstance(content, dict) else None


def _append(path: Path, line: str) -> None:
    """Append a line and force it to the disk; on failure the file is as before."""
    disk.step("append", path)
    handle = open_owned(path, os.O_WRONLY | os.O_APPEND)
    try:
        before = os.fstat(handle).st_size
        try:
            data = line.encode()
            while data:
                data = data[os.write(handle, data) :]
            disk.step("fsync", path)
            os.fsync(handle)
        except OSError:
            with suppress(OSError):
                os.ftruncate(handle, before)
            raise
    finally:
        os.close(handle)
