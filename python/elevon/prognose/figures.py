"""Pictures of a prognosis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.prognose.observation import Inspection
from elevon.report.figures import COLOURS, new_figure
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from elevon.prognose.answer import Prognosis
    from elevon.prognose.law import Law


def severity_unit(unit: str) -> str:
    """Return the unit severities are displayed in: shares in percent, lengths in millimetres."""
    return {"1": "%", "m": "mm"}.get(unit, display_unit(unit))


def course_figure(
    result: Prognosis, inspections: Sequence[Inspection], laws: Sequence[Law]
) -> Figure:
    """Draw the severities that inspections saw and those to come."""
    with new_figure(len(laws), 1, height=1.2 + 2.2 * len(laws), sharex=True) as (figure, axes):
        far = _far(result)
        for k, (law, axis) in enumerate(zip(laws, np.atleast_1d(axes), strict=True)):
            unit = severity_unit(law.unit)
            course = to_display(result.future.course[:, k, :], unit)
            at = result.future.at
            near = at <= far
            band = axis.fill_between(
                at[near], course[near, 0], course[near, 2], color=COLOURS["orange"], alpha=0.25
            )
            band.set_label("to come, 90 %")
            axis.plot(at[near], course[near, 1], color=COLOURS["orange"], label="median")
            _draw_seen(axis, inspections, law, unit)
            axis.axvline(result.usage, color=COLOURS["grey"], lw=0.8)
            axis.set(ylabel=f"{law.kind} [{unit}]")
            axis.margins(y=0.15)
            axis.legend(loc="upper left")
        np.atleast_1d(axes)[-1].set_xlim(0.0, far)
        np.atleast_1d(axes)[-1].set(xlabel=f"use [{result.unit}]")
    return figure


def _far(result: Prognosis) -> float:
    """Return where the axis of use ends: the history keeps a quarter of it at least."""
    ends = [value for value in (*result.interval, result.median) if np.isfinite(value)]
    ahead = 1.15 * max(ends, default=np.inf)
    most = 3.0 * result.usage or np.inf
    return result.usage + max(min(ahead, most, float(result.future.at[-1] - result.usage)), 1.0)


def _draw_seen(axis: object, inspections: Sequence[Inspection], law: Law, unit: str) -> None:
    rows = [
        (item.usage, s.severity, s.low, s.high)
        for item in inspections
        if (s := item.seen.get(law.key)) is not None and s.severity is not None
    ]
    if not rows:
        return
    usage, severity, low, high = np.array(rows).T
    spread = 1.6449 * np.vstack((to_display(low, unit), to_display(high, unit)))
    axis.errorbar(  # type: ignore[attr-defined]
        usage, to_display(severity, unit), spread, fmt="o", ms=3.5, lw=1.0,
        color=COLOURS["blue"], label="inspections, 90 %",
    )  # fmt: skip


def survival_figure(result: Prognosis) -> Figure:
    """Draw the probability of surviving the next N."""
    ranked = np.sort(result.future.remaining)
    share = 1.0 - np.arange(1, len(ranked) + 1) / len(ranked)
    finite = np.isfinite(ranked)
    with new_figure(width=8.0, height=3.0) as (figure, axis):
        axis.step(np.append(0.0, ranked[finite]), np.append(1.0, share[finite]), where="post")
        axis.set(
            xlabel=f"next N {result.unit}", ylabel="probability of surviving", ylim=(0.0, 1.03)
        )
        if finite.any():  # the few futures that go on for long would press the others together
            axis.set_xlim(0.0, 1.15 * float(np.quantile(ranked[finite], 0.98)))
        for value, style in ((result.median, "-"), *((v, ":") for v in result.interval)):
            if np.isfinite(value):
                axis.axvline(value, color=COLOURS["grey"], ls=style, lw=0.9)
    return figure
