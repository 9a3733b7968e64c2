"""What logs of another program show of diagnosis: shares with intervals, and what must hold."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from elevon.diagnose.learning.fit import share_interval
from elevon.report.checks import Check, verdict
from studies.independent.bench import AND
from studies.independent.campaign import Judged, Plan

_ALARMS = ("faulty", "unknown_fault")
_GATE = "model_does_not_fit"
_SET, _UNKNOWN, _NAMED, _ISOLATED, _SECOND, _SECONDS = 0.05, 0.8, 0.9, 0.9, 0.03, 0.5
_PAIRS, _SLOW = 0.8, 2.0
_LEARNED = ", spread learnt"
_COVERED = (0.85, 0.95)


@dataclass(frozen=True)
class IndependentResult:
    """All answers.

    Attributes
    ----------
    judged : tuple of Judged
        One a log and number of baselines.
    plan : Plan
        Of the study.
    seconds : float
        Time it took.
    """

    judged: tuple[Judged, ...]
    plan: Plan
    seconds: float = field(compare=False)

    def of(self, what: str, **chosen: object) -> list[Judged]:
        """Return answers of a kind, with these attributes."""
        pairs = chosen.items()
        return [
            r for r in self.judged if r.what == what and all(getattr(r, k) == v for k, v in pairs)
        ]

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Counts with their 95 % intervals."""
        out = self._healthy()
        moved = [r for r in self.of("cause") if r.moved]
        out.append(_row("causes that move the log: unknown", [_unknown(r) for r in moved]))
        out.append(_row("the same: called healthy", [r.status == "healthy" for r in moved]))
        out.append(_row("the same: a candidate above 0.9", [r.most > _NAMED for r in moved]))
        unmoved = [r for r in self.of("cause") if not r.moved]
        out.append(
            _row("causes that do not move it: alarms", [r.status in _ALARMS for r in unmoved])
        )
        for learned, tail in ((False, ""), (True, _LEARNED)):
            faults = self.of("fault", learned=learned)
            right = [r for r in faults if r.name in r.best]
            if faults or not learned:
                out.append(_row(f"single faults isolated{tail}", [_isolated(r) for r in faults]))
                out.append(
                    _row(f"their intervals hold the severity{tail}", [r.covered for r in right])
                )
                out.append(_row(f"a wrong second fault{tail}", [len(r.best) > 1 for r in faults]))
        out.append(_row("pairs of faults isolated", [_isolated(r) for r in self.of("pair")]))
        return out

    def _healthy(self) -> list[dict[str, Any]]:
        """Healthy logs called faulty or unknown, and gated ones, by program and baselines."""
        out = []
        for program in dict.fromkeys(r.program for r in self.judged):
            for learned, tail in ((False, ""), (True, _LEARNED)):
                for count in self.plan.baselines:
                    logs = self.of("healthy", program=program, baselines=count, learned=learned)
                    if logs:
                        text = f"{program}, healthy, {count} baselines{tail}"
                        out.append(_row(f"{text}: alarms", [r.status in _ALARMS for r in logs]))
                        out.append(_row(f"{text}: gated", [r.status == _GATE for r in logs]))
        return out

    @property
    def causes(self) -> list[dict[str, Any]]:
        """Each cause that is no candidate."""
        keys = ("name", "test", "unit", "rate", "moved", "status", "best", "p_other", "most")
        return [{key: getattr(r, key) for key in keys} for r in self.of("cause")]

    @property
    def checks(self) -> list[Check]:
        """What must hold: an interval's end where a share is set, else the share."""
        known = {row["what"]: row for row in self.rows}
        out = []
        for name, row in known.items():
            if name.endswith(("alarms", "gated")) and "healthy" in name:
                out.append(Check(f"{name}: lower end of 95 %", row["interval"][0], _SET))
        share = {name: row["share"] for name, row in known.items()}
        low, high = known["their intervals hold the severity"]["interval"]
        out += [
            Check("unknown of causes that move the log",
                  share["causes that move the log: unknown"], _UNKNOWN, at_least=True),
            Check("a candidate above 0.9", share["the same: a candidate above 0.9"], 0.0),
            Check("single faults isolated", share["single faults isolated"], _ISOLATED,
                  at_least=True),
            Check("coverage: upper end of 95 %", high, _COVERED[0], at_least=True),
            Check("coverage: lower end of 95 %", low, _COVERED[1]),
            Check("a wrong second fault", share["a wrong second fault"], _SECOND),
            Check("pairs of faults isolated", share["pairs of faults isolated"], _PAIRS,
                  at_least=True),
        ]  # fmt: skip
        for name in dict.fromkeys(r.program for r in self.judged):
            logs = [r for r in self.judged if r.program == name and r.baselines == 1]
            seconds = float(np.median([r.seconds for r in logs if not r.learned]))
            limit = _SLOW if name == "pisa-landing-gear" else _SECONDS
            out.append(Check(f"{name}: median processor time, one baseline [s]", seconds, limit))
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            **verdict(self.checks),
            "seed": self.plan.seed,
            "rows": self.rows,
            "causes": self.causes,
            "judged": [row.to_dict() for row in self.judged],
            "seconds": self.seconds,
        }


def _isolated(row: Judged) -> bool:
    """Whether an answer names what was injected and nothing else."""
    return set(row.best) == set(row.name.split(AND))


def _unknown(row: Judged) -> bool:
    """Whether an answer says that it does not know the cause; a refused log is none."""
    return row.status in ("unknown_fault", _GATE, "refused") or row.p_other >= 0.5


def _row(what: str, hits: Sequence[bool]) -> dict[str, Any]:
    count, of = sum(hits), len(hits)
    share = count / of if of else float("nan")
    return {"what": what, "hits": count, "logs": of, "share": share,
            "interval": share_interval(count, of)}  # fmt: skip
