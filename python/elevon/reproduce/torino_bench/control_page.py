"""The report of the root locus and the no-load speed."""

from __future__ import annotations

import numpy as np

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.provenance import closed
from elevon.reproduce.torino_bench.control import GAINS, ControlResult


def control_page(result: ControlResult, seed: int, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce torino-control`."""
    report = Report(
        "Root locus of the derivative branch, no-load speed",
        "The branch has one pole and a zero at the origin: its root runs along the real axis from "
        "the one to the other as the gain grows.",
        date=date,
    )
    section = report.section("Root locus")
    with new_figure(1, 2, width=8.0, height=2.8) as (figure, axes):
        axes[0].plot(result.roots, np.zeros(len(GAINS)), color=COLOURS["blue"])
        axes[0].plot(result.roots[:1], [0.0], "x", color=COLOURS["orange"], label="pole")
        axes[0].plot([0.0], [0.0], "o", mfc="none", color=COLOURS["orange"], label="zero")
        axes[0].set(xlabel="Real part [1/s]", ylabel="Imaginary part [1/s]")
        axes[0].legend(loc="upper right", ncols=2)
        axes[1].loglog(GAINS[1:], -result.roots[1:], color=COLOURS["blue"])
        axes[1].set(xlabel="Gain", ylabel="-Root [1/s]")
    section.figure(figure, "Root of 1 + K G with the printed time and filter (Figure 52).")
    rows = [[r.requirement, r.required_deg_s, r.speed_deg_s, r.met] for r in result.rows]
    caption = "Behind 1:124 the bench's drive, limited to 500 rpm, turns no faster."
    columns = ["No-load speed of", "Required [deg/s]", "Model [deg/s]", "Met"]
    report.section("No-load speed").table(ReportTable(columns, rows, caption, digits=4))
    return closed(report, result.checks, f"torino-control --seed {seed}", result.parameter_hash)
