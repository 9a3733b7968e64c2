"""The live bench: one actuator, its clock, its recorder, its health, and the door to change it."""

from __future__ import annotations

import json
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import ArgumentTypeError, ElevonError, InputError, unknown
from elevon.live.describe import description
from elevon.live.health import HealthWatch
from elevon.live.journal import Journal, moved_command
from elevon.live.loop import LiveLoop
from elevon.live.panel import WatchTable
from elevon.live.trace import Stretch, trace_signals, write_stretch

if TYPE_CHECKING:
    from elevon.live.unit import LiveUnit


KINDS = ("drive", "full")
_LONGEST_RECORDING = 3600.0  # s


class Recorder:
    """Takes samples from the simulation's thread until it is stopped.

    Parameters
    ----------
    kind : str
        ``drive`` or ``full``.
    names : sequence of str
        The signals that come.
    columns : sequence of int
        Those that are kept.
    period : float
        s between two samples.
    """

    def __init__(
        self, kind: str, names: Sequence[str], columns: Sequence[int], period: float
    ) -> None:
        if kind not in KINDS:
            raise InputError(f"record = {kind!r}; one of {', '.join(KINDS)}, true or false")
        self.kind = kind
        self.names = [names[i] for i in columns]
        self._columns = list(columns)
        self._most = int(_LONGEST_RECORDING / period)
        self._time: list[float] = []
        self._rows: list[Floats] = []

    def __len__(self) -> int:
        return len(self._time)

    @property
    def begun(self) -> float | None:
        """Instant of the first sample [s]."""
        return self._time[0] if self._time else None

    def __call__(self, time: float, values: Sequence[float]) -> None:
        """Take one sample; after an hour no more."""
        if len(self._time) < self._most:
            self._time.append(time)
            self._rows.append(np.asarray([values[i] for i in self._columns]))

    def taken(self) -> tuple[Floats, dict[str, Floats]]:
        """Return the instants, shape (n,), and the signals.

        Raises
        ------
        InputError
            Fewer than two samples.
        """
        if len(self._time) < 2:
            raise InputError("record: nothing was recorded yet")
        table = np.asarray(self._rows)
        return np.asarray(self._time), {n: table[:, i] for i, n in enumerate(self.names)}


def free_name(folder: Path, stem: str, ending: str) -> Path:
    """Return the first path of a numbered series that does not exist."""
    for number in range(1, 100_000):
        path = folder / f"{stem}-{number:03d}{ending}"
        if not path.exists():
            return path
    raise InputError(f"{folder}: too many recordings of one name")


_SLACK = 1e-6  # s: instants are whole samples, written in decimals


@dataclass
class Script:
    """Steps as a journal holds them.

    Attributes
    ----------
    mode : str
        Of the command at the start; empty: as it is.
    steps : deque of (float, mapping)
        Instant from the start [s], and what is done.
    error : str
        Why it ended before its last step.
    """

    mode: str = ""
    steps: deque[tuple[float, dict[str, Any]]] = field(default_factory=deque)
    error: str = ""
    _begun: float | None = None

    @classmethod
    def read(cls, given: object, known: Sequence[str]) -> Script:
        """Read steps, times rising.

        Raises
        ------
        InputError
            No list of tables, a time that is none or falls, an act that is not known.
        """
        if not isinstance(given, list) or not all(isinstance(step, Mapping) for step in given):
            raise ArgumentTypeError(f"repeat: {given!r:.60} is no list of steps")
        script = cls()
        for number, step in enumerate(given):
            acts = dict(step)
            time, mode = acts.pop("time", None), acts.pop("mode", "")
            last = script.steps[-1][0] if script.steps else 0.0
            if isinstance(time, bool) or not isinstance(time, (int, float)) or time < last:
                raise InputError(f"repeat: step {number}: time = {time!r:.20}: must rise from 0 s")
            for key in acts:
                if key not in known:
                    raise unknown("key", key, known, f"repeat: step {number}")
            script.mode = script.mode or str(mode)
            script.steps.append((float(time), acts))
        return script

    def due(self, now: float, act: Callable[[Mapping[str, object]], object]) -> None:
        """Carry out the steps that are due; the first call is the start."""
        self._begun = now if self._begun is None else self._begun
        while self.steps and self.steps[0][0] <= now - self._begun + _SLACK:
            try:
                act(self.steps.popleft()[1])
            except ElevonError as error:
                self.error = str(error)
                self.steps.clear()

    def to_dict(self) -> dict[str, object]:
        """Return the present state."""
        return {"left": len(self.steps), "error": self.error}


