"""The report of a comparison of the two fidelities."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.report import Report, Table
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.provenance import provenance

if TYPE_CHECKING:
    from elevon.compare import Comparison

__all__ = ["compare_report"]


def compare_report(found: Comparison, actuator: str, *, date: str | None = None) -> Report:
    """Return the report of a comparison of an actuator named as on the command line."""
    values = found.to_dict()
    report = Report(
        f"High and low fidelity of {values['actuator']}",
        f"Both models on one scenario, after {found.start:g} s, through one filter: "
        f"{values['filter']}.",
        date=date,
    )
    report.fact("Position", f"{100 * found.position_nrmse:.3f} %", "RMS error over amplitude")
    report.fact("Speed", f"{100 * found.speed_nrmse:.2f} %", "RMS error over RMS")
    report.fact("Torque current", f"{100 * found.q_current_nrmse:.2f} %", "RMS error over RMS")
    report.fact("Speed-up", f"{found.speed_up:.0f}", f"low at {values['low_realtime_factor']:.0f} "
                "times real time")  # fmt: skip
    _draw(report, found)
    shown = [[name, value] for name, value in values.items() if isinstance(value, float)]
    report.section("Numbers").table(Table(["Quantity", "Value"], shown))
    report.provenance(
        provenance(
            f"elevon compare {actuator} --out DIR",
            **{"Parameter hash": values["parameter_hash"], "Seed": values["seed"]},
            Faults=", ".join(values["faults"]) or "none",
        )
    )
    return report


_SHOWN = {"rad": ("deg", 180.0 / np.pi), "m": ("mm", 1e3), "rad/s": ("rpm", 30.0 / np.pi)}
_NAMES = {"position": "Output position", "speed": "Motor speed", "q_current": "Torque current"}


def _panel(found: Comparison, part: str) -> tuple[str, str, float]:
    """Signal, label and scale of one panel."""
    name = found.signals[part]
    unit = found.recordings[0][name].unit
    shown, scale = _SHOWN.get(unit, (unit, 1.0))
    return name, f"{_NAMES[part]} [{shown}]", scale


def _draw(report: Report, found: Comparison) -> None:
    section = report.section("Side by side")
    panels = [_panel(found, part) for part in found.signals]
    for name, label, scale in panels:
        ratios = {"height_ratios": [3, 1]}
        with new_figure(2, 1, width=8.0, height=3.8, sharex=True, **ratios) as (figure, axes):
            high, low = scale * found.high[name], scale * found.low[name]
            axes[0].plot(found.time, high, color=COLOURS["blue"], lw=2.2, label="high")
            axes[0].plot(found.time, low, "--", color=COLOURS["orange"], lw=1.4, label="low")
            axes[0].set_ylabel(label)
            axes[0].legend(loc="upper right", ncols=2)
            axes[1].plot(found.time, low - high, color=COLOURS["grey"], lw=1.0)
            axes[1].set(xlabel="Time [s]", ylabel="low - high")
        section.figure(figure, f"{label}, high and low, and their difference.")
