"""Pictures and interactive pages of recordings."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.errors import InputError, unknown
from elevon.files import atomic_path, check_output, write_text
from elevon.recording.channel import Channel
from elevon.report.cards import Html, badge, card, sparkline, table
from elevon.units import display_unit, format_quantity, to_display

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from elevon.recording.channel import Channel
    from elevon.recording.recording import Recording


def recording_card(recording: Recording) -> Html:
    """Return the HTML view of a recording: status, clocks, a line and a curve a channel."""
    meta = recording.meta
    facts: list[tuple[str, object]] = [("", badge(recording.status))]
    facts += [("", meta[name]) for name in ("message", "actuator", "fidelity") if meta.get(name)]
    facts += [("clock", repr(clock)[len("Clock(") : -1]) for clock in recording.clocks.values()]
    rows = [_row(channel, len(recording.clocks) > 1) for channel in recording.channels]
    head = ["channel", "unit", "least", "greatest", "last", "", "what it is"]
    return card("Recording", facts, table(head, rows))


def _row(channel: Channel, name_clock: bool) -> list[object]:
    unit = display_unit(channel.unit)
    values = channel.to(unit)
    good = values[np.isfinite(values)]
    numbers = (good.min(), good.max(), values[-1]) if good.size else ("", "", "")
    text = f"{channel.text} [{channel.clock.name}]" if name_clock else channel.text
    return [
        channel.name,
        "" if unit == "1" else unit,
        *(number if isinstance(number, str) else f"{number:.5g}" for number in numbers),
        sparkline(values),
        text,
    ]


@lru_cache
def code_names(wiring: str, signal: str) -> dict[int, str]:
    """Return the words for the codes of a signal, read from the core's own record of it.

    Parameters
    ----------
    wiring : str
        Such as ``landing_gear``.
    signal : str
        Such as ``state``.

    Returns
    -------
    dict
        Word by code; empty for a signal without codes, or a wiring or signal that does not exist.
    """
    from elevon import _core

    if wiring not in {item["name"] for item in _core.wirings()}:
        return {}
    texts = {item["name"]: item["text"] for item in _core.signals(wiring, "high")}
    codes = re.findall(r"(\d+) ([^,;:]+)", texts.get(signal, ""))
    return {int(code): word.strip() for code, word in codes}


@dataclass(frozen=True)
class Panel:
    """One set of axes.

    Attributes
    ----------
    title, unit : str
        What is displayed, in which unit.
    time : ndarray, shape (n,)
        Abscissa: s, or Hz of a spectrum.
    lines : dict of str to ndarray, shape (n,)
        Values in `unit`.
    gaps : tuple of int
        Indices after which lines are interrupted.
    clock : str
        Whose instants they are.
    spectrum : bool
        The abscissa is a frequency, both axes are logarithmic.
    others : dict of str to ndarray, shape (n,)
        The same lines of another recording.
    """

    title: str
    unit: str
    time: Floats
    lines: dict[str, Floats]
    gaps: tuple[int, ...] = ()
    clock: str = ""
    spectrum: bool = False
    others: dict[str, Floats] = field(default_factory=dict)


@dataclass(frozen=True)
class Band:
    """A stretch of time that has a name.

    Attributes
    ----------
    start, end : float
        s.
    text : str
        Of a fault ``short@motor.phase_a = 0.1``, of a state its name.
    kind : str
        ``fault`` or ``state``.
    """

    start: float
    end: float
    text: str
    kind: str


def overview(recording: Recording) -> list[Panel]:
    """Return the panels of a run, on its output's clock; none of what has no command or no output.

    Command against output on top, with the motor's angle over the ratio; the error below; then
    current and speed.
    """
    output = _output(recording)
    if output is None or _first(recording, "command") is None:
        return []
    command = _tracked(recording, output)
    speed = _first(recording, "motor_speed", "output_speed")
    follows_speed = command is not None and command.unit != output.unit
    answer = speed if follows_speed and speed is not None else output
    panels = [_position(recording, output, None if follows_speed else command)]
    if command is not None:
        panels.append(_error(command, answer))
    panels += _of(recording, "current", ("current_ref", "torque_current"))
    lines = ["speed_ref", "motor_speed", *(["command"] if follows_speed else [])]
    panels += _of(recording, "speed", lines)
    return [panel for panel in panels if panel.lines]


def _output(recording: Recording) -> Channel | None:
    """The true output where it is recorded (a simulation), else the measured one."""
    if "output_position" in recording:
        return recording["output_position"]
    return _first(recording, "output_position", "motor_position")


def _first(recording: Recording, *names: str) -> Channel | None:
    """Return the first of some roles or channels that the recording has."""
    for name in names:
        channel = recording.roles.get(name, name)
        if channel in recording:
            return recording[channel]
    return None


def _tracked(recording: Recording, output: Channel) -> Channel | None:
    """Return the command where it demands a position or a speed on the output's clock."""
    command = _first(recording, "command")
    if command is None or command.clock is not output.clock:
        return None
    return command if command.unit in (output.unit, "rad/s") else None


