"""The report of the Torino bench's validation: the works' pictures, bench beside model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.report import Report, ReportTable
from elevon.report.figures import COLOURS, new_figure
from elevon.reproduce.provenance import closed
from elevon.reproduce.torino_bench.validation import (
    START,
    TorinoValidation,
    ValidationCurves,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from elevon.arrays import Floats

_DEG, _RPM = 180.0 / np.pi, 30.0 / np.pi
_SHADES = ("blue", "orange", "green")
_SPAN = 10.0  # s that a picture shows: two periods


def torino_validation_page(result: TorinoValidation, *, date: str | None = None) -> Report:
    """Return the report of `elevon reproduce torino-validation`."""
    report = Report(
        "Bench against model at three backlashes",
        "The works draw measured and simulated curves; their signals were not published. Measured "
        "here means the virtual bench with hidden values. The model was calibrated on other logs, "
        "at the least backlash, and shares with the bench its equations: what is judged is the "
        "procedure and what it leaves over, not how good the works' own model is.",
        date=date,
    )
    _tables(report, result)
    _positions(report, result.curves)
    _errors(report, result.curves)
    _speeds(report, result.curves)
    return closed(
        report, result.checks, f"torino-validation --seed {result.seed}", result.parameter_hash
    )


def _tables(report: Report, result: TorinoValidation) -> None:
    section = report.section("Errors")
    rows: list[list[object]] = [
        [r.micrometer_mm, r.signal.replace("_", " "), r.rms, r.unit, r.percent_of_range, r.ratio]
        for r in result.rows
    ]
    columns = ["Micrometer [mm]", "Signal", "RMS error", "Unit", "% of range", "Bench over model"]
    caption = "After 10 s; the last column is the amplitudes' ratio."
    formats = ["", "", ".3g", "", ".3g", ".4f"]
    section.table(ReportTable(columns, rows, caption, formats=formats))
    columns = ["Micrometer [mm]", "Printed [deg]", "Bench [deg]", "Model [deg]", "Bench [s]",
               "Model [s]", "Amplitude [deg]", "Frequency [Hz]"]  # fmt: skip
    rows = [[f.micrometer_mm, f.printed_deg, f.bench_lost_deg, f.model_lost_deg, f.bench_flat_s,
             f.model_flat_s, f.fitted_amplitude_deg, f.fitted_frequency_hz]
            for f in result.backlashes]  # fmt: skip
    text = (
        "Lost motion of both, mean standstill at the extremes, and the sine fitted to the command."
    )
    section.table(ReportTable(columns, rows, text))


def _late(curve: ValidationCurves, span: float = _SPAN, start: float = START) -> slice:
    return slice(*np.searchsorted(curve.time, [start, start + span]).tolist())


def _pair(axis: Axes, curve: ValidationCurves, signal: str, scale: float, part: slice) -> None:
    """Draw bench and model of one signal."""
    time = curve.time[part]
    axis.plot(time, scale * curve.bench[signal][part], color=COLOURS["grey"], lw=2.6, label="bench")
    axis.plot(time, scale * curve.model[signal][part], color=COLOURS["orange"], lw=1, label="model")


def _positions(report: Report, curves: Sequence[ValidationCurves]) -> None:
    first, last = curves[0], curves[-1]
    section = report.section("Encoder and motor")
    with new_figure(len(curves), 1, width=8.0, height=6.4, sharex=True) as (figure, axes):
        for axis, curve in zip(axes, curves, strict=True):
            part = _late(curve)
            axis.plot(curve.time[part], _DEG * curve.command[part], color=COLOURS["green"], lw=0.8,
                      label="command")  # fmt: skip
            _pair(axis, curve, "encoder_position", _DEG, part)
            axis.set_ylabel(f"{curve.reading:g} mm [deg]")
        axes[0].legend(loc="upper right", ncols=3)
        axes[-1].set_xlabel("Time [s]")
    section.figure(figure, "Encoder at three backlashes (paper, Figures 9 and 11; thesis, 76, 83).")
    _peak(section.figure, first)
    with new_figure(width=8.0, height=2.4) as (figure, axis):
        _pair(axis, first, "motor_position", _DEG, _late(first))
        axis.set(xlabel="Time [s]", ylabel="Motor [deg]")
        axis.legend(loc="upper right", ncols=2)
    section.figure(figure, f"Motor at {first.reading:g} mm (thesis, Figure 78).")
    with new_figure(2, 1, width=8.0, height=4.0, sharex=True) as (figure, axes):
        for axis, curve in zip(axes, (first, last), strict=True):
            part = _late(curve)
            axis.plot(curve.time[part], _DEG * curve.bench["encoder_position"][part],
                      color=COLOURS["green"], label="encoder")  # fmt: skip
            axis.plot(curve.time[part], _DEG * _sine(curve)[part], color=COLOURS["grey"], lw=0.9,
                      label="sine fitted to the command")  # fmt: skip
            axis.set_ylabel(f"{curve.reading:g} mm [deg]")
        axes[0].legend(loc="upper right", ncols=2)
        axes[-1].set_xlabel("Time [s]")
    section.figure(figure, "Encoder and fitted command, least and most backlash (Figure 79).")


def _peak(add: Callable[..., object], curve: ValidationCurves) -> None:
    """Draw one extreme of the encoder: the standstill."""
    part = _late(curve, 5.0)
    top = curve.time[part][int(np.argmax(curve.bench["encoder_position"][part]))]
    near = _late(curve, 0.8, top - 0.3)
    with new_figure(width=8.0, height=2.6) as (figure, axis):
        _pair(axis, curve, "encoder_position", _DEG, near)
        axis.set(xlabel="Time [s]", ylabel="Encoder [deg]")
        axis.legend(loc="lower right", ncols=2)
    add(figure, f"The standstill at an extreme, {curve.reading:g} mm (thesis, Figure 77).")


def _sine(curve: ValidationCurves) -> Floats:
    """Return the sine nearest to the command, on the log's clock."""
    from elevon.reproduce.torino_bench.validation import fitted_sine

    _, frequency = fitted_sine(curve.time, curve.command, late=START)
    angle = 2.0 * np.pi * frequency * curve.time
    design = np.column_stack([np.ones_like(angle), np.sin(angle), np.cos(angle)])
    late = curve.time >= START
    weights = np.linalg.lstsq(design[late], curve.command[late], rcond=None)[0]
    return np.asarray(design @ weights)


