"""The report of the gear as planets beside the single backlash."""

from __future__ import annotations

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.provenance import closed
from elevon.reproduce.torino_bench.gear import ELASTIC, LUMPED, PLANETS, GearResult


def gear_page(result: GearResult, seed: int, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce torino-gear`."""
    report = Report(
        "The gear as planets, a backlash in each mesh",
        "The paper lumps the gear's backlash at the output and leaves a multi-body gear to the "
        "future (3.1.5). Here is that gear beside the single backlash of equal lost motion. How "
        "the lost motion is shared by the meshes is ASSUMED: one backlash along all pitch circles.",
        date=date,
    )
    section = report.section("Models")
    columns = ["Model", "Lost motion [deg]", "Stiffness [N m/rad]", "In the sine [deg]",
               "Loaded [deg]", "Loaded, RMS to planets [deg]"]  # fmt: skip
    rows = [
        [r.model, r.lost_motion_deg, r.stiffness_nm_per_rad, r.moving_deg, r.loaded_deg,
         r.loaded_rms_deg]
        for r in result.rows
    ]  # fmt: skip
    caption = "Pushed with the motor off; in the sine of 7 deg, 0.2 Hz, without and with friction."
    section.table(ReportTable(columns, rows, caption, digits=5))
    with new_figure(width=6.0, height=2.8) as (figure, axes):
        for name, colour in ((LUMPED, "blue"), (ELASTIC, "orange"), (PLANETS, "green")):
            axes.plot(result.time, result.curves[name], color=COLOURS[colour], label=name)
        axes.set(xlabel="Time [s]", ylabel="Motor / 124 less output [deg]")
        axes.legend(loc="upper right")
    section.figure(figure, "One period of the sine under 1 N m of friction at the output.")
    columns = ["Mesh", "Reaches the output", "Lost motion there [deg]", "Share of compliance [%]"]
    rows = [[m.mesh, m.reaches_output, m.lost_motion_deg, m.compliance_percent]
            for m in result.meshes]  # fmt: skip
    caption = "The backlash at the fixed ring reaches the output whole, the sun's by one in 124."
    report.section("Meshes").table(ReportTable(columns, rows, caption, digits=4))
    return closed(report, result.checks, f"torino-gear --seed {seed}", result.parameter_hash)
