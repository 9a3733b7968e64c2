"""The report of `elevon reproduce cranfield`."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.logs.formats.cranfield import DATA_DOI, PAPER_DOI
from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.cranfield.result import GROUPED, STRICT, CranfieldResult
from elevon.reproduce.provenance import closed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PROTOCOLS = (f"three classes: {STRICT}", f"four families: {GROUPED}", f"four families: {STRICT}",
          f"thirteen classes: {GROUPED}", f"thirteen classes: {STRICT}")  # fmt: skip


def cranfield_report(result: CranfieldResult, *, seed: int = 0, date: str | None = None) -> Report:
    """Return the report: one sentence, the figures, the confusions, what the data cannot tell."""
    report = Report("Diagnosis of the Cranfield linear actuator", _sentence(result), date=date)
    for label, key, note in (
        ("Three classes", "three_class_macro_f1_mean", "mean macro-F1, load left out"),
        ("Worst load", "three_class_macro_f1_worst", "macro-F1 of the same"),
        ("Four families", "four_family_grouped_accuracy_worst", "worst load, runs left out"),
        ("Thirteen classes", "thirteen_class_grouped_accuracy", "mean of loads, runs left out"),
    ):
        value = result.headline.get(key)
        report.fact(label, "not possible" if value is None else f"{value:.3f}", note)
    _figures(report, result)
    _confusions(report, result)
    _detection(report, result)
    _sessions(report, result)
    _contents(report, result)
    sources = {"Data": f"doi {DATA_DOI}", "Paper": f"doi {PAPER_DOI}", "Seed": seed}
    return closed(report, result.checks, f"cranfield --data FOLDER --seed {seed}", **sources)


def _sentence(result: CranfieldResult) -> str:
    worst = result.headline.get("three_class_macro_f1_worst")
    mean = result.headline.get("three_class_macro_f1_mean")
    if mean is None or worst is None:
        return "This folder does not hold what the comparison at a load left out needs."
    return (
        "At a load that was never trained, healthy, backlash and lost lubrication are "
        f"distinguished with "
        f"a macro-F1 of {mean:.3f} (worst load {worst:.3f}); which of it is the fault and which "
        "the session of its recording, these data cannot tell."
    )


def _figures(report: Report, result: CranfieldResult) -> None:
    rows = [[f.figure, f.protocol, f.load, f.value, f"{f.low:.3f} to {f.high:.3f}", f.recordings]
            for f in result.figures]  # fmt: skip
    columns = ["Figure", "Protocol", "Load [kgf]", "Score", "95 % interval", "Recordings"]
    caption = (
        "Macro-F1 where a load is left out, accuracy where runs are. Intervals of macro-F1 draw "
        "the tested recordings again (the classifiers stay; a load without an error has no width "
        "then); those of an accuracy are exact for recordings that are independent."
    )
    mean = [row for row in rows if row[2] in {"mean", "worst"}]
    section = report.section("Scores")
    section.table(ReportTable(columns, mean, caption, formats=["", "", "", ".3f", "", ""]))
    section.table(
        ReportTable(
            columns, rows, caption, formats=["", "", "", ".3f", "", ""], folded="Every load"
        )
    )
    section.table(
        ReportTable(
            ["Answers", "Mean probability given", "Share right"],
            [[name, p, right] for name, (p, right) in result.reliability.items()],
            "A calibrated classifier gives what it says the share with which it is right.",
            formats=["", ".3f", ".3f"],
        )
    )


def _confusions(report: Report, result: CranfieldResult) -> None:
    section = report.section("Who is taken for whom")
    for name in _PROTOCOLS:
        if name in result.confusions:
            classes, counts = result.confusions[name]
            section.figure(_matrix(classes, counts), f"{name}; a row is what it was.")


def _matrix(classes: list[str], counts: list[list[int]]) -> Figure:
    table = np.array(counts, dtype=np.float64)
    share = table / np.maximum(table.sum(axis=1, keepdims=True), 1.0)
    size = 2.2 + 0.42 * len(classes)
    with new_figure(width=size + 1.4, height=size) as (figure, axes):
        axes.grid(visible=False)
        axes.imshow(share, cmap="Blues", vmin=0.0, vmax=1.6)
        for (row, column), value in np.ndenumerate(table):
            if value:
                axes.text(column, row, f"{value:.0f}", ha="center", va="center", color="black")
        axes.set_xticks(range(len(classes)), classes, rotation=60, ha="right")
        axes.set_yticks(range(len(classes)), classes)
        axes.set_xlabel("answer")
    return figure


def _detection(report: Report, result: CranfieldResult) -> None:
    rows = [d.to_dict() for d in result.detections]
    section = report.section(
        "Healthy or not",
        "Each recording is held against the healthy ones at its load, itself left out, at a "
        "false-alarm rate of 5 %. The row 'normal' is the same figure healthy against healthy. "
        "All healthy recordings of a load come from one session; the last column allows for a "
        "difference between two sessions, as large as the scatter of spalling stages 1 to 5 "
        "(ASSUMED to differ by their session only; the published detection does not see them).",
    )
    section.table(
        ReportTable(
            ["Condition", "Called faulty", "95 % interval", "Recordings", "Sessions allowed for"],
            [[d["condition"], d["rate"], "{:.3f} to {:.3f}".format(*d["interval"]),
              d["recordings"], d["rate_between_sessions"]] for d in rows],
            formats=["", ".3f", "", "", ".3f"],
        )
    )  # fmt: skip


def _sessions(report: Report, result: CranfieldResult) -> None:
    markers = result.markers()
    section = report.section(
        "Drift and sessions",
        "Every condition was recorded in one go. Whatever drifted between two goes is therefore "
        "confounded with the condition, in every score above that has a condition in training "
        "and test. At standstill the current and the tracking error go together with one sign in "
        "some conditions and with the other in the rest. No fault of a screw at rest is known to "
        "us that would do this, so this number is used by no classifier; it is shown because it "
        "tells which conditions were recorded alike.",
    )
    with new_figure(height=3.2) as (figure, axes):
        axes.bar(list(markers), list(markers.values()), color=COLOURS["blue"])
        axes.set_ylabel("correlation at standstill")
        axes.tick_params(axis="x", rotation=60)
    section.figure(figure, "Correlation of current and tracking error at standstill.")


def _contents(report: Report, result: CranfieldResult) -> None:
    section = report.section("What was there")
    rows = [[p["condition"], p["load_kgf"], ", ".join(map(str, p["runs"]))]  # type: ignore[call-overload]
            for p in result.data.present()]  # fmt: skip
    section.table(ReportTable(["Condition", "Load [kgf]", "Runs"], rows, folded="Recordings used"))
    left_out = [*result.data.skipped, *(f"{name}: not possible here" for name in result.missing)]
    if left_out:
        section.points(left_out)
