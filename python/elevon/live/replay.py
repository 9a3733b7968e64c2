"""A log, or a recording, played on the page of the live bench, the healthy model beside it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import ArgumentTypeError, ElevonError, InputError, unknown
from elevon.live.describe import PLOTS, unit_text
from elevon.live.health import Health, health_of
from elevon.live.loop import LiveLoop
from elevon.live.unit import PERIOD
from elevon.scenario.compile import signal_records

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log


_KEYS = ("restart", "factor", "pause")


class _LogSource:
    """The samples of a log as a source: time runs to its end and stands there."""

    def __init__(self, time: Floats, signals: Mapping[str, Floats]) -> None:
        self.names = tuple(signals)
        self.clock = np.arange(0.0, float(time[-1] - time[0]) + 1e-9, PERIOD)
        at = np.searchsorted(time - time[0], self.clock + 1e-9, side="right") - 1
        self.table = np.column_stack([signals[name][at] for name in self.names])
        self.period, self.at, self.begun = PERIOD, 0, 0.0

    @property
    def time(self) -> float:
        return self.begun + float(self.clock[self.at])

    @property
    def status(self) -> tuple[str, str]:
        ended = self.at + 1 >= len(self.clock)
        return ("ended", "the end of the log") if ended else ("ok", "")

    def step(self) -> Sequence[float]:
        self.at = min(self.at + 1, len(self.clock) - 1)
        values: list[float] = self.table[self.at].tolist()
        return values

    def restart(self) -> None:
        self.begun, self.at = self.time, 0


class LogReplay:
    """Replays a log against the clock; takes no commands.

    Parameters
    ----------
    log : Log
        What is played.
    actuator : Actuator
        The healthy unit, whose model runs beside it.
    factor : float
        Played over wall time.
    """

    def __init__(self, log: Log, actuator: Actuator, *, factor: float = 1.0) -> None:
        self.log, self.actuator = log, actuator
        self.files: list[Path] = []
        self.health = Health(text="diagnosing the log")
        known = signal_records(actuator.wiring, "high")
        by_role = {record["role"]: name for name, record in reversed(list(known.items()))}
        names = {role: by_role.get(role) or role for role in log.channels}
        self._units = {names[role]: log.units.get(role) or "1" for role in names}
        signals = {names[role]: values for role, values in log.channels.items()}
        self._model: list[tuple[str, list[str]]] = []
        self._text = {name: str(known[name]["text"]) if name in known else name for name in signals}
        self.health, panels = _diagnosed(log, actuator)
        for panel, lines, unit in panels:
            self._model.append((panel, list(lines)))
            self._units |= dict.fromkeys(lines, unit)
            self._text |= {name: name for name in lines}
            signals |= lines
        self.source = _LogSource(log.time, signals)
        self.loop = LiveLoop(self.source, factor)

    @classmethod
    def of_file(
        cls,
        path: Path,
        actuator: Actuator,
        *,
        column_map: Path | None = None,
        factor: float = 1.0,
        drive: str | None = None,
        roles: Mapping[str, str] | None = None,
    ) -> LogReplay:
        """Read a log with its map or what its guess asks, or a recording; as `read_log`.

        Raises
        ------
        InputError
            No such file, or none that can be read.
        """
        from elevon.logs.read import read_log

        log = read_log(path, column_map, drive=drive, roles=roles)
        return cls(log, actuator, factor=factor)

    def start(self) -> None:
        """Begin."""
        self.loop.start()

    def stop(self) -> None:
        """End."""
        self.loop.stop()

    def describe(self) -> dict[str, object]:
        """Return the description of the log that a page needs."""
        drawn = {name for _, names in PLOTS for name in names}
        present = [name for name in self.source.names if name in drawn]
        plots = [{"title": panel, "signals": lines} for panel, lines in self._model]
        plots += [
            {"title": title, "signals": [name for name in names if name in present]}
            for title, names in PLOTS
            if any(name in present for name in names)
        ]
        return {
            "actuator": self.actuator.name,
            "title": f"replay of {self.log.name}",
            "wiring": self.actuator.wiring,
            "fidelity": "replay",
            "mode": "replay",
            "modes": [],
            "actions": [],
            "period": self.source.period,
            "signals": [
                {"name": name, "text": self._text[name], **unit_text(self._units[name])}
                for name in self.source.names
            ],
            "plots": plots,
            "inputs": {},
            "faults": [],
            "parameters": [],
            "geometry": {},
            "waveforms": [],
        }

    def state(self) -> dict[str, object]:
        """Return time, speed factor, values and the verdict on the log."""
        source = self.source
        status, message = source.status
        return {
            "time": source.time,
            "factor": self.loop.reached_factor,
            "values": dict(zip(source.names, source.table[source.at].tolist(), strict=True)),
            "health": self.health.to_dict(),
            "status": status,
            "message": message,
            "paused": self.loop.paused,
            "factor_asked": self.loop.factor,
            "panel": None,
            "command": None,
            "inputs": {},
            "recording": None,
            "files": [],
            "injected": None,
        }

    def act(self, message: Mapping[str, object]) -> dict[str, object]:
        """Pause, go on, begin again, change the factor.

        Raises
        ------
        InputError
            Anything else: a log takes no commands.
        """
        for key in message:
            if key in ("command", "set", "fault", "record", "panel", "block", "save"):
                raise InputError(f"{key}: a log is played; it takes {', '.join(_KEYS)}")
            if key not in _KEYS:
                raise unknown("key", key, _KEYS, "act")
        return self.loop.call(lambda: self._act(message))

    def _act(self, message: Mapping[str, Any]) -> dict[str, Any]:
        for key in ("restart", "pause"):
            if key in message and not isinstance(message[key], bool):
                raise ArgumentTypeError(f"{key}: {message[key]!r:.60} is neither true nor false")
        if message.get("restart"):
            self.source.restart()
        factor = message.get("factor", self.loop.factor)
        if isinstance(factor, bool) or not isinstance(factor, (int, float)):
            raise ArgumentTypeError(f"factor: {factor!r:.60} is no number")
        self.loop.set_factor(float(factor))
        if "pause" in message:
            self.loop.pause(message["pause"])
        return {"time": self.source.time}


def _diagnosed(
    log: Log, actuator: Actuator
) -> tuple[Health, list[tuple[str, dict[str, Floats], str]]]:
    """Return the verdict on a log, and panels of its signals, the model's and the difference."""
    from elevon.diagnose.door import diagnose

    try:
        answer = diagnose(log, actuator)
        traces = [] if answer.request is None else answer.request.traces(answer)
    except ElevonError as error:
        return Health(text=str(error)), []
    panels = []
    for trace in traces[:1]:
        for panel in trace.panels:
            stem = panel.name.lower().replace(" ", "_")
            lines = {f"{stem}_logged": panel.log, f"{stem}_model": panel.healthy}
            lines[f"{stem}_residual"] = panel.log - panel.healthy
            on = {n: np.interp(log.time, trace.time, v) for n, v in lines.items()}
            panels.append((f"{panel.name} and the model's", on, panel.unit))
    return health_of(answer), panels
