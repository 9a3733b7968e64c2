"""The report of commutation, modulation and the shorted motor."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.actuator import Actuator
from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.pisa_currents import WINDOW, CommutationResult, electrical
from elevon.reproduce.pisa_gear import ACTUATOR
from elevon.reproduce.provenance import closed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_LEGS = {"a": COLOURS["blue"], "b": COLOURS["orange"], "c": COLOURS["grey"]}
_TURN = 360.0
_CARRIERS = 6  # periods of the carrier in the figure of the modulation


def commutation_report(result: CommutationResult, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce pisa-commutation`."""
    report = Report(
        "Commutation, modulation and shorted motor of the Pisa landing gear",
        "The thesis's Figs. 2.6 to 2.8 and 5.4 from the switching model: a retraction recorded "
        "faster than its carrier, and the phase currents of the nominal extension.",
        date=date,
    )
    section = report.section("As Figs. 2.6 and 2.7: commutation")
    section.figure(_commutation(result), "One electrical turn: Hall sensors and phase currents.")
    section.table(
        ReportTable(
            ["From [deg]", "Hall a b c", "High", "Low", "Other codes [%]", "Duty [%]", "On [%]"],
            [[r.begin_deg, r.hall, r.high, r.low, r.wrong_percent, r.duty_percent, r.on_percent]
             for r in result.rows],
            "Retraction: the demand is negative. Duty and on-time in the second half of a sector.",
            formats=[".0f", "", "", "", ".3f", ".2f", ".2f"],
        )
    )  # fmt: skip
    report.section("As Fig. 2.8: modulation").figure(
        _modulation(result), "Voltage between the conducting legs over some carrier periods."
    )
    report.section("As Fig. 5.4: the shorted motor").figure(
        _shorted(result),
        f"Phase currents of the nominal extension; {len(result.pulses)} stretches of shorted "
        "windings, the longest in the lower panel.",
    )
    return closed(report, result.checks, "pisa-commutation")


def _commutation(result: CommutationResult) -> Figure:
    run = result.window
    poles = Actuator.load(ACTUATOR).parameters.value("motor.pole_pairs")
    turned = np.degrees(poles * np.abs(run["motor_position"].values))
    first = int(np.searchsorted(run.clock().time, WINDOW[0]))
    part = slice(first, int(np.searchsorted(run.clock().time, WINDOW[1])))
    degrees, _, _ = electrical(run, poles)
    way = np.abs(turned[part] - turned[first])
    inside = np.flatnonzero(way < _TURN) + first
    at = degrees[inside]
    order = np.argsort(at)
    with new_figure(width=8.0, height=5.0, rows=2, sharex=True) as (figure, axes):
        for number, (leg, colour) in enumerate(_LEGS.items()):
            hall = run[f"hall_{leg}"].values[inside][order]
            axes[0].plot(at[order], 0.8 * hall - number, color=colour, drawstyle="steps-post")
            axes[1].plot(at[order], run[f"current_{leg}"].values[inside][order], color=colour,
                         label=leg)  # fmt: skip
        axes[0].set_yticks([0.4, -0.6, -1.6], ["Hall a", "Hall b", "Hall c"])
        axes[1].set(xlabel="Electrical angle [deg]", ylabel="Current [A]", xlim=(0.0, 360.0))
        axes[1].set_xticks(range(30, 360, 60))
        axes[1].legend(loc="upper right", ncols=3)
    return figure


def _modulation(result: CommutationResult) -> Figure:
    run = result.window
    period = Actuator.load(ACTUATOR).parameters.value("inverter.switching_period")
    time = run.clock().time
    inside = (time > WINDOW[0]) & (time < WINDOW[0] + _CARRIERS * period)
    axis = 1e3 * (time[inside] - WINDOW[0])
    with new_figure(width=8.0, height=3.2) as (figure, axes):
        for leg, colour in _LEGS.items():
            axes.plot(axis, run[f"voltage_{leg}"].values[inside], color=colour, lw=1.0,
                      label=f"phase {leg}")  # fmt: skip
        demand = run["duty"].values[inside] * run["supply_voltage"].values[inside]
        axes.plot(axis, demand, "k--", lw=1.0, label="demand")
        axes.set(xlabel="Time [ms]", ylabel="Voltage [V]")
        axes.legend(loc="upper right", ncols=4)
    return figure


def _shorted(result: CommutationResult) -> Figure:
    run, time = result.extension, result.extension.clock().time
    longest = max(result.pulses, key=lambda pulse: pulse.length, default=None)
    middle = 0.0 if longest is None else longest.time
    close = (time > middle - 0.003) & (time < middle + 0.006)
    with new_figure(width=8.0, height=5.0, rows=2) as (figure, axes):
        for leg, colour in _LEGS.items():
            values = run[f"current_{leg}"].values
            axes[0].plot(time[::4], values[::4], color=colour, lw=0.6)
            axes[1].plot(1e3 * (time[close] - middle), values[close], color=colour, label=leg)
        axes[0].set(xlabel="Time [s]", ylabel="Current [A]")
        axes[1].set(xlabel="Time from the short [ms]", ylabel="Current [A]")
        axes[1].legend(loc="upper right", ncols=3)
    return figure
