"""What the first look at a log has found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

from elevon.calibrate.validation import Validation
from elevon.diagnose.engine.answer import Diagnosis
from elevon.plain import STORED, WORKING, Plain
from elevon.results import Result

if TYPE_CHECKING:
    from elevon.recording import Recording
    from elevon.report import Report


@dataclass(frozen=True)
class ReadColumn(Plain):
    """A column of a log: what it was taken for, in which unit, and why.

    Attributes
    ----------
    log, name : str
        Log and column.
    role, unit : str
        Empty where not known.
    why : str
        The reason of a guess; empty where a header or a map states it.
    """

    log: str
    name: str
    role: str
    unit: str
    why: str = ""


@dataclass(frozen=True)
class DataCheck(Plain):
    """One question to the data of a log.

    Attributes
    ----------
    log, check : str
        Log and question: ``clock``, ``gaps``, ``values``, ``columns``, ``others``.
    ok : bool
        Whether nothing was seen that needs a look.
    text : str
        What was seen.
    """

    log: str
    check: str
    ok: bool
    text: str


@dataclass(frozen=True)
class Examination(Result):
    """The answer of `elevon.doctor`.

    Attributes
    ----------
    actuator : str
        Its name.
    logs, baselines : tuple of str
        Of the unit, and of it when it was healthy.
    columns_by : str
        ``map``: given; ``guess``; ``headers``.
    columns : tuple of ReadColumn
        What the columns were taken for.
    checks : tuple of DataCheck
        What the data look like.
    fit : Validation or None
        The model beside the logs; None where they cannot be compared.
    verdict : Diagnosis or None
        None where the logs cannot be diagnosed.
    reasons : mapping of str to str
        Why there is no ``verdict``, no ``fit``.
    map_text : str
        The guessed column map, to be corrected; empty where none was guessed.
    recordings : mapping of str to Recording
        What was read, by log; for the page.
    """

    actuator: str
    logs: tuple[str, ...]
    baselines: tuple[str, ...]
    columns_by: Literal["map", "guess", "headers"]
    columns: tuple[ReadColumn, ...]
    checks: tuple[DataCheck, ...]
    fit: Validation | None
    verdict: Diagnosis | None
    reasons: Mapping[str, str] = field(default_factory=dict)
    map_text: Annotated[str, STORED] = ""
    recordings: Annotated[Mapping[str, Recording], WORKING] = field(
        default_factory=dict, compare=False, repr=False
    )

    KIND: ClassVar = "examination"
    COMPUTED: ClassVar = ("status",)
    TABLE: ClassVar = "checks"

    @property
    def status(self) -> str:
        """Of the diagnosis; ``no_verdict`` where there is none."""
        return "no_verdict" if self.verdict is None else self.verdict.status

    @property
    def failed(self) -> bool:
        """Whether a check failed: no verdict, or a model that is not this unit's."""
        return self.status in ("no_verdict", "model_does_not_fit") or self.misfit

    @property
    def misfit(self) -> bool:
        """Whether a log of the healthy unit is over a threshold of the actuator file."""
        errors = () if self.fit is None else self.fit.errors
        return any(error.passed is False and error.log in self.baselines for error in errors)

    @property
    def headline(self) -> str:
        """The answer in one line."""
        seen = sum(not check.ok for check in self.checks)
        data = f"data: {seen} to look at" if seen else "data: sound"
        columns = ", columns guessed" if self.columns_by == "guess" else ""
        fit = "; the healthy log is over its threshold" if self.misfit else ""
        return f"{self._verdict()} ({data}{columns}{fit})"

    def _verdict(self) -> str:
        if self.verdict is not None:
            return self.verdict.headline
        wrong = next((c for c in self.checks if c.check == "columns" and not c.ok), None)
        if wrong is not None:  # what follows from a wrong column is no reason by itself
            return f"NO VERDICT: {wrong.log}: {wrong.text}"
        return f"NO VERDICT: {self.reasons.get('verdict', 'not diagnosed')}"

    def report(self, *, date: str | None = None) -> Report:
        """Return its page: that of the diagnosis, then the data and the fit."""
        from elevon.doctor.page import examination_page

        return examination_page(self, date)

    def write(self, folder: Path, *, force: bool = False) -> list[Path]:
        """Write page, answer and, where it was guessed, the column map into a folder."""
        from elevon.files import write_text

        written = [
            self.report().save(folder / "doctor.html", force=force),
            self.save(folder / "doctor.json", force=force),
        ]
        if self.map_text:
            written.append(write_text(folder / "map.toml", self.map_text, force=force))
        return written
