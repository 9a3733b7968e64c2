"""The report of the loaded campaign."""

from __future__ import annotations

import math

import numpy as np

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.provenance import provenance
from elevon.reproduce.torino_bench.loaded import LoadedCampaign

_SHADES = ("blue", "orange", "green")


def loaded_page(result: LoadedCampaign, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce torino-loaded`."""
    report = Report(
        "Loaded campaign of the Torino bench",
        "A constant brake torque a test, linear from 0.2 to 2 N m, at three backlashes; the first "
        "period is dropped. The bench is the virtual one with hidden values; the model was "
        "calibrated on other logs.",
        date=date,
    )
    backlashes = list(dict.fromkeys(row.net_backlash_rad for row in result.rows))
    section = report.section("Torque and current")
    with new_figure(1, 2, width=8.0, height=3.2) as (figure, axes):
        for net, shade in zip(backlashes, _SHADES, strict=True):
            rows = [row for row in result.rows if row.net_backlash_rad == net]
            label = f"{math.degrees(net):.2f} deg net"
            cell = [row.cell_nm for row in rows]
            axes[0].plot(np.arange(1, len(rows) + 1), cell, "o", ms=4, color=COLOURS[shade],
                         label=label)  # fmt: skip
            axes[1].plot(cell, [row.current_a for row in rows], "o", ms=4, color=COLOURS[shade])
        axes[0].set(xlabel="Test", ylabel="Brake torque by the cell [N m]")
        axes[1].set(xlabel="Brake torque by the cell [N m]", ylabel="Mean torque current [A]")
        axes[0].legend(loc="upper left")
    section.figure(figure, "Torques of the tests (thesis, Figure 84) and the current they cost.")
    columns = ["Net backlash [deg]", "Set [N m]", "Cell [N m]", "Current [A]", "Bench lost [deg]",
               "Model lost [deg]", "Position error [% of range]"]  # fmt: skip
    tests: list[list[object]] = [
        [math.degrees(r.net_backlash_rad), r.set_nm, r.cell_nm, r.current_a, r.bench_lost_deg,
         r.model_lost_deg, r.position_percent]
        for r in result.rows
    ]  # fmt: skip
    report.section("Tests").table(ReportTable(columns, tests, "After the first period.", digits=4))
    report.section("Checks").checks(result.checks)
    command = (
        f"elevon reproduce torino-loaded --fidelity {result.fidelity} --seed {result.seed} "
        "--out DIR"
    )
    report.provenance(provenance(command, **{"Parameter hash": result.parameter_hash}))
    return report
