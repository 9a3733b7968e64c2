"""The part of the demonstration's page that holds estimates against the hidden truth."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.estimate import LEVEL
from elevon.report import ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.units import to_display

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.demo.run import Demo
    from elevon.report import Report

_DISPLAYED = {"rad": "deg", "kg m2": "kg cm2", "1": ""}
_LINEAR = 1.0  # percent up to which the axis of the errors is linear
_SPACE, _MINUS = "\N{NO-BREAK SPACE}", "\N{MINUS SIGN}"


def parameters_section(report: Report, demo: Demo, rows: list[dict[str, Any]]) -> None:
    """Add the section: text, figure, table, what the estimates are, what was found on the way."""
    inside = sum(row["inside"] for row in rows)
    text = (
        f"Intervals are meant to hold {100 * LEVEL:.0f} % of the truths; here {inside} of "
        f"{len(rows)} are inside. The model behind the fit is the reduced-order one; the logs "
        "come from the switching one, with a PWM bridge, encoder counts and noise."
    )
    if inside < LEVEL * len(rows):
        text += (
            " What the reduced-order model lacks shows as a bias that the intervals do not cover."
        )
    section = report.section("Parameters against the hidden truth", text)
    compared = [row for row in rows if not _absolute(row)]
    section.figure(
        errors_figure(compared),
        "Error of each estimate in percent of the truth, with its interval. Grey: the published "
        f"value the calibration began with. The axis is linear up to {_LINEAR:g} % either way and "
        "logarithmic beyond; the dotted lines stand there.",
    )
    columns = [
        "Parameter", "Published", "Truth", "Estimate", f"{100 * LEVEL:.0f} % interval", "Error",
        "Inside",
    ]  # fmt: skip
    cells = [_cells(row, _unit(demo, row)) for row in rows]
    caption = "Errors of offsets and initial positions are given in their own unit."
    section.table(ReportTable(columns, cells, caption))
    notes = _notes(demo, rows)
    if notes:
        section.text("Estimates that no actuator file holds:")
        section.points(notes)
    if demo.calibration.findings:
        section.text("What the calibration itself has to say:")
        section.points(demo.calibration.findings)


def errors_figure(rows: Sequence[dict[str, Any]]) -> Figure:
    """Draw errors and intervals in percent of the truth.

    Parameters
    ----------
    rows : sequence of dict
        Of `Demo.rows`, with truths that are not zero.
    """
    with new_figure(width=8.5, height=0.34 * len(rows) + 1.6) as (figure, axes):
        axes.set_xscale("symlog", linthresh=_LINEAR, linscale=1.2)
        for place, row in enumerate(reversed(rows)):
            _draw_error(axes, place, row)
        for edge in (-_LINEAR, _LINEAR):
            axes.axvline(edge, color=COLOURS["grey"], lw=0.8, ls=":")
        axes.axvline(0.0, color=COLOURS["green"], lw=1.2, zorder=1)
        reach = 1.3 * max(abs(error) for row in rows for error in _errors(row).values())
        reach = max(reach, 2.0 * _LINEAR)
        ticks = [t for t in (0.5, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0) if t < reach]
        marks = [*(-t for t in reversed(ticks)), 0.0, *ticks]
        axes.set_xticks(marks, [f"{mark:g}".replace("-", _MINUS) for mark in marks], minor=False)
        axes.set_xticks([], minor=True)
        axes.set(
            xlim=(-reach, reach),
            ylim=(-0.7, len(rows) - 0.3),
            yticks=range(len(rows)),
            yticklabels=[row["path"] for row in reversed(rows)],
            xlabel="Error [% of the truth]",
        )
        _legend(axes, rows)
    return figure


def _draw_error(axes: Any, place: int, row: dict[str, Any]) -> None:
    errors = _errors(row)
    colour = COLOURS["blue"] if row["inside"] else COLOURS["orange"]
    if "before" in errors:
        axes.plot(errors["before"], place, "D", mfc="none", color=COLOURS["grey"], ms=7, zorder=2)
    ends = [errors["low"], errors["high"]]
    axes.plot(ends, [place, place], color=colour, lw=4, solid_capstyle="butt", zorder=3)
    axes.plot(ends, [place, place], "|", color=colour, ms=9, mew=1.4, zorder=3)
    axes.plot(errors["value"], place, "o", mfc="white", color=colour, ms=4.5, zorder=4)


def _errors(row: dict[str, Any]) -> dict[str, float]:
    """Errors in percent of the truth, of the published value too where there is one."""
    keys = [key for key in ("before", "value", "low", "high") if row[key] is not None]
    return {key: 100.0 * (row[key] / row["truth"] - 1.0) for key in keys}


def _legend(axes: Any, rows: Sequence[dict[str, Any]]) -> None:
    from matplotlib.lines import Line2D

    entries = [
        (any(r["inside"] for r in rows), "blue", "-", "estimate, truth inside its interval"),
        (any(not r["inside"] for r in rows), "orange", "-", "truth outside"),
        (any(r["before"] is not None for r in rows), "grey", "D", "published value"),
    ]
    look: dict[str, dict[str, Any]] = {
        "-": {"lw": 4, "marker": "o", "mfc": "white", "ms": 4.5, "solid_capstyle": "butt"},
        "D": {"marker": "D", "ls": "", "mfc": "none"},
    }
    handles = [
        Line2D([], [], color=COLOURS[colour], label=text, **look[mark])
        for there, colour, mark, text in entries
        if there
    ]
    axes.legend(handles=handles, loc="lower center", bbox_to_anchor=(0.5, 1.0), ncols=len(handles))


def _absolute(row: dict[str, Any]) -> bool:
    """Whether an error in percent would mean nothing: the zero is arbitrary."""
    path = str(row["path"])
    return path.endswith("offset") or path.startswith("initial.") or float(row["truth"]) == 0.0


def _unit(demo: Demo, row: dict[str, Any]) -> str:
    """The unit the published set writes the value in, else one a person reads."""
    path, known = row["path"], demo.base.parameters
    written = known[path].unit if path in known else ""
    return _DISPLAYED.get(written or row["unit"], written or row["unit"])


def _cells(row: dict[str, Any], unit: str) -> list[str]:
    displayed = unit or "1"
    before, truth, value, low, high = (
        math.nan if row[key] is None else to_display(row[key], displayed)
        for key in ("before", "truth", "value", "low", "high")
    )
    places = _places(high - low)
    text = [_fixed(x, places) for x in (before, truth, value)]
    interval = f"{_fixed(low, places)} to {_fixed(high, places)}"
    if _absolute(row):
        error = f"{_fixed(value - truth, places, sign='+')} {unit}"
    else:
        percent = 100.0 * (value / truth - 1.0)
        places = _places(100.0 * (high - low) / abs(truth))
        error = f"{_fixed(percent, places, sign='+')} %"
    name = f"{row['path']} [{unit}]" if unit else row["path"]
    cells = [name, *text, interval, error, "yes" if row["inside"] else "no"]
    return [cell.replace(" ", _SPACE) for cell in cells]


def _places(width: float) -> int:
    """Decimal places that show two digits of an interval's width."""
    if not 0.0 < width < math.inf:
        return 6
    return min(max(1 - math.floor(math.log10(width)), 0), 9)


def _fixed(value: float, places: int, sign: str = "") -> str:
    if not np.isfinite(value):
        return ""
    return f"{value:{sign}.{places}f}".replace("-", _MINUS)


def _notes(demo: Demo, rows: Sequence[dict[str, Any]]) -> list[str]:
    """Say what the estimates are that have no place in a set."""
    notes: dict[str, str] = {}
    for row in rows:
        item = demo.calibration[row["path"]]
        if not item.in_set and item.note:
            name = item.path.partition("[")[0]
            notes.setdefault(name, f"{name}: {item.note}")
    return list(notes.values())
