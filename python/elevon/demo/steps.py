"""A demonstration's steps: timed, and kept for a run that is interrupted."""

from __future__ import annotations

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, TypeVar

from elevon.actuator import Actuator
from elevon.demo.finished import FinishedSteps
from elevon.demo.results import Step
from elevon.plain import plain
from elevon.report.checks import Check, verdict

Result = TypeVar("Result")


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
