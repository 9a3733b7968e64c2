"""The report of the dropped weights: each drop, the estimates, model against bench, the springs."""

from __future__ import annotations

import numpy as np

from elevon.bench.spring import STANDARD_WIRES, SpringTask, design_spring
from elevon.report import Report, ReportTable
from elevon.report.document import Section
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.provenance import closed
from elevon.reproduce.torino_bench.drops import DAMPING, MASSES, DropsResult, DropTrace


def drops_page(result: DropsResult, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce torino-drops`."""
    report = Report(
        "From dropped weights to a model of the transmission",
        "Ten weights, four drops each, on the virtual bench with hidden stiffness and damping. The "
        "thesis tunes both by hand and prints 68.23, then 43, and 5.5, then 7.5, in units that do "
        "not fit: nothing here can be held against them.",
        date=date,
    )
    _estimates(report, result)
    section = report.section("Each weight", "Motor and encoder about the drop, bench and model.")
    for number, drop in enumerate(result.traces, 1):
        _drop(section, drop, f"{drop.mass:g} kg (thesis, Figure 5.{number})")
    section = report.section("Series block against the bench")
    _drop(section, result.traces[-1], "Heaviest weight (Figures 6.1, 6.2)", rigid=True)
    _springs(report)
    return closed(
        report, result.checks, f"torino-drops --seed {result.seed}", result.parameter_hash
    )


def _estimates(report: Report, result: DropsResult) -> None:
    low, high = result.stiffness_interval
    span = f"{low:.5g} to {high:.5g}"
    rows: list[list[object]] = [
        ["stiffness [N m/rad]", result.hidden_stiffness, result.stiffness, span],
        ["damping [N m s/rad]", result.hidden_damping, result.damping, ""],
    ]
    section = report.section("Stiffness and damping")
    section.table(ReportTable(["Value", "Hidden", "Recovered", "Interval"], rows))
    with new_figure(1, 2, width=8.0, height=3.0) as (figure, axes):
        torque = [row.torque_nm for row in result.rows]
        axes[0].plot([row.loss_deg for row in result.rows], torque, "o", ms=3,
                     color=COLOURS["blue"])  # fmt: skip
        axes[0].set(xlabel="Angle lost [deg]", ylabel="Torque at the output [N m]")
        tried, error = np.transpose(result.misfits)
        axes[1].semilogx(tried, error, "o-", ms=3, color=COLOURS["orange"])
        axes[1].set(xlabel=f"{DAMPING} [N m s/rad]", ylabel="Squared error [deg2]")
    section.figure(figure, f"Angle lost over load, {len(MASSES)} weights; error over the damping.")


def _drop(section: Section, drop: DropTrace, caption: str, *, rigid: bool = False) -> None:
    with new_figure(1, 2, width=8.0, height=2.4) as (figure, axes):
        for axis, place, name in zip(axes, (0, 1), ("Motor", "Encoder"), strict=True):
            axis.plot(drop.time, drop.bench[place], color=COLOURS["grey"], lw=2.6, label="bench")
            axis.plot(drop.time, drop.model[place], color=COLOURS["orange"], lw=1, label="model")
            if rigid:
                axis.plot(drop.time, drop.rigid[place], color=COLOURS["blue"], lw=0.8,
                          label="rigid")  # fmt: skip
            axis.set(xlabel="Time [s]", ylabel=f"{name} [deg]")
        axes[0].legend(loc="best")
    section.figure(figure, caption)


def _springs(report: Report) -> None:
    """Draw mean diameter and number of coils of the load module's springs over the wire."""
    task = SpringTask()
    wires = np.array([wire for wire in STANDARD_WIRES if 2e-3 <= wire <= 4e-3])
    largest = np.array([task.largest_coil(float(wire)) for wire in wires])
    coils = [design_spring(task, wire=float(wire)).coils for wire in wires]
    section = report.section("Springs of the load module")
    with new_figure(1, 2, width=8.0, height=2.8) as (figure, axes):
        axes[0].plot(1e3 * wires, 1e3 * largest, "o-", ms=3, color=COLOURS["blue"])
        axes[0].plot([3.0], [34.0], "s", color=COLOURS["orange"])
        axes[0].set(xlabel="Wire [mm]", ylabel="Largest mean diameter [mm]")
        axes[1].plot(1e3 * wires, coils, "o-", ms=3, color=COLOURS["blue"])
        axes[1].plot([3.0], [342.0], "s", color=COLOURS["orange"])
        axes[1].set(xlabel="Wire [mm]", ylabel="Coils at 34 mm")
    section.figure(figure, "Diameter that the stress allows, and coils (thesis, Figures 4.3, 4.4); "
                   "the printed choice is marked.")  # fmt: skip
