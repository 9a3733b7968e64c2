"""The report of `nasa-baseline`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.nasa.baseline import DRIFT
from elevon.reproduce.nasa.baseline_rows import MEASURES, BaselineResult
from elevon.reproduce.nasa.histories import HistoryFigure

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def baseline_page(result: BaselineResult, date: str | None) -> Report:
    """Return the report, without its checks and its provenance."""
    statuses = [row.status for row in result.rows]
    report = Report(
        "Nominal runs of the ballscrew actuator",
        f"Every profile at both amplitudes and both rates under every load, {result.replicates} "
        "times: each time another reassembly, in an order of its own, while the laboratory warms "
        f"by {DRIFT:g} K. Statistics after the first 2 s; tracking is command less position on "
        "the load's side of the joint.",
        date=date,
    )
    report.fact("Cells", str(len(result.rows)), f"load: {result.load_kind}")
    report.fact("Runs", str(sum(len(row.runs) for row in result.rows)), "replicates in blocks")
    report.fact("Limited", str(statuses.count("limited")), "ask for more than there is, and run")
    report.fact("Refused", str(statuses.count("refused")), "ramps that cannot be followed")
    if result.effects:
        _effects(report, result)
    section = report.section("Current against load")
    section.figure(_current_figure(result), "RMS phase current at 50 mm and 6 cm/s, each run.")
    if result.histories:
        section = report.section(
            "Time histories",
            "Figures 5, 6 and 7 of the paper as the model gives them. Their curves are drawn, not "
            "printed, so nothing is held against them.",
        )
        for history in result.histories:
            section.figure(_history_figure(history), f"Figure {history.figure}: {history.title}.")
    if result.corners:
        _corners(report, result)
    report.section("All cells").table(_rows_table(result))
    return report


def _corners(report: Report, result: BaselineResult) -> None:
    columns = ["Profile", "Load [N]", "Acceleration [m/s2]", "Peak current [A]", "RMS current [A]",
               "Tracking max [mm]"]  # fmt: skip
    rows = [list(row.values()) for row in result.corners]
    report.section(
        "Corners",
        "The paper draws sharp corners, which ask for infinite acceleration: the current limit of "
        "20 A is then every peak. With the corners rounded the peak is that of the motion.",
    ).table(
        ReportTable(columns, rows, "Acceleration 0: sharp, as drawn.",
              formats=("", ".0f", ".1f", ".2f", ".3f", ".3f"))
    )  # fmt: skip


def _effects(report: Report, result: BaselineResult) -> None:
    section = report.section(
        "Effects",
        "Change from the low to the high level in the two-level part of the matrix (sinusoidal "
        "against triangular, 50 against 100 mm, 6 against 12 cm/s, 500 against 8500 N, tensile "
        "against compressive): least squares with one offset a block and all pairs of factors, "
        "95 % intervals, probabilities corrected over the terms (Holm).",
    )
    for name, effects in result.effects.items():
        title, unit, digits = MEASURES[name]
        rows = [[e.term, e.effect, e.low, e.high, _probability(e.p)] for e in effects]
        number = f"+.{digits}f"
        section.table(
            ReportTable(["Factor or pair", f"Effect [{unit}]", "from", "to", "p"], rows, title,
                  formats=("", number, number, number, ""))
        )  # fmt: skip


def _probability(p: float) -> str:
    return "< 1e-4" if p < 1e-4 else f"{p:.2g}"


def _current_figure(result: BaselineResult) -> Figure:
    colours = ("grey", "blue", "orange", "green", "red")
    with new_figure(width=8.0, height=3.6) as (figure, axes):
        names = list(dict.fromkeys(row.profile.name for row in result.rows))
        for place, (name, colour) in enumerate(zip(names, colours, strict=False)):
            chosen = [
                (row.load / 1e3 + 0.06 * (place - 2), run[0])
                for row in result.rows
                if row.profile.name == name
                and abs(row.profile.amplitude - 0.05) < 1e-9
                and abs(row.profile.rate - 0.06) < 1e-9
                for run in row.runs
            ]
            if chosen:
                load, current = np.array(chosen).T
                axes.plot(load, current, "o", ms=3, color=COLOURS[colour], label=name)
        axes.set(xlabel="Load, compressive positive [kN]", ylabel="RMS phase current [A]")
        axes.legend()
    return figure


def _history_figure(history: HistoryFigure) -> Figure:
    curve = history.curves
    with new_figure(2, 2, width=8.0, height=4.4, sharex=True) as (figure, grid):
        position, load, current, warm = grid.flat
        position.plot(history.time, 1e3 * curve["command"], color=COLOURS["grey"], label="command")
        position.plot(history.time, 1e3 * curve["output_position"], color=COLOURS["blue"],
                      label="position", lw=1)  # fmt: skip
        position.set_ylabel("Position [mm]")
        _legend_above(position)
        load.plot(history.time, 1e-3 * curve["joint_force"], color=COLOURS["violet"], lw=1)
        load.set_ylabel("Load cell [kN]")
        current.plot(history.time, curve["current_ref"], color=COLOURS["orange"], lw=1)
        current.set_ylabel("Current reference [A]")
        for name, colour in (("winding", "orange"), ("surface", "blue")):
            rise = curve[f"{name}_temperature"] - 273.15
            warm.plot(history.time, rise, color=COLOURS[colour], label=name)
        warm.set_ylabel("Temperature [degC]")
        _legend_above(warm)
        for axes in grid[-1]:
            axes.set_xlabel("Time [s]")
    return figure


def _legend_above(axes: Axes) -> None:
    """The curves fill their axes."""
    axes.legend(fontsize=8, loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, borderpad=0.2)


def _rows_table(result: BaselineResult) -> ReportTable:
    measures = ("rms_current_a", "peak_current_a", "tracking_rms_mm", "winding_rise_k")
    columns = ["Profile", "Amplitude [mm]", "Rate [mm/s]", "Load [N]", "Direction",
               *(f"{MEASURES[name][0]} [{MEASURES[name][1]}]" for name in measures),
               "Scatter of the RMS [A]", "Status"]  # fmt: skip
    rows = [
        [d["profile"], d["amplitude_mm"], d["rate_mm_s"], d["load_n"], d["direction"],
         *(d[name] for name in measures), d["rms_current_scatter_a"], d["status"]]
        for d in (row.to_dict() for row in result.rows)
    ]  # fmt: skip
    numbers = [f".{MEASURES[name][2]}f" for name in measures]
    return ReportTable(
        columns, rows, "Means over the replicates and the scatter between reassemblies.",
        formats=("", ".0f", ".0f", ".0f", "", *numbers, ".4f", ""),
    )  # fmt: skip
