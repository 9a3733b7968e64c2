"""What a folder of logs says of itself: which work it belongs to, and how each log ended."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path

from elevon.bench.traces import trace_files
from elevon.errors import FormatError, InputError, OutputExistsError
from elevon.files import check_output
from elevon.recording.description import description_path
from elevon.worklog import Item, WorkLog


@dataclass(frozen=True, slots=True)
class LogRecord:
    """How one finished log ended.

    Attributes
    ----------
    status, message : str
        As of its run: ``ok`` or ``tripped``, and why.
    files : tuple of str
        Their names.
    """

    status: str
    message: str
    files: tuple[str, ...]


@dataclass
class BenchState:
    """The log of a procedure's folder, a line for each finished log.

    Attributes
    ----------
    log : WorkLog
        ``bench-NAME.log``.
    resumed : bool
        Whether the very same work was found in the folder.
    """

    log: WorkLog
    resumed: bool = False

    @property
    def path(self) -> Path:
        """The log's file."""
        return self.log.path

    @classmethod
    def claim(cls, path: Path, key: str, names: Iterable[str], *, force: bool) -> BenchState:
        """Make a folder this work's own, or find the same work begun there.

        Raises
        ------
        InputError
            The folder is a file.
        OutputExistsError
            Without `force`: the folder holds logs of other work, or logs that nobody knows.
        """
        folder = path.parent
        if folder.exists() and not folder.is_dir():
            raise InputError(f"{folder}: is not a folder")
        if not force:
            old = _read(path)
            if old is not None and old.key == key:
                return cls(old, resumed=True)
            if old is not None:
                raise OutputExistsError(
                    f"{path}: belongs to other work; use force (--force) to replace them"
                )
            for name in names:
                traces = trace_files(folder, name, cell=True)
                for file in (*traces, description_path(traces[-1])):
                    check_output(file)
        return cls(WorkLog.begin(path, key))

    def intact(self, name: str) -> LogRecord | None:
        """Return the record of a log whose files are there, each as it was written."""
        item = self.log.intact(name)
        return None if item is None else _record(item)

    def note(self, name: str, status: str, message: str, files: Sequence[Path]) -> None:
        """Write down how a log ended."""
        self.log.note(name, files, status=status, message=message)


def finished_logs(path: Path) -> list[str]:
    """Return the names of the logs that a state file calls finished; none where there is none."""
    try:
        log = WorkLog.read(path)
    except FormatError:
        return []
    return [] if log is None else [name for name, item in log.items.items() if _record(item)]


def _read(path: Path) -> WorkLog | None:
    try:
        return WorkLog.read(path)
    except FormatError as error:
        raise OutputExistsError(f"{path}: cannot be read ({error}); use force (--force)") from error


def _record(item: Item) -> LogRecord | None:
    """Return an item as a record, None where it is none."""
    texts = [item.data.get("status"), item.data.get("message")]
    if not item.files or not all(isinstance(text, str) for text in texts):
        return None
    return LogRecord(str(texts[0]), str(texts[1]), tuple(item.files))
