"""What judged lives show, in figures, checks and a page."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.report.checks import Check, verdict
from studies.lives.judge import OURS, Scored, by_thirds, figures, flatness

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.report import Report

_COVERAGE, _HALF, _TAIL = (0.85, 0.95), (0.42, 0.58), 0.02
_WORSE, _FLAT = 1.2, 0.01
_KNOWING, _LEARNED = 1.2, 1.3
_ACCURACY = 0.75
DRAWN = "drawn"
_COLUMNS = ("group", "method", "lives", "coverage90", "coverage50", "below1", "crps", "accuracy",
            "width")  # fmt: skip


@dataclass(frozen=True)
class LivesResult:
    """All predictions.

    Attributes
    ----------
    judged : tuple of Scored
        Of all methods and groups.
    plan : dict
        Cost, failures and replacements of the fleet by each policy, of a unit and a year.
    seed : int
        Of everything.
    seconds : float
        Time it took.
    """

    judged: tuple[Scored, ...]
    plan: dict[str, Any]
    seed: int
    seconds: float = field(compare=False)

    def rows(self, group: str, method: str) -> list[Scored]:
        """Return the predictions of a method in a group."""
        return [r for r in self.judged if r.group == group and r.method == method]

    def summary(self) -> list[dict[str, Any]]:
        """Return figures of each method in each group, and in each part of the drawn lives."""
        pairs = dict.fromkeys((r.group, r.method) for r in self.judged)
        out = [{"group": g, "method": m, **figures(self.rows(g, m))} for g, m in pairs]
        for name, parts in self.parts().items():
            for k, part in enumerate(parts):
                for method in dict.fromkeys(r.method for r in part):
                    mine = [r for r in part if r.method == method]
                    out.append(
                        {"group": f"{name}, part {k + 1}", "method": method, **figures(mine)}
                    )
        return out

    def parts(self) -> dict[str, list[list[Scored]]]:
        """Return the drawn lives by thirds of curvature and of inspections, and by changes."""
        drawn = [r for r in self.judged if r.group == DRAWN]
        if not drawn:
            return {}
        return {
            "curvature": by_thirds(drawn, lambda r: r.curvature),
            "inspections": by_thirds(drawn, lambda r: float(r.looks)),
            "changes of rate": [
                part
                for part in ([r for r in drawn if not r.changes], [r for r in drawn if r.changes])
                if part
            ],
        }

    @property
    def checks(self) -> list[Check]:
        """What must hold."""
        return [*self._of_drawn(), *self._of_own(), *self._of_fleets()]

    def _of_drawn(self) -> list[Check]:
        ours = self.rows(DRAWN, OURS)
        values = figures(ours)
        out = [
            Check("90 % intervals cover", values["coverage90"], _COVERAGE[0], at_least=True),
            Check("90 % intervals cover, at most", values["coverage90"], _COVERAGE[1]),
            Check("50 % intervals cover", values["coverage50"], _HALF[0], at_least=True),
            Check("50 % intervals cover, at most", values["coverage50"], _HALF[1]),
            Check("lives below the 1 % quantile", values["below1"], _TAIL),
            Check("probability of a histogram as uneven, if it were flat", flatness(ours), _FLAT,
                  at_least=True),
            Check("score over the best other method's", _ratio(self.judged, DRAWN), 1.0),
        ]  # fmt: skip
        for name, parts in self.parts().items():
            out += [
                Check(f"the same, {name}, part {k + 1}", _ratio(part, DRAWN), _WORSE)
                for k, part in enumerate(parts)
            ]
        return out

    def _of_own(self) -> list[Check]:
        out = []
        ours, knowing = (self.rows("own law", m) for m in (OURS, "knows the law"))
        if ours:
            ratio = float(
                np.median([r.width for r in ours]) / np.median([r.width for r in knowing])
            )
            out.append(Check("width over a filter's that knows law and spread", ratio, _KNOWING))
        for looks in (2, 3):
            mine = self.rows(f"own law, {looks} inspections", OURS)
            if mine:
                values = figures(mine)
                out += [
                    Check(f"accuracy at {looks} inspections", values["accuracy"], _ACCURACY,
                          at_least=True),
                    Check(f"coverage at {looks} inspections", values["coverage90"], _COVERAGE[0],
                          at_least=True),
                ]  # fmt: skip
        return out

    def _of_fleets(self) -> list[Check]:
        out = []
        learned, known = (self.rows("fleet", m) for m in ("learned", "known"))
        if learned:
            ratio = float(
                np.median([r.width for r in learned]) / np.median([r.width for r in known])
            )
            out.append(Check("width by 20 histories over the known population's", ratio, _LEARNED))
        if self.plan:
            ratio = self.plan["plan"]["cost"] / self.plan["fixed"]["cost"]
            out.append(Check("cost of the plan over the best fixed age's", ratio, 1.0))
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            **verdict(self.checks),
            "seed": self.seed,
            "rows": self.summary(),
            "plan": self.plan,
            "seconds": self.seconds,
        }


def _width(rows: Sequence[Scored]) -> float:
    """Return the median width of the intervals."""
    return float(np.median([r.width for r in rows]))


def _ratio(rows: Sequence[Scored], group: str) -> float:
    """Return our score over the best of the other methods'."""
    means: dict[str, float] = {}
    for method in dict.fromkeys(r.method for r in rows if r.group == group):
        means[method] = float(np.mean([r.crps for r in rows if r.method == method]))
    best = min((value for name, value in means.items() if name != OURS), default=np.inf)
    return means[OURS] / best


def shares_figure(rows: Sequence[Scored]) -> Figure:
    """Draw how often the truth lies in each tenth of the futures: flat where they are right."""
    from elevon.report.figures import COLOURS, new_figure

    with new_figure(width=7.0, height=2.6) as (figure, axis):
        axis.hist([r.pit for r in rows], 10, (0.0, 1.0), color=COLOURS["blue"], alpha=0.7)
        axis.axhline(len(rows) / 10.0, color=COLOURS["grey"], ls=":")
        axis.set(xlabel="share of the futures that end before the truth", ylabel="lives")
    return figure


def lives_report(result: LivesResult, *, seed: int, date: str | None = None) -> Report:
    """Return the report."""
    from elevon.report import Report, ReportTable, provenance

    report = Report(
        "Remaining lives",
        "Predictions on lives of growth drawn at random, by the law told, of fleets, and real.",
        date=date,
    )
    report.section("Checks").checks(result.checks)
    report.section("The truth among the futures").figure(
        shares_figure(result.rows(DRAWN, OURS)), "Lives drawn at random."
    )
    rows = [[row[name] for name in _COLUMNS] for row in result.summary()]
    report.section("Every method").table(ReportTable(_COLUMNS, rows, digits=3))
    report.provenance(provenance("python -m studies lives", Seed=seed))
    return report
