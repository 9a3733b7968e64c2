"""Reports of the ballscrew actuator's reproductions."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.report import Report, Table
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.nasa.baseline import BaselineResult
from elevon.reproduce.nasa.separation import SeparationResult
from elevon.reproduce.nasa.thermal import STEP_TIME, ThermalResult
from elevon.reproduce.provenance import provenance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

__all__ = ["nasa_report"]

Result = BaselineResult | SeparationResult | ThermalResult


def nasa_report(result: Result, *, date: str | None = None) -> Report:
    """Return the report of a result of this room."""
    if isinstance(result, ThermalResult):
        report, command = _thermal(result, date), "nasa-thermal"
    elif isinstance(result, BaselineResult):
        report, command = _baseline(result, date), "nasa-baseline"
    else:
        report, command = _separation(result, date), "nasa-separation"
    report.section("Checks").checks(result.checks)
    values = result.to_dict()
    known = {"Parameter hash": "parameter_hash", "Seed": "seed", "Core": "version"}
    facts = {name: values[key] for name, key in known.items() if key in values}
    report.provenance(provenance(f"elevon reproduce {command} --out DIR", **facts))
    return report


def _thermal(result: ThermalResult, date: str | None) -> Report:
    winding, surface = result.winding - 273.15, result.surface - 273.15
    report = Report(
        "One hour of the ballscrew actuator's motor",
        f"Sine of 50 mm, 4500 N and from {STEP_TIME / 60:.0f} minutes on 8500 N, low fidelity. The "
        "network's parameters are fitted to the published trend; no temperature is published.",
        date=date,
    )
    report.fact("Winding", f"{winding[-1]:.1f} degC", "after one hour")
    report.fact("Surface", f"{surface[-1]:.1f} degC", "after one hour")
    section = report.section("Temperatures")
    section.figure(_thermal_figure(result), "Winding and surface; the load rises at half time.")
    return report


def _thermal_figure(result: ThermalResult) -> Figure:
    with new_figure(width=8.0, height=3.4) as (figure, axes):
        minutes = result.time / 60.0
        axes.plot(minutes, result.winding - 273.15, color=COLOURS["orange"], label="winding")
        axes.plot(minutes, result.surface - 273.15, color=COLOURS["blue"], label="surface")
        axes.axvline(STEP_TIME / 60.0, color=COLOURS["grey"], lw=0.8)
        axes.set(xlabel="Time [min]", ylabel="Temperature [degC]")
        axes.legend(loc="upper left")
    return figure


def _baseline(result: BaselineResult, date: str | None) -> Report:
    statuses = [row.status for row in result.rows]
    report = Report(
        "Nominal runs of the ballscrew actuator",
        "Every profile under every load. Statistics after the first 2 s; tracking is command less "
        "position on the load's side of the joint.",
        date=date,
    )
    report.fact("Runs", str(len(result.rows)), f"load: {result.load_kind}")
    report.fact("Limited", str(statuses.count("limited")), "ask for more than there is, and run")
    report.fact("Refused", str(statuses.count("refused")), "ramps that cannot be followed")
    section = report.section("Current against load")
    section.figure(_baseline_figure(result), "RMS phase current of the 50 mm profiles.")
    columns = ["Profile", "Amplitude [mm]", "Load [N]", "Direction", "RMS current [A]",
               "Peak current [A]", "Tracking RMS [mm]", "Winding [K]", "Status"]  # fmt: skip
    keys = ("profile", "amplitude_mm", "load_n", "direction", "rms_current_a", "peak_current_a",
            "tracking_rms_mm", "winding_k", "status")  # fmt: skip
    rows = [[_cell(row.to_dict()[key]) for key in keys] for row in result.rows]
    report.section("All runs").table(Table(columns, rows, "The whole matrix."))
    return report


def _baseline_figure(result: BaselineResult) -> Figure:
    colours = ("grey", "blue", "orange", "green", "red")
    with new_figure(width=8.0, height=3.6) as (figure, axes):
        names = dict.fromkeys(row.profile.name for row in result.rows)
        for name, colour in zip(names, colours, strict=False):
            chosen = sorted(
                (row.load, row.rms_current)
                for row in result.rows
                if row.profile.name == name and abs(row.profile.amplitude - 0.05) < 1e-9
            )
            if chosen:
                load, current = np.array(chosen).T
                shown = COLOURS.get(colour, COLOURS["grey"])
                axes.plot(load / 1e3, current, "o-", ms=4, color=shown, label=name)
        axes.set(xlabel="Load, compressive positive [kN]", ylabel="RMS phase current [A]")
        axes.legend()
    return figure


def _separation(result: SeparationResult, date: str | None) -> Report:
    report = Report(
        "Which profile shows which fault",
        f"Separation |faulty - healthy| / pooled standard deviation over {result.reassemblies} "
        "reassemblies, each with its own friction, preload and sensor noise.",
        date=date,
    )
    best = result.best()
    report.fact("Faults", str(len(best)), "one severity each")
    columns = ["Fault", "Profile", "Load", "Feature", "Healthy", "Faulty", "Separation"]
    keys = ("fault", "profile", "load", "feature", "healthy", "faulty", "separation")

    def cells(rows: list[Any]) -> list[list[str]]:
        return [[_cell(row.to_dict()[key]) for key in keys] for row in rows]

    report.section("Best profile").table(
        Table(columns, cells(list(best.values())), "The profile that shows each fault best.")
    )
    report.section("All").table(Table(columns, cells(result.rows), "Every fault and profile."))
    return report


def _cell(value: Any) -> str:
    if value is None:
        return ""
    return f"{value:.4g}" if isinstance(value, float) else str(value)
