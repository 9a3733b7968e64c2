"""The demonstration's report."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.calibrate.estimate import LEVEL
from elevon.calibrate.validation import SIGNALS
from elevon.demo.bench_figure import bench_figure
from elevon.report import Report, Table
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.backlash.page import summary_figure
from elevon.reproduce.provenance import provenance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.calibrate.validation import Trace
    from elevon.demo.run import Demo

__all__ = ["demo_report"]

_SHOWN = {
    "encoder_position": ("encoder", 180.0 / math.pi, "deg"),
    "motor_speed": ("motor speed", 30.0 / math.pi, "rpm"),
    "current_q_meas": ("torque current", 1.0, "A"),
}


def demo_report(demo: Demo) -> Report:
    """Return the report of a demonstration."""
    rows = demo.rows()
    inside = sum(row["inside"] for row in rows)
    passed = [check.passed for check in demo.checks]
    report = Report(
        "A bench with hidden values, found again from its logs",
        "A published table is recomputed; then an actuator whose values nobody told the "
        "calibration writes the logs a bench would write, and is found again from them.",
    )
    report.fact("Checks passed", f"{sum(passed)} of {len(passed)}")
    report.fact("Truths inside", f"{inside} of {len(rows)}", f"{100 * LEVEL:.0f} % intervals")
    report.fact("Logs", "4 of 20 s", "one kept back from the fit")
    report.fact("All steps", f"{demo.seconds:.0f} s")
    _bench(report, demo)
    _parameters(report, demo, rows)
    _agreement(report, demo)
    _clocks(report, demo)
    _backlash(report, demo)
    _times(report, demo)
    report.section("Checks").checks(demo.checks)
    report.provenance(
        provenance(
            "elevon demo",
            **{
                "Seed": demo.seed,
                "Published set": demo.base.hash,
                "Hidden set": demo.hidden.hash,
            },
        )
    )
    return report


def _bench(report: Report, demo: Demo) -> None:
    section = report.section(
        "The bench",
        "The actuator, its user-side encoder, and a disk brake on the motor's shaft. The brake is "
        "closed by a servo in a torque loop on a load cell, which samples on a clock of its own. "
        "The drive's trace holds what the drive's sensors show, at 400 Hz: no true position, no "
        "true current, no command. When the command began, where in the play the motor stood, the "
        "cell's offset and its clock's error were left to chance.",
    )
    section.figure(bench_figure(), "The bench. Orange: what is written to files.")
    logs = demo.bench_truth["logs"]
    rows = [
        [
            log["name"],
            "on" if demo.logs[k].brake.known != "off" else "off",
            log["conditions"]["trigger"],
            log["conditions"]["start"],
            100.0 * log["conditions"]["zero"],
        ]
        for k, log in enumerate(logs)
    ]
    columns = ["Log", "Brake", "Trigger [s]", "Command begins [s]", "Motor in the play [%]"]
    formats = ["", "", ".3f", ".3f", "+.0f"]
    caption = "What chance set; the calibration saw none of it."
    section.table(Table(columns, rows, caption, formats=formats))


def _parameters(report: Report, demo: Demo, rows: list[dict[str, Any]]) -> None:
    section = report.section(
        "Parameters against the hidden truth",
        f"Intervals are meant to hold {100 * LEVEL:.0f} % of the truths. The model behind the "
        "calibration is the low one; the logs come from the high one, with a PWM bridge, encoder "
        f"counts and noise. Here {sum(row['inside'] for row in rows)} of {len(rows)} are inside: "
        "what the low model lacks shows as a bias that the intervals do not cover.",
    )
    with new_figure(width=8.5, height=0.34 * len(rows) + 1.3) as (figure, axes):
        _draw_errors(axes, rows)
    section.figure(
        figure,
        "Error of each estimate in percent of the truth, with its interval; grey: the published "
        "value the calibration began with (an arrow where it lies outside the plot).",
    )
    cells = [
        [
            row["path"],
            row["before"],
            row["truth"],
            row["value"],
            f"{row['low']:.4g} to {row['high']:.4g}",
            _percent(row),
            row["unit"],
            "yes" if row["inside"] else "no",
        ]
        for row in rows
    ]
    columns = ["Parameter", "Before", "Truth", "Estimate", "Interval", "Error", "Unit", "Inside"]
    section.table(Table(columns, cells, "Offsets are compared in their own unit.", digits=5))
    if demo.calibration.findings:
        section.text("What the calibration itself has to say:")
        section.points(demo.calibration.findings)


def _percent(row: dict[str, Any]) -> str:
    if row["path"].endswith("offset") or row["truth"] == 0.0:
        return f"{row['value'] - row['truth']:+.2g} {row['unit']}".replace("-", "\N{MINUS SIGN}")
    error = 100.0 * (row["value"] / row["truth"] - 1.0)
    return f"{error:+.2f} %".replace("-", "\N{MINUS SIGN}")


def _draw_errors(axes: Any, rows: list[dict[str, Any]]) -> None:
    shown = [row for row in rows if abs(row["truth"]) > 0.0 and row["before"] != 0.0]
    shown = [row for row in shown if not row["path"].endswith("offset")]
    reach = 1.0 + max(
        100.0 * max(abs(row["low"] / row["truth"] - 1.0), abs(row["high"] / row["truth"] - 1.0))
        for row in shown
    )
    for place, row in enumerate(reversed(shown)):
        ends = [100.0 * (row[key] / row["truth"] - 1.0) for key in ("low", "high")]
        colour = COLOURS["blue"] if row["inside"] else COLOURS["orange"]
        axes.plot(ends, [place, place], color=colour, lw=4, solid_capstyle="butt")
        axes.plot(100.0 * (row["value"] / row["truth"] - 1.0), place, "o", color=colour, ms=4)
        if row["before"] is None:
            continue
        old = 100.0 * (row["before"] / row["truth"] - 1.0)
        marker = "D" if abs(old) < reach else ">" if old > 0.0 else "<"
        axes.plot(np.clip(old, -0.97 * reach, 0.97 * reach), place, marker, color=COLOURS["grey"])
    axes.axvline(0.0, color=COLOURS["green"], lw=1.2)
    axes.set(
        xlim=(-reach, reach),
        yticks=range(len(shown)),
        yticklabels=[row["path"] for row in reversed(shown)],
        xlabel="Error [% of the truth]",
    )


def _agreement(report: Report, demo: Demo) -> None:
    section = report.section(
        "Logs against the model, before and after",
        f"The low model run in closed loop on each log's own rebuilt command; the first "
        f"{demo.after.transient:g} s are left out. The last log was kept from the calibration.",
    )
    old = {(e.log, e.signal): e for e in demo.before.errors}
    rows = []
    for e in demo.after.errors:
        label, factor, unit = _SHOWN[e.signal]
        before = old[e.log, e.signal]
        cells = [factor * before.rms, factor * e.rms, before.of_range, e.of_range]
        rows.append([e.log, label, unit, *cells])
    columns = [
        "Log",
        "Signal",
        "Unit",
        "RMS before",
        "RMS after",
        "Of range before [%]",
        "after [%]",
    ]
    section.table(Table(columns, rows, "RMS of model less log.", digits=3))
    earlier = {trace.log: trace for trace in demo.before.traces}
    for trace in demo.after.traces:
        section.figure(
            _trace_figure(trace, earlier[trace.log]),
            f"{trace.log}: log and model on the left, model less log on the right.",
        )
    kept = demo.after.traces[-1]
    for name in ("motor_speed", "current_q_meas"):
        label, factor, unit = _SHOWN[name]
        section.chart(
            f"{kept.log}: {label}",
            kept.time,
            {
                "log": factor * kept.measured[name],
                "before": factor * earlier[kept.log].simulated[name],
                "after": factor * kept.simulated[name],
            },
            y_label=f"{label} [{unit}]",
            note="Drag to zoom, double click to go back.",
        )


def _trace_figure(trace: Trace, before: Trace) -> Figure:
    keep = trace.used
    time = trace.time[keep]
    thin = slice(None, None, max(1, len(time) // 2000))
    with new_figure(3, 2, width=9.5, height=6.2, sharex=True) as (figure, axes):
        for (left, right), name in zip(axes, SIGNALS, strict=True):
            label, factor, unit = _SHOWN[name]
            log, new = factor * trace.measured[name][keep], factor * trace.simulated[name][keep]
            old = factor * before.simulated[name][keep]
            left.plot(time[thin], log[thin], color=COLOURS["grey"], lw=2.4, label="log")
            left.plot(time[thin], new[thin], color=COLOURS["orange"], lw=0.9, label="model, after")
            right.plot(time[thin], (old - log)[thin], color=COLOURS["blue"], lw=0.7, label="before")
            right.plot(
                time[thin], (new - log)[thin], color=COLOURS["orange"], lw=0.7, label="after"
            )
            left.set(ylabel=f"{label} [{unit}]")
        axes[0][0].set(title="Log and model")
        axes[0][1].set(title="Model less log")
        for axis in axes[0]:
            axis.margins(y=0.22)  # room for the legend, clear of the lines
            axis.legend(loc="upper right", ncols=2)
        for axis in axes[2]:
            axis.set(xlabel="Time [s]")
    return figure


def _clocks(report: Report, demo: Demo) -> None:
    section = report.section(
        "Two clocks",
        "The load cell's file begins at the trigger's edge and runs on another clock. What both "
        "logs saw gives its offset and drift.",
    )
    rows = []
    for log, item in zip(demo.bench_truth["logs"], demo.imported, strict=True):
        found = item.report.synchronisation
        if not found or found.get("offset_s") is None:
            continue
        true = log["conditions"]
        rows.append(
            [
                log["name"],
                found["method"],
                true["trigger"],
                found["offset_s"],
                1e3 * found["offset_std_s"],
                1e6 * true["cell"]["clock_drift"],
                1e6 * found["drift"],
                None if found["drift_std"] is None else 1e6 * found["drift_std"],
            ]
        )
    columns = [
        "Log", "From", "True offset [s]", "Found [s]", "Std [ms]",
        "True drift [ppm]", "Found [ppm]", "Std [ppm]",
    ]  # fmt: skip
    formats = ["", "", ".4f", ".4f", ".2f", "+.0f", "+.0f", ".0f"]
    section.table(
        Table(columns, rows, "Offset and drift of the load cell's clock.", formats=formats)
    )


def _backlash(report: Report, demo: Demo) -> None:
    worst = max(demo.backlash.rows, key=lambda row: abs(row.error_deg) / row.limit_deg)
    section = report.section(
        "The published backlash table, recomputed",
        "Fifteen measured plays, put into the simulated actuator and recovered from its encoder "
        f"alone. Largest error against its limit: row {worst.measured.row}, "
        f"{abs(worst.error_deg):.4f} of {worst.limit_deg:.4f} deg. All rows and traces: "
        "backlash.html in this folder.",
    )
    section.figure(
        summary_figure(demo.backlash.rows), "Total play against the spacing of the gears."
    )


def _times(report: Report, demo: Demo) -> None:
    rows: list[list[object]] = [[step.name, step.seconds, step.kept] for step in demo.steps]
    rows.append(["all", demo.seconds, ""])
    resumed = any(step.kept for step in demo.steps)
    columns = ["Step", "Time [s]", "Resumed"] if resumed else ["Step", "Time [s]"]
    table = Table(
        columns,
        rows if resumed else [row[:2] for row in rows],
        "Wall time of this run; drawing and writing this page is not in it."
        + (" Steps kept from an interrupted run took only the time to read them." * resumed),
        formats=["", ".1f", ""],
    )
    report.section("Time of each step").table(table)
