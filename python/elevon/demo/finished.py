"""What an interrupted demonstration leaves for the next one: its finished steps, as JSON.

A file ``unfinished.log`` beside the reports names the work; each finished step adds a line with its
result. The work is told by the package's own files, the seed and both parameter
sets, a step also by what it was made from. What does not fit to the digit is made again.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, TypeVar

from elevon.actuator import Actuator
from elevon.errors import FormatError, OutputExistsError
from elevon.plain import read_plain
from elevon.worklog import WorkLog, digest

Result = TypeVar("Result")
LOG = "unfinished.log"
_CODE = {".py", ".so", ".pyd", ".toml", ".csv", ".j2", ".css", ".js"}

#: Steps that are kept, by the name of their file, and what they are called.
STEPS = {
    "backlash": "the backlash table",
    "calibration": "the calibration",
    "before": "the validation of the published values",
    "after": "the validation of the calibrated values",
    "life": "the unit's life",
}
_INSPECTION = "inspection-"


def work_key(seed: int, base: Actuator, hidden: Actuator) -> str:
    """Return digits that tell this work, done by this very package, from any other."""
    import elevon

    root = Path(str(elevon.__file__)).parent
    mark = hashlib.sha256()
    for path in sorted(path for path in root.rglob("*") if path.suffix in _CODE):
        mark.update(f"{path.relative_to(root).as_posix()}\n".encode())
        mark.update(hashlib.sha256(path.read_bytes()).digest())
    mark.update(json.dumps([elevon.__version__, seed, base.hash, hidden.hash]).encode())
    return mark.hexdigest()[:32]


class FinishedSteps:
    """The finished steps of one work.

    Parameters
    ----------
    out : Path
        Folder of the demonstration.
    key : str
        From `work_key`.
    """

    def __init__(self, out: Path, key: str) -> None:
        self.path = out / LOG
        self.key = key
        self._log: WorkLog | None = None

    def begun(self, *, force: bool) -> bool:
        """Whether this very work was begun here and not finished.

        Raises
        ------
        OutputExistsError
            Without `force`: other work was.
        """
        log = _read(self.path)
        if log is not None and log.key == self.key:
            self._log = log
            return True
        if log is not None and not force:
            raise OutputExistsError(
                f"{self.path}: tells of an unfinished demonstration of other work; use force "
                "(--force) to replace it"
            )
        return False

    def begin(self) -> None:
        """Forget whatever was kept and name the work."""
        self._log = WorkLog.begin(self.path, self.key)

    def load(self, name: str, inputs: str, kind: type[Result]) -> tuple[Result, float] | None:
        """Return the result of a finished step and the seconds it took, or None.

        Parameters
        ----------
        name : str
            Of `STEPS`.
        inputs : str
            What the step is made from, in digits.
        kind : type
            Record of the result; what does not fit it is not taken.
        """
        log = self._open_log()
        item = None if log is None else log.intact(name)
        if item is None or item.data.get("inputs") != inputs:
            return None
        try:
            result: Result = read_plain(kind, item.data["result"], name)
            return result, float(item.data["seconds"])
        except (FormatError, KeyError, TypeError, ValueError):
            return None

    def save(
        self, name: str, inputs: str, result: Any, seconds: float, files: Sequence[Path]
    ) -> None:
        """Keep the JSON form of a step's result; it counts while `files` are as they are now."""
        log = self._open_log()
        if log is None:
            self.begin()
            log = self._log
        assert log is not None
        log.note(name, files, inputs=inputs, result=result, seconds=seconds)

    def clear(self) -> None:
        """Remove what is kept: the work is done, or another one begins."""
        self._log = None
        self.path.unlink(missing_ok=True)

    def _open_log(self) -> WorkLog | None:
        """Return this work's log, None where the folder has none or that of other work."""
        log = self._log or _read(self.path)
        self._log = log if log is not None and log.key == self.key else None
        return self._log


def finished_steps(out: Path) -> list[str]:
    """Name the steps, and the logs, that an unfinished demonstration in a folder has finished."""
    from elevon.bench.run import state_file
    from elevon.bench.traces import finished_logs
    from elevon.demo.procedure import demo_procedure

    log = _read(out / LOG)
    if log is None:
        return []
    steps = [text for name, text in STEPS.items() if name in log.items]
    seen = sum(name.startswith(_INSPECTION) for name in log.items)
    if seen or "life" in log.items:
        return [*steps, *([f"{seen} diagnoses"] if seen else [])]
    procedure = demo_procedure()
    logs = len(finished_logs(state_file(out / "logs", procedure.name)))
    return [*steps, *([f"{logs} of {len(procedure.traces)} logs"] if logs else [])]


def inputs_of(files: Iterable[Path], *more: str) -> str:
    """Return digits over files and texts that a step is made from."""
    marks = sorted((path.name, digest(path)["sha256"]) for path in files if path.is_file())
    return hashlib.sha256(json.dumps([marks, *more]).encode()).hexdigest()[:32]


def _read(path: Path) -> WorkLog | None:
    try:
        return WorkLog.read(path)
    except FormatError:
        return None
