"""The demonstration's report."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from elevon.calibrate.validation import SIGNALS
from elevon.calibrate.zeros import encoder_count
from elevon.demo.bench_figure import bench_figure
from elevon.demo.page_parameters import parameters_section
from elevon.estimate import LEVEL
from elevon.report import Report, ReportTable, provenance
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.backlash.page import summary_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.calibrate.validation import ValidationTrace
    from elevon.demo.run import Demo
    from elevon.demo.steps import Story
    from elevon.logs.importing import ImportedLog
    from elevon.report.checks import Check
    from elevon.report.document import Section

_DISPLAYED = {
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
        "A bench with hidden values, recovered from its logs",
        "A published table is recomputed; then an actuator whose values nobody gave the "
        "calibration writes the logs a bench would write, and is recovered from them.",
    )
    report.fact("Checks passed", f"{sum(passed)} of {len(passed)}")
    report.fact("Truths inside", f"{inside} of {len(rows)}", f"{100 * LEVEL:.0f} % intervals")
    length = f"{max(log.duration for log in demo.logs):.0f} s"
    times = "\N{MULTIPLICATION SIGN}"
    report.fact("Logs", f"{len(demo.logs)} {times} {length}", "one kept back from the fit")
    resumed = sum(bool(step.reused) for step in demo.steps)
    note = f"{resumed} of {len(demo.steps)} steps resumed" if resumed else ""
    report.fact("All steps", f"{demo.seconds:.0f} s", note)
    _bench(report, demo)
    parameters_section(report, demo, rows)
    _agreement(report, demo)
    _clocks(report, demo)
    _backlash(report, demo)
    times_section(report, demo)
    return closed(report, demo, demo.checks)


def closed(report: Report, demo: Story, checks: Sequence[Check]) -> Report:
    """Return a demonstration's page with what each ends with: checks, and what it was made from."""
    report.section("Checks").checks(checks)
    sets = {"Seed": demo.seed, "Published set": demo.base.hash, "Hidden set": demo.hidden.hash}
    report.provenance(provenance("elevon demo", **sets))
    return report


def _bench(report: Report, demo: Demo) -> None:
    section = report.section(
        "The bench",
        "The actuator, its output-side encoder, and a disk brake on the motor's shaft. The brake "
        "is closed by a servo in a torque loop on a load cell, which samples on a clock of its "
        "own. The drive's trace holds what the drive's sensors show, at 400 Hz: no true position, "
        "no true current, no command. When the command began, where in the backlash the motor "
        "stood, the cell's offset and its clock's error were left to chance.",
    )
    section.figure(
        bench_figure(),
        "The bench. Blue: the actuator. Green: what loads it. Orange: what is written to files, "
        "and all that the calibration is given of it.",
    )
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
    columns = "Log", "Brake", "Trigger at [s]", "Command begins at [s]", "Motor in the backlash [%]"
    formats = ["", "", ".3f", ".3f", "+.0f"]
    caption = (
        "What chance set; the calibration was given none of it. Where the motor stands in the "
        "backlash at first: 0 is the middle, \N{PLUS-MINUS SIGN}50 its ends."
    )
    section.table(ReportTable(columns, rows, caption, formats=formats))


def _agreement(report: Report, demo: Demo) -> None:
    section = report.section(
        "Logs against the model, before and after",
        f"The reduced-order model run in closed loop on each log's own rebuilt command; the first "
        f"{demo.after.transient:g} s are left out. The last log was kept from the calibration. "
        f"One count of the encoder is {math.degrees(encoder_count(demo.base)):.4f} deg.",
    )
    old = {(e.log, e.signal): e for e in demo.before.errors}
    rows = []
    for e in demo.after.errors:
        label, factor, unit = _DISPLAYED[e.signal]
        before = old[e.log, e.signal]
        cells = [factor * before.rms, factor * e.rms, before.of_range, e.of_range]
        rows.append([e.log, label, unit, *cells])
    columns = ["Log", "Signal", "Unit", "RMS before", "RMS after", "Of range, before [%]",
               "after [%]"]  # fmt: skip
    caption = "RMS of model less log, and the same in percent of the range of the logged signal."
    section.table(ReportTable(columns, rows, caption, digits=3))
    earlier = {trace.log: trace for trace in demo.before.traces}
    for trace in demo.after.traces:
        section.figure(
            _trace_figure(trace, earlier[trace.log]),
            f"{trace.log}: log and calibrated model on the left; on the right model less log, "
            "with the published values before and the calibrated ones after.",
        )
    held_out = demo.after.traces[-1]
    _charts(section, held_out, earlier[held_out.log])


