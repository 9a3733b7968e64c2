"""What a folder of logs says of itself: which work it belongs to, and how each log ended."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from elevon.bench.traces import trace_files
from elevon.errors import InputError, OutputExistsError
from elevon.files import check_output, write_text

__all__ = ["BenchState", "LogRecord", "digests", "finished_logs"]


@dataclass(frozen=True, slots=True)
class LogRecord:
    """How one finished log ended.

    Attributes
    ----------
    status, message : str
        As of its run: ``ok`` or ``tripped``, and why.
    files : dict of str to str
        SHA-256 by file name.
    """

    status: str
    message: str
    files: dict[str, str]

    @classmethod
    def read(cls, data: Any) -> LogRecord | None:
        """Return a record from its JSON form, None where it is none."""
        if not isinstance(data, dict) or set(data) != {"status", "message", "files"}:
            return None
        files = data["files"]
        texts = [data["status"], data["message"]]
        if not isinstance(files, dict) or not files:
            return None
        texts += [text for pair in files.items() for text in pair]
        return cls(**data) if all(isinstance(text, str) for text in texts) else None


@dataclass
class BenchState:
    """The state file of a procedure's folder, written whole after every log.

    Attributes
    ----------
    path : Path
        ``bench-NAME.json``.
    key : str
        Digits that tell the work from any other, and nothing about it.
    logs : dict of str to LogRecord
        The finished ones.
    resumed : bool
        Whether the very same work was found in the folder.
    """

    path: Path
    key: str
    logs: dict[str, LogRecord] = field(default_factory=dict)
    resumed: bool = False

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
            old = _load(path)
            if old is not None and old.get("bench") == key:
                return cls(path, key, _records(old), resumed=True)
            if old is not None:
                raise OutputExistsError(
                    f"{path}: belongs to other work; use force (--force) to replace them"
                )
            for name in names:
                for file in trace_files(folder, name, cell=True):
                    check_output(file)
        state = cls(path, key)
        state.write()
        return state

    def kept(self, name: str) -> LogRecord | None:
        """Return the record of a log whose files are there, each as it was written."""
        record = self.logs.get(name)
        if record is None:
            return None
        found = digests(self.path.parent / file for file in record.files)
        return record if found == record.files else None

    def note(self, name: str, status: str, message: str, files: Sequence[Path]) -> None:
        """Write down how a log ended."""
        self.logs[name] = LogRecord(status, message, digests(files))
        self.write()

    def write(self) -> None:
        """Write the state, whole or not at all."""
        content = {"bench": self.key, "logs": {n: asdict(log) for n, log in self.logs.items()}}
        write_text(self.path, json.dumps(content, indent=1) + "\n", force=True)


def finished_logs(path: Path) -> list[str]:
    """Return the names of the logs that a state file calls finished; none where there is none."""
    try:
        return list(_records(_load(path) or {}))
    except OutputExistsError:
        return []


def digests(files: Iterable[Path]) -> dict[str, str]:
    """Return the SHA-256 of each file by its name; files that are not there are left out."""
    return {
        path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in files if path.is_file()
    }


def _load(path: Path) -> dict[str, Any] | None:
    try:
        found = json.loads(path.read_text("utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError) as error:
        raise OutputExistsError(f"{path}: cannot be read ({error}); use force (--force)") from error
    return found if isinstance(found, dict) else {}


def _records(state: dict[str, Any]) -> dict[str, LogRecord]:
    logs = state.get("logs")
    if not isinstance(logs, dict):
        return {}
    read = {str(name): LogRecord.read(data) for name, data in logs.items()}
    return {name: record for name, record in read.items() if record is not None}
