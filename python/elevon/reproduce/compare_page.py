"""The report of a comparison of the two fidelities."""

from __future__ import annotations

import numpy as np

from elevon.compare import Comparison
from elevon.report import Report, ReportTable
from elevon.report.document import Section
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.provenance import provenance


def compare_report(comparison: Comparison, actuator: str, *, date: str | None = None) -> Report:
    """Return the report of a comparison of an actuator named as on the command line."""
    values = comparison.to_dict()
    report = Report(
        f"High and low fidelity of {values['actuator']}",
        f"Both models on one scenario, after {comparison.start:g} s, through one filter: "
        f"{values['filter']}.",
        date=date,
    )
    report.fact("Position", f"{100 * comparison.position_nrmse:.3f} %", "RMS error over amplitude")
    report.fact("Speed", f"{100 * comparison.speed_nrmse:.2f} %", "RMS error over RMS")
    report.fact("Torque current", f"{100 * comparison.q_current_nrmse:.2f} %", "RMS error over RMS")
    speed = f"low at {values['low_realtime_factor']:.0f} times real time"
    report.fact("Speed-up", f"{comparison.speed_up:.0f}", speed)
    draw_comparison(report.section("Side by side"), comparison)
    numbers = [[name, value] for name, value in values.items() if isinstance(value, float)]
    report.section("Numbers").table(ReportTable(["Quantity", "Value"], numbers))
    report.provenance(
        provenance(
            f"elevon compare {actuator} --out DIR",
            **{"Parameter hash": values["parameter_hash"], "Seed": values["seed"]},
            Faults=", ".join(values["faults"]) or "none",
        )
    )
    return report


_DISPLAYED = {"rad": ("deg", 180.0 / np.pi), "m": ("mm", 1e3), "rad/s": ("rpm", 30.0 / np.pi)}
_NAMES = {"position": "Output position", "speed": "Motor speed", "q_current": "Torque current"}


def _panel(comparison: Comparison, part: str) -> tuple[str, str, float]:
    """Signal, label and scale of one panel."""
    name = comparison.signals[part]
    unit = {"position": comparison.unit, "speed": "rad/s", "q_current": "A"}[part]
    text, scale = _DISPLAYED.get(unit, (unit, 1.0))
    return name, f"{_NAMES[part]} [{text}]", scale


def draw_comparison(section: Section, comparison: Comparison) -> None:
    """Draw each signal of both models, and their difference."""
    panels = [_panel(comparison, part) for part in comparison.signals]
    for name, label, scale in panels:
        ratios = {"height_ratios": [3, 1]}
        with new_figure(2, 1, width=8.0, height=3.8, sharex=True, **ratios) as (figure, axes):
            high, low = scale * comparison.high[name], scale * comparison.low[name]
            axes[0].plot(comparison.time, high, color=COLOURS["blue"], lw=2.2, label="high")
            axes[0].plot(comparison.time, low, "--", color=COLOURS["orange"], lw=1.4, label="low")
            axes[0].set_ylabel(label)
            axes[0].legend(loc="upper right", ncols=2)
            axes[1].plot(comparison.time, low - high, color=COLOURS["grey"], lw=1.0)
            axes[1].set(xlabel="Time [s]", ylabel="low - high")
        section.figure(figure, f"{label}, high and low, and their difference.")
