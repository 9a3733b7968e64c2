"""Steps of the demonstration, timed; an interrupted run leaves the finished ones for the next.

A file ``unfinished.log`` beside the page names the work; each finished step adds a line with its
result. A step counts only while every file that it was made from, or that it wrote, is as it was.
"""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TypeVar

from elevon.errors import FormatError
from elevon.plain import Plain, key, plain, read_plain
from elevon.worklog import WorkLog

Made = TypeVar("Made")
LOG = "unfinished.log"
_STEPS = {"life": "the unit's life", "calibration": "the calibration"}
_INSPECTION = "inspection-"


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


class Story:
    """The steps of one demonstration, those done now and those an interrupted run has finished.

    Parameters
    ----------
    out : Path
        Folder of the demonstration.
    key : str
        Tells this work from any other.

    Attributes
    ----------
    resumes : bool
        Whether an interrupted run has begun this very work in the folder.
    """

    def __init__(self, out: Path, key: str) -> None:
        log = _read(out)
        self.resumes = log is not None and log.key == key
        self._log = log if log is not None and self.resumes else WorkLog(out / LOG, key)
        self._steps: dict[str, Step] = {}

    def begin(self) -> None:
        """Forget whatever was kept and name the work."""
        self._log = WorkLog.begin(self._log.path, self._log.key)

    def clear(self) -> None:
        """Remove what is kept: the work is done."""
        self._log.path.unlink(missing_ok=True)

    def timed(self, name: str, work: Callable[[], Made]) -> Made:
        """Do a step and note its time; steps of one name are one."""
        begin = clock.perf_counter()
        result = work()
        self._note(name, begin, "")
        return result

    def resumable(
        self, name: str, piece: str, kind: type[Made], work: Callable[[], Made],
        files: Sequence[Path] = (),
    ) -> Made:  # fmt: skip
        """Take a step's result from an interrupted run, or do it and keep its result.

        Parameters
        ----------
        name : str
            What is done.
        piece : str
            Its name in the file of finished steps.
        kind : type
            Record of the result, written as JSON and read back equal.
        work : callable
            Does it.
        files : sequence of Path
            What it is made from, and what it writes: all as they were, or it is done again.
        """
        begin = clock.perf_counter()
        if (item := self._log.intact(piece)) is not None:
            with suppress(FormatError, KeyError, TypeError, ValueError):
                result: Made = read_plain(kind, item.data["result"], piece)
                took = f"which took {item.data['seconds']:.1f} s for it"
                self._note(name, begin, f"kept from the interrupted run, {took}")
                return result
        result = self.timed(name, work)
        seconds = clock.perf_counter() - begin
        self._log.note(piece, files, result=plain(result), seconds=seconds)
        return result

    def _note(self, name: str, begin: float, reused: str) -> None:
        old = self._steps.get(name, Step(name, 0.0))
        seconds = old.seconds + clock.perf_counter() - begin
        self._steps[name] = Step(name, seconds, reused or old.reused)

    @property
    def steps(self) -> list[Step]:
        """What was done so far, in order."""
        return list(self._steps.values())

    @property
    def seconds(self) -> float:
        """Time of all steps so far."""
        return sum(step.seconds for step in self.steps)


def finished_steps(out: Path) -> list[str]:
    """Return the steps that an unfinished demonstration in a folder has finished, in words."""
    log = _read(out)
    if log is None:
        return []
    seen = sum(name.startswith(_INSPECTION) for name in log.items)
    steps = [text for name, text in _STEPS.items() if name in log.items]
    return [*steps, *([f"{seen} diagnoses"] if seen else [])]


def _read(out: Path) -> WorkLog | None:
    with suppress(FormatError):
        return WorkLog.read(out / LOG)
    return None
