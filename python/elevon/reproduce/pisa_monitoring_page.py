"""The report of the simplified model's cost."""

from __future__ import annotations

from elevon.report import Report, ReportTable
from elevon.reproduce.pisa_monitoring import TARGET, MonitoringResult
from elevon.reproduce.provenance import closed


def monitoring_report(result: MonitoringResult, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce pisa-monitoring`."""
    report = Report(
        "Condition monitoring of the landing gear by the simplified model",
        "One retraction of ten seconds in the switching model and in the reduced-order one, both "
        f"recorded at 400 Hz. {TARGET:g} times faster was asked for; the table has what this "
        "machine measured. Recorded at each of its steps, the reduced-order model costs four "
        "times as much: the recording, not the model.",
        date=date,
    )
    report.section("Cost and errors").table(
        ReportTable(
            ["Model", "Step [us]", "Processor [s]", "Times faster", "Position [%]", "Speed [%]",
             "Current [%]"],
            [[r.model, r.step_us, r.processor_s, r.faster, r.position_percent, r.speed_percent,
              r.current_percent] for r in result.rows],
            "Errors of means over half a second, over the RMS about the mean.",
            formats=["", ".0f", ".4f", ".1f", ".3f", ".3f", ".3f"],
        )
    )  # fmt: skip
    return closed(report, result.checks, "pisa-monitoring")
