"""What an import has to say: nothing is repaired without a line here."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

from elevon.data import packaged_toml
from elevon.plain import Plain, key

Level = Literal["info", "warning"]


@dataclass(frozen=True, slots=True)
class Finding(Plain):
    """One thing seen: its level, the channel or clock, a code for programs, a text for people."""

    level: Level
    place: str
    code: str
    text: str


@dataclass(slots=True)
class ImportReport(Plain):
    """The report of one import.

    Attributes
    ----------
    source : str
        The log.
    file_format : str
        Reader and layout.
    clocks : dict of str to dict
        Samples, rate, jitter, gaps, duplicates of each clock.
    channels : list of dict
        Name, column in the file, unit, range, missing samples of each channel.
    findings : list of Finding
        In the order they were made.
    synchronisation : dict or None
        Offset and drift of the load cell's clock with their uncertainty.
    """

    source: str
    file_format: Annotated[str, key("format")]
    clocks: dict[str, dict[str, Any]] = field(default_factory=dict)
    channels: list[dict[str, Any]] = field(default_factory=list)
    findings: list[Finding] = field(default_factory=list)
    synchronisation: dict[str, Any] | None = None

    def say(self, place: str, name: str, *values: object) -> None:
        """Add a finding of ``findings.toml``, with the values that its text has places for."""
        known = packaged_toml("elevon.logs", "findings.toml")[name]
        level, text = known.get("level", "warning"), known["text"].format(*values)
        self.findings.append(Finding(level, place, known.get("code", name), text))

    def has(self, code: str) -> bool:
        """Whether a finding of this code was made."""
        return any(finding.code == code for finding in self.findings)