def _errors(report: Report, curves: Sequence[ValidationCurves]) -> None:
    section = report.section("Errors over time")
    for signal, number in (("encoder_position", 80), ("motor_position", 81)):
        with new_figure(width=8.0, height=2.6) as (figure, axis):
            for curve, shade in zip(curves, _SHADES, strict=True):
                part = _late(curve)
                error = curve.model[signal][part] - curve.bench[signal][part]
                axis.plot(curve.time[part], _DEG * error, color=COLOURS[shade], lw=0.9,
                          label=f"{curve.reading:g} mm")  # fmt: skip
            axis.set(xlabel="Time [s]", ylabel="Model - bench [deg]")
            axis.legend(loc="upper right", ncols=3)
        name = signal.replace("_", " ")
        section.figure(figure, f"Error of the {name} at three backlashes (Figure {number}).")


def _speeds(report: Report, curves: Sequence[ValidationCurves]) -> None:
    section = report.section("Speed")
    with new_figure(len(curves), 1, width=8.0, height=6.0, sharex=True) as (figure, axes):
        for axis, curve in zip(axes, curves, strict=True):
            _pair(axis, curve, "motor_speed", _RPM, _late(curve))
            axis.set_ylabel(f"{curve.reading:g} mm [rpm]")
        axes[0].legend(loc="upper right", ncols=2)
        axes[-1].set_xlabel("Time [s]")
    section.figure(figure, "Motor speed at three backlashes (paper, Figure 10; thesis, 82).")
