"""Report of the friction tests of the Pisa landing gear, figure by figure of the thesis."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.pisa_friction import FrictionResult, FrictionRow, FrictionTrace
from elevon.reproduce.provenance import closed

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_PALETTE = tuple(COLOURS.values())
_WAYS = (("extension", COLOURS["blue"]), ("retraction", COLOURS["orange"]))
_HISTORIES = (
    (True, 1.0, "3.23 to 3.28"),
    (True, 4.0, "3.29 to 3.34"),
    (False, 1.0, "3.35 to 3.40"),
    (False, 3.0, "3.41 to 3.46"),
)
"""Released, mm/s, figures of P."""
_COLUMNS = ("Quantity", "Direction", "Speed [mm/s]", "Load [N]", "Put in", "Recovered", "Unit")


def friction_report(result: FrictionResult, *, date: str | None = None) -> Report:
    """Return the report of the friction tests."""
    report = Report(
        "Friction tests of the Pisa landing gear",
        "Free fall (FF) and modified free fall (FFM) on the virtual rig at 1 to 10 mm/s in both "
        "directions, and loaded retractions. Weight, friction, harmonics and efficiency are "
        "recovered from the logs alone.",
        date=date,
    )
    functional = [row for row in result.rows if row.quantity in ("efficiency", "mass")]
    section = report.section("From the functional runs: weight and efficiency under load")
    section.figure(_efficiency_figure(result), "Efficiency of the screw over its load (Fig. 4.9).")
    section.table(ReportTable(_COLUMNS, _cells(functional), digits=4))
    _means(report.section("Mean friction"), result)
    _harmonics(report.section("Harmonics of the pitch"), result)
    _preload(report.section("Efficiency at the preload"), result)
    section = report.section("Histories of the tests")
    for released, speed, figures in _HISTORIES:
        kind = "FF" if released else "FFM"
        section.figure(
            _history(result, released, speed),
            f"Friction, position and speeds, {kind} at {speed:g} mm/s (Figs. {figures}).",
        )
    section = report.section("All quantities")
    title = f"{len(result.rows)} quantities, put in and recovered"
    section.table(ReportTable(_COLUMNS, _cells(result.rows), digits=4, folded=title))
    return closed(report, result.checks, "pisa-friction", Seed=result.seed)


def _cells(rows: Iterable[FrictionRow]) -> list[list[object]]:
    return [
        [r.quantity, r.direction, r.speed_mm_s, r.load_n, r.put_in, r.recovered, r.unit]
        for r in rows
    ]


def _means(section: Any, result: FrictionResult) -> None:
    section.text(
        "The tests end at 10 mm/s, the leg works at 24 to 50 mm/s. P adds values there with which "
        "the simulation meets the measured peak speeds; ours are ASSUMED. Dashed: extrapolated."
    )
    section.figure(
        _mean_figure(result), "Mean friction: tested, and extrapolated (Figs. 3.47, 3.48, 4.3)."
    )


def _mean_figure(result: FrictionResult) -> Figure:
    with new_figure(width=8.0, height=5.0, rows=2) as (figure, axes):
        for one, kind in zip(axes, ("ffm", "ff"), strict=True):
            for way, colour in _WAYS:
                table = np.array(result.tables[f"{kind}_{way}"])
                tested, beyond = table[table[:, 0] <= 10.0], table[table[:, 0] >= 10.0]
                one.semilogx(*tested.T, color=colour, label=f"{way}, put in")
                one.semilogx(*beyond.T, "--", color=colour, label="extrapolated")
                _crosses(one, result, f"friction_{kind}", way, colour)
            one.axvline(10.0, color=COLOURS["grey"], lw=0.8)
            one.set(ylabel=f"{kind.upper()} [N]", ylim=(0, None))
            one.legend(ncols=2, loc="upper left")
        axes[1].set(xlabel="Ram speed [mm/s]")
    return figure


def _crosses(axes: Any, result: FrictionResult, quantity: str, way: str, colour: str) -> None:
    rows = [r for r in result.rows if r.quantity == quantity and r.direction == way]
    axes.plot([r.speed_mm_s for r in rows], [r.recovered for r in rows], "x", color=colour)


def _harmonics(section: Any, result: FrictionResult) -> None:
    section.figure(
        _harmonics_figure(result),
        "Amplitudes of the first five harmonics: FF (Figs. 3.49, 4.4) and FFM (Fig. 3.50).",
    )
    section.figure(
        _spectra_figure(result), "Spectra of the friction, FF at 2 mm/s (Figs. 4.5 and 4.6)."
    )


def _harmonics_figure(result: FrictionResult) -> Figure:
    with new_figure(width=8.0, height=5.0, rows=2, sharex=True) as (figure, axes):
        for one, name, kind in zip(axes, ("harmonic", "harmonic_ffm"), ("FF", "FFM"), strict=True):
            for colour, order in zip(_PALETTE, range(1, 6), strict=False):
                rows = [r for r in result.rows if r.quantity == f"{name}_{order}"]
                put = sorted((r.speed_mm_s, r.put_in) for r in rows if r.speed_mm_s is not None)
                one.plot(*np.array(put).T, color=colour, label=f"harmonic {order}")
                one.plot(
                    [r.speed_mm_s for r in rows], [r.recovered for r in rows], "x", color=colour
                )
            one.set(ylabel=f"{kind}, amplitude [N]", ylim=(0, None))
        axes[0].legend(ncols=3)
        axes[1].set(xlabel="Ram speed [mm/s]")
    return figure


def _spectra_figure(result: FrictionResult) -> Figure:
    with new_figure(width=8.0, height=3.0, columns=2, sharey=True) as (figure, axes):
        for one, (way, colour), direction in zip(axes, _WAYS, (1, -1), strict=True):
            trace = _find(result, True, 2.0, direction)
            one.stem(trace.order, trace.amplitude_n, linefmt=colour, markerfmt="o", basefmt=" ")
            one.set(xlabel="Periods a turn of the screw", title=way, ylim=(0, None))
        axes[0].set(ylabel="Amplitude [N]")
    return figure


def _find(result: FrictionResult, released: bool, speed: float, direction: int) -> FrictionTrace:
    return next(
        trace
        for trace in result.traces
        if (trace.released, trace.direction) == (released, direction)
        and abs(trace.speed_mm_s - speed) < 1e-9
    )


def _preload(section: Any, result: FrictionResult) -> None:
    section.text(
        "Eq. (40): the friction of an unloaded nut taken as that of its preload. Symmetric in both "
        "directions, falling with the friction force."
    )
    section.figure(
        _preload_figure(result), "Efficiency over speed (Fig. 4.7) and friction (Fig. 4.8)."
    )


def _preload_figure(result: FrictionResult) -> Figure:
    with new_figure(width=8.0, height=3.2, columns=2, sharey=True) as (figure, axes):
        for way, colour in _WAYS:
            sign = 1.0 if way == "extension" else -1.0
            eta = {
                r.speed_mm_s: r.recovered
                for r in result.rows
                if r.quantity == "preload_efficiency" and r.direction == way
            }
            force = {
                r.speed_mm_s: r.recovered
                for r in result.rows
                if r.quantity == "friction_ff" and r.direction == way
            }
            speeds = sorted(speed for speed in eta if speed is not None)
            axes[0].plot(
                [sign * speed for speed in speeds],
                [eta[speed] for speed in speeds],
                "x-",
                color=colour,
                label=way,
            )
            pairs = sorted((force[speed], eta[speed]) for speed in speeds)
            axes[1].plot(*np.array(pairs).T, "x-", color=colour)
        axes[0].set(xlabel="Ram speed, positive extends [mm/s]", ylabel="Efficiency")
        axes[1].set(xlabel="Friction, FF [N]")
        axes[0].legend()
    return figure


def _history(result: FrictionResult, released: bool, speed: float) -> Figure:
    with new_figure(width=8.0, height=6.2, rows=4, sharex=True) as (figure, axes):
        for (way, colour), direction in zip(_WAYS, (1, -1), strict=True):
            trace = _find(result, released, speed, direction)
            thin = slice(10, None, max(1, trace.time.size // 1500))
            axes[0].plot(trace.time[thin], trace.friction_n[thin], color=colour, lw=0.8, label=way)
            axes[1].plot(trace.time[thin], trace.position_mm[thin], color=colour)
            axes[2].plot(trace.time[thin], trace.ram_mm_s[thin], color=colour)
            axes[3].plot(trace.time[thin], trace.motor_rad_s[thin], color=colour)
        axes[0].set(ylabel="Friction [N]")
        axes[0].legend(loc="center right")
        axes[1].set(ylabel="Ram [mm]")
        axes[2].set(ylabel="Ram [mm/s]")
        axes[3].set(ylabel="Motor [rad/s]", xlabel="Time [s]")
    return figure


def _efficiency_figure(result: FrictionResult) -> Figure:
    rows = [row for row in result.rows if row.quantity == "efficiency"]
    load = [row.load_n for row in rows]
    with new_figure(width=8.0, height=3.0) as (figure, axes):
        axes.plot(load, [row.put_in for row in rows], color=COLOURS["blue"], label="put in")
        axes.plot(
            load, [row.recovered for row in rows], "x", color=COLOURS["orange"], label="recovered"
        )
        axes.set(xlabel="Load [N]", ylabel="Efficiency of the screw", ylim=(0.5, 0.8))
        axes.legend()
    return figure
