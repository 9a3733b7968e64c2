"""The report of the table of failure modes."""

from __future__ import annotations

from elevon.report import Report, ReportTable
from elevon.reproduce.provenance import closed
from elevon.reproduce.torino_bench.fmeca import ALIKE, NAMED, FmecaResult


def fmeca_page(result: FmecaResult, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce torino-fmeca`."""
    named = sum(row.seen in (NAMED, ALIKE) for row in result.rows)
    report = Report(
        "Failure modes of an actuator, and what diagnosis sees of them",
        f"Each line of the printed table as faults of the catalogue, one log of 20 s each. "
        f"{named} of {len(result.rows)} are named.",
        date=date,
    )
    columns = ["Component", "Failure mode", "Rate [1/h]", "Fault", "Change [%]", "Channel", "Seen",
               "Answer"]  # fmt: skip
    rows: list[list[object]] = [
        [r.component, r.mode, f"{r.rate_per_h:.3g}", r.fault, r.change_percent,
         r.channel.replace("_", " "), r.seen, r.answer]
        for r in result.rows
    ]  # fmt: skip
    caption = (
        "Rates as printed, of a component; change: of a channel's RMS against the healthy log."
    )
    report.section("Failure modes").table(ReportTable(columns, rows, caption, digits=3))
    return closed(
        report, result.checks, f"torino-fmeca --seed {result.seed}", result.parameter_hash
    )
