"""The report of the backlash campaign."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.backlash.campaign import FREQUENCY, START, BacklashResult
from elevon.reproduce.provenance import provenance

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.figure import Figure

    from elevon.reproduce.backlash.campaign import RowResult

DISPLAYED = (1, 7, 14)
"""Rows whose traces the paper shows."""


def backlash_report(result: BacklashResult, *, date: str | None = None) -> Report:
    """Return the report of a backlash result."""
    worst = max(result.rows, key=lambda row: abs(row.error_deg) / row.limit_deg)
    report = Report(
        "Backlash of the Torino bench",
        "Fifteen measured backlashes, put into the simulated actuator and recovered from its "
        "encoder "
        f"alone. Largest error against its limit: row {worst.measured.row}, "
        f"{abs(worst.error_deg):.4f} of {worst.limit_deg:.4f} deg.",
        date=date,
    )
    errors = np.array([row.error_deg for row in result.rows])
    gaps = np.array([row.formula_deg - row.backlash_in_deg for row in result.rows])
    report.fact("Error of recovery", f"{np.sqrt(np.mean(errors**2)):.4f} deg", "RMS, fifteen rows")
    report.fact("Encoder count", f"{result.encoder_count_deg:.4f} deg", "at the output side")
    report.fact("Formula less measured", f"{gaps.min():+.2f} deg", "largest, at the widest spacing")
    values = result.to_dict()
    report.fact("Simulated", f"{values['sim_s']:.0f} s", f"{len(result.rows) + 1} runs, 1 us steps")
    _comparison(report, result)
    _traces(report, result)
    _method(report, result)
    report.section("Checks").checks(result.checks)
    report.provenance(
        provenance(
            "elevon reproduce torino-backlash --out DIR",
            **{
                "Parameter hash (no backlash)": values["parameter_hash"],
                "Seed": values["seed"],
                "Core": values["version"],
            },
        )
    )
    return report


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


def _comparison(report: Report, result: BacklashResult) -> None:
    section = report.section(
        "Measured, calculated, simulated",
        "The formula is that of ideal teeth. Above some 2 mm of spacing the printed gears' flanks "
        "are no involutes any more and the bench shows more backlash than the formula.",
    )
    section.figure(summary_figure(result.rows), "Total backlash against the spacing of the gears.")
    columns = [
        "Row", "Micrometer [mm]", "Measured [deg]", "Formula [deg]", "Put in [deg]",
        "Recovered [deg]", "Error [deg]", "Limit [deg]", "Motor less encoder [deg]", "Flat [s]",
    ]  # fmt: skip
    rows = [
        [
            row.measured.row,
            row.measured.micrometer_mm,
            row.measured.measured_total_deg,
            row.formula_deg,
            row.backlash_in_deg,
            row.backlash_out_deg,
            row.error_deg,
            row.limit_deg,
            row.lost_motion_deg,
            row.flat_s,
        ]
        for row in result.rows
    ]
    formats = ["d", ".2f", ".4f", ".4f", ".4f", ".4f", "+.4f", ".4f", ".4f", ".3f"]
    section.table(ReportTable(columns, rows, "Total backlash at the output side.", formats=formats))
    section.figure(
        _errors(result),
        "Error of the recovered backlash; the band is one count and 2 % of the backlash.",
    )


def _traces(report: Report, result: BacklashResult) -> None:
    section = report.section(
        "What the encoder sees",
        "While the gap is crossed the encoder stands still. The loop, closed on the encoder, "
        "drives the motor on: it overshoots by the backlash; the flat ends with a step in speed.",
    )
    section.figure(
        _trace_figure(result),
        f"Rows 1, 7 and 14: command, motor divided by the gear ratio, encoder. Above one period "
        f"after {START:g} s, below its top.",
    )


def _method(report: Report, result: BacklashResult) -> None:
    edges = f"{result.encoder_count_deg:g} deg"
    report.section(
        "How the backlash is recovered",
        "From encoder signals only. Over half a period, from before one reversal to before the "
        "next, the motor turns the encoder's own travel plus the backlash. The loop's integral "
        "action "
        "makes the time integral of command less encoder, times the position gain, equal to that "
        "travel, up to what friction takes to turn round. The same command without backlash (a "
        "blank "
        "run) takes the same for friction. So the backlash is the position gain times the area "
        "between "
        "the two encoder signals over half a period: no inertia, friction or timing enters. The "
        f"areas of the reversals after {START:g} s are averaged; a count is {edges}.",
        "Second estimate, for comparison: the range of motor position less encoder, which a bench "
        "with a motor sensor sees directly, to within a count.",
    )


def _errors(result: BacklashResult) -> Figure:
    with new_figure(width=8.0, height=2.6) as (figure, axes):
        backlash = np.array([row.backlash_in_deg for row in result.rows])
        limit = np.array([row.limit_deg for row in result.rows])
        axes.fill_between(backlash, -limit, limit, color=COLOURS["green"], alpha=0.15, lw=0)
        axes.axhline(0.0, color=COLOURS["grey"], lw=0.8)
        axes.errorbar(
            backlash,
            [row.error_deg for row in result.rows],
            [row.spread_deg for row in result.rows],
            fmt="o",
            ms=4.5,
            lw=1,
            color=COLOURS["orange"],
        )
        axes.set(xlabel="Backlash put in [deg]", ylabel="Error [deg]")
    return figure


def _trace_figure(result: BacklashResult) -> Figure:
    with new_figure(2, 3, width=9.0, height=5.6) as (figure, axes):
        for column, number in enumerate(DISPLAYED):
            whole, top = axes[:, column]
            period = 1.0 / FREQUENCY
            _draw_trace(whole, result, number, (START, START + period))
            _draw_trace(top, result, number, (START + 0.2 * period, START + 0.42 * period))
            backlash = result.rows[number - 1].backlash_in_deg
            whole.set(title=f"Row {number}: {backlash:.2f} deg", ylim=(1.0, 19.0))
            top.set(xlabel="Time [s]", ylim=(14.2, 18.8))
        for axis in axes[:, 0]:
            axis.set_ylabel("Position at the output [deg]")
        axes[0, 0].legend(loc="lower left")
    return figure


def _draw_trace(axis: Any, result: BacklashResult, number: int, span: tuple[float, float]) -> None:
    recording = result.recordings[number - 1]
    encoder = recording["encoder_position"]
    window = (encoder.time >= span[0]) & (encoder.time < span[1])
    lines = [
        ("command", recording["command"].values, "grey", 1.0),
        ("motor / ratio", recording["motor_position"].values / result.gear_ratio, "blue", 1.2),
        ("encoder", encoder.values, "orange", 1.6),
    ]
    for label, values, colour, width in lines:
        degrees = np.degrees(values[window])
        axis.plot(encoder.time[window], degrees, color=COLOURS[colour], lw=width, label=label)