def _charts(section: Section, trace: ValidationTrace, before: ValidationTrace) -> None:
    """Draw the log that was kept back, to zoom in."""
    for name in ("motor_speed", "current_q_meas"):
        label, factor, unit = _DISPLAYED[name]
        lines = {
            "log": trace.measured[name],
            "after": trace.simulated[name],
            "before": before.simulated[name],
        }
        section.chart(
            f"{trace.log}, the log kept back: {label}",
            trace.time[trace.used],
            {key: factor * values[trace.used] for key, values in lines.items()},
            y_label=f"{label} [{unit}]",
            note="Point at it for numbers, drag to zoom, double click to go back.",
        )


def _trace_figure(trace: ValidationTrace, before: ValidationTrace) -> Figure:
    keep = trace.used
    time = trace.time[keep]
    thin = slice(None, None, max(1, len(time) // 2000))
    with new_figure(3, 2, width=9.5, height=6.2, sharex=True) as (figure, axes):
        for (left, right), name in zip(axes, SIGNALS, strict=True):
            label, factor, unit = _DISPLAYED[name]
            log, new = factor * trace.measured[name][keep], factor * trace.simulated[name][keep]
            old = factor * before.simulated[name][keep]
            # Colours as in the charts below.
            left.plot(time[thin], log[thin], color=COLOURS["blue"], lw=2.4, label="log")
            left.plot(time[thin], new[thin], color=COLOURS["orange"], lw=0.9, label="model, after")
            for label_, model, colour in (("before", old, "green"), ("after", new, "orange")):
                residual = (model - log)[thin]
                right.plot(time[thin], residual, color=COLOURS[colour], lw=0.7, label=label_)
            left.set(ylabel=f"{label} [{unit}]")
            right.set(ylabel=f"[{unit}]")
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
        "The load cell's file begins at the trigger's edge in the drive's trace and runs on a "
        "clock of its own. What both saw gives the offset, an instant on the drive's clock, and "
        "the drift, by which the cell's seconds are longer.",
    )
    pairs = zip(demo.bench_truth["logs"], demo.imported, strict=True)
    rows = [row for log, item in pairs if (row := _clock(log, item))]
    columns = [
        "Log", "Recovered from", "True offset [s]", "Recovered [s]", "Deviation [ms]",
        "True drift [ppm]", "Recovered [ppm]", "Deviation [ppm]",
    ]  # fmt: skip
    formats = ["", "", ".4f", ".4f", ".2f", "+.0f", "+.0f", ".0f"]
    section.table(
        ReportTable(
            columns,
            rows,
            "Offset and drift of the load cell's clock, with their estimated standard deviations; "
            "empty where nothing that both saw tells the drift.",
            formats=formats,
        )
    )


def _clock(log: dict[str, Any], item: ImportedLog) -> list[object]:
    """Return a log's row; empty where the clocks were not brought together."""
    clock, true = item.report.synchronisation, log["conditions"]
    if not clock or clock.get("offset_s") is None:
        return []
    determined = clock["drift_std"] is not None and all(
        finding.code != "drift-unknown" for finding in item.report.findings
    )
    drift = [1e6 * clock["drift"], 1e6 * clock["drift_std"]] if determined else [None, None]
    return [
        log["name"].replace("-", "\N{NON-BREAKING HYPHEN}"), clock["method"],
        true["trigger"], clock["offset_s"], 1e3 * clock["offset_std_s"],
        1e6 * true["cell"]["clock_drift"], *drift,
    ]  # fmt: skip


def _backlash(report: Report, demo: Demo) -> None:
    worst = max(demo.backlash.rows, key=lambda row: abs(row.error_deg) / row.limit_deg)
    section = report.section(
        "The published backlash table, recomputed",
        "Fifteen measured backlashes, put into the simulated actuator and recovered from its "
        f"encoder alone. Largest error against its limit: row {worst.measured.row}, "
        f"{abs(worst.error_deg):.4f} of {worst.limit_deg:.4f} deg. All rows and traces: "
        "backlash.html in this folder.",
    )
    section.figure(
        summary_figure(demo.backlash.rows), "Total backlash against the spacing of the gears."
    )


def times_section(report: Report, demo: Story) -> None:
    """Add the time of each step."""
    rows: list[list[object]] = [[step.name, step.seconds, step.reused] for step in demo.steps]
    rows.append(["all", demo.seconds, ""])
    resumed = any(step.reused for step in demo.steps)
    columns = ["Step", "Time [s]", "Resumed"] if resumed else ["Step", "Time [s]"]
    table = ReportTable(
        columns,
        rows if resumed else [row[:2] for row in rows],
        "Wall time of this run; drawing and writing this page is not in it."
        + (" Steps kept from an interrupted run took only the time to read them." * resumed),
        formats=["", ".1f", ""],
    )
    report.section("Time of each step").table(table)
