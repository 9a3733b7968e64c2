"""The report of a fit of the reduced-order model."""

from __future__ import annotations

from elevon.calibrate.low_fit import LowFit
from elevon.report import Report, ReportTable
from elevon.reproduce.provenance import provenance


def lowfit_report(fit: LowFit, actuator: str, *, date: str | None = None) -> Report:
    """Return the report of a fit of an actuator named as on the command line."""
    values = fit.to_dict()
    report = Report(
        f"Reduced-order model of {values['actuator']} fitted",
        "The reduced-order model's own numbers, by least squares of filtered position, speed and q "
        f"current against the switching model with drive.kind = {values['drive']}.",
        date=date,
    )
    for row in values["fitted"]:
        report.fact(row["path"], f"{row['new']:.4g}", f"was {row['old']:.4g}")
    fitted = [[row["path"], row["old"], row["new"], row["deviation"]] for row in values["fitted"]]
    section = report.section("Numbers")
    section.table(ReportTable(["Number", "Old", "New", "Deviation over the cases"], fitted))
    for row in values["kept"]:
        section.text(f"{row['path']} is kept: {row['reason']}.")
    names = list(values["rms_before"])
    head = [f"{n.replace('_', ' ')} {when} [%]" for n in names for when in ("before", "after")]
    rows = [
        [case["name"], *(100 * case[when][n] for n in names for when in ("before", "after"))]
        for case in values["cases"]
    ]
    report.section("Cases").table(ReportTable(["Case", *head], rows))
    report.provenance(provenance(f"elevon fit-low {actuator} --report FILE", Hash=fit.before.hash))
    return report
