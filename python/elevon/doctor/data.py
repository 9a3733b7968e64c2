"""What an import has seen of a log, as questions with an answer each."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from elevon.doctor.answer import DataCheck, ReadColumn
from elevon.logs.foreign import ForeignLog
from elevon.logs.report import ImportReport

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
