"""The page of a calibration, and that of a validation."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.calibrate.estimate import LEVEL
from elevon.calibrate.forest import forest
from elevon.calibrate.validation import SIGNALS
from elevon.report import Check, Report, ReportTable
from elevon.report.figures import COLOURS, new_figure

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.figure import Figure

    from elevon.calibrate.calibration import Calibration
    from elevon.calibrate.validation import Validation, ValidationTrace

__all__ = ["calibration_report", "validation_report"]

_AXES = {
    "encoder_position": (180.0 / math.pi, "deg"),
    "motor_speed": (30.0 / math.pi, "rpm"),
    "current_q_meas": (1.0, "A"),
}
_LABELS = {
    "encoder_position": "encoder",
    "motor_speed": "motor speed",
    "current_q_meas": "torque current",
}


def calibration_report(
    result: Calibration,
    before: Validation | None = None,
    after: Validation | None = None,
    *,
    truth: Mapping[str, float] | None = None,
    provenance: Mapping[str, object] | None = None,
    date: str | None = None,
) -> Report:
    """Return the report of a calibration.

    Parameters
    ----------
    result : Calibration
        What was found.
    before, after : Validation, optional
        The closed loop against the same logs with old and new values.
    truth : mapping, optional
        True values by path, where they are known.
    provenance : mapping, optional
        Version, command line.
    date : str, optional
        Printed on the page.
    """
    names = ", ".join(log.name for log in result.logs)
    report = Report(
        f"Calibration of {result.before.name}",
        f"From {names}. "
        + (
            "The load cell gives the torque constant: torques are absolute."
            if result.torque.measured
            else "No load cell: torques are known only as ratios to the torque constant."
        ),
        date=date,
    )
    report.fact("Parameters estimated", str(sum(i.in_set for i in result.estimates)))
    if result.plant is not None:
        report.fact("Torque balance", f"{100 * result.plant.explained:.2f} %", "of the current")
    if result.law is not None:
        report.fact("Speed controller", f"{100 * result.law.explained:.2f} %", "of the set point")
    report.fact("Time", f"{result.wall_s:.1f} s")
    _parameters(report, result, truth or {})
    if result.findings:
        report.section("What to know").points(result.findings)
    _ranking(report, result)
    _held_out(report, result)
    if after is not None:
        _agreement(report, before, after)
    if provenance:
        report.provenance(provenance)
    return report


def validation_report(
    result: Validation,
    *,
    provenance: Mapping[str, object] | None = None,
    date: str | None = None,
) -> Report:
    """Return the report of a validation."""
    report = Report(
        f"{result.actuator} against its logs",
        f"Closed loop of the {result.fidelity} model on each log's own command, "
        f"{result.transient:g} s left out at the beginning.",
        date=date,
    )
    _agreement(report, None, result)
    checks = [
        Check(f"{e.log}: {_LABELS[e.signal]}, RMS error over range", e.of_range, e.limit, "%")
        for e in result.errors
        if e.limit is not None
    ]
    if checks:
        report.section("Thresholds of the actuator file").checks(checks)
    if provenance:
        report.provenance(provenance)
    return report


def _parameters(report: Report, result: Calibration, truth: Mapping[str, float]) -> None:
    section = report.section(
        "Parameters",
        f"Intervals hold {100 * LEVEL:.0f} % of the time for coloured residuals. Plant, controller "
        "and sensor are kept apart; what no actuator file has a place for is marked.",
    )
    columns = ["Parameter", "Before", "After", "Interval", "Unit", "Register", "From", "Holds for"]
    if truth:
        columns.insert(2, "Truth")
    rows = []
    for item in result.estimates:
        row: list[object] = [
            item.path + ("" if item.in_set else " *"),
            item.old,
            item.value,
            f"{item.interval[0]:.5g} to {item.interval[1]:.5g}",
            item.unit,
            item.register,
            item.method,
            ", ".join(item.given),
        ]
        if truth:
            row.insert(2, truth.get(item.path))
        rows.append(row)
    figure = forest(result.estimates, truth)
    if figure is not None:
        section.figure(figure, "Estimates over the old values, with their intervals.")
    section.table(ReportTable(columns, rows, "* not part of the actuator file", digits=5))


def _ranking(report: Report, result: Calibration) -> None:
    if result.dynamic is None:
        return
    ranking = result.dynamic.ranking
    section = report.section(
        "What the logs can determine",
        "Sensitivities of speed and current of the model runs, scaled by a meaningful change of "
        "each parameter and by the residual's spread. Small singular values are directions that "
        "the logs do not see.",
    )
    rows = [[k + 1, float(s)] for k, s in enumerate(ranking.singular_values)]
    section.table(ReportTable(["", "Singular value"], rows, digits=4))
    section.table(
        ReportTable(
            ["Candidate", "Predicted deviation"],
            sorted(ranking.predicted.items()),
            "Relative for positive parameters, SI for offsets and delays.",
            digits=3,
        )
    )
    pairs = [f"{a} and {b}: correlation {c:+.3f}" for a, b, c in ranking.pairs]
    section.points(pairs or ["No pair is correlated by more than 0.95."])
    section.points(
        [f"{p} left out: {why}" for p, why in ranking.dropped.items()]
        or ["No candidate had to be left out."]
    )


def _held_out(report: Report, result: Calibration) -> None:
    if not result.held_out:
        return
    rows = [
        [
            h.log,
            h.span,
            h.speed * 30.0 / math.pi,
            h.speed_all * 30.0 / math.pi,
            h.current,
            h.current_all,
        ]
        for h in result.held_out
    ]
    report.section(
        "Held-out logs",
        "Each log predicted with values fitted without it: errors near those with all logs mean "
        "that nothing was fitted that only one log shows.",
    ).table(
        ReportTable(
            [
                "Log",
                "Kept back",
                "Speed, without it [rpm]",
                "with it [rpm]",
                "Current, without it [A]",
                "with it [A]",
            ],
            rows,
            "RMS errors of the model runs.",
            digits=3,
        )
    )


def _agreement(report: Report, before: Validation | None, after: Validation) -> None:
    section = report.section(
        "Logs against the model",
        f"After {after.transient:g} s. Percent of the measured signal's RMS about its mean, and of "
        "its range.",
    )
    old = {(e.log, e.signal): e for e in before.errors} if before else {}
    columns = [
        "Log",
        "Signal",
        "Unit",
        "RMS",
        "Max",
        "RMS/RMS [%]",
        "RMS/range [%]",
        "Max/range [%]",
    ]
    rows = []
    for e in after.errors:
        factor, unit = _AXES[e.signal]
        row: list[object] = [
            e.log,
            _LABELS[e.signal],
            unit,
            factor * e.rms,
            factor * e.largest,
            e.of_rms,
            e.of_range,
            e.largest_of_range,
        ]
        if before:
            row.append(factor * old[e.log, e.signal].rms)
        rows.append(row)
    section.table(ReportTable([*columns, *(["RMS before"] if before else [])], rows, digits=3))
    earlier = {t.log: t for t in before.traces} if before else {}
    for trace in after.traces:
        section.figure(
            _traces(trace, earlier.get(trace.log), after.transient),
            f"{trace.log}: measured and simulated, residual, spectrum of the residual.",
        )


def _traces(trace: ValidationTrace, before: ValidationTrace | None, transient: float) -> Figure:
    with new_figure(3, 3, width=9.5, height=7.0, width_ratios=[2, 2, 1.4]) as (figure, axes):
        keep = trace.used
        time = trace.time[keep]
        for row, name in enumerate(SIGNALS):
            factor, unit = _AXES[name]
            data, model = factor * trace.measured[name], factor * trace.simulated[name]
            left, middle, right = axes[row]
            thin = slice(None, None, max(1, len(time) // 3000))
            left.plot(time[thin], data[keep][thin], color=COLOURS["grey"], lw=2.2, label="log")
            left.plot(time[thin], model[keep][thin], color=COLOURS["orange"], lw=0.9, label="model")
            left.set(ylabel=f"{_LABELS[name]} [{unit}]")
            if before is not None:
                residual = factor * (before.simulated[name] - before.measured[name])[keep]
                middle.plot(
                    time[thin], residual[thin], color=COLOURS["blue"], lw=0.7, label="before"
                )
            residual = (model - data)[keep]
            middle.plot(time[thin], residual[thin], color=COLOURS["orange"], lw=0.7, label="after")
            middle.set(ylabel=f"model less log [{unit}]")
            frequency, density = _spectrum(trace.time[keep], residual)
            right.loglog(frequency, density, color=COLOURS["orange"], lw=0.9)
            right.set(ylabel=f"{unit}/\N{SQUARE ROOT}Hz")
        axes[0][0].legend(loc="upper right")
        axes[0][1].legend(loc="upper right")
        for axis in axes[2][:2]:
            axis.set(xlabel=f"Time [s], from {transient:g} s")
        axes[2][2].set(xlabel="Frequency [Hz]")
    return figure


def _spectrum(time: Any, residual: Any) -> tuple[Any, Any]:
    from scipy.signal import welch

    rate = 1.0 / float(np.median(np.diff(time)))
    frequency, power = welch(residual, rate, nperseg=min(1024, len(residual)))
    return frequency[1:], np.sqrt(np.maximum(power[1:], 1e-300))
