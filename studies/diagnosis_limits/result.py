"""What the campaign shows: shares with their intervals, checks, and the detection curve."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from elevon.diagnose.learning.fit import share_interval
from elevon.progress import Progress
from elevon.report import Check, verdict
from studies.diagnosis_limits.campaign import Campaign, run_campaign
from studies.diagnosis_limits.judge import Row
from studies.diagnosis_limits.logs import TESTS
from studies.diagnosis_limits.plan import FAULTS, CampaignFault

__all__ = ["DiagnosisLimits", "study_diagnosis_limits"]

FALSE_ALARM = 0.05
ISOLATED = 0.95
TOGETHER = 0.85
COVER = (0.80, 0.97)
OF_TRUE, OF_RANGE = 0.10, 0.05  # severity error: the larger of the two is allowed
SECONDS = 2.0


@dataclass(frozen=True)
class DiagnosisLimits:
    """The campaign and what follows from it."""

    campaign: Campaign

    def _rows(self, *groups: str) -> list[Row]:
        return [row for row in self.campaign.rows if row.group in groups]

    @property
    def checks(self) -> list[Check]:
        """The figures with a limit."""
        healthy = self._rows("healthy")
        alarms = sum(row.alarm for row in healthy)
        out = [Check("false-alarm rate, lower end of its 95 % interval",
                     share_interval(alarms, len(healthy))[0], FALSE_ALARM)]  # fmt: skip
        single = self._rows("single")
        for fault in FAULTS:
            of_kind = [row for row in single if row.truth[0].kind == fault.kind]
            out.append(
                _share_check(f"{fault.kind} isolated at or above its limit", of_kind, ISOLATED)
            )
        out.append(_share_check("pairs named together", self._rows("pair"), TOGETHER))
        for fault in FAULTS:
            out.append(_error_check(fault, single))
        inside = _covered([*single, *self._rows("pair")])
        share = float(np.mean(inside)) if inside else float("nan")
        out.append(
            Check("share of 90 % intervals that cover, at least", share, COVER[0], at_least=True)
        )
        out.append(Check("share of 90 % intervals that cover, at most", share, COVER[1]))
        seconds = [row.seconds for row in self.campaign.rows]
        out.append(Check("median time of a log", float(np.median(seconds)), SECONDS, "s"))
        return out

    def rows(self) -> list[dict[str, Any]]:
        """Return the table: one row for each part of the campaign, test and fault."""
        healthy = self._rows("healthy")
        out = [_row("healthy", t, "-", None, [r for r in healthy if r.test == t]) for t in TESTS]
        for fault in FAULTS:
            for test in TESTS:
                of_kind = [
                    row
                    for row in self._rows("single", "below")
                    if row.test == test and row.truth[0].kind == fault.kind
                ]
                levels = sorted({abs(row.truth[0].severity) for row in of_kind})
                for level in levels:
                    at = [row for row in of_kind if abs(row.truth[0].severity) == level]
                    out.append(_row(at[0].group, test, fault.kind, level, at))
        for test in TESTS:
            pairs = [row for row in self._rows("pair") if row.test == test]
            out.append(_row("pair", test, "pairs", None, pairs))
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return what `--json` prints."""
        healthy = self._rows("healthy")
        alarms = sum(row.alarm for row in healthy)
        checks = self.checks
        return {
            **verdict(checks),
            "seed": self.campaign.seed,
            "units": self.campaign.units,
            "healthy_logs": len(healthy),
            "faulty_logs": len(self.campaign.rows) - len(healthy),
            "false_alarm_rate": alarms / max(len(healthy), 1),
            "false_alarm_interval": list(share_interval(alarms, len(healthy))),
            "severity_ranges": {fault.kind: fault.range for fault in FAULTS},
            "coverage": {
                f.kind: _mean(_covered(self._rows("single", "pair"), f.kind)) for f in FAULTS
            },
            "rows": self.rows(),
            "logs": [row.to_dict() for row in self.campaign.rows],
        }


def study_diagnosis_limits(
    *, seed: int = 0, units: int = 8, folder: Path | None = None, progress: Progress | None = None
) -> DiagnosisLimits:
    """Run the campaign; arguments and errors as `run_campaign`."""
    return DiagnosisLimits(run_campaign(seed=seed, units=units, folder=folder, progress=progress))


def _share_check(name: str, rows: Sequence[Row], limit: float) -> Check:
    share = float(np.mean([row.named for row in rows])) if rows else float("nan")
    return Check(name, share, limit, at_least=True)


def _error_check(fault: CampaignFault, rows: Iterable[Row]) -> Check:
    """Median of the severity's error over what is allowed for it."""
    ratios = [
        abs(row.severities[0][0] - row.truth[0].severity)
        / max(OF_TRUE * abs(row.truth[0].severity), OF_RANGE * fault.range)
        for row in rows
        if row.truth[0].kind == fault.kind and row.named and row.severities[0] is not None
    ]
    value = float(np.median(ratios)) if ratios else float("nan")
    return Check(f"{fault.kind}: median severity error over the allowed one", value, 1.0)


def _covered(rows: Iterable[Row], kind: str | None = None) -> list[bool]:
    """Whether each interval of a named fault holds the true severity."""
    return [
        severity[1] <= item.severity <= severity[2]
        for row in rows
        if row.named
        for item, severity in zip(row.truth, row.severities, strict=True)
        if severity is not None and kind in (None, item.kind)
    ]


def _row(
    group: str, test: str, fault: str, severity: float | None, rows: Sequence[Row]
) -> dict[str, Any]:
    """One line of the table."""
    count: Callable[[str], int] = lambda name: sum(getattr(row, name) for row in rows)  # noqa: E731
    hits = count("alarm" if group == "healthy" else "named")
    errors = [
        abs(severity[0] - item.severity)
        for row in rows
        if row.named
        for item, severity in zip(row.truth, row.severities, strict=True)
        if severity is not None
    ]
    return {
        "group": group,
        "test": test,
        "fault": fault,
        "severity": severity,
        "logs": len(rows),
        "detected": count("alarm"),
        "isolated": count("named"),
        "share": hits / len(rows) if rows else None,
        "interval": list(share_interval(hits, len(rows))),
        "error_median": float(np.median(errors)) if errors and len(rows[0].truth) == 1 else None,
        "coverage": _mean(_covered(rows)),
        "seconds_median": float(np.median([row.seconds for row in rows])) if rows else None,
    }


def _mean(values: Sequence[bool]) -> float | None:
    return float(np.mean(values)) if values else None
