"""Reports of the Pisa landing gear: functional runs and hydraulic comparison."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.recording.states import code_names
from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.pisa_functional import FunctionalResult, FunctionalRow
from elevon.reproduce.pisa_gear import COMMANDED
from elevon.reproduce.provenance import closed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.reproduce.hydraulic import HydraulicResult

_PALETTE = tuple(COLOURS.values())


def functional_report(result: FunctionalResult, *, date: str | None = None) -> Report:
    """Return the report of the functional runs."""
    met = sum(row.passed is True for row in result.rows)
    judged = sum(row.passed is not None for row in result.rows)
    report = Report(
        "Functional runs of the Pisa landing gear",
        f"Extension and retraction in {len(result.rows)} conditions, {result.fidelity} fidelity. "
        f"The cycle, one stroke in each direction, meets its requirement in {met} of {judged} "
        "conditions; the limit condition has none.",
        date=date,
    )
    columns = ["Condition", "Load factor", "Supply [V]", "Extension [s]", "Retraction [s]",
               "Cycle [s]", "Required [s]", "Peak current [A]", "Peak speed [rad/s]",
               "Extension, high, low [rad/s]", "Retraction, high, low [rad/s]"]  # fmt: skip
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
            *(_speeds(row, stroke) for stroke in ("extension", "retraction")),
        ]
        for row in result.rows
    ]
    formats = ["", ".1f", ".1f", ".2f", ".2f", ".2f", ".0f", ".1f", ".0f", "", ""]
    section = report.section("Times, currents and speeds")
    section.table(
        ReportTable(columns, rows, "From the command to the end switch.", formats=formats)
    )
    section.text(
        "In extension the leg drives the actuator: the current stays near zero, and below a demand "
        "of 0.8 V the software brake shorts the windings, which holds the overrun. At 14 V the "
        "supply cannot reach the EMF of the high speed: retraction saturates."
    )
    section.text(
        "P asks for a constant speed: 590.6 rad/s over three quarters of the stroke, 280.3 rad/s "
        "over the last. The mean speeds of both parts stand beside it. In the critical condition P "
        "doubles the cycle and the set points are not held to it: at 20.5 V the retraction's high "
        "speed is what the supply gives."
    )
    for row in result.rows:
        title = f"{row.condition.name}: {row.condition.load_factor:g} g, {row.condition.supply:g} V"
        part = report.section(title[0].upper() + title[1:])
        part.figure(
            _stroke_figure(row), f"Position, speeds, current and state over the stroke, {title}."
        )
        part.figure(_load_figure(row), f"Load on the ram over the stroke, {title}.")
    return closed(report, result.checks, "pisa-functional", **_run_facts(result))


def _speeds(row: FunctionalRow, stroke: str) -> str:
    return ", ".join(f"{row.speeds_rad_s[f'{stroke}_{part}']:.0f}" for part in ("high", "low"))


def _run_facts(result: FunctionalResult) -> dict[str, Any]:
    values = result.to_dict()
    return {"Seed": values["seed"], "Core": values["version"], "Fidelity": result.fidelity}


def _stroke_figure(row: FunctionalRow) -> Figure:
    states = code_names("landing_gear", "state")
    longest = max(row.extension_s, row.retraction_s)
    with new_figure(width=8.0, height=7.6, rows=4, sharex=True) as (figure, axes):
        for run, name, colour in (
            (row.extension, "extension", COLOURS["blue"]),
            (row.retraction, "retraction", COLOURS["orange"]),
        ):
            time = run["output_position"].time - COMMANDED
            thin = np.flatnonzero((time >= 0.0) & (time <= longest + 0.4))[::5]
            time = time[thin]
            axes[0].plot(time, 1e3 * run["output_position"].values[thin], color=colour, label=name)
            axes[1].plot(time, run["motor_speed"].values[thin], color=colour)
            axes[1].plot(time, run["speed_ref"].values[thin], ":", color=colour, lw=1.0)
            axes[2].plot(time, run["current_mean"].values[thin], color=colour)
            axes[3].step(time, run["state"].values[thin], color=colour, where="post")
        axes[0].set(ylabel="Ram [mm]")
        axes[0].legend(loc="center right")
        axes[1].set(ylabel="Motor [rad/s],\nreference dotted")
        axes[2].set(ylabel="Current [A]")
        axes[3].set_yticks(range(4), [states[code] for code in range(4)])
        axes[3].set(ylabel="State", xlabel="Time from the command [s]", xlim=(0.0, longest + 0.4))
    return figure


def _load_figure(row: FunctionalRow) -> Figure:
    with new_figure(width=8.0, height=2.6) as (figure, axes):
        for run, name, colour, line in (
            (row.extension, "extension", COLOURS["blue"], "-"),
            (row.retraction, "retraction", COLOURS["orange"], "--"),
        ):
            ram, load = run["output_position"].values, run["load_force"].values
            # Beyond the stroke the housing or the lock carries the load.
            moving = (ram > 1e-4) & (ram < ram.max() - 1e-4)
            axes.plot(1e3 * ram[moving][::5], load[moving][::5], line, color=colour, label=name)
        axes.set(xlabel="Ram [mm]", ylabel="Load [N]", ylim=(0, None))
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
               "Electromechanical [mm/s]", "Winding alone [mm/s]", "Current [A]",
               "Winding alone [A]"]  # fmt: skip
    rows = [
        [
            r.temperature_c,
            r.nz,
            r.direction,
            r.hydraulic_mm_s,
            r.electric_mm_s,
            r.electric_winding_mm_s,
            r.electric_a,
            r.electric_winding_a,
        ]
        for r in result.rows
    ]
    section = report.section("Speeds")
    section.figure(_hydraulic_figure(result), "Speed over load factor, one line a temperature.")
    section.text(
        "Temperature reaches the oil, and in the electromechanical actuator the winding, the "
        "friction tables and the efficiencies (curves ASSUMED, set pisa-landing-gear). With the "
        "winding alone cold would help the motor, and the small spread would be so by construction."
    )
    formats = [".0f", ".1f", "", ".1f", ".1f", ".1f", ".1f", ".1f"]
    section.table(
        ReportTable(columns, rows, "Extension aids the load, retraction lifts it.", formats=formats)
    )
    return closed(report, result.checks, "pisa-hydraulic")


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
