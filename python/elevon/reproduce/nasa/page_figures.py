"""The report of figures 18 and 19 and of the ways to seed a winding short."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.nasa.figures import LEVELS, SPEEDS, ZOOM, FaultFigure, FaultFiguresResult
from elevon.reproduce.provenance import closed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_THIN = 10  # of the samples of a whole run: the zoom has them all


def faults_report(result: FaultFiguresResult, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce nasa-faults`."""
    report = Report(
        "Dynamic eccentricity and winding shorts of the ballscrew actuator",
        "The paper's Figs. 18 and 19 with their printed levels, each beside the healthy unit, and "
        "true shorts beside resistors to the centre tap at its five levels over speed.",
        date=date,
    )
    for item in result.figures:
        section = report.section(f"As Fig. {item.figure}: {item.fault}")
        caption = (
            f"The tracking error moves by {item.tracking_percent:.2g} % of the amplitude, the RMS "
            f"of the torque current by {item.torque_current_percent:.2g} %."
        )
        section.figure(_panels(item), caption)
    section = report.section("Seeding a winding short")
    section.figure(_seeding(result), "Current that the fault adds to the leg of phase 1, RMS.")
    section.text(
        "At a fixed applied voltage: a resistor draws V/R at any speed, shorted turns let through "
        "what the EMF leaves of the voltage. Under the drive's control the voltage follows the "
        "speed itself, so no closed-loop run shows this."
    )
    section.table(
        ReportTable(
            ["Level", "Resistor [ohm]", "Speed [rad/s]", "Shorted turns [A]", "Resistor [A]"],
            [[r.level, r.resistance_ohm, r.speed_rad_s, r.turns_a, r.resistor_a]
             for r in result.rows],
            formats=[".4g", ".0f", ".0f", ".3f", ".3f"],
        )
    )  # fmt: skip
    return closed(report, result.checks, "nasa-faults", result.parameter_hash)


def _panels(item: FaultFigure) -> Figure:
    """The paper's four panels: position, load, current of phase 1, a part of it."""
    inside = (item.time > ZOOM[0]) & (item.time < ZOOM[1])
    with new_figure(width=8.0, height=5.4, rows=2, columns=2) as (figure, axes):
        (position, load), (current, zoom) = axes
        position.plot(item.time[::_THIN], 1e3 * item.position[::_THIN], color=COLOURS["blue"])
        position.set(ylabel="Position [mm]")
        load.plot(item.time[::_THIN], item.load[::_THIN], color=COLOURS["blue"])
        load.set(ylabel="Load [N]")
        for axis, at in ((current, slice(None, None, _THIN)), (zoom, inside)):
            axis.plot(item.time[at], item.healthy[at], color=COLOURS["grey"], lw=1.5,
                      label="baseline")  # fmt: skip
            axis.plot(item.time[at], item.faulty[at], color=COLOURS["orange"], lw=0.8,
                      label="fault")  # fmt: skip
            axis.set(xlabel="Time [s]", ylabel="Phase 1 [A]")
        zoom.legend(loc="upper right")
    return figure


def _seeding(result: FaultFiguresResult) -> Figure:
    with new_figure(width=8.0, height=3.2, columns=2) as (figure, axes):
        for axis, name, title in zip(
            axes, ("turns_a", "resistor_a"), ("shorted turns", "resistor"), strict=True
        ):
            for level in LEVELS:
                values = [getattr(r, name) for r in result.rows if r.level == level]
                axis.plot(SPEEDS, values, "o-", ms=3, label=f"{100 * level:.4g} %")
            axis.set(xlabel="Motor [rad/s]", title=title, ylim=(0, None))
        axes[0].set(ylabel="Added current [A]")
        axes[0].legend()
    return figure
