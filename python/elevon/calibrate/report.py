"""The page of a calibration, and that of a validation."""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.estimate import LEVEL, Estimate
from elevon.report import Check, Report, ReportTable
from elevon.report.figures import COLOURS, new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.arrays import Floats
    from elevon.calibrate.outcome import Calibration
    from elevon.calibrate.validation import SignalError, Validation, ValidationTrace


def forest(
    estimates: Sequence[Estimate], truth: Mapping[str, float] | None = None
) -> Figure | None:
    """Return the plot of what an actuator file holds and held before; None where that is nothing.

    Parameters
    ----------
    estimates : sequence of Estimate
        Those without an old value of the same sign cannot be displayed as a ratio.
    truth : mapping, optional
        True values of a virtual unit, SI.
    """
    known = truth or {}
    changed = [i for i in estimates if i.in_set and i.old and i.value and i.old * i.value > 0.0]
    if not changed:
        return None
    with new_figure(width=8.0, height=0.28 * len(changed) + 1.2) as (figure, axes):
        for row, item in enumerate(reversed(changed)):
            assert item.old is not None
            low, high = (end / item.old for end in item.interval)
            axes.plot([low, high], [row, row], color=COLOURS["blue"], lw=3, solid_capstyle="butt")
            axes.plot(item.value / item.old, row, "o", color=COLOURS["blue"], ms=4)
            if item.path in known:
                axes.plot(known[item.path] / item.old, row, "x", color=COLOURS["red"], ms=7)
        axes.axvline(1.0, color=COLOURS["grey"], lw=0.8)
        axes.set(
            yticks=range(len(changed)),
            yticklabels=[item.path for item in reversed(changed)],
            xlabel="New value over old (cross: truth)" if known else "New value over old",
        )
    return figure


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
    _subsystems(report, facts.get("subsystems", {}))
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
    rows: list[dict[str, object]] = [
        {
            "Parameter": item.path + ("" if item.in_set else " *"),
            "Before": item.old,
            **({"Truth": truth.get(item.path)} if truth else {}),
            "After": item.value,
            "Interval": f"{item.interval[0]:.5g} to {item.interval[1]:.5g}",
            "Unit": item.unit,
            "Register": item.register,
            "From": item.source,
            "Holds for": ", ".join(item.given),
        }
        for item in result.estimates
    ]
    figure = forest(result.estimates, truth)
    if figure is not None:
        section.figure(figure, "Estimates over the old values, with their intervals.")
    section.table(ReportTable.of(rows, "* not part of the actuator file"))


def _subsystems(report: Report, parts: Mapping[str, Mapping[str, Any]]) -> None:
    """What is determined of each subsystem, and the inverse model beside its data."""
    if not parts:
        return
    section = report.section(
        "Subsystems",
        "Each from what was measured at its input and at its output; none waits for another.",
    )
    rows = [
        [name, part["status"].replace("_", " "), part.get("reason", "")]
        for name, part in parts.items()
    ]
    section.table(ReportTable(["Subsystem", "Status", "Why"], rows))
    numbers: list[dict[str, object]] = [
        {
            "Subsystem": name,
            "Number": key,
            "Value": item["value"],
            "Interval": f"{item['low']:.5g} to {item['high']:.5g}",
            "Unit": item["unit"],
        }
        for name, part in parts.items()
        for key, item in part.get("parameters", {}).items()
    ]
    if numbers:
        section.table(ReportTable.of(numbers))
    mechanics = parts.get("mechanics", {})
    for log, table in mechanics.get("residual", {}).items():
        section.figure(
            _inverse_model(np.asarray(table)),
            f"{log}: measured and predicted effort; what is left against speed and position.",
        )
    curve = np.asarray(mechanics.get("friction_curve", []))
    if curve.size:
        section.figure(
            _friction(curve), "Friction: the effort less inertia and constant load, by speed."
        )


def _inverse_model(table: Floats) -> Figure:
    """Draw columns time, position, speed, measured and predicted effort of a log."""
    time, position, speed, measured, predicted = table.T
    with new_figure(1, 3, width=9.5, height=2.8, squeeze=False) as (figure, axes):
        left, middle, right = axes[0]
        left.plot(time, measured, color=COLOURS["grey"], lw=2.0, label="measured")
        left.plot(time, predicted, color=COLOURS["orange"], lw=0.9, label="predicted")
        left.set(xlabel="Time [s]", ylabel="Effort")
        left.legend(loc="upper right")
        for axis, values, label in (
            (middle, speed, "Speed of the motor [rad/s]"),
            (right, position, "Position of the motor [rad]"),
        ):
            axis.plot(values, measured - predicted, ".", ms=2, color=COLOURS["blue"])
            axis.set(xlabel=label, ylabel="Measured less predicted")
    return figure


