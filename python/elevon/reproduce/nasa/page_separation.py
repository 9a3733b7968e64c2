"""The report of `nasa-separation`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.nasa.corners import ACCELERATION
from elevon.reproduce.nasa.effect import POWER
from elevon.reproduce.nasa.population import spread_rows
from elevon.reproduce.nasa.separation_rows import SeparationResult, SeparationRow

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_ROUNDED = ", rounded"
SHAPE_COLOURS = {
    "trapezoidal": COLOURS["blue"],
    "sinusoidal": COLOURS["orange"],
    "triangular": COLOURS["green"],
    "sweep": COLOURS["violet"],
}


def separation_page(result: SeparationResult, date: str | None) -> Report:
    """Return the report, without its checks and its provenance."""
    report = Report(
        "Which profile shows which fault",
        f"{result.healthy} healthy units and {result.reassemblies} of each fault, every one in "
        "every profile under every load. One feature a fault, named beforehand. A profile is "
        "called the best only where its interval lies above all others and another such "
        f"experiment would find that again with a probability of {100 * POWER:.0f} %. "
        f"Rounded corners have {ACCELERATION:g} m/s2, all others are sharp as in the paper.",
        date=date,
    )
    winners = result.winners()
    named = sum(winner is not None for winner in winners.values())
    report.fact("Best profile named", f"{named} of {len(winners)}", "pairs of fault and load")
    report.fact("Null rate", f"{100 * result.null_rate:.2g} %", "healthy against healthy")
    report.fact("Level", f"{100 * result.level:.3f} %", "of each interval; 95 % for the table")
    section = report.section("Best profiles")
    section.figure(
        _power_map(result),
        "Largest distance from healthy, in healthy standard deviations, of each fault under each "
        "load by profile; a frame: the best, named.",
    )
    section.table(_winners_table(result))
    section = report.section("Effect sizes")
    section.figure(
        _effects_figure(result),
        "Distance from healthy in healthy standard deviations, with the intervals that hold "
        "together over the table. The load opposes motion.",
    )
    if result.impacts:
        _impact_sections(report, result)
    _population(report)
    report.section("All rows").table(_rows_table(result))
    return report


def _groups(result: SeparationResult) -> dict[tuple[str, float], list[SeparationRow]]:
    groups: dict[tuple[str, float], list[SeparationRow]] = {}
    for row in result.rows:
        groups.setdefault((row.fault, row.load), []).append(row)
    return groups


def _winners_table(result: SeparationResult) -> ReportTable:
    rows: list[list[object]] = []
    for (fault, load), group in _groups(result).items():
        largest = max(group, key=lambda row: abs(row.effect.size))
        winner = next((row.profile for row in group if row.winner), None)
        if winner is None and not any(row.effect.significant for row in group):
            verdict = "not shown by any"
        else:
            verdict = winner or "none named"
        rows.append(
            [fault, f"{load:.0f}", largest.feature.replace("current reference", "current"),
             verdict, f"{abs(largest.effect.size):.3g}", f"{100 * largest.power:.0f} %",
             _draws(largest, verdict)]
        )  # fmt: skip
    columns = ["Fault", "Load [N]", "Feature", "Best profile", "Largest effect", "Power",
               "Draws that would name one"]  # fmt: skip
    return ReportTable(
        columns, rows,
        "Features: lines and rms of the current reference, peak of the load cell. "
        "Power: probability that the intervals of the two largest effects part in another such "
        f"experiment, were they as estimated; named from {100 * POWER:.0f} % on. Draws: of each "
        "fault, with as many times more healthy units.",
    )  # fmt: skip


def _power_map(result: SeparationResult) -> Figure:
    groups = _groups(result)
    shapes = list(dict.fromkeys(row.profile for row in result.rows))
    sizes = np.zeros((len(groups), len(shapes)))
    best: list[tuple[int, int]] = []
    for line, group in enumerate(groups.values()):
        for row in group:
            column = shapes.index(row.profile)
            sizes[line, column] = max(sizes[line, column], abs(row.effect.size))
            if row.winner:
                best.append((line, column))
    with new_figure(width=8.0, height=0.24 * len(groups) + 1.6) as (figure, axes):
        picture = axes.imshow(np.log10(np.maximum(sizes, 0.1)), aspect="auto", cmap="viridis")
        axes.grid(visible=False)
        axes.set_xticks(range(len(shapes)), shapes, rotation=20, ha="right", fontsize=8)
        names = [f"{fault}, {load:.0f} N" for fault, load in groups]
        axes.set_yticks(range(len(names)), names, fontsize=7)
        for line, column in best:
            axes.plot(column, line, "s", mfc="none", mec="white", ms=11, mew=1.5)
        figure.colorbar(picture, label="log10 of the effect size")
    return figure


def _draws(row: SeparationRow, verdict: str) -> str:
    if row.draws is not None:
        return f"{row.draws:d}"
    return "over 1e9" if verdict == "none named" else ""


def _effects_figure(result: SeparationResult) -> Figure:
    faults = list(dict.fromkeys(row.fault for row in result.rows))
    loads = sorted({row.load for row in result.rows})
    shapes = list(dict.fromkeys(row.profile for row in result.rows))
    lines = (len(faults) + 1) // 2
    height = 1.9 * lines + 0.5
    with new_figure(lines, 2, width=8.0, height=height, sharex=True, squeeze=False) as (
        figure,
        grid,
    ):
        for axes, fault in zip(grid.flat, faults, strict=False):
            for place, shape in enumerate(shapes):
                rows = [r for r in result.rows if r.fault == fault and r.profile == shape]
                x = np.array([loads.index(r.load) for r in rows])
                _bars(axes, x + (place - 0.5 * (len(shapes) - 1)) * 0.7 / len(shapes), rows)
            axes.axhline(0.0, color=COLOURS["grey"], lw=0.8)
            axes.set_title(fault, fontsize=9)
            axes.set_xticks(range(len(loads)), [f"{load:.0f} N" for load in loads])
        for axes in grid[:, 0]:
            axes.set_ylabel("Effect size")
        handles, labels = grid.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, fontsize=8)
    return figure


def _bars(axes: Axes, x: np.ndarray, rows: list[SeparationRow]) -> None:
    """Draw the effects of one profile with their intervals; rounded corners have open marks."""
    shape = rows[0].profile
    name, rounded, _ = shape.partition(_ROUNDED)
    size = np.array([row.effect.size for row in rows])
    ends = np.array([[row.effect.low, row.effect.high] for row in rows]).T
    axes.errorbar(
        x, size, np.abs(ends - size), fmt="o", ms=3.5, lw=1, mew=1,
        color=SHAPE_COLOURS.get(name, COLOURS["grey"]), label=shape,
        mfc="none" if rounded else None,
    )  # fmt: skip


def _impact_sections(report: Report, result: SeparationResult) -> None:
    section = report.section(
        "The gap's impact",
        "The paper calls the triangular profile well suited for backlash. That holds without "
        "load; under a load that opposes motion the trapezoid, whose rest lets the joint relax, "
        "hits harder.",
    )
    section.figure(
        _trace_figure(result),
        "Load cell of the nominal actuator about the first reversal, healthy and with a gap of "
        "0.5 mm; time from the corner of the command.",
    )
    rows = [
        [impact.profile, impact.load, impact.excess, impact.low, impact.high]
        for impact in result.impacts
    ]
    columns = ["Profile", "Load [N]", "Excess of the peak [N]", "from [N]", "to [N]"]
    section.table(
        ReportTable(
            columns,
            rows,
            "Peak of the load cell with the gap less without, 95 % intervals.",
            formats=("", ".0f", ".0f", ".0f", ".0f"),
        )
    )


def _trace_figure(result: SeparationResult) -> Figure:
    with new_figure(2, 2, width=8.0, height=4.6, sharex=True) as (figure, grid):
        places = dict.fromkeys((t.load, t.profile) for t in result.traces)
        for axes, (load, shape) in zip(grid.flat, places, strict=False):
            for trace in result.traces:
                if (trace.load, trace.profile) == (load, shape):
                    colour = COLOURS["red" if trace.gap else "grey"]
                    label = "gap 0.5 mm" if trace.gap else "healthy"
                    axes.plot(1e3 * trace.time, trace.force, lw=1, color=colour, label=label)
            axes.set_title(f"{shape}, {load:.0f} N", fontsize=9)
        for axes in grid[-1]:
            axes.set_xlabel("Time [ms]")
        for axes in grid[:, 0]:
            axes.set_ylabel("Load cell [N]")
        grid.flat[0].legend(fontsize=8)
    return figure


def _population(report: Report) -> None:
    rows = [[row["property"], row["deviation"], row["reason"]] for row in spread_rows()]
    report.section(
        "Healthy population",
        "Nothing of it is printed: every spread is ASSUMED. Deviations are in SI units or shares "
        "of the actuator file's value; all groups, healthy and faulty, are drawn from it.",
    ).table(ReportTable(["Property", "Deviation", "Why this much"], rows))


def _rows_table(result: SeparationResult) -> ReportTable:
    columns = ["Fault", "Profile", "Load [N]", "Feature", "Unit", "Healthy", "Faulty", "Effect",
               "from", "to", "Half severity", "Best"]  # fmt: skip
    rows = [
        [row.fault, row.profile, row.load, row.feature, row.unit, row.healthy, row.faulty,
         row.effect.size, row.effect.low, row.effect.high,
         None if row.half is None else row.half.size, "yes" if row.winner else ""]
        for row in result.rows
    ]  # fmt: skip
    two = "+.2f"
    return ReportTable(
        columns, rows, "Every fault, load and profile.", digits=4,
        formats=("", "", ".0f", "", "", "", "", two, two, two, two, ""),
    )  # fmt: skip
