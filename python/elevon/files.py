"""Files are written whole or not at all.

The content goes to a temporary file in the same folder, is forced to the disk, and takes its name
in one step. A process killed at any moment leaves the old file, the new one, or none; never a
half one. An existing file is replaced only with `force`.
"""

import errno
import os
import secrets
import stat
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from contextvars import ContextVar
from pathlib import Path

from elevon.errors import FormatError, InputError, OutputError, OutputExistsError

#: Folders that this process writes into and did not make alone: links below are refused.
_owned: set[Path] = set()

_journal: ContextVar[list[Path] | None] = ContextVar("journal", default=None)


def step(operation: str, path: Path) -> None:
    """Called before each operation on the disk: the one place where a fault can be put in.

    Operations are ``make``, ``write``, ``fsync``, ``link``, ``rename``, ``sync folder``,
    ``append``, ``lock`` and ``unlink``.
    """


@contextmanager
def owning(folder: Path) -> Iterator[None]:
    """Refuse links below a folder, wherever this process writes into it; see `check_owned`."""
    known = folder in _owned
    _owned.add(folder)
    try:
        yield
    finally:
        if not known:
            _owned.discard(folder)


def check_owned(folder: Path, path: Path) -> None:
    """Refuse a path below a folder that leads elsewhere.

    Raises
    ------
    OutputError
        The file, or a folder on the way to it, is a link; or the file is no regular one, or has
        another name: writing it would change what is not below the folder.
    """
    place = folder
    for part in path.relative_to(folder).parts:
        place = place / part
        try:
            about = place.lstat()
        except OSError:
            return  # nothing there: it will be made
        _check_kind(place, about, last=place == path)


def open_owned(path: Path, flags: int) -> int:
    """Open a file to write, in a folder of unknown origin: a regular file of one name only.

    Raises
    ------
    OutputError
        It is a link, has another name, or is no file; nothing has been written.
    OSError
        It cannot be opened.
    """
    plain = getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
    try:
        handle = os.open(path, flags | plain, 0o666)
    except OSError as error:
        if error.errno == errno.ELOOP:
            raise OutputError(f"{path}: is a link; nothing is written through it") from error
        raise
    try:
        _check_kind(path, os.fstat(handle), last=True)
    except OutputError:
        os.close(handle)
        raise
    return handle


def _check_kind(path: Path, about: os.stat_result, *, last: bool) -> None:
    """Raise `OutputError` for what is neither a folder nor, at the end, a file of one name."""
    if stat.S_ISLNK(about.st_mode):
        raise OutputError(f"{path}: is a link; nothing is written through it")
    if not last or stat.S_ISDIR(about.st_mode):
        return
    if not stat.S_ISREG(about.st_mode):
        raise OutputError(f"{path}: is no regular file; nothing is written to it")
    if about.st_nlink > 1 and not _is_left_over(path, about):
        raise OutputError(
            f"{path}: has another name somewhere (a hard link); nothing is written to it"
        )


def _is_left_over(path: Path, about: os.stat_result) -> bool:
    """Return whether the other name is the temporary one of a writer that was killed."""
    names = [
        other
        for other in path.parent.glob(f".*.part{path.suffix}")
        if os.path.samestat(other.lstat(), about)
    ]
    return len(names) == about.st_nlink - 1


def visible(folder: Path, pattern: str) -> list[Path]:
    """Return a folder's entries of a pattern, sorted, without what a killed writer left behind."""
    return sorted(path for path in folder.glob(pattern) if not path.name.startswith("."))


def read_regular(path: str | os.PathLike[str], limit: int) -> bytes:
    """Return the content of a file whose kind and size are checked before it is read.

    Raises
    ------
    InputError
        There is no such file, or it cannot be read.
    FormatError
        It is no regular file (a device, a pipe, a folder), or longer than `limit` bytes.
    """
    name = os.fspath(path)
    try:
        handle = os.open(name, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
    except (OSError, ValueError) as error:
        why = getattr(error, "strerror", None) or error
        raise InputError(f"{name}: cannot be read: {why}") from error
    about = os.fstat(handle)
    if not stat.S_ISREG(about.st_mode):
        os.close(handle)
        raise FormatError(f"{name}: cannot be read: is no regular file")
    with os.fdopen(handle, "rb") as stream:
        if about.st_size > limit:
            raise FormatError(f"{name}: has {about.st_size} bytes; the limit is {limit}")
        try:
            data = stream.read(limit + 1)
        except OSError as error:
            raise InputError(f"{name}: cannot be read: {error.strerror or error}") from error
    if len(data) > limit:  # it has grown since
        raise FormatError(f"{name}: has more than {limit} bytes, the limit")
    return data


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
        The path is a folder, or its folder cannot be made or written; or it leads out of a folder
        that is being written (`owning`).
    """
    target = Path(path).expanduser()
    for folder in _owned:
        if target.is_relative_to(folder):
            check_owned(folder, target)
    if target.is_dir():
        raise OutputError(f"{target}: is a folder, not a file")
    if os.path.lexists(target) and not force:
        raise OutputExistsError(f"{target}: exists already")
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
        step("write", temporary)
        yield temporary
        _sync(temporary)
        _publish(temporary, target, force=force)
        if (written := _journal.get()) is not None:
            written.append(target)
    except OutputError:
        raise
    except OSError as error:
        raise _unwritten(target, error) from error
    finally:
        with suppress(OSError):  # what is left is swept by the next writer
            step("unlink", temporary)
            temporary.unlink()
    sync_folder(target.parent)


def _unwritten(target: Path, error: OSError) -> OutputError:
    """Return the error in the system's own words: a library's for a full disk say it twice."""
    why = os.strerror(error.errno) if error.errno else str(error)
    return OutputError(f"{target}: cannot be written: {why}")


def publish(waiting: Path, target: Path, *, force: bool) -> None:
    """Give a file that waits beside, written before, its name; errors as `atomic_path`."""
    try:
        check_output(target, force=force)
        _publish(waiting, target, force=force)
        if (written := _journal.get()) is not None:
            written.append(target)
    except OutputError:
        raise
    except OSError as error:
        raise _unwritten(target, error) from error
    with suppress(FileNotFoundError):
        waiting.unlink()
    sync_folder(target.parent)


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
        step("make", temporary)
        os.close(os.open(temporary, os.O_CREAT | os.O_EXCL | os.O_WRONLY, 0o666))
    except OSError as error:
        raise OutputError(f"{target}: cannot be written: {error}") from error


def _sync(path: Path) -> None:
    step("fsync", path)
    with path.open("rb+") as stream:
        os.fsync(stream.fileno())


def _publish(temporary: Path, target: Path, *, force: bool) -> None:
    """Give the file its name; without `force` a file that appeared meanwhile is kept."""
    if force:
        step("rename", target)
        temporary.replace(target)
        return
    try:
        step("link", target)
        os.link(temporary, target)
    except FileExistsError as error:
        raise OutputExistsError(f"{target}: appeared while it was being written") from error
    except OSError as error:
        if error.errno not in {errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS}:
            raise
        check_output(target)  # a file system without links: the check is the best there is
        temporary.replace(target)


def sync_folder(folder: Path) -> None:
    """Force the new name to the disk, where the system lets folders be opened."""
    with suppress(OSError):
        step("sync folder", folder)
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)
