"""Pictures and interactive pages of recordings."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError, unknown
from elevon.files import atomic_path, check_output, write_text
from elevon.recording.channel import Channel
from elevon.recording.clock import Clock
from elevon.units import shown_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from elevon.recording.recording import Recording

__all__ = ["plot"]

PICTURES = (".png", ".svg", ".pdf")
_MOST_POINTS = 100_000
"""On a picture of some thousand pixels the extremes of this many slices look like all samples."""


@dataclass(frozen=True)
class _Panel:
    unit: str
    clock: Clock
    lines: dict[str, npt.NDArray[np.float64]]


def plot(
    recording: Recording,
    names: Iterable[str] | None,
    path: str | os.PathLike[str] | None,
    *,
    units: Mapping[str, str],
    title: str | None,
    force: bool,
) -> Figure | Path:
    """See `Recording.plot`."""
    chosen = recording.channels if names is None else [recording[name] for name in names]
    if not chosen:
        raise InputError("nothing to plot: the recording has no channel, or none was named")
    for name in units:
        recording[name]
    heading = str(recording.meta.get("actuator", "Recording")) if title is None else title
    suffix = None if path is None else Path(path).suffix.lower()
    if suffix is not None and suffix not in (*PICTURES, ".html"):
        raise unknown("ending of a plot", suffix, (*PICTURES, ".html"), str(path))
    if path is not None:
        check_output(path, force=force)
    panels = _panels(chosen, units)
    if path is not None and suffix == ".html":
        return write_text(path, _page(panels, heading), force=force)
    figure = _figure(panels, heading)
    if path is None:
        return figure
    with atomic_path(path, force=force) as temporary:
        figure.savefig(temporary, format=str(suffix)[1:], dpi=150)
    return Path(path).expanduser()


def _panels(channels: list[Channel], units: Mapping[str, str]) -> list[_Panel]:
    """Group channels that share a clock and a unit."""
    panels: dict[tuple[str, str], _Panel] = {}
    for channel in channels:
        unit = units.get(channel.name) or shown_unit(channel.unit)
        key = (channel.clock.name, unit)
        panel = panels.setdefault(key, _Panel(unit, channel.clock, {}))
        panel.lines[channel.name] = channel.to(unit)
    return list(panels.values())


def _page(panels: list[_Panel], heading: str) -> str:
    from elevon.report.uplot import chart, page

    several = len({panel.clock.name for panel in panels}) > 1
    charts = []
    for panel in panels:
        label = "" if panel.unit == "1" else f"[{panel.unit}]"
        note = f"Clock: {panel.clock.name}." if several else ""
        charts.append(
            chart(
                ", ".join(panel.lines),
                panel.clock.time,
                panel.lines,
                y_label=label,
                note=note,
                breaks=panel.clock.gaps,
            )
        )
    return page(heading, "\n".join(charts))


def _figure(panels: list[_Panel], heading: str) -> Figure:
    from matplotlib.figure import Figure

    height = 1.0 + 2.2 * len(panels)
    figure = Figure(figsize=(9.0, min(height, 200.0)), layout="constrained")
    axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
    shared = {panel.clock.name for panel in panels}
    for axis, panel in zip(axes, panels, strict=True):
        _draw(axis, panel, len(shared) > 1)
        axis.sharex(axes[0])
    for axis in axes[:-1]:
        axis.tick_params(labelbottom=False)
    axes[-1].set_xlabel("time [s]")
    figure.suptitle(heading.replace("$", r"\$"), fontsize=11)
    return figure


def _draw(axis: Axes, panel: _Panel, name_clock: bool) -> None:
    from elevon.report.uplot import COLOURS, thinned

    for k, (name, values) in enumerate(panel.lines.items()):
        time, line = panel.clock.time, values
        if panel.clock.gaps:
            after = np.asarray(panel.clock.gaps, dtype=np.intp) + 1
            time, line = np.insert(time, after, np.nan), np.insert(line, after, np.nan)
        elif time.size > _MOST_POINTS:
            time, thin_lines = thinned(time, {name: line}, _MOST_POINTS)
            line = thin_lines[name]
        axis.plot(time, line, label=name, linewidth=1.1, color=COLOURS[k % len(COLOURS)])
    clock = f" ({panel.clock.name})" if name_clock else ""
    axis.set_ylabel(("" if panel.unit == "1" else f"[{panel.unit}]") + clock)
    axis.grid(alpha=0.3, linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
