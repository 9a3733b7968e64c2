"""Pictures and interactive pages of recordings."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from elevon.errors import InputError, unknown
from elevon.files import atomic_path, check_output, write_text
from elevon.recording.channel import Channel
from elevon.recording.overview import Band, Panel, bands, overlaid, overview
from elevon.recording.overview import spectra as spectra_of
from elevon.units import display_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from elevon.recording.recording import Recording

PICTURES = (".png", ".svg", ".pdf")
_NONE: Mapping[str, str] = {}
_MOST_POINTS = 100_000
"""On a picture of some thousand pixels the extremes of this many slices look like all samples."""


def plot(
    recording: Recording,
    names: Iterable[str] | None = None,
    path: str | os.PathLike[str] | None = None,
    *,
    units: Mapping[str, str] = _NONE,
    title: str | None = None,
    compare: Recording | str | os.PathLike[str] | None = None,
    spectra: bool = False,
    force: bool = False,
) -> Figure | Path:
    """Plot a run: command against output, error, current, speed, faults and states marked.

    With names, or where nothing says what is what: one panel for each unit and clock.

    Parameters
    ----------
    names : iterable of str, optional
        Channels; by default what shows how the run went, by the roles of the channels.
    path : path, optional
        ``.png``, ``.svg`` or ``.pdf`` for a picture, ``.html`` for one self-contained
        interactive page. Without it the matplotlib figure is returned and nothing written.
    units : mapping of str to str, optional
        Channel name to the unit displayed; default degrees, rpm and degC for angles, angular
        speeds and temperatures, else SI.
    title : str, optional
        Title; default the actuator's name.
    compare : Recording or path, optional
        Another run, drawn over this one: healthy beside faulty.
    spectra : bool
        Add the amplitude spectra of error, current and speed.
    force : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Figure or Path
        The figure, or the file written.

    Raises
    ------
    UnknownNameError
        Unknown channel or file ending.
    OutputError
        The file exists already or cannot be written.
    """
    names = None if names is None else list(names)
    suffix = None if path is None else Path(path).suffix.lower()
    if suffix is not None and suffix not in (*PICTURES, ".html"):
        raise unknown("ending of a plot", suffix, (*PICTURES, ".html"), str(path))
    if path is not None:
        check_output(path, force=force)
    heading = str(recording.meta.get("actuator", "Recording")) if title is None else title
    panels = panels_of(recording, names, units)
    marked = bands(recording)
    if compare is not None:
        if isinstance(compare, (str, os.PathLike)):
            name, other = Path(compare).name, type(recording).load(compare)
        else:
            name, other = str(compare.meta.get("label") or "other"), compare
        panels = overlaid(panels, panels_of(other, names, units), name)
        marked += [item for item in bands(other) if item.kind == "fault" and item not in marked]
    if spectra:
        panels = panels + spectra_of(panels)
    if path is not None and suffix == ".html":
        return write_text(path, _page(panels, marked, heading), force=force)
    figure = _figure(panels, marked, heading)
    if path is None:
        return figure
    with atomic_path(path, force=force) as temporary:
        figure.savefig(temporary, format=str(suffix)[1:], dpi=150)
    return Path(path).expanduser()


def panels_of(
    recording: Recording, names: Iterable[str] | None = None, units: Mapping[str, str] = _NONE
) -> list[Panel]:
    """Return the panels of the channels named; without names the run's, or of every channel."""
    for name in units:
        recording[name]
    panels = overview(recording) if names is None and not units else []
    if panels:
        return panels
    chosen = recording.channels if names is None else [recording[name] for name in names]
    if not chosen:
        raise InputError("nothing to plot: the recording has no channel, or none was named")
    return _panels(chosen, units)


def _panels(channels: list[Channel], units: Mapping[str, str]) -> list[Panel]:
    """Group channels that share a clock and a unit."""
    panels: dict[tuple[str, str], Panel] = {}
    for channel in channels:
        unit = units.get(channel.name) or display_unit(channel.unit)
        clock = channel.clock
        panel = panels.setdefault(
            (clock.name, unit), Panel("", unit, clock.time, {}, tuple(clock.gaps), clock.name)
        )
        panel.lines[channel.name] = channel.to(unit)
    return list(panels.values())


