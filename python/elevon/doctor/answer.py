"""What the first look at a log has found."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

from elevon.calibrate.validation import Validation
from elevon.diagnose.engine.answer import Diagnosis
from elevon.logs.read import ForeignLog
from elevon.logs.report import ImportReport
from elevon.number_text import quantity_text
from elevon.plain import STORED, WORKING, Plain
from elevon.report import Report, ReportTable
from elevon.results import Result
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from elevon.calibrate.validation import Validation
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

    def text_tables(self) -> list[ReportTable]:
        """Return what was seen in the data, how columns were guessed, and the model's fit."""
        rows = [(c.log, c.check, "ok" if c.ok else "look", c.text) for c in self.checks]
        tables = [ReportTable(("log", "data", "", "what was seen"), rows)]
        if self.columns_by == "guess":
            first = [c for c in self.columns if c.log == self.columns[0].log]
            columns = [(c.name, c.role or "?", c.unit, c.why) for c in first]
            tables.append(ReportTable(("column", "guessed as", "unit", "why"), columns))
        if self.fit is not None:
            fit = [
                (e.log, e.signal, f"{e.of_range:.3g}", "" if e.limit is None else f"{e.limit:.3g}")
                for e in self.fit.errors
            ]
            tables.append(ReportTable(("log", "model beside it", "% of range", "threshold %"), fit))
        return tables

    @property
    def remarks(self) -> list[str]:
        """What could not be looked at, and why."""
        return [f"no {name}: {text}" for name, text in self.reasons.items()]

    def _verdict(self) -> str:
        if self.verdict is not None:
            return self.verdict.headline
        wrong = next((c for c in self.checks if c.check == "columns" and not c.ok), None)
        if wrong is not None:  # what follows from a wrong column is no reason by itself
            return f"NO VERDICT: {wrong.log}: {wrong.text}"
        return f"NO VERDICT: {self.reasons.get('verdict', 'not diagnosed')}"

    def report(self, *, date: str | None = None) -> Report:
        """Return its page: that of the diagnosis, then the data and the fit."""
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


#: Question to the codes of findings that answer it; what is in none belongs to ``others``.
_QUESTIONS: Mapping[str, frozenset[str]] = {
    "clock": frozenset({"jitter", "duplicates"}),
    "gaps": frozenset({"gap", "missing", "empty"}),
    "values": frozenset({"clipped", "stuck"}),
    "columns": frozenset({"disagrees", "unit-unconfirmed", "convention-assumed"}),
}
_SOUND = {
    "gaps": "no sample is missing",
    "values": "nothing clipped, nothing stands still",
    "columns": "they agree with each other",
}
_EVEN = 1e-6  # share of a period: what rounding leaves
_MOST = 6  # findings stated for one question


def checks_of(name: str, log: ForeignLog) -> list[DataCheck]:
    """Return the questions to a log's data with their answers."""
    seen = _seen(log.imported.report)
    if log.guess is not None and log.guess.swapped:
        names = " and ".join(f"{column!a}" for column in log.guess.swapped)
        seen.setdefault("columns", []).append(f"{names} are swapped: read by what they do")
    sound = {"clock": _clock(log.imported.report.clocks["drive"]), **_SOUND}
    if log.guess is not None and log.column_map is not None and log.column_map.current:
        sound["columns"] += f"; currents and voltages taken as {log.column_map.current} (ASSUMED)"
    checks = [
        DataCheck(name, question, question not in seen, _text_of(seen.get(question), text))
        for question, text in sound.items()
    ]
    others = seen.get("others")
    return checks + ([DataCheck(name, "others", False, _text_of(others, ""))] if others else [])


def _seen(report: ImportReport) -> dict[str, list[str]]:
    seen: dict[str, list[str]] = {}
    for finding in report.findings:
        if finding.level == "warning":
            question = next((q for q, codes in _QUESTIONS.items() if finding.code in codes), "")
            seen.setdefault(question or "others", []).append(f"{finding.place}: {finding.text}")
    return seen


def _text_of(texts: list[str] | None, otherwise: str) -> str:
    if not texts:
        return otherwise
    more = f"; and {len(texts) - _MOST} more" if len(texts) > _MOST else ""
    return "; ".join(texts[:_MOST]) + more


