"""Report of the landing gear's failure cases."""

from __future__ import annotations

from collections.abc import Sequence

from elevon.report import Report, ReportTable
from elevon.reproduce.pisa_failures import PHASES, FailureRow, FailuresResult
from elevon.reproduce.provenance import provenance


def summary(result: FailuresResult) -> tuple[list[str], list[list[str]]]:
    """Return headings and rows: a phase a row, how many faults were found, silent, unsafe."""
    rows = []
    for phase in PHASES:
        mine = [row for row in result.rows if row.phase == phase.name]
        detected = sum(row.detected_by.startswith("fault") for row in mine)
        warned = sum(row.detected_by.startswith("warning") for row in mine)
        unsafe = sum(not row.safe for row in mine)
        silent = len(mine) - detected - warned
        rows.append([phase.name, *map(str, (len(mine), detected, warned, silent, unsafe))])
    return ["phase", "faults", "fault shown", "warning shown", "silent", "unsafe"], rows


_SIGNS = {
    "retracted": "R",
    "extending": "e",
    "locked": "L",
    "retracting": "r",
    "stopped": "S",
    "released": "F",
    "fault": "X",
    "unconfirmed": "U",
    "off": "O",
}


def matrix(result: FailuresResult) -> str:
    """Return all cases as one Markdown table: a fault a row, a phase a column.

    A cell is the state indicated, ``w`` where the unit warned, the seconds from the fault to its
    report, and the true state (L, R, or - between the ends) where it is another; ``!`` if unsafe.
    """
    faults = list(dict.fromkeys(row.fault for row in result.rows))
    cells = {(row.fault, row.phase): _cell(row) for row in result.rows}
    lines = ["| fault | " + " | ".join(phase.name for phase in PHASES) + " |"]
    lines.append("|---" * (len(PHASES) + 1) + "|")
    for fault in faults:
        cells_of_fault = [cells[(fault, phase.name)] for phase in PHASES]
        lines.append(f"| `{fault}` | " + " | ".join(cells_of_fault) + " |")
    return "\n".join(lines) + "\n"


def _cell(row: FailureRow) -> str:
    true = {"locked": "L", "retracted": "R"}.get(row.true_state, "-")
    sign = _SIGNS.get(row.indicated, row.indicated)
    text = sign if true == sign else f"{sign}({true})"
    if row.detected_by.startswith("warning"):
        text += " w"
    if row.time_s is not None:
        text += f" {row.time_s:.1f}"
    return text if row.safe else f"**{text} !**"


def failures_report(result: FailuresResult, *, date: str | None = None) -> Report:
    """Return the report of the failure cases."""
    unsafe = [row for row in result.rows if not row.safe]
    listed = sum(row.listed for row in unsafe)
    report = Report(
        "Failure cases of the Pisa landing gear",
        f"{len(result.rows)} cases at {result.fidelity} fidelity: every fault of the catalogue in "
        f"every phase. The unit shows locked or retracted falsely in {len(unsafe)} of them, "
        f"{listed} of which no sensor could prevent.",
        date=date,
    )
    report.fact("Cases", str(len(result.rows)), "fault, place and phase")
    report.fact("Unsafe", str(len(unsafe)), "locked or retracted shown, and not true")
    report.fact("of these listed", str(listed), "every sensor that could see it failed or agreed")
    section = report.section("What the unit found")
    columns, rows = summary(result)
    section.table(
        ReportTable(
            [name.capitalize() for name in columns],
            [[row[0], *map(int, row[1:])] for row in rows],
            "Silent: no fault and no warning, because the move arrived or nothing moved.",
        )
    )
    section = report.section("Unsafe cases")
    if unsafe:
        section.table(ReportTable(_COLUMNS, _cells(unsafe), formats=_FORMATS))
        section.points(
            [f"{row.fault}, {row.phase}: {row.sensors or 'not listed'}" for row in unsafe]
        )
    else:
        section.text("None.")
    section = report.section("All cases")
    for phase in PHASES:
        mine = [row for row in result.rows if row.phase == phase.name]
        marked = frozenset(i for i, row in enumerate(mine) if not row.safe)
        if mine:
            title = f"{phase.name[0].upper()}{phase.name[1:]}: {len(mine)} faults"
            section.table(
                ReportTable(_COLUMNS, _cells(mine), marked=marked, formats=_FORMATS, folded=title)
            )
    report.section("Checks").checks(result.checks)
    report.provenance(
        provenance(
            f"elevon reproduce pisa-failures --fidelity {result.fidelity} --out DIR",
            Seed=result.seed,
            Fidelity=result.fidelity,
        )
    )
    return report


_COLUMNS = ("Fault", "Phase", "Indicated", "True", "Safe", "Found by", "after [s]",
            "Ram [mm]")  # fmt: skip
_FORMATS = ("", "", "", "", "", "", ".3f", ".1f")


def _cells(rows: Sequence[FailureRow]) -> list[list[object]]:
    return [
        [r.fault, r.phase, r.indicated, r.true_state, r.safe, r.detected_by, r.time_s,
         r.position_mm]
        for r in rows
    ]  # fmt: skip
