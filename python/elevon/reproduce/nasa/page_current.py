"""The report of the current's validation: table and figures in the paper's layout."""

from __future__ import annotations

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.nasa.current import PUBLISHED, CurrentResult
from elevon.reproduce.provenance import closed


def current_report(result: CurrentResult, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce nasa-current`."""
    report = Report(
        "Predicted and measured current of the ballscrew actuator",
        "The paper prints its percentages and draws four runs; its signals were not published. "
        "Measured here means our virtual stand with a mismatch that the model does not know "
        "(friction law, magnets, screw, reassembly, load actuator, sensors). The percentages stand "
        "beside the published ones and are not the same experiment.",
        date=date,
    )
    section = report.section("Percent RMS error of the current")
    section.table(
        ReportTable(
            ["Runs", "Source", "Average [%]", "Maximum [%]", "Minimum [%]"],
            [
                [state, source, *values]
                for state in PUBLISHED
                for source, values in (
                    ("published", PUBLISHED[state]),
                    ("here", result.summary(state)),
                    ("here, between corners", result.summary(state, "percent_between_corners")),
                )
            ],
            "RMS error over the measured current's RMS about its mean; the paper does not define "
            "its percentage.",
            formats=["", "", ".2f", ".2f", ".2f"],
        )
    )
    section.table(
        ReportTable(
            [
                "State",
                "Assembly",
                "Profile",
                "Load",
                "Error [%]",
                "Between corners [%]",
                "Error [A]",
            ],
            [
                [
                    r.state,
                    r.assembly,
                    r.profile,
                    r.load,
                    r.percent_rms,
                    r.percent_between_corners,
                    r.rms_a,
                ]
                for r in result.rows
            ],
            "Every run.",
            folded="Every run",
        )
    )
    for trace in result.traces:
        part = report.section(f"As Fig. {trace.figure}: {trace.title}")
        with new_figure(1, 1, width=8.0, height=3.0) as (figure, axes):
            axes.plot(trace.time, trace.measured, color=COLOURS["grey"], lw=3.0, label="measured")
            axes.plot(trace.time, trace.predicted, color=COLOURS["orange"], lw=1.0, label="model")
            axes.set(xlabel="Time [s]", ylabel="Current [A]")
            axes.legend(loc="upper right", ncols=2)
        part.figure(figure, "Torque current of the virtual stand and of the model.")
    return closed(
        report, result.checks, f"nasa-current --seed {result.seed}", result.parameter_hash
    )
