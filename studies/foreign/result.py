"""What the foreign lives show: every method in one table, form by form."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from elevon.report.checks import Check, verdict
from studies.foreign.judge import OURS, Judged, judge, paired_gap
from studies.foreign.truth import FORMS, NAMED_LAW

_COVERAGE = (0.85, 0.95)
_ACCURACY, _WIDTH, _OFF_LAW = 0.62, 1.8, 0.05
_WIENER = "Wiener, Kalman filter"
_CRACKS = "Virkler"
_ALL = "all foreign"
_WINDINGS, _OF_WINDINGS = "insulation", 0.85


@dataclass(frozen=True)
class ForeignResult:
    """All predictions.

    Attributes
    ----------
    judged : tuple of Judged
        Of all methods.
    seed : int
        Of everything.
    seconds : float
        Time it took.
    """

    judged: tuple[Judged, ...]
    seed: int
    seconds: float = field(compare=False)

    def rows(self, method: str, chosen: Callable[[Judged], bool]) -> list[Judged]:
        """Return a method's predictions that are chosen."""
        return [r for r in self.judged if r.method == method and chosen(r)]

    def summary(self) -> list[dict[str, Any]]:
        """Return figures of each method by density and form, and over all foreign forms."""
        out = []
        for density in sorted({r.density for r in self.judged}):
            for form in [NAMED_LAW, *FORMS, _CRACKS, _ALL]:
                for law in self._laws(form):
                    for method in dict.fromkeys(r.method for r in self.judged):
                        rows = self.rows(method, _of(form, density, law))
                        if rows:
                            name = f"{form}, {law}" if law else form
                            out.append(
                                {"density": density, "form": name, "method": method, **judge(rows)}
                            )
        return out

    def _laws(self, form: str) -> Sequence[str]:
        """Return the laws whose predictions a form is split by; "" is all of them."""
        if form == _CRACKS:
            return sorted({r.law for r in self.judged if r.form == form})
        if form not in {NAMED_LAW, _ALL}:
            return [""]
        return ["", *dict.fromkeys(r.law for r in self.judged if r.form != _CRACKS)]

    def gaps(self) -> list[dict[str, Any]]:
        """Return by how much ours is more accurate than the best other method, form by form."""
        out = []
        others = [m for m in dict.fromkeys(r.method for r in self.judged) if m != OURS]
        for form in FORMS:
            ours = self.rows(OURS, _of(form))
            if not ours:
                continue
            best = max(others, key=lambda m: judge(self.rows(m, _of(form)))["accuracy"])
            gap, low, high = paired_gap(ours, self.rows(best, _of(form)))
            out.append({"form": form, "best": best, "gap": gap, "interval": [low, high]})
        return out

    @property
    def checks(self) -> list[Check]:
        """What must hold."""
        out = []
        for density in sorted({r.density for r in self.judged if r.form != _CRACKS}):
            ours = judge(self.rows(OURS, _of(_ALL, density)))
            wiener = judge(self.rows(_WIENER, _of(_ALL, density)))
            named = self.rows(OURS, _of(NAMED_LAW, density))
            name = f"{density:g} times the inspections"
            out += [
                Check(f"coverage, at least, {name}", ours["coverage"], _COVERAGE[0], at_least=True),
                Check(f"coverage, at most, {name}", ours["coverage"], _COVERAGE[1]),
                Check(f"median width over the Wiener filter's, {name}",
                      ours["width"] / wiener["width"], _WIDTH),
                Check(f"accuracy, {name}", ours["accuracy"], _ACCURACY, at_least=True),
                Check(f"accuracy on windings by their own law, {name}",
                      judge(self.rows(OURS, _of(NAMED_LAW, density, _WINDINGS)))["accuracy"],
                      _OF_WINDINGS, at_least=True),
                Check(f"own laws said to be off, {name}",
                      float(np.mean([r.status == "off_law" for r in named])), _OFF_LAW),
            ]  # fmt: skip
        out += [
            Check(f"accuracy over {g['best']}, {g['form']}: upper end of 90 %", g["interval"][1],
                  0.0, at_least=True)
            for g in self.gaps()
        ]  # fmt: skip
        out += [
            Check(f"coverage, cracks, {law}",
                  judge(self.rows(OURS, _of(_CRACKS, 1.0, law)))["coverage"],
                  _COVERAGE[0], at_least=True)
            for law in self._laws(_CRACKS)
        ]  # fmt: skip
        return out

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            **verdict(self.checks),
            "seed": self.seed,
            "rows": self.summary(),
            "gaps": self.gaps(),
            "seconds": self.seconds,
        }


def _of(form: str, density: float | None = None, law: str = "") -> Callable[[Judged], bool]:
    """Return what chooses the predictions of a form."""

    def chosen(r: Judged) -> bool:
        right = r.form in FORMS if form == _ALL else r.form == form
        return right and density in (None, r.density) and law in ("", r.law)

    return chosen