def _page(panels: list[Panel], marked: list[Band], heading: str) -> str:
    from elevon.report.uplot import chart, page

    several = len({panel.clock for panel in panels if panel.clock}) > 1
    charts = []
    for panel in panels:
        label = "" if panel.unit == "1" else f"[{panel.unit}]"
        notes = [f"Clock: {panel.clock}."] if several and panel.clock else []
        shaded = [] if panel.spectrum else marked
        if panel is panels[0]:
            notes += [f"{band.text}: {band.start:g} to {band.end:g} s." for band in shaded[:12]]
        charts.append(
            chart(
                panel.title or ", ".join(panel.lines),
                panel.time,
                panel.lines | panel.others,
                dashed=list(panel.others),
                x_label="frequency [Hz]" if panel.spectrum else "time [s]",
                y_label=label,
                note=" ".join(notes),
                breaks=panel.gaps,
                shaded=[(b.start, b.end, b.text, b.kind == "fault") for b in shaded],
                logarithmic=panel.spectrum,
            )
        )
    return page(heading, "\n".join(charts))


def _figure(panels: list[Panel], marked: list[Band], heading: str) -> Figure:
    from matplotlib.figure import Figure

    height = 1.0 + 2.2 * len(panels)
    figure = Figure(figsize=(9.0, min(height, 200.0)), layout="constrained")
    axes = figure.subplots(len(panels), 1, squeeze=False)[:, 0]
    shared = {panel.clock for panel in panels if panel.clock}
    timed = [axis for axis, panel in zip(axes, panels, strict=True) if not panel.spectrum]
    for axis, panel in zip(axes, panels, strict=True):
        _draw(axis, panel, len(shared) > 1)
        if panel.spectrum:
            axis.set(xscale="log", yscale="log", xlabel="frequency [Hz]")
        else:
            axis.sharex(timed[0])
            _shade(axis, marked, named=axis is timed[0])
    for axis in timed[:-1]:
        axis.tick_params(labelbottom=False)
    if timed:
        timed[-1].set_xlabel("time [s]")
    figure.suptitle(heading.replace("$", r"\$"), fontsize=11)
    return figure


def _shade(axis: Axes, marked: list[Band], *, named: bool) -> None:
    """Shade stretches with a fault in red, states in turns of grey; name them on the top panel."""
    states = 0
    for level, band in enumerate(marked):
        fault = band.kind == "fault"
        states += not fault
        alpha = 0.10 if fault else 0.10 * (states % 2)
        colour = "#d1483c" if fault else "#8a929d"
        axis.axvspan(band.start, band.end, color=colour, alpha=alpha, lw=0)
        if named:
            place = (band.start, 0.98 - 0.09 * (level % 3))
            axis.annotate(
                band.text.replace("$", r"\$"),
                place,
                xycoords=("data", "axes fraction"),
                fontsize=7,
                color=colour,
                va="top",
                clip_on=True,
            )


def _draw(axis: Axes, panel: Panel, name_clock: bool) -> None:
    from elevon.report.thinning import thinned
    from elevon.report.uplot import COLOURS

    for k, (name, values) in enumerate((panel.lines | panel.others).items()):
        time, line = panel.time, values
        if panel.gaps:
            after = np.asarray(panel.gaps, dtype=np.intp) + 1
            time, line = np.insert(time, after, np.nan), np.insert(line, after, np.nan)
        elif time.size > _MOST_POINTS:
            time, thin_lines = thinned(time, {name: line}, _MOST_POINTS)
            line = thin_lines[name]
        style = "--" if name in panel.others else "-"
        colour = COLOURS[k % len(COLOURS)]
        axis.plot(time, line, style, label=name, linewidth=1.1, color=colour)
    clock = f" ({panel.clock})" if name_clock and panel.clock else ""
    unit = "" if panel.unit == "1" else f"[{panel.unit}]"
    axis.set_ylabel(f"{panel.title} {unit}".strip() + clock)
    axis.grid(alpha=0.3, linewidth=0.6)
    axis.spines[["top", "right"]].set_visible(False)
    axis.legend(loc="upper left", bbox_to_anchor=(1.0, 1.0), frameon=False, fontsize=8)