def _clock(facts: Mapping[str, Any]) -> str:
    jitter = facts["jitter_rms_s"]
    even = jitter < _EVEN * facts["period_s"]
    spread = "even" if even else f"jitter {1e3 * jitter:.2g} ms"
    length = f"{facts['samples']} samples over {facts['duration_s']:.4g} s"
    return f"{length} at {facts['rate_hz']:.5g} Hz, {spread}"


def columns_of(name: str, log: ForeignLog) -> list[ReadColumn]:
    """Return what each column of a log was taken for; with a guess, why."""
    if log.guess is not None:
        return [
            ReadColumn(name, c.name, c.role or "", c.unit or "", "; ".join(c.reasons))
            for c in log.guess.columns
        ]
    roles = {signal: role for role, signal in log.imported.recording.roles.items()}
    return [
        ReadColumn(name, c["column"], roles.get(c["name"], c["name"]), c["unit"])
        for c in log.imported.report.channels
    ]


_DRAWN = 6  # logs


def examination_page(result: Examination, date: str | None = None) -> Report:
    """Return the report of a first look."""
    report = Report("", date=date) if result.verdict is None else result.verdict.report(date=date)
    report.title = f"First look at {', '.join(result.logs)}: {result.actuator}"
    report.lead = result.headline
    seen = [check for check in result.checks if not check.ok]
    report.fact("Data", "sound" if not seen else f"{len(seen)} to look at", "clock, gaps, values")
    report.fact("Columns", {"guess": "guessed"}.get(result.columns_by, f"by {result.columns_by}"))
    report.fact("Model", _fit_word(result), "beside the logs")
    _fit(report, result)
    _data(report, result)
    return report


def _fit_word(result: Examination) -> str:
    if result.fit is None:
        return "not compared"
    return f"{max(error.of_range for error in result.fit.errors):.3g} % off at worst"


def _fit(report: Report, result: Examination) -> None:
    section = report.section("The model beside the logs")
    if result.fit is None:
        section.text(f"Not compared: {result.reasons.get('fit', '')}")
        _recorded(report, result)
        return
    section.table(
        ReportTable(
            ("log", "signal", "RMS error", "% of range", "threshold %", "passed"),
            [
                (e.log, e.signal, " ".join(quantity_text(e.rms, e.unit, 3)), e.of_range, e.limit,
                 e.passed)
                for e in result.fit.errors
            ],
            f"The same command on the model of the healthy unit, after {result.fit.transient:g} s. "
            "A fault of the unit is in these errors, too; those of a healthy log are the model's.",
            digits=3,
        )
    )  # fmt: skip
    _charts(report, result.fit)


def _charts(report: Report, fit: Validation) -> None:
    units = {error.signal: error.unit for error in fit.errors}
    for trace in fit.traces[:_DRAWN]:
        section = report.section(f"Signals of {trace.log}")
        for name, simulated in trace.simulated.items():
            unit = display_unit(units.get(name, "1"))
            lines = {
                "log": to_display(trace.measured[name], unit),
                "model": to_display(simulated, unit),
            }
            section.chart(name, trace.time, lines, y_label=f"[{unit}]", dashed=["model"])


def _recorded(report: Report, result: Examination) -> None:
    """Draw what was logged, where no model stands beside it."""
    from elevon.recording.plot import panels_of

    for name, recording in list(result.recordings.items())[:_DRAWN]:
        section = report.section(f"Signals of {name}")
        for panel in panels_of(recording):
            section.chart(
                panel.title or ", ".join(panel.lines),
                panel.time,
                panel.lines,
                y_label=f"[{panel.unit}]",
                breaks=panel.gaps,
            )


def _data(report: Report, result: Examination) -> None:
    rows = [(c.log, c.check, "ok" if c.ok else "look", c.text) for c in result.checks]
    marked = frozenset(k for k, check in enumerate(result.checks) if not check.ok)
    report.section("Data").table(
        ReportTable(("log", "question", "", "what was seen"), rows, marked=marked)
    )
    how = {
        "map": "By the map that was given.",
        "guess": "Guessed: correct map.toml where a column is not what it was taken for, and give "
        "it with --map.",
        "headers": "By the headers of the logs.",
    }[result.columns_by]
    report.section("Columns", how).table(
        ReportTable(
            ("log", "column", "taken for", "unit", "why"),
            [(c.log, c.name, c.role or "?", c.unit, c.why) for c in result.columns],
        )
    )
