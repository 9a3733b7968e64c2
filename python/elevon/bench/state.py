"""What a folder of logs says of itself: which work it belongs to, and how each log ended."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from elevon.bench.traces import trace_files
from elevon.errors import FormatError, InputError, OutputExistsError
from elevon.files import check_output
from elevon.recording.csv import description_path
from elevon.worklog import Item, WorkLog


def claim_logs(path: Path, key: str, names: Iterable[str], *, force: bool) -> tuple[WorkLog, bool]:
    """Make a folder this work's own, or find the same work begun there.

    Returns
    -------
    WorkLog, bool
        ``bench-NAME.log``, a line for each finished log; whether the very same work was there.

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
    if force:
        return WorkLog.begin(path, key), False
    try:
        old = WorkLog.read(path)
    except FormatError as error:
        raise OutputExistsError(f"{path}: cannot be read ({error}); use force (--force)") from error
    if old is not None and old.key == key:
        return old, True
    if old is not None:
        raise OutputExistsError(
            f"{path}: belongs to other work; use force (--force) to replace them"
        )
    for name in names:
        traces = trace_files(folder, name, cell=True)
        for file in (*traces, description_path(traces[-1])):
            check_output(file)
    return WorkLog.begin(path, key), False


def finished_logs(path: Path) -> list[str]:
    """Return the names of the logs that a state file calls finished; none where there is none."""
    try:
        log = WorkLog.read(path)
    except FormatError:
        return []
    return [] if log is None else [name for name, item in log.items.items() if ending_of(item)]


def ending_of(item: Item) -> tuple[str, str] | None:
    """Return status (``ok`` or ``tripped``) and message of a finished log; None: it says none."""
    status, message = item.data.get("status"), item.data.get("message")
    if item.files and isinstance(status, str) and isinstance(message, str):
        return status, message
    return None
