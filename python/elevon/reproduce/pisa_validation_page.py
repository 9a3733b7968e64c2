"""The report of the landing gear's validation."""

from __future__ import annotations

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.pisa_validation import DISPLAYED, MEAN, StrokeSignalRow, ValidationResult
from elevon.reproduce.provenance import closed
from elevon.units import display_unit, to_display

_AXES = {
    "output_position": ("Position [mm]", 1e3),
    "motor_speed": ("Motor speed [rad/s]", 1.0),
    "torque_current": ("Current [A]", 1.0),
}


def validation_page(result: ValidationResult, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce pisa-validation`."""
    report = Report(
        "Predicted and measured strokes of the Pisa landing gear",
        "The thesis draws measured and simulated position, speed and current and prints no error; "
        "its signals were not published. Measured here means our virtual rig with a mismatch that "
        "the model does not know (friction, temperature, EMF constant, efficiency, load control, "
        "sensors). The model is tuned on the strokes of two conditions, as the thesis tunes its "
        "own, and judged on the others. It shows the way, not how good the thesis's model is.",
        date=date,
    )
    rows = [_row(row) for row in result.rows]
    columns = ["Stroke", "Held out", "Signal", "RMS error", "Unit", "% of RMS", "% of range",
               "Judged [%]", "Before tuning [%]", "Repetition [%]", "Limit [%]"]  # fmt: skip
    caption = (
        "Percent of the measured signal's RMS about its mean, and of its range. Judged: position "
        f"over its range, speed over its RMS, current as means over {MEAN:g} s over their RMS. "
        "Repetition: the same actuator's strokes twice, which no model can be below: the software "
        "brake's pulses have other instants each time."
    )
    formats = ["", "", "", ".3g", "", ".3g", ".3g", ".3g", ".3g", ".3g", ".3g"]
    report.section("Errors").table(ReportTable(columns, rows, caption, formats=formats))
    friction = [[path, *pair] for path, pair in result.friction.items()]
    report.section("What was tuned").table(
        ReportTable(["Friction", "Before [N]", "Tuned [N]"], friction, formats=["", ".0f", ".0f"])
    )
    for trace in result.traces:
        section = report.section(trace.log[0].upper() + trace.log[1:])
        with new_figure(3, 1, width=8.0, height=5.4, sharex=True) as (figure, axes):
            for axis, role in zip(axes, DISPLAYED, strict=True):
                label, scale = _AXES[role]
                axis.plot(trace.time, scale * trace.measured[role], color=COLOURS["grey"], lw=3.0)
                axis.plot(trace.time, scale * trace.simulated[role], color=COLOURS["orange"], lw=1)
                axis.set_ylabel(label)
            axes[-1].set_xlabel("Time [s]")
        section.figure(figure, "Virtual rig (grey) and model (orange).")
    return closed(
        report, result.checks, f"pisa-validation --seed {result.seed}", result.parameter_hash
    )


def _row(row: StrokeSignalRow) -> list[object]:
    unit = display_unit(row.unit)
    return [
        row.stroke,
        "yes" if row.held_out else "no",
        row.signal.replace("_", " "),
        to_display(row.rms, unit),
        unit,
        row.percent_of_rms,
        row.percent_of_range,
        row.judged_percent,
        row.before_percent,
        row.floor_percent,
        row.limit_percent,
    ]