#: What a message to `act` may hold, in the order in which it is done.
KEYS = (
    "restart", "repeat", "factor", "pause", "set", "fault", "panel", "block", "command", "record",
    "save",
)  # fmt: skip
#: What no step of `repeat` may be: a script writes no files and begins no other.
NOT_REPEATED = frozenset({"repeat", "record", "save", "restart"})
_LOOK = 10.0  # s of a log that are diagnosed; two periods of a slower sine
_LONGEST = 30.0
_SHORTEST = 8.0
_RUN_IN = 1.0  # s from a change of the command, the loads or a parameter that are not looked at
_LEAST = 3.0  # s of an action
_ENDED = 1.0  # s after an action's motion has ended at which it is diagnosed


class LiveBench:
    """The bench as a page or a program sees and operates it.

    Parameters
    ----------
    unit : LiveUnit
        The actuator.
    factor : float
        Simulated time over wall time.
    folder : Path
        Where recordings go.
    baselines : sequence of Path
        Healthy logs for the diagnosis.
    mission : Path, optional
        For the remaining life.
    hide_truth : bool
        Whether the faults that were set are told to nobody.
    """

    def __init__(
        self,
        unit: LiveUnit,
        *,
        factor: float = 1.0,
        folder: Path | None = None,
        baselines: Sequence[Path] = (),
        mission: Path | None = None,
        hide_truth: bool = False,
    ) -> None:
        self.unit = unit
        self.loop = LiveLoop(unit, factor)
        self.folder = folder or Path()
        self.panel = WatchTable()
        self.journal = Journal(unit)
        self.script = Script()
        self.hide_truth = hide_truth
        self.recorder: Recorder | None = None
        self.files: list[Path] = []
        self._traced = trace_signals(unit.actuator, unit.fidelity)
        self._columns = self.loop.ring.columns(self._traced)
        self.watch = HealthWatch(
            unit.actuator, unit.fidelity, self.stretch, baselines=baselines, mission=mission
        )
        self.loop.listener = self._sampled

    def start(self) -> None:
        """Start the simulation and the health watch."""
        self.loop.start()
        self.watch.start()

    def stop(self) -> None:
        """Stop the simulation and the health watch."""
        self.watch.stop()
        self.loop.stop()

    def describe(self) -> dict[str, object]:
        """Return the description of the actuator that a page needs."""
        return description(self.unit)

    def state(self) -> dict[str, object]:
        """Return time, speed factor, values, health and state of the bench."""
        unit, recorder = self.unit, self.recorder
        self.panel.refresh(unit)
        status, message = unit.status
        return {
            "time": unit.time,
            "factor": self.loop.reached_factor,
            "values": dict(zip(unit.names, self.loop.ring.latest().tolist(), strict=True)),
            "health": self.watch.health.to_dict(),
            "status": status,
            "message": message,
            "paused": self.loop.paused,
            "factor_asked": self.loop.factor,
            "panel": self.panel.to_dict(),
            "command": None if unit.given is None else dict(unit.given),
            "inputs": dict(unit.inputs),
            "recording": None if recorder is None else self._recording(recorder),
            "repeating": self.script.to_dict(),
            "files": [path.name for path in self.files],
            "injected": None if self.hide_truth else self._injected(),
        }

    def act(self, message: Mapping[str, object]) -> dict[str, object]:
        """Carry out the action of a message between two samples; return its result.

        Parameters
        ----------
        message : mapping
            ``command`` (as in a scenario file, runs at once), ``block`` (the same, waits for
            ``panel: move``), ``panel``, ``set`` (inputs and parameters), ``fault`` (``KIND@PLACE``
            to severity), ``record`` (``drive`` or true, ``full``, false), ``factor``, ``pause``,
            ``restart``, ``save`` (returns the scenario and the steps of what was done), ``repeat``
            (does such steps again, from rest, each at its instant).

        Raises
        ------
        InputError
            A key, a name or a value that cannot be; what stands before it in the order of `KEYS`
            is done.
        """
        for key in message:
            if key not in KEYS:
                raise unknown("key", key, KEYS, "act")
        return self.loop.call(lambda: self._act(message))

    def stretch(self) -> Stretch | str:
        """Return the latest stretch of the drive's log, or why there is none."""
        return self.loop.call(self._stretch)

    def _act(self, message: Mapping[str, Any]) -> dict[str, Any]:
        answer: dict[str, Any] = {}
        done: dict[str, Any] = {}
        try:
            for key in KEYS:
                if key in message:
                    getattr(self, f"_do_{key}")(message[key], answer)
                    done[key] = message[key]
        finally:
            self.journal.note(done)
        return {"time": self.unit.time, **answer}

    def _do_restart(self, given: Any, _: dict[str, Any]) -> None:
        if _switch("restart", given):
            self.unit.restart()
            self._begun()

    def _do_repeat(self, given: Any, _: dict[str, Any]) -> None:
        script = Script.read(given, [key for key in KEYS if key not in NOT_REPEATED])
        self.unit.renew(script.mode or self.unit.mode)
        self._begun()
        self.script = script
        self.script.due(self.unit.time, self._act)

    def _begun(self) -> None:
        """Begin what counts from a start from rest."""
        self.panel, self.script = WatchTable(), Script()
        self.journal.begin()

    def _do_factor(self, given: Any, _: dict[str, Any]) -> None:
        if isinstance(given, bool) or not isinstance(given, (int, float)):
            raise ArgumentTypeError(f"factor: {given!r:.60} is no number")
        self.loop.set_factor(float(given))

    def _do_pause(self, given: Any, _: dict[str, Any]) -> None:
        self.loop.pause(_switch("pause", given))

    def _do_set(self, given: Any, _: dict[str, Any]) -> None:
        for name, value in _mapping("set", given).items():
            self.unit.set(name, value)

    def _do_fault(self, given: Any, _: dict[str, Any]) -> None:
        for name, value in _mapping("fault", given).items():
            self.unit.inject(name, value)

    def _do_panel(self, given: Any, answer: dict[str, Any]) -> None:
        if not isinstance(given, str):
            raise ArgumentTypeError(f"panel: {given!r:.60} is no action")
        self.panel.act(self.unit, given)
        answer["panel"] = self.panel.to_dict()

    def _do_block(self, given: Any, _: dict[str, Any]) -> None:
        self.panel.submit(self.unit, _mapping("block", given))

    def _do_command(self, given: Any, _: dict[str, Any]) -> None:
        self.panel.run(self.unit, _mapping("command", given))

    def _do_record(self, given: Any, answer: dict[str, Any]) -> None:
        if given is False:
            answer["files"] = [str(path) for path in self._written()]
            return
        if self.recorder is not None:
            raise InputError("record: a recording runs; stop it with false")
        kind = "drive" if given is True else given
        if not isinstance(kind, str):
            raise ArgumentTypeError(f"record: {given!r:.60} is neither true, false nor a kind")
        names = self.unit.names
        columns = self._columns if kind == "drive" else range(len(names))
        self.recorder = Recorder(kind, names, list(columns), self.unit.period)

    def _do_save(self, given: Any, answer: dict[str, Any]) -> None:
        if self.hide_truth:
            raise InputError("save: the truth is hidden, and what was done would tell it")
        if _switch("save", given):
            answer["scenario"] = self.journal.scenario()
            answer["steps"] = self.journal.steps()

    def _sampled(self, time: float, values: Sequence[float]) -> None:
        if self.recorder is not None:
            self.recorder(time, values)
        self.script.due(time, self._act)

    def _recording(self, recorder: Recorder) -> dict[str, Any]:
        begun = recorder.begun
        return {"kind": recorder.kind, "seconds": 0.0 if begun is None else self.unit.time - begun}

    def _injected(self) -> dict[str, Any]:
        return {name: fault.severity for name, fault in self.unit.faults.items()}

    def _written(self) -> list[Path]:
        """End the recording and write it; the files, the log first."""
        recorder = self.recorder
        if recorder is None:
            raise InputError("record: no recording runs")
        time, signals = recorder.taken()
        self.recorder = None
        actuator, name = self.unit.actuator, self.unit.actuator.name
        self.folder.mkdir(parents=True, exist_ok=True)
        if recorder.kind == "drive":
            path = free_name(self.folder, f"live-{name}", ".csv")
            part = self._part(time, signals)
            written = write_stretch(path, part, actuator, self.unit.fidelity)
        else:
            written = [self._full(time, signals)]
        self.files += written
        return written

    def _full(self, time: Any, signals: Mapping[str, Any]) -> Path:
        from elevon.recording import Recording

        units = self.unit.units
        recording = Recording.build(
            time,
            signals,
            {name: units[name] for name in signals},
            clock="live",
            rate=1.0 / self.unit.period,
            meta={
                "status": self.unit.status[0],
                "actuator": self.unit.actuator.name,
                "fidelity": self.unit.fidelity,
                "seed": self.unit.seed,
                "steps": "" if self.hide_truth else json.dumps(self.journal.steps()),
            },
        )
        path = free_name(self.folder, f"live-{self.unit.actuator.name}-full", ".csv")
        recording.save(path)
        return path

    def _part(self, time: Any, signals: Mapping[str, Any]) -> Stretch:
        unit = self.unit
        output, none = unit.inputs.get("output", 0.0), np.zeros(len(time))
        load = signals.get("load_force", none) if output else none
        brake = signals.get("brake_torque")
        given = None
        if unit.given is not None:
            given = moved_command(unit.given, unit.given_at - float(time[0]))
        return Stretch(
            time, signals, given, load,
            brake=bool(unit.actuator.wiring == "rotary" and brake is not None and np.any(brake)),
            seed=unit.seed, since=max(unit.given_at, unit.changed_at),
        )  # fmt: skip

    def _stretch(self) -> Stretch | str:
        unit = self.unit
        if unit.given is None:
            return "waiting for a command"
        if unit.mode == "gear":
            return self._action()
        length = _length(unit.given)
        begin = max(unit.time - length, max(unit.given_at, unit.changed_at) + _RUN_IN)
        if unit.time - begin < min(_SHORTEST, length):
            return "gathering a stretch of motion"
        time, table = self.loop.ring.stretch(begin, self._columns)
        return self._part(time, dict(zip(self._traced, table.T, strict=True)))

    def _action(self) -> Stretch | str:
        """Return the log of the last action, once its motion has ended."""
        unit = self.unit
        begin = unit.given_at - 0.2
        if unit.time - unit.given_at < _LEAST:
            return "waiting for the end of the motion"
        ring = self.loop.ring
        time, table = ring.stretch(begin, self._columns)
        _, speeds = ring.stretch(begin, ring.columns(["motor_speed"]))
        late, speed = time > time[-1] - _ENDED, np.abs(speeds[:, 0])
        if speed[late].max() > 0.01 * max(speed.max(), 1.0):
            return "waiting for the end of the motion"
        return self._part(time, dict(zip(self._traced, table.T, strict=True)))


def _length(given: Mapping[str, Any]) -> float:
    """Return how much of a motion is looked at [s]: two periods of a slow one."""
    from elevon.units import parse_quantity

    length = _LOOK
    for term in given.get("terms", ()):
        frequency = term.get("frequency")
        if frequency is not None:
            hertz = parse_quantity(frequency, "Hz", "frequency")
            length = max(length, 2.0 / hertz if hertz > 0.0 else 0.0)
    return min(length, _LONGEST)


def _switch(name: str, given: Any) -> bool:
    if not isinstance(given, bool):
        raise ArgumentTypeError(f"{name}: {given!r:.60} is neither true nor false")
    return given


def _mapping(name: str, given: Any) -> Mapping[str, Any]:
    if not isinstance(given, Mapping) or not all(isinstance(key, str) for key in given):
        raise ArgumentTypeError(f"{name}: {given!r:.60} is no table of names and values")
    return given
