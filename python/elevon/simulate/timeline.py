"""What happened when: the codes of a control unit in words, and a run as a list of events."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from elevon.recording import Recording
from elevon.recording.plot import code_names

_CODES = ("command", "command_refused", "state", "fault_code", "warning_code")


@dataclass(frozen=True, slots=True)
class Event:
    """Something that changed.

    Attributes
    ----------
    time : float
        s from the start of the run.
    signal : str
        The signal that changed.
    text : str
        To what, in words.
    """

    time: float
    signal: str
    text: str


def has_states(wiring: str) -> bool:
    """Tell whether a wiring has a control unit with states."""
    return len(code_names(wiring, "state")) > 1


def timeline(recording: Recording, wiring: str) -> list[Event]:
    """Return what commands, states, faults, warnings, lock and brake did, in order of time.

    Parameters
    ----------
    recording : Recording
        A run of an actuator with a control unit; signals that were not recorded are left out.
    wiring : str
        Its wiring.

    Returns
    -------
    list of Event
        The times are those of the first sample that shows the change.
    """
    events: list[Event] = []
    for name in _CODES:
        if name in recording.names:
            words = code_names(wiring, name)
            none = words.get(0) in {"none", "accepted"}
            events += [
                Event(time, name, _phrase(name, words.get(code, str(code))))
                for time, code in _changes(recording, name)
                if code != 0 or not none
            ]
    for name, on, off in (
        ("locked", "down-lock engaged", "down-lock free"),
        ("brake_released", "brake open", "brake set"),
        ("released", "free-fall release open", ""),
    ):
        if name in recording.names:
            events += [
                Event(time, name, on if code else off) for time, code in _changes(recording, name)
            ]
    # In one instant the command comes before what it causes.
    rank = {name: index for index, name in enumerate(_CODES)}
    return _since_command(sorted(events, key=lambda e: (e.time, rank.get(e.signal, 9))))


def _since_command(events: list[Event]) -> list[Event]:
    """Return the events with, at each state, the time since the command."""
    dated: list[Event] = []
    command: Event | None = None
    for event in events:
        text = event.text
        if event.signal == "command":
            command = event
        elif event.signal == "state" and command is not None and event.time > command.time + 0.05:
            action = command.text.removeprefix("command: ")
            text = f"{text} ({event.time - command.time:.2f} s after {action})"
        dated.append(Event(event.time, event.signal, text))
    return dated


def _phrase(name: str, word: str) -> str:
    start = {
        "command": "command: ",
        "command_refused": "command refused: ",
        "fault_code": "fault: ",
        "warning_code": "warning: ",
    }
    return start.get(name, "") + word


def _changes(recording: Recording, name: str) -> list[tuple[float, int]]:
    channel = recording[name]
    values = np.rint(channel.values).astype(int)
    places = np.flatnonzero(np.diff(values)) + 1
    return [(float(channel.time[place]), int(values[place])) for place in places]
