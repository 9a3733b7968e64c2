"""The report of the flyable stand's flight."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.nasa.flight import FAULT, SWITCH, FlightResult
from elevon.reproduce.provenance import closed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_THIN = 5
_PANELS = (
    ("command", 1e3, "Command [mm]"),
    ("load", 1.0, "Force [N]"),
    ("torque_current", 1.0, "Current [A]"),
    ("surface_temperature", 1.0, "Housing [K]"),
)


def flight_report(result: FlightResult, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce nasa-flight`."""
    report = Report(
        "The flyable stand: nominal and faulty actuator in one flight",
        "The paper plans a stand with a nominal, a faulty and a load actuator, the load switched "
        "between the two in flight. It prints no flight: this one is synthetic, and so are load "
        f"factor, vibration and the fault ({FAULT}).",
        date=date,
    )
    report.section("The flight").figure(
        _figure(result), f"Both actuators; the load changes over every {SWITCH:g} s."
    )
    report.section("Stretches").table(
        ReportTable(
            ["Actuator", "From [s]", "Force RMS [N]", "Current RMS [A]", "Tracking RMS [mm]",
             "Current a force [A/kN]"],
            [[r.unit, r.begin_s, r.load_n, r.current_a, r.tracking_mm, r.current_per_load_a]
             for r in result.rows],
            "Of whoever bears the load.",
            formats=["", ".0f", ".0f", ".3f", ".3f", ".4f"],
        )
    )  # fmt: skip
    return closed(report, result.checks, "nasa-flight")


def _figure(result: FlightResult) -> Figure:
    with new_figure(width=8.0, height=7.0, rows=len(_PANELS), sharex=True) as (figure, axes):
        for item, colour in zip(result.logs, (COLOURS["blue"], COLOURS["orange"]), strict=True):
            for axis, (role, scale, label) in zip(axes, _PANELS, strict=True):
                channel = item.log.role(role)
                axis.plot(channel.time[::_THIN], scale * channel.values[::_THIN], color=colour,
                          lw=0.8, label=item.unit)  # fmt: skip
                axis.set_ylabel(label)
        axes[0].legend(loc="upper right", ncols=2)
        axes[-1].set_xlabel("Time [s]")
    return figure