def _position(recording: Recording, output: Channel, command: Channel | None) -> Panel:
    unit = _unit(output)
    lines = {} if command is None else {command.name: command.to(unit)}
    motor = _first(recording, "motor_position")
    if motor is not None and motor is not output and motor.clock is output.clock:
        scaled = _over_ratio(motor, output)
        if scaled is not None:
            text, values = scaled
            lines[f"{motor.name} {text}"] = np.asarray(to_display(values, unit), dtype=np.float64)
    lines[output.name] = output.to(unit)
    return _panel("position", unit, output, lines)


def _over_ratio(motor: Channel, output: Channel) -> tuple[str, Floats] | None:
    """Return how the motor's angle is scaled to the output, and the scaled angle.

    The ratio is the median of those of the increments in fast motion, where the train is in
    contact: reversals, in which backlash is crossed, do not count.
    """
    good = np.isfinite(motor.values) & np.isfinite(output.values)
    turned, moved = motor.values[good], output.values[good]
    step = max(turned.size // 500, 1)
    if turned.size <= step:
        return None
    turn, move = turned[step:] - turned[:-step], moved[step:] - moved[:-step]
    fast = np.abs(turn) > 0.5 * np.abs(turn).max()
    share = float(np.median(move[fast] / turn[fast])) if fast.any() else 0.0
    if share == 0.0 or not np.isfinite(share):
        return None
    if output.unit == motor.unit:
        text = f"/ {1.0 / share:.4g}"
    else:
        text = f"x {share * 2e3 * np.pi:.4g} mm/rev"
    return text, share * (motor.values - turned.mean()) + moved.mean()


def _unit(channel: Channel) -> str:
    return {"m": "mm", "m/s": "mm/s"}.get(channel.unit, display_unit(channel.unit))


def _error(command: Channel, answer: Channel) -> Panel:
    unit = _unit(answer)
    lines = {f"{command.name} - {answer.name}": command.to(unit) - answer.to(unit)}
    return _panel("error", unit, answer, lines)


def _of(recording: Recording, title: str, names: Iterable[str]) -> list[Panel]:
    """Return a panel of the channels of one kind that lie on one clock."""
    chosen: dict[str, Channel] = {}
    for name in names:
        channel = _first(recording, name)
        if channel is not None:
            chosen.setdefault(channel.name, channel)
    if not chosen:
        return []
    first = next(reversed(chosen.values()))
    unit = _unit(first)
    alike = {
        name: channel.to(unit)
        for name, channel in chosen.items()
        if channel.clock is first.clock and channel.unit == first.unit
    }
    return [_panel(title, unit, first, alike)]


def _panel(title: str, unit: str, channel: Channel, lines: dict[str, Floats]) -> Panel:
    clock = channel.clock
    return Panel(title, unit, clock.time, lines, tuple(clock.gaps), clock.name)


def bands(recording: Recording) -> list[Band]:
    """Return when which fault was present, and when which state of the control unit."""
    marked: list[Band] = []
    for label in recording.labels if isinstance(recording.labels, list) else []:
        channel = label.get("channel") if isinstance(label, dict) else None
        if isinstance(channel, str) and channel in recording:
            marked += _fault(recording[channel], label)
    wiring = str(recording.meta.get("wiring", ""))
    names = code_names(wiring, "state") if wiring and "state" in recording else {}
    if len(names) > 1:
        marked += _states(recording["state"], names)
    return marked


def _fault(channel: Channel, label: dict[str, object]) -> Iterator[Band]:
    severity = label.get("severity")
    if isinstance(severity, (int, float)):
        severity = format_quantity(severity, display_unit(str(label.get("unit") or "1")), 4)
    text = f"{label.get('kind')}@{label.get('place')} = {severity}"
    for start, end in _stretches(channel.values != 0.0, channel.time):
        yield Band(start, end, text, "fault")


def _states(channel: Channel, names: dict[int, str]) -> Iterator[Band]:
    codes = np.round(np.nan_to_num(channel.values, nan=-1.0)).astype(int)
    edges = [0, *(np.flatnonzero(np.diff(codes)) + 1).tolist(), codes.size]
    for first, last in itertools.pairwise(edges):
        if last > first:
            end = channel.time[min(last, codes.size - 1)]
            name = names.get(int(codes[first]), f"state {codes[first]}")
            yield Band(float(channel.time[first]), float(end), name, "state")


def _stretches(there: Bools, time: Floats) -> Iterator[tuple[float, float]]:
    edges = np.flatnonzero(np.diff(np.concatenate([[False], there, [False]]).astype(int)))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        yield float(time[first]), float(time[min(last, time.size - 1)])


def overlaid(panels: list[Panel], others: list[Panel], name: str) -> list[Panel]:
    """Return panels with the lines of another recording's panels of the same titles.

    Its lines are read at the instants of the first; where it was not recorded they have a hole.
    """
    return [_with_other(panel, others, name) for panel in panels]


def _with_other(panel: Panel, others: list[Panel], name: str) -> Panel:
    same = next((o for o in others if (o.title, o.unit) == (panel.title, panel.unit)), None)
    if same is None:
        return panel
    lines = {
        f"{line} ({name})": np.interp(panel.time, same.time, values, left=np.nan, right=np.nan)
        for line, values in same.lines.items()
        if line != "command"
    }
    return replace(panel, others=lines)


def spectrum_panels(panels: list[Panel]) -> list[Panel]:
    """Return the amplitude spectra of panels, but of those of positions: error, current, speed.

    A Hann window, scaled so that a sine shows its amplitude; lines with holes are left out.
    """
    return [item for panel in panels if panel.title != "position" for item in _spectrum(panel)]


def _spectrum(panel: Panel) -> Iterator[Panel]:
    steps = np.diff(panel.time)
    if panel.time.size < 16 or panel.gaps or np.ptp(steps) > 1e-3 * steps.mean():
        return
    window = np.hanning(panel.time.size)
    lines_at = np.fft.rfftfreq(panel.time.size, float(steps.mean()))[1:]
    frequency = np.asarray(lines_at, dtype=np.float64)
    lines, others = (
        {
            name: 2.0 * np.abs(np.fft.rfft((values - values.mean()) * window))[1:] / window.sum()
            for name, values in given.items()
            if np.isfinite(values).all() and name != "command"
        }
        for given in (panel.lines, panel.others)
    )
    if lines:
        title = f"spectrum of the {panel.title}"
        yield Panel(title, panel.unit, frequency, lines, spectrum=True, others=others)


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
        panels = panels + spectrum_panels(panels)
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
