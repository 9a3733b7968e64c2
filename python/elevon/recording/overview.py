"""What the picture of a run shows first: tracking, error, current, speed, faults and states."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.recording.states import code_names
from elevon.units import display_unit, format_quantity, to_display

if TYPE_CHECKING:
    from elevon.recording.channel import Channel
    from elevon.recording.recording import Recording


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


def spectra(panels: list[Panel]) -> list[Panel]:
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
