"""The page of a calibration, and that of a validation."""

from __future__ import annotations

import math
import sys
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.calibrate.forest import forest
from elevon.estimate import LEVEL
from elevon.report import Check, Report, ReportTable
from elevon.report.figures import COLOURS, new_figure

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.figure import Figure

    from elevon.calibrate.outcome import Calibration
    from elevon.calibrate.validation import Validation, ValidationTrace

#: How a quantity is shown, by its SI unit.
_DISPLAY = {
    "rad": (180.0 / math.pi, "deg"),
    "rad/s": (30.0 / math.pi, "rpm"),
    "m": (1e3, "mm"),
    "m/s": (1e3, "mm/s"),
}
_LABELS = {"encoder_position": "encoder", "current_q_meas": "torque current"}


def calibration_report(
    result: Calibration, *, truth: Mapping[str, float] | None = None, date: str | None = None
) -> Report:
    """Return the page of a calibration: parameters, what was not determined, errors of the logs.

    Parameters
    ----------
    result : Calibration
        The answer.
    truth : mapping, optional
        True values by path, where they are known.
    date : str, optional
        Printed on the page.
    """
    facts = result.facts
    names = ", ".join(log.name for log in result.logs)
    report = Report(f"Calibration of {result.name}", f"From {names}. {_scale(facts)}", date=date)
    count, missing = sum(i.in_set for i in result.estimates), len(result.undetermined)
    text = f"{count} parameters determined" + (f", {missing} not" if missing else "")
    report.judge(text, "open" if missing or not count else "pass")
    report.fact("Parameters estimated", str(sum(i.in_set for i in result.estimates)))
    explained = facts.get("explained", {})
    for name, text, of in (
        ("torque_balance", "Torque balance", "of the current"),
        ("speed_controller", "Speed controller", "of the set point"),
    ):
        if explained.get(name) is not None:
            report.fact(text, f"{100 * explained[name]:.2f} %", of)
    if "structure" in facts:
        report.fact("Controller", f"{facts['structure']['chosen']} ({facts['structure']['why']})")
    report.fact("Time", f"{result.wall_s:.1f} s")
    _parameters(report, result, truth or {})
    if result.undetermined:
        rows = list(result.undetermined.items())
        report.section("Not determined").table(ReportTable(["Parameter", "Reason"], rows))
    if result.findings:
        report.section("What to know").points(result.findings)
    _ranking(report, facts.get("identifiability"))
    _held_out(report, [item for item in facts.get("held_out", ()) if "speed_rms" in item])
    if result.validation is not None:
        _agreement(report, result.validation_before, result.validation)
    report.provenance(_provenance())
    return report


def _scale(facts: Mapping[str, Any]) -> str:
    """Return what the scale of all torques comes from, where that was a question."""
    if "torque_constant" not in facts:
        return ""
    if facts["torque_constant"]["from_load_cell"]:
        return "The load cell gives the torque constant: torques are absolute."
    return "No load cell: torques are known only as ratios to the torque constant."


def _provenance() -> dict[str, object]:
    import elevon

    python = ".".join(str(part) for part in sys.version_info[:3])
    return {"Elevon": elevon.__version__, "Python": python}


def validation_report(result: Validation, *, date: str | None = None) -> Report:
    """Return the page of a validation."""
    report = Report(
        f"{result.actuator} against its logs",
        f"Closed loop of the {result.fidelity} model on each log's own command, "
        f"{result.transient:g} s left out at the beginning.",
        date=date,
    )
    _agreement(report, None, result)
    checks = [
        Check(f"{e.log}: {_label(e.signal)}, RMS error over range", e.of_range, e.limit, "%")
        for e in result.errors
        if e.limit is not None
    ]
    if checks:
        report.section("Thresholds of the actuator file").checks(checks)
    else:
        report.judge("Measured: the actuator file has no thresholds", "open")
    report.provenance(_provenance())
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
            item.source,
            ", ".join(item.given),
        ]
        if truth:
            row.insert(2, truth.get(item.path))
        rows.append(row)
    figure = forest(result.estimates, truth)
    if figure is not None:
        section.figure(figure, "Estimates over the old values, with their intervals.")
    section.table(ReportTable(columns, rows, "* not part of the actuator file", digits=5))