def _friction(curve: Floats) -> Figure:
    """Draw bins of speed: friction and its deviation."""
    with new_figure(1, 1, width=6.0, height=2.8, squeeze=False) as (figure, axes):
        axis = axes[0][0]
        axis.errorbar(
            curve[:, 0], curve[:, 1], yerr=curve[:, 2], fmt="o", ms=3, color=COLOURS["blue"]
        )
        axis.set(xlabel="Speed of the motor [rad/s]", ylabel="Friction")
    return figure


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
    text = "Relative for positive parameters, SI for offsets and delays."
    deviations = sorted(ranking["predicted"].items())
    section.table(ReportTable(["Candidate", "Predicted deviation"], deviations, text, digits=3))
    pairs = [f"{a} and {b}: correlation {c:+.3f}" for a, b, c in ranking["correlated"]]
    section.points(pairs or ["No pair is correlated by more than 0.95."])
    section.points(
        [f"{p} left out: {why}" for p, why in ranking["dropped"].items()]
        or ["No candidate had to be left out."]
    )


def _held_out(report: Report, held_out: Sequence[Mapping[str, Any]]) -> None:
    if not held_out:
        return
    rpm = 30.0 / math.pi
    rows = [
        {
            "Log": h["log"],
            "Kept back": h["span"],
            "Speed, without it [rpm]": h["speed_rms"] * rpm,
            "with it [rpm]": h["speed_rms_all_data"] * rpm,
            "Current, without it [A]": h["current_rms"],
            "with it [A]": h["current_rms_all_data"],
        }
        for h in held_out
    ]
    report.section(
        "Held-out logs",
        "Each log predicted with values fitted without it: errors near those with all logs mean "
        "that nothing was fitted that only one log shows.",
    ).table(ReportTable.of(rows, "RMS errors of the model runs.", digits=3))


def _agreement(report: Report, before: Validation | None, after: Validation) -> None:
    section = report.section(
        "Logs against the model",
        f"After {after.transient:g} s. Percent of the measured signal's RMS about its mean, and of "
        "its range.",
    )
    old = {(e.log, e.signal): e for e in before.errors} if before else {}
    rows = [_error_row(e, old.get((e.log, e.signal))) for e in after.errors]
    section.table(ReportTable.of(rows, digits=3))
    if after.phases:
        each = [
            {"Phase": phase, **_error_row(error, None)}
            for phase, rows in after.phases.items()
            for error in rows
        ]
        section.table(ReportTable.of(each, "Start, steady motion, reversal, contact.", digits=3))
    earlier = {t.log: t for t in before.traces} if before else {}
    units = {e.signal: e.unit for e in after.errors}
    for trace in after.traces:
        section.figure(
            _traces(trace, earlier.get(trace.log), after.transient, units),
            f"{trace.log}: measured and simulated, residual, spectrum of the residual.",
        )


def _error_row(error: SignalError, before: SignalError | None) -> dict[str, object]:
    factor, unit = _DISPLAY.get(error.unit, (1.0, error.unit))
    return {
        "Log": error.log,
        "Signal": _label(error.signal),
        "Unit": unit,
        "RMS": factor * error.rms,
        "Max": factor * error.largest,
        "RMS/RMS [%]": error.of_rms,
        "RMS/range [%]": error.of_range,
        "Away from corners [%]": error.of_rms_away,
        "Max/range [%]": error.largest_of_range,
        **({"RMS before": factor * before.rms} if before else {}),
    }


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
            both = (("before", before, "blue"), ("after", trace, "orange"))
            for label, of, colour in both:
                if of is not None:
                    residual = factor * (of.simulated[name] - of.measured[name])[keep]
                    middle.plot(
                        time[thin], residual[thin], color=COLOURS[colour], lw=0.7, label=label
                    )
            middle.set(ylabel=f"model less log [{unit}]")
            frequency, density = _spectrum(time, residual)
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
