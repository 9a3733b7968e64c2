"""Steps of the demonstration, timed; an interrupted one leaves the finished ones for the next.

A file ``unfinished.log`` beside the reports names the work; each finished step adds a line with its
result. The work is told by the package's own files, the seed and both parameter
sets, a step also by what it was made from. What does not fit to the digit is made again.
"""

from __future__ import annotations

import hashlib
import json
import time as clock
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, Generic, TypeVar

from elevon.actuator import Actuator
from elevon.errors import FormatError, OutputExistsError
from elevon.plain import Plain, key, plain, read_plain
from elevon.report.checks import Check, verdict
from elevon.worklog import WorkLog, digest

Result = TypeVar("Result")
LOG = "unfinished.log"
_CODE = {".py", ".so", ".pyd", ".toml", ".csv", ".j2", ".css", ".js"}

#: Steps that are kept, by the name of their file, and what they are called.
STEPS = {
    "calibration": "the calibration",
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
    """Return the steps that an unfinished demonstration in a folder has finished, in words."""
    log = _read(out / LOG)
    if log is None:
        return []
    steps = [text for name, text in STEPS.items() if name in log.items]
    seen = sum(name.startswith(_INSPECTION) for name in log.items)
    return [*steps, *([f"{seen} diagnoses"] if seen else [])]


def inputs_of(files: Iterable[Path], *more: str) -> str:
    """Return digits over files and texts that a step is made from."""
    marks = sorted((path.name, digest(path)["sha256"]) for path in files if path.is_file())
    return hashlib.sha256(json.dumps([marks, *more]).encode()).hexdigest()[:32]


def _read(path: Path) -> WorkLog | None:
    try:
        return WorkLog.read(path)
    except FormatError:
        return None


@dataclass(frozen=True)
class Step(Plain):
    """A step of the demonstration.

    Attributes
    ----------
    name : str
        What was done.
    seconds : float
        Time it took now.
    reused : str
        What of it was kept from an interrupted run; empty where nothing was.
    """

    COMPUTED = ("resumed",)

    name: str
    seconds: float
    reused: Annotated[str, key("kept")] = ""

    @property
    def resumed(self) -> bool:
        """Whether some of it was kept."""
        return bool(self.reused)


@dataclass(frozen=True)
class Work(Generic[Result]):
    """A step that can be kept: how it is done, and what kind of record it gives.

    Attributes
    ----------
    piece : str
        Its name in the log of finished steps.
    do : callable
        Does it.
    kind : type
        Of its result: a record, kept as JSON and read back equal.
    inputs : str
        What it is made from, in digits.
    files : sequence of Path
        What it writes: kept while they are as they were.
    """

    piece: str
    do: Callable[[], Result]
    kind: type[Result]
    inputs: str = ""
    files: Sequence[Path] = ()


@dataclass
class Story:
    """What every demonstration has.

    Attributes
    ----------
    seed : int
        Of the hidden values and of chance.
    base, hidden : Actuator
        The published set, and the unit on the bench.
    folder : Path
        Of the outputs.
    finished : FinishedSteps
        What an interrupted run left, and this one leaves if it is interrupted.
    steps : list of Step
        What was done, the seconds it took, and what of it was kept from an interrupted run.
    """

    seed: int
    base: Actuator
    hidden: Actuator
    folder: Path
    finished: FinishedSteps
    steps: list[Step] = field(default_factory=list)

    def timed(
        self, name: str, work: Callable[[], Result], summary: Callable[[Result], str] | None = None
    ) -> Result:
        """Do a step and note its time, and what `summary` says of its result."""
        begin = clock.perf_counter()
        result = work()
        self._note(name, clock.perf_counter() - begin, "" if summary is None else summary(result))
        return result

    def resumed(self, name: str, work: Work[Result]) -> Result:
        """Take a step's result from an interrupted run, or do it and keep its result."""
        begin = clock.perf_counter()
        stored = self.finished.load(work.piece, work.inputs, work.kind)
        if stored is not None:
            result, before = stored
            text = f"kept from the interrupted run, which took {before:.1f} s for it"
            self._note(name, clock.perf_counter() - begin, text)
            return result
        result = self.timed(name, work.do)
        seconds = clock.perf_counter() - begin
        self.finished.save(work.piece, work.inputs, plain(result), seconds, work.files)
        return result

    def _note(self, name: str, seconds: float, reused: str) -> None:
        """Add a step; steps of one name are one, with their times added up."""
        for k, step in enumerate(self.steps):
            if step.name == name:
                self.steps[k] = Step(name, step.seconds + seconds, reused or step.reused)
                return
        self.steps.append(Step(name, seconds, reused))

    @property
    def seconds(self) -> float:
        """Time of all steps so far."""
        return sum(step.seconds for step in self.steps)

    def summary(self, checks: Sequence[Check]) -> dict[str, Any]:
        """Return what every demonstration's JSON form has."""
        return {
            **verdict(checks),
            "seed": self.seed,
            "steps": [step.to_dict() for step in self.steps],
            "wall_s": self.seconds,
            "report": str(self.folder / "report.html"),
        }