def _ranking(report: Report, ranking: Mapping[str, Any] | None) -> None:
    if ranking is None:
        return
    section = report.section(
        "What the logs can determine",
        "Sensitivities of speed and current of the model runs, scaled by a meaningful change of "
        "each parameter and by the residual's spread. Small singular values are directions that "
        "the logs do not see.",
    )
    rows = [[k + 1, float(s)] for k, s in enumerate(ranking["singular_values"])]
    section.table(ReportTable(["", "Singular value"], rows, digits=4))
    section.table(
        ReportTable(
            ["Candidate", "Predicted deviation"],
            sorted(ranking["predicted"].items()),
            "Relative for positive parameters, SI for offsets and delays.",
            digits=3,
        )
    )
    pairs = [f"{a} and {b}: correlation {c:+.3f}" for a, b, c in ranking["correlated"]]
    section.points(pairs or ["No pair is correlated by more than 0.95."])
    section.points(
        [f"{p} left out: {why}" for p, why in ranking["dropped"].items()]
        or ["No candidate had to be left out."]
    )


def _held_out(report: Report, held_out: Sequence[Mapping[str, Any]]) -> None:
    if not held_out:
        return
    rows = [
        [
            h["log"],
            h["span"],
            h["speed_rms"] * 30.0 / math.pi,
            h["speed_rms_all_data"] * 30.0 / math.pi,
            h["current_rms"],
            h["current_rms_all_data"],
        ]
        for h in held_out
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
        factor, unit = _DISPLAY.get(e.unit, (1.0, e.unit))
        row: list[object] = [
            e.log,
            _label(e.signal),
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
    units = {e.signal: e.unit for e in after.errors}
    for trace in after.traces:
        section.figure(
            _traces(trace, earlier.get(trace.log), after.transient, units),
            f"{trace.log}: measured and simulated, residual, spectrum of the residual.",
        )


def _label(signal: str) -> str:
    return _LABELS.get(signal, signal.replace("_", " "))


def _traces(
    trace: ValidationTrace,
    before: ValidationTrace | None,
    transient: float,
    units: Mapping[str, str],
) -> Figure:
    names = [name for name in trace.simulated if name in units]
    height = 0.4 + 2.2 * len(names)
    with new_figure(
        len(names), 3, width=9.5, height=height, squeeze=False, width_ratios=[2, 2, 1.4]
    ) as (figure, axes):
        keep = trace.used
        time = trace.time[keep]
        for row, name in enumerate(names):
            factor, unit = _DISPLAY.get(units[name], (1.0, units[name]))
            data, model = factor * trace.measured[name], factor * trace.simulated[name]
            left, middle, right = axes[row]
            thin = slice(None, None, max(1, len(time) // 3000))
            left.plot(time[thin], data[keep][thin], color=COLOURS["grey"], lw=2.2, label="log")
            left.plot(time[thin], model[keep][thin], color=COLOURS["orange"], lw=0.9, label="model")
            left.set(ylabel=f"{_label(name)} [{unit}]")
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
        for axis in axes[-1][:2]:
            axis.set(xlabel=f"Time [s], from {transient:g} s")
        axes[-1][2].set(xlabel="Frequency [Hz]")
    return figure


def _spectrum(time: Any, residual: Any) -> tuple[Any, Any]:
    from scipy.signal import welch

    rate = 1.0 / float(np.median(np.diff(time)))
    frequency, power = welch(residual, rate, nperseg=min(1024, len(residual)))
    return frequency[1:], np.sqrt(np.maximum(power[1:], 1e-300))
