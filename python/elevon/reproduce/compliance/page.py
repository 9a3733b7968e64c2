"""The report of the compliance campaign."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.compliance.campaign import (
    NM_PER_RAD,
    PUBLISHED_N_PER_DEG,
    STANDARD_GRAVITY_FACTOR,
    ComplianceResult,
)
from elevon.reproduce.provenance import closed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def compliance_report(
    result: ComplianceResult, *, date: str | None = None, seed: int = 0
) -> Report:
    """Return the report of a compliance result."""
    low, high = (end * NM_PER_RAD for end in result.interval)
    stiffness = result.robust.stiffness * NM_PER_RAD
    report = Report(
        "Stiffness of the Torino transmission",
        f"Forty drops of a weight give {stiffness:.0f} N m/rad at the output shaft, 95 % interval "
        f"{low:.0f} to {high:.0f}. The published {PUBLISHED_N_PER_DEG} is the other regression.",
        date=date,
    )
    report.fact("Stiffness", f"{stiffness:.0f} N m/rad", f"{low:.0f} to {high:.0f}, 95 %")
    report.fact("Robust fit", f"{result.robust.stiffness:.1f} N/deg", "loss on load, repaired rows")
    report.fact("As published", f"{PUBLISHED_N_PER_DEG} N/deg", "load on loss; printed as N m/deg")
    report.fact("Rows wrong", f"{len(result.rows_inconsistent)} of {len(result.printed)}",
                f"and {len(result.rows_swapped)} with swapped columns")  # fmt: skip
    _data(report, result)
    _estimators(report, result)
    _answer(report, result)
    return closed(report, result.checks, "torino-compliance", **{"Bootstrap seed": seed})


def _data(report: Report, result: ComplianceResult) -> None:
    section = report.section(
        "What is wrong in the printed rows",
        "The encoder came back to the same few end positions and the motor never stopped twice at "
        "the same place: a motor column that holds an encoder position is a swapped column. All "
        "weights pull one way: a motor end of the other sign has lost its minus. And the printed "
        "loss is the distance between the two positions of its row, or it is not that row's.",
    )
    rows = [[slip.row, slip.kind, slip.reason] for slip in result.slips]
    section.table(ReportTable(["Row", "Slip", "Evidence"], rows))
    section.text(
        "Swapping columns changes no loss that is taken as a distance. It turns the sign of a loss "
        "taken as encoder minus motor, and ruins both regressions (fourth line of the next table)."
    )


def _estimators(report: Report, result: ComplianceResult) -> None:
    section = report.section(
        "Which regression",
        "The load was set and is known to its printed digits; the scatter is in the measured "
        "angle. So the loss is regressed on the load and the stiffness is the inverse of that "
        "slope. Regressing the load on the loss gives a slope that is too small by the squared "
        f"correlation (here {result.variants[0].r2:.3f}), whatever the number of drops. Allowing "
        "errors in both, with the load's printed rounding against the angle's scatter, gives "
        f"{result.deming:.1f} N/deg: the load's own error does not matter.",
    )
    rows = [
        [v.name, v.rows, v.load_on_loss, v.loss_on_load, v.theil_sen, v.r2] for v in result.variants
    ]
    columns = ["Rows used", "Rows", "Load on loss", "Loss on load", "Theil-Sen", "r squared"]
    section.table(
        ReportTable(
            columns,
            rows,
            "Stiffness in N/deg, by reading of the table and by estimator.",
            formats=["", "d", ".2f", ".2f", ".2f", ".3f"],
        )
    )
    section.text(
        f"The second line gives {result.variants[1].load_on_loss:.2f}: the published "
        f"{PUBLISHED_N_PER_DEG} was computed from the positions, and the losses of rows 3, 10 and "
        "14 were slips of the print only."
    )
    section.figure(
        _scatter(result),
        "Loss against load: each repaired row (dots; a weight's first drop in orange), wrong "
        "losses as printed (crosses), and the fits.",
    )


def _answer(report: Report, result: ComplianceResult) -> None:
    fit = result.robust
    low, high = result.interval
    per_degree = fit.stiffness * NM_PER_RAD * np.pi / 180
    report.section(
        "The answer",
        f"The first drop of each weight starts from elsewhere and loses "
        f"{fit.group_offsets[0]:.3f} deg more; with that offset and Huber's weights the repaired "
        f"rows give {fit.stiffness:.1f} N/deg, that is {per_degree:.1f} N m/deg or "
        f"{fit.stiffness * NM_PER_RAD:.0f} N m/rad. Drawing whole weights with replacement gives "
        f"{low * NM_PER_RAD:.0f} to {high * NM_PER_RAD:.0f} N m/rad (95 %). "
        f"{fit.offset:.3f} deg are lost already at no load: backlash and friction.",
        f"A straight line is not the whole truth: a quadratic term is significant "
        f"(p = {result.curvature_p:.1g}), the transmission stiffens with load.",
    ).points(
        [
            "ASSUMED: the printed load hangs on each of the two cables of the 160 mm guide, so "
            "the torque is 0.16 m times the load. If it is the sum of both: "
            f"{fit.stiffness * NM_PER_RAD / 2:.0f} N m/rad.",
            "The printed load is ten times the mass. In true newtons every stiffness is "
            f"{100 * (1 - STANDARD_GRAVITY_FACTOR):.1f} % lower: "
            f"{fit.stiffness * NM_PER_RAD * STANDARD_GRAVITY_FACTOR:.0f} N m/rad.",
        ]
    )


def _scatter(result: ComplianceResult) -> Figure:
    with new_figure(width=8.0, height=4.4) as (figure, axes):
        printed = np.array([(drop.load_n, drop.loss_deg) for drop in result.printed])
        mended = np.array([(drop.load_n, drop.loss_deg) for drop in result.repaired])
        first = np.array([drop.drop == 1 for drop in result.repaired])
        changed = (printed != mended).any(axis=1)
        axes.plot(*printed[changed].T, "x", color=COLOURS["grey"], label="printed, wrong")
        axes.plot(*mended[~first].T, "o", color=COLOURS["blue"], ms=4.5, label="repaired")
        axes.plot(*mended[first].T, "o", color=COLOURS["orange"], ms=4.5, label="first drops")
        grid = np.array([0.0, 52.0])
        fit = result.robust
        line = fit.offset + grid / fit.stiffness
        axes.plot(grid, line, color=COLOURS["blue"], label=f"robust, {fit.stiffness:.0f} N/deg")
        axes.plot(grid, line + fit.group_offsets[0], "--", color=COLOURS["orange"], lw=1.2)
        other = result.variants[0].load_on_loss
        centre = printed.mean(axis=0)
        axes.plot(grid, centre[1] + (grid - centre[0]) / other, ":", color=COLOURS["red"],
                  label=f"load on loss, {other:.0f} N/deg")  # fmt: skip
        axes.set(xlabel="Load [N]", ylabel="Loss [deg]", xlim=(0, 52), ylim=(-0.05, 0.95))
        axes.legend(loc="upper left", ncols=2)
    return figure
