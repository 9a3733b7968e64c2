"""What the landing gear's failure cases come to: by phase, for the page."""

from __future__ import annotations

from elevon.reproduce.pisa_failures import PHASES, FailuresResult


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


def page_values(result: FailuresResult) -> dict[str, object]:
    """Return what the page says beside the rows: counts, unsafe rows, rows by phase."""
    unsafe = [row for row in result.rows if not row.safe]
    by_phase = [(p, [row for row in result.rows if row.phase == p.name]) for p in PHASES]
    return {
        "unsafe": unsafe,
        "listed": sum(row.listed for row in unsafe),
        "named": [f"{row.fault}, {row.phase}: {row.sensors or 'not listed'}" for row in unsafe],
        "phases": [(phase, rows) for phase, rows in by_phase if rows],
        "summary": [[row[0], *map(int, row[1:])] for row in summary(result)[1]],
    }
