"""What the page of the backlash campaign draws."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.backlash.campaign import FREQUENCY, START, BacklashResult

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from elevon.reproduce.backlash.campaign import RowResult

DISPLAYED = (1, 7, 14)
"""Rows whose traces the paper shows."""


def summary_figure(rows: Sequence[RowResult]) -> Figure:
    """Draw measured, calculated and recovered backlash over the spacing."""
    spacing = np.array([row.measured.spacing_mm for row in rows])
    with new_figure(width=8.0, height=3.8) as (figure, axes):
        axes.plot(
            spacing,
            [row.formula_deg for row in rows],
            color=COLOURS["grey"],
            label="geometric formula, with the intrinsic backlash",
        )
        axes.plot(
            spacing,
            [row.measured.measured_total_deg for row in rows],
            "o",
            ms=8,
            mfc="none",
            color=COLOURS["blue"],
            label="measured on the bench",
        )
        axes.plot(
            spacing,
            [row.backlash_out_deg for row in rows],
            "x",
            color=COLOURS["orange"],
            label="recovered from the simulated encoder",
        )
        axes.set(
            xlabel="Radial spacing of the gears [mm]", ylabel="Total backlash [deg]", ylim=(0, 2.8)
        )
        axes.legend(loc="upper left")
    return figure


def page_values(result: BacklashResult) -> dict[str, object]:
    """Return what the page says and draws beside the rows."""
    errors = np.array([row.error_deg for row in result.rows])
    period = 1.0 / FREQUENCY
    return {
        "answer": result.to_dict(),
        "worst": max(result.rows, key=lambda row: abs(row.error_deg) / row.limit_deg),
        "rms": np.sqrt(np.mean(errors**2)),
        "gap": min(row.formula_deg - row.backlash_in_deg for row in result.rows),
        "summary": summary_figure,
        "limit": np.array([row.limit_deg for row in result.rows]),
        "wholes": [_trace(result, row, START, START + period) for row in DISPLAYED],
        "tops": [_trace(result, row, START + 0.2 * period, START + 0.42 * period)
                 for row in DISPLAYED],
    }  # fmt: skip


def _trace(result: BacklashResult, number: int, start: float, stop: float) -> dict[str, object]:
    """Return a part of a row's signals [deg] at the output."""
    recording = result.recordings[number - 1]
    time = recording["encoder_position"].time
    window = (time >= start) & (time < stop)
    lines = {
        "command": recording["command"].values,
        "motor": recording["motor_position"].values / result.gear_ratio,
        "encoder": recording["encoder_position"].values,
    }
    backlash = result.rows[number - 1].backlash_in_deg
    degrees = {name: np.degrees(values[window]) for name, values in lines.items()}
    return {"title": f"Row {number}: {backlash:.2f} deg", "time": time[window], **degrees}
