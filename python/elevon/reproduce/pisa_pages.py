"""Reports of the Pisa landing gear: functional runs, friction tests, hydraulic comparison."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.report import Report, Table
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.pisa_functional import FunctionalResult, FunctionalRow
from elevon.reproduce.provenance import provenance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.reproduce.hydraulic import HydraulicResult
    from elevon.reproduce.pisa_friction import FrictionResult

__all__ = ["friction_report", "functional_report", "hydraulic_report"]

_PALETTE = tuple(COLOURS.values())


def functional_report(result: FunctionalResult, *, date: str | None = None) -> Report:
    """Return the report of the functional runs."""
    met = sum(row.passed is True for row in result.rows)
    asked = sum(row.passed is not None for row in result.rows)
    report = Report(
        "Functional runs of the Pisa landing gear",
        f"Extension and retraction in six conditions, {result.fidelity} fidelity. The cycle, one "
        f"stroke in each direction, meets its requirement in {met} of {asked} conditions; the "
        "limit condition has none.",
        date=date,
    )
    columns = ["Condition", "Load factor", "Supply [V]", "Extension [s]", "Retraction [s]",
               "Cycle [s]", "Required [s]", "Peak current [A]", "Peak speed [rad/s]"]  # fmt: skip
    rows = [
        [
            row.condition.name,
            row.condition.load_factor,
            row.condition.supply,
            row.extension_s,
            row.retraction_s,
            row.cycle_s,
            row.condition.requirement,
            row.peak_current_a,
            row.peak_speed_rad_s,
        ]
        for row in result.rows
    ]
    formats = ["", ".1f", ".1f", ".2f", ".2f", ".2f", ".0f", ".1f", ".0f"]
    section = report.section("Times, currents and speeds")
    section.table(Table(columns, rows, "From the command to the end switch.", formats=formats))
    section.text(
        "In extension the leg drives the actuator: the current stays near zero and the motor runs "
        "ahead of its command until the demand has crossed zero. At 14 V the supply cannot reach "
        "the EMF of the high speed: retraction saturates, extension is braked by the diodes."
    )
    for row in result.rows:
        title = f"{row.condition.name}: {row.condition.load_factor:g} g, {row.condition.supply:g} V"
        part = report.section(title[0].upper() + title[1:])
        part.figure(_stroke_figure(row), f"Position, motor speed and line current, {title}.")
    report.section("Checks").checks(result.checks)
    report.provenance(
        provenance("elevon reproduce pisa-functional --out DIR", **_run_facts(result))
    )
    return report


def _run_facts(result: FunctionalResult) -> dict[str, Any]:
    values = result.to_dict()
    return {"Seed": values["seed"], "Core": values["version"], "Fidelity": result.fidelity}


def _stroke_figure(row: FunctionalRow) -> Figure:
    with new_figure(width=8.0, height=5.6, rows=3) as (figure, axes):
        for run, name, colour in (
            (row.extension, "extension", COLOURS["blue"]),
            (row.retraction, "retraction", COLOURS["orange"]),
        ):
            shown = slice(None, None, 5)
            time = run["user_position"].time[shown]
            axes[0].plot(time, 1e3 * run["user_position"].values[shown], color=colour, label=name)
            axes[1].plot(time, run["motor_speed"].values[shown], color=colour)
            axes[1].plot(time, run["speed_ref"].values[shown], ":", color=colour, lw=1.0)
            axes[2].plot(time, run["current_mean"].values[shown], color=colour)
        axes[0].set(ylabel="Ram [mm]")
        axes[0].legend(loc="center right")
        axes[1].set(ylabel="Motor [rad/s]")
        axes[2].set(ylabel="Current [A]", xlabel="Time [s]")
    return figure


def friction_report(result: FrictionResult, *, date: str | None = None) -> Report:
    """Return the report of the friction tests."""
    report = Report(
        "Friction tests of the Pisa landing gear",
        "Free fall and modified free fall on the virtual rig at 1 to 10 mm/s in both directions, "
        "and loaded retractions. Weight, friction, harmonics and efficiency are recovered from the "
        "logs alone.",
        date=date,
    )
    section = report.section("Put in and recovered")
    section.figure(_friction_figure(result), "Mean friction and the amplitudes of the harmonics.")
    section.figure(_efficiency_figure(result), "Efficiency of the screw over its load.")
    columns = ["Quantity", "Direction", "Speed [mm/s]", "Load [N]", "Put in", "Recovered", "Unit"]
    rows = [
        [r.quantity, r.direction, r.speed_mm_s, r.load_n, r.put_in, r.recovered, r.unit]
        for r in result.rows
    ]
    section.table(Table(columns, rows, "Every quantity at every speed or load.", digits=4))
    report.section("Checks").checks(result.checks)
    report.provenance(provenance("elevon reproduce pisa-friction --out DIR", Seed=result.seed))
    return report


def _friction_figure(result: FrictionResult) -> Figure:
    with new_figure(width=8.0, height=5.0, rows=2) as (figure, axes):
        kinds = ["friction_ffm", "friction_ff"]
        for colour, kind in zip(_PALETTE, kinds, strict=False):
            _both(axes[0], result, kind, colour, kind.removeprefix("friction_").upper())
        for colour, order in zip(_PALETTE, range(1, 6), strict=False):
            _both(axes[1], result, f"harmonic_{order}", colour, f"harmonic {order}")
        axes[0].set(ylabel="Mean friction [N]", ylim=(0, None))
        axes[1].set(ylabel="Amplitude [N]", xlabel="Ram speed [mm/s]", ylim=(0, None))
        for one in axes:
            one.legend(ncols=3)
    return figure


def _both(axes: Any, result: FrictionResult, kind: str, colour: str, label: str) -> None:
    rows = [row for row in result.rows if row.quantity == kind]
    put = sorted((row.speed_mm_s, row.put_in) for row in rows if row.speed_mm_s is not None)
    axes.plot(*np.array(put).T, color=colour, label=label)
    axes.plot(
        [row.speed_mm_s for row in rows],
        [row.recovered for row in rows],
        "x",
        color=colour,
    )


def _efficiency_figure(result: FrictionResult) -> Figure:
    rows = [row for row in result.rows if row.quantity == "efficiency"]
    load = [row.load_n for row in rows]
    with new_figure(width=8.0, height=3.0) as (figure, axes):
        axes.plot(load, [row.put_in for row in rows], color=COLOURS["blue"], label="put in")
        axes.plot(
            load, [row.recovered for row in rows], "x", color=COLOURS["orange"], label="recovered"
        )
        axes.set(xlabel="Load [N]", ylabel="Efficiency of the screw", ylim=(0.5, 0.8))
        axes.legend()
    return figure


def hydraulic_report(result: HydraulicResult, *, date: str | None = None) -> Report:
    """Return the report of the hydraulic comparison."""
    report = Report(
        "Open-loop hydraulics and controlled speed",
        "Speed of the ram in mid-stroke over load and temperature: a hydraulic cylinder behind a "
        "restrictor, and the electromechanical actuator under its speed control.",
        date=date,
    )
    columns = ["Temperature [C]", "Load factor", "Direction", "Hydraulic [mm/s]",
               "Electromechanical [mm/s]"]  # fmt: skip
    rows = [
        [r.temperature_c, r.nz, r.direction, r.hydraulic_mm_s, r.electric_mm_s] for r in result.rows
    ]
    section = report.section("Speeds")
    section.figure(_hydraulic_figure(result), "Speed over load factor, one line a temperature.")
    formats = [".0f", ".1f", "", ".1f", ".1f"]
    section.table(
        Table(columns, rows, "Extension aids the load, retraction lifts it.", formats=formats)
    )
    report.section("Checks").checks(result.checks)
    report.provenance(provenance("elevon reproduce pisa-hydraulic --out DIR"))
    return report


def _hydraulic_figure(result: HydraulicResult) -> Figure:
    with new_figure(width=8.0, height=3.6, columns=2) as (figure, axes):
        for one, direction in zip(axes, ("extension", "retraction"), strict=True):
            for colour, temperature in zip(_PALETTE, result.temperatures, strict=False):
                rows = [
                    r
                    for r in result.rows
                    if r.direction == direction and r.temperature_c == temperature
                ]
                factors = [r.nz for r in rows]
                one.plot(factors, [r.hydraulic_mm_s for r in rows], "o-", ms=3, color=colour,
                         label=f"hydraulic, {temperature:g} C")  # fmt: skip
                one.plot(factors, [r.electric_mm_s for r in rows], "x--", color=colour)
            one.set(xlabel="Load factor", title=direction, ylim=(0, None))
        axes[0].set(ylabel="Ram speed [mm/s]")
        axes[0].plot([], [], "x--", color=COLOURS["grey"], label="electromechanical, 28 V")
        axes[0].legend()
    return figure
