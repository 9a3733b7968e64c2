"""The gallery of fault signatures as a page."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.units import display_unit, format_quantity, to_display

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.reproduce.signatures import Signature, SignaturesResult


def signatures_page(result: SignaturesResult, date: str | None = None) -> Report:
    """Return the page: for each actuator a map of what changes, then fault by fault."""
    report = Report("What each fault looks like", date=date)
    report.lead = (
        f"{len(result.signatures)} faults, each beside the healthy unit of the same run: high "
        "fidelity, carrier-PWM drive where there is one, one place a kind, from a quarter of "
        "the run on. The severities are chosen to be plainly visible."
    )
    names = list(dict.fromkeys(item.actuator for item in result.signatures))
    for name in names:
        mine = [item for item in result.signatures if item.actuator == name]
        section = report.section(name)
        section.figure(
            _map(mine),
            "Rms difference from the healthy run over the healthy signal's spread (logarithmic): "
            "the brighter, the plainer.",
        )
        for item in mine:
            section.heading(f"{item.kind}@{item.place}")
            section.figure(_pair(item), _caption(item))
    section = report.section("All of them")
    section.checks(result.checks)
    rows = [list(item.to_dict().values()) for item in result.signatures]
    section.table(ReportTable(list(result.signatures[0].to_dict()), rows, digits=3))
    return report


def _caption(item: Signature) -> str:
    unit = "%" if item.unit == "1" else display_unit(item.unit)
    severity = format_quantity(item.severity, unit, 3)
    others = f"; also at {', '.join(item.places[1:])}" if len(item.places) > 1 else ""
    return f"{severity}: {item.effect}{others}. Run: {item.status}."


def _map(items: list[Signature]) -> Figure:
    signals = list(items[0].changes)
    values = np.array([[max(item.changes[name], 1e-6) for name in signals] for item in items])
    with new_figure(height=1.2 + 0.2 * len(items), width=7.0) as (figure, axis):
        picture = axis.imshow(np.log10(values), aspect="auto", cmap="viridis", vmin=-4, vmax=1)
        axis.grid(visible=False)
        axis.set_xticks(range(len(signals)), signals, rotation=20, ha="right")
        axis.set_yticks(range(len(items)), [item.kind for item in items], fontsize=7)
        figure.colorbar(picture, label="log10 of the change")
    return figure


def _pair(item: Signature) -> Figure:
    from elevon.recording.plot import Panel, spectrum_panels

    unit = {"motor_speed": "rpm", "motor_torque": "N m"}.get(item.signal, "A")
    scale = float(to_display(1.0, unit)) if unit == "rpm" else 1.0
    if item.signal.endswith("_position"):
        linear = item.actuator != "torino-rotary"
        unit, scale = ("mm", 1e3) if linear else ("deg", float(np.rad2deg(1.0)))
    # The healthy one is wide and lies below: it is seen where both agree, and where they do not.
    looks = {"healthy": {"color": COLOURS["grey"], "lw": 3.0},
             "faulty": {"color": COLOURS["orange"], "lw": 0.9}}  # fmt: skip
    lines = {"healthy": scale * item.healthy, "faulty": scale * item.faulty}
    step = max(item.time.size // 1500, 1)
    with new_figure(1, 2, height=2.3, width_ratios=[3, 2]) as (figure, axes):
        for name, values in lines.items():
            axes[0].plot(item.time[::step], values[::step], label=name, **looks[name])
        for panel in spectrum_panels([Panel(item.signal, unit, item.time, lines)]):
            low = panel.time < 0.45 / (item.time[1] - item.time[0])
            for name, values in panel.lines.items():
                slices = np.unique(np.geomspace(1, low.sum() - 1, 300).astype(int))
                axes[1].loglog(panel.time[slices], values[slices] + 1e-12, **looks[name])
        axes[0].set(xlabel="time [s]", ylabel=f"{item.signal} [{unit}]")
        axes[1].set(xlabel="frequency [Hz]", ylabel=f"[{unit}]")
        figure.legend(loc="outside upper right", ncols=2, fontsize=8)
    return figure
