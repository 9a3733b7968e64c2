"""Pictures of the demonstration."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.prognose.page import severity_unit
from elevon.report.figures import COLOURS, new_figure
from elevon.units import to_display

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.demo.life.results import LifeDemo
    from elevon.logs.log import Log


def cone_figure(demo: LifeDemo) -> Figure:
    """Draw the predicted end of life at each inspection: a cone that closes on the true one."""
    track = demo.track
    with new_figure(width=9.0, height=4.4) as (figure, axis):
        axis.fill_between(
            track.usage, track.usage + track.low, track.usage + track.high,
            color=COLOURS["orange"], alpha=0.25, lw=0, label="predicted, 90 %",
        )  # fmt: skip
        axis.plot(
            track.usage, track.usage + track.median, "o-", color=COLOURS["orange"],
            label="predicted end of life",
        )  # fmt: skip
        axis.axhline(track.end, color=COLOURS["blue"], lw=2.0, label="true end of life")
        reach = np.array([0.0, track.end])
        axis.fill_between(reach, 0.0, reach, color=COLOURS["grey"], alpha=0.12, lw=0)
        axis.text(0.97 * track.end, 0.45 * track.end, "flown", ha="right", color=COLOURS["grey"])
        highest = float(np.max((track.usage + track.high)[1:], initial=track.end))
        axis.set(
            xlim=(0.0, 1.03 * track.end),
            ylim=(0.0, 1.15 * max(highest, track.end)),
            xlabel="flights at the inspection",
            ylabel="end of life [flights]",
        )
        axis.plot([track.end], [track.end], "s", color=COLOURS["blue"], ms=7)
        axis.legend(loc="lower left")
    return figure


def remaining_figure(demo: LifeDemo) -> Figure:
    """Draw remaining life, predicted and true, with the 20 % wedge."""
    track = demo.track
    with new_figure(width=8.5, height=3.4) as (figure, axis):
        use = np.array([0.0, track.end])
        true = track.end - use
        axis.fill_between(
            use, 0.8 * true, 1.2 * true, color=COLOURS["green"], alpha=0.2, lw=0,
            label="20 % about the truth",
        )  # fmt: skip
        axis.plot(use, true, color=COLOURS["green"], label="truth")
        spread = np.vstack((track.median - track.low, track.high - track.median))
        axis.errorbar(
            track.usage, track.median, spread, fmt="o", ms=4, color=COLOURS["orange"],
            label="predicted, 90 %",
        )  # fmt: skip
        axis.set(xlabel="flights at the inspection", ylabel="remaining [flights]", ylim=(0.0, None))
        axis.legend()
    return figure


def diagnoses_figure(demo: LifeDemo) -> Figure:
    """Draw what each inspection's diagnosis said, and the truth."""
    laws = demo.response.laws
    with new_figure(1, len(laws), width=9.0, height=3.4) as (figure, axes):
        for k, (law, axis) in enumerate(zip(laws, np.atleast_1d(axes), strict=True)):
            unit = severity_unit(law.unit)
            truth = to_display(demo.life.severity[:, k], unit)
            axis.plot(demo.life.usage, truth, color=COLOURS["green"], label="truth")
            rows = [
                (v.usage, s.severity, 1.6449 * s.low, 1.6449 * s.high)
                for v in demo.visits
                if (s := v.inspection.seen.get(law.key)) is not None and s.severity is not None
            ]
            if rows:
                usage, value, low, high = np.array(rows).T
                axis.errorbar(
                    usage, to_display(value, unit),
                    np.vstack((to_display(low, unit), to_display(high, unit))),
                    fmt="o", ms=4, color=COLOURS["blue"], label="diagnosis, 90 %",
                )  # fmt: skip
            missed = [
                v.usage for v in demo.visits
                if (s := v.inspection.seen.get(law.key)) is not None and s.severity is None
            ]  # fmt: skip
            axis.plot(missed, np.zeros(len(missed)), "x", color=COLOURS["grey"], label="not seen")
            axis.set(xlabel="flights", ylabel=f"{law.kind} [{unit}]", title=law.kind)
            axis.legend(loc="upper left")
    return figure


def signals_figure(healthy: Log, worn: Log, ratio: float, usage: float) -> Figure:
    """Draw two logs of the same test: the two positions' difference, and the current."""
    with new_figure(2, 1, width=9.0, height=4.8, sharex=True) as (figure, axes):
        for data, colour, name in (
            (healthy, "blue", "new"),
            (worn, "orange", f"at flight {usage:.0f}"),
        ):
            keep = (data.time > 5.0) & (data.time < 15.0)
            time = data.time[keep] - 5.0
            gap = np.degrees(data.motor / ratio - data.output)[keep]
            axes[0].plot(time, gap - 0.5 * (gap.max() + gap.min()), color=COLOURS[colour], lw=1.2,
                         label=name)  # fmt: skip
            current = _smooth(data.current[keep], 9)
            axes[1].plot(time, current, color=COLOURS[colour], lw=0.9, label=name)
        axes[0].set(
            ylabel="motor less output [deg]", title="Lost motion: both positions of the log"
        )
        axes[1].set(ylabel="torque current [A]", xlabel="time [s]",
                    title="Current, smoothed over 20 ms")  # fmt: skip
        axes[0].margins(y=0.25)
        axes[0].legend(loc="upper right", ncols=2)
    return figure


def _smooth(values: Floats, width: int) -> Floats:
    return np.convolve(values, np.full(width, 1.0 / width), mode="same")
