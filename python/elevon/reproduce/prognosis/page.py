"""The page of the run-to-failure histories."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.prognose.metrics import Track
from elevon.report import Report, Table
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.prognosis.result import SHARES, PrognosisResult
from elevon.reproduce.provenance import provenance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["alpha_lambda_figure", "prognosis_report"]


def prognosis_report(result: PrognosisResult, *, seed: int, date: str | None = None) -> Report:
    """Return the report."""
    report = Report(
        "Run-to-failure histories, predicted",
        f"{len(result.units)} units live on the high-fidelity model with growth laws other than "
        f"the filter's; over 50 to 90 % of life the median prediction is right to "
        f"{100 * (1 - result.accuracy()):.0f} % of what truly remained.",
        date=date,
    )
    report.fact("Mean relative accuracy", f"{result.accuracy():.3f}", "50 to 90 % of life")
    report.fact("Coverage", f"{result.covered():.3f}", "of 90 % intervals")
    report.fact("Laws alone", f"{result.accuracy(track='unaided'):.3f}", "without a diagnosis")
    section = report.section("By law of growth")
    rows = [
        [r["law"], r["histories"], r["accuracy"], *(r[_key(s)] for s in SHARES), r["coverage"],
         r["horizon"], r["unscented_accuracy"], r["unaided_accuracy"]]
        for r in result.summary()
    ]  # fmt: skip
    columns = ["law", "histories", "mean", *(f"{s:.0%}" for s in SHARES)]
    columns += ["coverage", "horizon (20 %)", "sigma points", "laws alone"]
    section.table(
        Table(columns, rows, "Relative accuracy by share of life; horizon: median, strict.",
              digits=3)
    )  # fmt: skip
    for law in dict.fromkeys(u.law for u in result.units):
        tracks = [u.track for u in result.units if u.law == law]
        section.figure(
            alpha_lambda_figure(tracks),
            f"{law}: predicted remaining life of each unit, in lives, over the share of life; the "
            "wedge is 20 % about the truth.",
        )
    report.section("Checks").checks(result.checks)
    report.provenance(provenance("elevon reproduce prognosis", Seed=seed))
    return report


def _key(share: float) -> str:
    return f"ra_{share:.0%}".replace("%", "")


def alpha_lambda_figure(tracks: list[Track], alpha: float = 0.2) -> Figure:
    """Draw predicted over true remaining life, all in lives."""
    with new_figure(width=8.0, height=3.4) as (figure, axis):
        truth = np.linspace(1.0, 0.0, 50)
        axis.fill_between(
            1.0 - truth, (1.0 - alpha) * truth, (1.0 + alpha) * truth, color=COLOURS["green"],
            alpha=0.2, lw=0,
        )  # fmt: skip
        axis.plot(1.0 - truth, truth, color=COLOURS["green"])
        for track in tracks:
            life = track.end - track.start
            axis.plot(
                (track.usage - track.start) / life, track.median / life, color=COLOURS["orange"],
                lw=0.8, alpha=0.7,
            )  # fmt: skip
        axis.set(
            xlim=(0.0, 1.0), ylim=(0.0, 1.6), xlabel="share of life", ylabel="remaining [lives]"
        )
    return figure
