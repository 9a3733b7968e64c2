"""Classes that `elevon learn` makes of labelled logs of another program (`studies.independent`).

Units differ widely there (inertia by three times, friction by four), and nothing is known of them
but their logs. Units left out judge what was learnt, and units that were made for nothing else.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

from elevon.diagnose.learning.answer import diagnose_by_classes
from elevon.diagnose.learning.door import learn
from elevon.diagnose.learning.fit import share_interval
from elevon.diagnose.learning.labels import HEALTHY, LabelledLog
from elevon.diagnose.learning.motion import KnownMotion, motion_of
from elevon.errors import ElevonWarning, InputError
from elevon.progress import Progress
from elevon.report import Check, verdict
from studies.independent.bench import CAUSES, TESTS, Cause, Unit, singles, together, written
from studies.independent.bench import units as units_of
from studies.side_by_side import side_by_side

if TYPE_CHECKING:
    from elevon.diagnose.learning.model import LearnedClasses
    from elevon.logs.log import Log

__all__ = ["LearnedResult", "study_learned"]

_RATE = 0.05  # of false alarms that is set
_DAYS = 4  # healthy logs of a unit
#: Causes without a candidate that a maintainer has a word for.
_WORDS = ("inertia doubled", "cogging 0.4 N m", "contact of 4 ohm")
Labelled = list[tuple["Log", LabelledLog]]


@dataclass(frozen=True)
class LearnedResult:
    """What groups left out and other units judge.

    Attributes
    ----------
    report : dict
        Of `LearnedModel`: classifier, counts, groups left out.
    seen : tuple of (str, str, str)
        Label, status and named cause of each log of the units that were not learnt.
    refused : int
        Logs that were taken for another motion: without a command in them their set points count,
        which hold what a unit's loop makes of it.
    seed : int
        Of everything.
    """

    report: dict[str, Any]
    seen: tuple[tuple[str, str, str], ...]
    refused: int
    seed: int

    @property
    def rows(self) -> list[dict[str, Any]]:
        """Counts with their 95 % intervals."""
        out = [_row("refused as of another motion", self.refused, self.refused + self._taken)]
        for group, left in self.report["left_out"].items():
            out += [
                _row(f"{group} left out: class right", left["right"], left["logs"]),
                _row(f"{group} left out: false alarms", left["false_alarms"], left["healthy"]),
                _row(f"{group} left out: missed", left["missed"], left["faulty"]),
            ]
        healthy = [status for label, status, _ in self.seen if label == HEALTHY]
        faulty = [item for item in self.seen if item[0] != HEALTHY]
        alarms = [status for status in healthy if status != HEALTHY]
        out += [
            _row("other units: false alarms", len(alarms), len(healthy)),
            _row("other units: class right", sum(x == y for x, _, y in faulty), len(faulty)),
            _row("other units: missed", sum(s == HEALTHY for _, s, _ in faulty), len(faulty)),
        ]
        return out

    @property
    def _taken(self) -> int:
        return int(self.report["logs"]) + len(self.seen)

    @property
    def checks(self) -> list[Check]:
        """The set rate of false alarms."""
        low = next(r for r in self.rows if r["what"] == "other units: false alarms")["interval"][0]
        return [Check("other units: false alarms, lower end of 95 %", low, _RATE)]

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {**verdict(self.checks), "seed": self.seed, "classifier": self.report["classifier"],
                "classes": self.report["classes"], "rows": self.rows}  # fmt: skip


def study_learned(
    *,
    seed: int = 0,
    units: int = 16,
    processes: int | None = None,
    progress: Progress | None = None,
) -> LearnedResult:
    """Learn from three quarters of the units, judge by groups left out and by the other units.

    Raises
    ------
    InputError
        Fewer than eight units.
    Interrupted
        `progress` returned False.
    """
    if units < 8:
        raise InputError(f"--units {units}: at least eight")
    drawn = units_of(seed, units)
    calls = {str(u.number): partial(_logs, u, seed) for u in drawn}
    logs = dict(side_by_side(calls, processes=processes, progress=progress))
    count = 3 * units // 4
    every = sum(map(len, logs.values()))
    logs = _of_one_motion(logs)
    known = [item for u in drawn[:count] for item in logs[str(u.number)]]
    learned = learn(
        [log for log, _ in known], [label for _, label in known], pole_pairs=4.0, seed=seed
    )
    assert learned.classes is not None
    others = [item for u in drawn[count:] for item in logs[str(u.number)]]
    refused = every - sum(map(len, logs.values()))
    return LearnedResult(dict(learned.report), tuple(_seen(learned.classes, others)), refused, seed)


def _logs(unit: Unit, seed: int) -> Labelled:
    """Healthy days of a unit, one day of each fault, one of each cause with a word."""
    from elevon.logs.read import read_logs

    causes: list[Cause | None] = [None] * _DAYS
    causes += [together(faults) for faults in singles(unit)]
    causes += [cause for cause in CAUSES if cause.name in _WORDS]
    out: Labelled = []
    with TemporaryDirectory() as folder, warnings.catch_warnings():
        warnings.simplefilter("ignore", ElevonWarning)
        for k, cause in enumerate(causes):
            place, run = Path(folder) / str(k), 10_000 * (100 * seed + unit.number) + k
            path = written(unit, next(iter(TESTS)), place, run, cause)
            label = LabelledLog(
                HEALTHY if cause is None else cause.name, f"unit {unit.number}", f"{unit.rate:g} Hz"
            )
            out.append((read_logs([path])[0], label))
    return out


def _of_one_motion(logs: dict[str, Labelled]) -> dict[str, Labelled]:
    """Leave out what `elevon learn` would refuse as another motion than the first log's."""
    first = motion_of(next(iter(logs.values()))[0][0])
    known = KnownMotion(first.command, first.pace, first.seconds)
    return {
        unit: [item for item in items if not known.refusal(motion_of(item[0]))]
        for unit, items in logs.items()
    }


def _seen(learned: LearnedClasses, items: Sequence[tuple[Log, LabelledLog]]) -> Any:
    """What is said of each log of units that were not learnt."""
    for log, label in items:
        answer = diagnose_by_classes([log], learned, false_alarm=_RATE)
        named = answer.best[0].removesuffix("@unit") if answer.best else ""
        yield label.label, answer.status, named


def _row(what: str, hits: int, of: int) -> dict[str, Any]:
    return {"what": what, "hits": hits, "logs": of, "share": hits / of if of else float("nan"),
            "interval": share_interval(hits, of)}  # fmt: skip
