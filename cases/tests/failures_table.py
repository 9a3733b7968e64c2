"""The landing gear's failure cases as one table: that of the evidence page."""

from elevon_cases.pisa.failures import PHASES, FailureRow, FailuresResult

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
