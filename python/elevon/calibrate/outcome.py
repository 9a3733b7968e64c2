"""The answer of every calibration: the actuator, what was estimated, what was not and why."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

from elevon.actuator import Actuator
from elevon.calibrate.validation import Validation
from elevon.errors import unknown
from elevon.estimate import Estimate
from elevon.logs.log import Log
from elevon.number_text import estimate_row
from elevon.plain import REMAINDER, STORED, Plain, in_unit, key, plain
from elevon.report import ReportTable
from elevon.report.cards import Html, badge, card, table
from elevon.results import Result

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.report import Report


@dataclass(frozen=True)
class LogFacts(Plain):
    """A log's name, samples and rate, and what else is to be known of it, plain types."""

    name: str
    samples: int
    rate: Annotated[float, key("rate_hz"), in_unit("Hz")]
    more: Annotated[Mapping[str, Any], REMAINDER] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Calibration(Result):
    """What logs determine of an actuator.

    Attributes
    ----------
    actuator, before : Actuator
        With the calibrated values, and as given.
    logs : tuple of LogFacts
        The data.
    parameters : mapping of str to Estimate
        What the logs determine; those with `Estimate.in_set` went into `actuator`.
    undetermined : mapping of str to str
        What they do not, and why, where that is listed by parameter.
    facts : mapping of str to object
        What else is known of the fit, plain types.
    promise : Validation or None
        Errors on data held out of the fit: what an actuator file takes its thresholds from.
    validation_before, validation : Validation or None
        Errors of the closed loop on the same logs, with the old and the new values.
    findings : tuple of str
        What the caller should know, in words.
    wall_s : float
        Time it took.
    """

    actuator: Annotated[Actuator, key("calibrated"), STORED]
    before: Annotated[Actuator, key("given"), STORED]
    logs: tuple[LogFacts, ...]
    parameters: Mapping[str, Estimate]
    undetermined: Mapping[str, str] = field(default_factory=dict)
    findings: tuple[str, ...] = ()
    promise: Annotated[Validation | None, STORED] = None
    validation_before: Annotated[Validation | None, key("validation.before")] = None
    validation: Annotated[Validation | None, key("validation.after")] = None
    facts: Annotated[Mapping[str, Any], REMAINDER] = field(default_factory=dict)
    wall_s: Annotated[float, in_unit("s")] = field(default=0.0, compare=False)

    KIND: ClassVar = "calibration"
    COMPUTED: ClassVar = ("status", "actuator=name")
    TABLE: ClassVar = "estimates"
    COLUMNS: ClassVar = ("path", "old", "value", "low", "high", "unit", "given")
    status: ClassVar = "ok"

    def __post_init__(self) -> None:
        object.__setattr__(self, "facts", plain(self.facts))

    def __getitem__(self, path: str) -> Estimate:
        if path not in self.parameters:
            raise unknown("estimate", path, self.parameters)
        return self.parameters[path]

    @property
    def name(self) -> str:
        """Of the actuator that was calibrated."""
        return self.before.name

    @property
    def estimates(self) -> tuple[Estimate, ...]:
        """What the logs determine."""
        return tuple(self.parameters.values())

    @property
    def headline(self) -> str:
        """The answer in one sentence."""
        known = [item.path for item in self.estimates if item.in_set]
        missing = f"; not {_listed(list(self.undetermined))}" if self.undetermined else ""
        return f"{self.name}: determined {_listed(known)}{missing}."

    def text_tables(self) -> list[ReportTable]:
        """Return what was estimated."""
        rows = [estimate_row(item, self.before, item.register) for item in self.estimates]
        columns = ("parameter", "before", "after", "low", "high", "unit", "register", "holds for")
        return [ReportTable(columns, rows, optional=("register",))]

    @property
    def remarks(self) -> list[str]:
        """What else to know: how it was done, what is not determined and why, what was seen."""
        texts, facts = [], self.facts
        if "structure" in facts:
            texts.append(
                f"controller: {facts['structure']['chosen']} ({facts['structure']['why']})"
            )
        if facts.get("fidelity"):
            share = facts.get("ripple_share")
            why = "" if share is None else f" (the logs have {share:.2g} of the switching ripple)"
            texts.append(f"balances corrected by runs at --fidelity {facts['fidelity']}{why}")
        for reason in dict.fromkeys(self.undetermined.values()):
            names = [path for path, why in self.undetermined.items() if why == reason]
            more = f" and {len(names) - 4} more" if len(names) > 4 else ""
            texts.append(f"not determined: {', '.join(names[:4])}{more}: {reason}")
        if "structure" in facts and self.validation is not None:
            texts += [
                f"{error.log}: {error.signal} within {error.of_range:.2g} % of its range, "
                f"{error.of_rms:.3g} % of its RMS"
                for error in self.validation.errors
            ]
        return [*texts, *self.findings]

    def _repr_html_(self) -> str:
        names = [log.name for log in self.logs]
        return calibration_card(self.before, names, self.estimates, self.undetermined)

    def plot(self) -> Figure:
        """Return the estimates over the old values, with their intervals."""
        from elevon.calibrate.report import forest

        return forest(self.estimates) or super().plot()

    def report(self, *, date: str | None = None) -> Report:
        """Return its page."""
        from elevon.calibrate.report import calibration_report

        return calibration_report(self, date=date)

    def write_actuator(self, path: str | os.PathLike[str], *, force: bool = False) -> Path:
        """Write the calibrated actuator as a file, with thresholds where there is a `promise`.

        Raises
        ------
        OutputExistsError
            The file is there, and not `force`.
        """
        from elevon.calibrate.write import write_calibration

        return write_calibration(path, self, validation=self.promise, force=force)


def _listed(names: Sequence[str], most: int = 6) -> str:
    """Return names in a sentence: all of a few, else the first of them and how many there are."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more if names else "nothing"


def log_facts(logs: Sequence[Log], **more: Mapping[str, object]) -> tuple[LogFacts, ...]:
    """Return what is to be reported of logs; of each key in `more`, the entry of a log's name."""
    return tuple(
        LogFacts(
            log.name,
            len(log.time),
            1.0 / log.period,
            {name: values[log.name] for name, values in more.items()},
        )
        for log in logs
    )


def calibration_card(
    before: Actuator,
    logs: Sequence[str],
    estimates: Sequence[Estimate],
    undetermined: Mapping[str, str],
) -> Html:
    """Return the HTML view: each number with its interval, then what the logs cannot tell."""
    rows = [estimate_row(item, before) for item in estimates]
    head = ["parameter", "before", "after", "low", "high", "unit", "holds for"]
    facts = [("", badge("ok")), ("from", ", ".join(logs)), ("intervals of", "90 %")]
    parts = [table(head, rows)]
    if undetermined:
        parts.append(table(["not determined", "reason"], undetermined.items()))
    return card(f"Calibration of {before.name}", facts, *parts)
