"""Files are written whole or not at all.

The content goes to a temporary file in the same folder, is forced to the disk, and takes its name
in one step. A process killed at any moment leaves the old file, the new one, or none; never a
half one. An existing file is replaced only when asked for (`force`).
"""

import errno
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from elevon.errors import OutputError, OutputExistsError

__all__ = ["atomic_path", "check_output", "journal", "write_bytes", "write_text"]

_journal: ContextVar[list[Path] | None] = ContextVar("journal", default=None)


@contextmanager
def journal() -> Iterator[list[Path]]:
    """Note down what is written, for whoever must say what is there when the work is cut short.

    Yields
    ------
    list of Path
        Grows by a file each time one has got its name; files of an inner journal are not in it.
    """
    written: list[Path] = []
    token = _journal.set(written)
    try:
        yield written
    finally:
        _journal.reset(token)


def check_output(path: str | os.PathLike[str], *, force: bool = False) -> Path:
    """Check, before long work starts, that an output could be written.

    Parameters
    ----------
    path : path
        The output file. Its folder is made when it does not exist.
    force : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path
        The same path, expanded.

    Raises
    ------
    OutputExistsError
        The file exists and `force` is false.
    OutputError
        The path is a folder, or its folder cannot be made or written.
    """
    target = Path(path).expanduser()
    if target.is_dir():
        raise OutputError(f"{target}: is a folder, not a file")
    if os.path.lexists(target) and not force:
        raise OutputExistsError(f"{target}: exists already; use force (--force) to replace it")
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise OutputError(f"{target}: cannot make the folder {target.parent}: {error}") from error
    if not os.access(target.parent, os.W_OK | os.X_OK):
        raise OutputError(f"{target}: the folder {target.parent} is not writable")
    return target


@contextmanager
def atomic_path(path: str | os.PathLike[str], *, force: bool = False) -> Iterator[Path]:
    """Give a temporary path to write to; on success it becomes `path` in one step.

    Parameters
    ----------
    path : path
        The output file.
    force : bool
        Whether an existing file may be replaced.

    Yields
    ------
    Path
        A file in the same folder and with the same ending, removed if the block raises.

    Raises
    ------
    OutputExistsError, OutputError
        As `check_output`; also when the disk is full or the file appears meanwhile.
    """
    target = check_output(path, force=force)
    # Named before it is made: a Ctrl-C in between must find what to remove.
    name = f".{target.stem[:64]}.{secrets.token_hex(6)}.part{target.suffix}"
    temporary = target.parent / name
    try:
        _make(temporary, target)
        yield temporary
        _sync(temporary)
        _publish(temporary, target, force=force)
        if (written := _journal.get()) is not None:
            written.append(target)
    except OutputError:
        raise
    except OSError as error:
        # The system's own words: a library's for a full disk say it twice.
        why = os.strerror(error.errno) if error.errno else str(error)
        raise OutputError(f"{target}: cannot be written: {why}") from error
    finally:
        with suppress(FileNotFoundError):
            temporary.unlink()
    _sync_folder(target.parent)


def write_bytes(path: str | os.PathLike[str], data: bytes, *, force: bool = False) -> Path:
    """Write bytes to a file, whole or not at all; errors as `atomic_path`."""
    with atomic_path(path, force=force) as temporary:
        temporary.write_bytes(data)
    return Path(path).expanduser()


def write_text(path: str | os.PathLike[str], text: str, *, force: bool = False) -> Path:
    """Write UTF-8 text with bare newlines, whole or not at all; errors as `atomic_path`."""
    return write_bytes(path, text.encode("utf-8"), force=force)


def _make(temporary: Path, target: Path) -> None:
    """Make an empty, hidden file beside the target, with the mode of any new file."""
    try:
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error}") from error


def _sync(path: Path) -> None:
    with path.open("rb+") as stream:
        os.fsync(stream.fileno())


def _publish(temporary: Path, target: Path, *, force: bool) -> None:
    """Give the file its name; without `force` a file that appeared meanwhile is kept."""
    if force:
        temporary.replace(target)
        return
    try:
        os.link(temporary, target)
    except FileExistsError as error:
        raise OutputExistsError(f"{target}: appeared while it was being written") from error
    except OSError as error:
        if error.errno not in {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS}:
            raise
        check_output(target)  # a file system without links: the check is the best there is
        temporary.replace(target)


def _sync_folder(folder: Path) -> None:
    """Force the new name to the disk, where the system lets folders be opened."""
    with suppress(OSError):
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
