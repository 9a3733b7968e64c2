"""Reports of the ballscrew actuator's reproductions."""

from __future__ import annotations

from typing import TYPE_CHECKING

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.nasa.baseline_rows import BaselineResult
from elevon.reproduce.nasa.dema import DemaFit
from elevon.reproduce.nasa.page_baseline import baseline_page
from elevon.reproduce.nasa.page_separation import separation_page
from elevon.reproduce.nasa.separation_rows import SeparationResult
from elevon.reproduce.nasa.thermal import STEP_TIME, ThermalResult
from elevon.reproduce.provenance import provenance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Result = BaselineResult | SeparationResult | ThermalResult


def nasa_report(result: Result, *, date: str | None = None) -> Report:
    """Return the report of a result of this package."""
    if isinstance(result, ThermalResult):
        report, command = _thermal(result, date), "nasa-thermal"
    elif isinstance(result, BaselineResult):
        report = baseline_page(result, date)
        command = f"nasa-baseline --load-kind {result.load_kind} --replicates {result.replicates}"
    else:
        report = separation_page(result, date)
        command = f"nasa-separation --reassemblies {result.reassemblies} --healthy {result.healthy}"
    report.section("Checks").checks(result.checks)
    values = result.to_dict()
    known = {
        "Parameter hash": "parameter_hash",
        "Parameter hash of nasa-dema": "fit_parameter_hash",
        "Seed": "seed",
        "Core": "version",
    }
    facts = {name: values[key] for name, key in known.items() if values.get(key) is not None}
    options = f"--seed {values.get('seed', 0)} --out DIR"
    report.provenance(provenance(f"elevon reproduce {command} {options}", **facts))
    return report


def _thermal(result: ThermalResult, date: str | None) -> Report:
    winding, surface = result.winding - 273.15, result.surface - 273.15
    report = Report(
        "One hour of the ballscrew actuator's motor",
        f"Sine of 50 mm, 4500 N and from {STEP_TIME / 60:.0f} minutes on 8500 N, low fidelity. The "
        "network's parameters are ASSUMED within insulation classes; no temperature is published.",
        date=date,
    )
    report.fact("Winding", f"{winding[-1]:.1f} degC", "after one hour")
    report.fact("Surface", f"{surface[-1]:.1f} degC", "after one hour")
    section = report.section("Temperatures")
    section.figure(_thermal_figure(result), "Winding and surface; the load rises at half time.")
    if result.fit is not None:
        rows = [[r.parameter, r.put_in, r.recovered, r.low, r.high] for r in result.fit.rows]
        section = report.section(
            "The fit's procedure on a bench with hidden values",
            "The paper fits its network to an hour on a smaller stand (surface within 0.84 K, "
            "0.42 K rms) and prints neither temperatures nor parameters. Here a bench with hidden "
            "values about the set nasa-dema is measured in the same way (surface and nut, averaged "
            "over 1 s) and fitted; the load changes every quarter of an hour, and the air warms by "
            "some degrees: the model is given what the air's thermocouple says.",
        )
        section.figure(_fit_figure(result.fit), "Surface and nut as measured and as fitted.")
        section.table(
            ReportTable(["Parameter, SI", "Put in", "Recovered", "from", "to"], rows, digits=4)
        )
    return report


def _fit_figure(fit: DemaFit) -> Figure:
    with new_figure(width=8.0, height=3.4) as (figure, axes):
        minutes = fit.time / 60.0
        for row, (name, colour) in enumerate((("surface", "blue"), ("nut", "green"))):
            axes.plot(minutes, fit.measured[row] - 273.15, ".", ms=1, color=COLOURS["grey"])
            fitted = fit.fitted[row] - 273.15
            axes.plot(minutes, fitted, color=COLOURS[colour], label=f"{name}, fitted")
        label = "winding, not measured"
        axes.plot(
            minutes, fit.air - 273.15, ".", ms=1, color=COLOURS["blue"], label="air, measured"
        )
        axes.plot(minutes, fit.fitted[2] - 273.15, color=COLOURS["orange"], label=label, lw=0.8)
        axes.set(xlabel="Time [min]", ylabel="Temperature [degC]")
        axes.legend(loc="upper left")
    return figure


def _thermal_figure(result: ThermalResult) -> Figure:
    with new_figure(width=8.0, height=3.4) as (figure, axes):
        minutes = result.time / 60.0
        axes.plot(minutes, result.winding - 273.15, color=COLOURS["orange"], label="winding")
        axes.plot(minutes, result.surface - 273.15, color=COLOURS["blue"], label="surface")
        axes.axvline(STEP_TIME / 60.0, color=COLOURS["grey"], lw=0.8)
        axes.set(xlabel="Time [min]", ylabel="Temperature [degC]")
        axes.legend(loc="upper left")
    return figure
