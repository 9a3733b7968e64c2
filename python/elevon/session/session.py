"""A run, or many, that go on from call to call."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, nullcontext
from typing import Any, NoReturn, Self

import numpy as np

from elevon.actuator import Actuator
from elevon.errors import ArgumentTypeError, InputError, Interrupted, unknown
from elevon.faults import Fault
from elevon.parameters.records import record_of
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.scenario.compile import port_units
from elevon.session.fmu import Fmu
from elevon.session.values import (
    SessionState,
    SignalIndex,
    Value,
    announced,
    callable_or_none,
    diverged_error,
    diverged_runs,
    fault_places,
    input_change,
    left_out,
    one_each,
    positive_seconds,
    runs_of,
    text,
    texts,
    whole_steps,
)
from elevon.simulate.acting import report
from elevon.simulate.prepare import ActuatorLike, Prepared, Run, ScenarioLike, prepare, solver_step
from elevon.units import parse_quantity

_FOREVER = 4.0e15  # solver steps: a session has no end of its own


class Session:
    """An actuator that its caller steps, reads and changes while it runs; or many, side by side.

    It has no clock of its own: time passes in `advance` only. A session that is stepped through the
    instants of a scenario gives the bits that `elevon.simulate` gives, whatever the steps.

    Parameters
    ----------
    actuator : Actuator, str, path, or sequence of Run
        What moves. A sequence of `elevon.Run` is a session of a batch, one run each, all of one
        wiring: every reading then is an array of shape (runs,), every value set may be one.
    scenario : Scenario, mapping or path, optional
        What acts at the start, such as waveforms of loads; its duration does not count. Without it
        the command is a constant zero.
    fidelity : str
        ``high`` or ``low``.
    mode : str, optional
        Without a scenario: what the command demands, ``position``, ``speed`` or ``torque``.
    seed : int
        Of the random numbers.
    tunable : iterable of str
        Parameters that `set_parameter` will change. The core leaves out equations that values at
        the start do not need; what is named here keeps them. Others may be changed as well, as long
        as the equations in use hold them.
    faults : iterable of str
        ``KIND@PLACE`` of the faults that `set_fault` will set; as for `tunable`.
    signals : iterable of str
        Signals to read that need equations of their own (energies, filtered currents, vibration).
    lanes : str
        Vector width, as for `elevon.simulate`.
    controller : Fmu, optional
        Foreign FMU that drives it, sample by sample.
    loads : sequence of Fmu
        Foreign FMUs that load it.

    Attributes
    ----------
    time : float
        s.
    step : float
        Solver step in s.
    actuators : tuple of Actuator
        One a run, with the parameters as they are now.

    Raises
    ------
    InputError
        Anything in actuator, scenario, names that cannot be; place, value, limit are named.

    Examples
    --------
    >>> session = Session("torino-rotary", mode="speed")  # doctest: +SKIP
    >>> session.set(command="100 rpm")  # doctest: +SKIP
    >>> session.advance(0.1)  # doctest: +SKIP
    >>> session["motor_speed"]  # doctest: +SKIP
    """

    def __init__(
        self,
        actuator: ActuatorLike | Sequence[Run],
        scenario: ScenarioLike = None,
        *,
        fidelity: str = "high",
        mode: str | None = None,
        seed: int = 0,
        tunable: Iterable[str] = (),
        faults: Iterable[str] = (),
        signals: Iterable[str] = (),
        lanes: str = "auto",
        controller: Fmu | None = None,
        loads: Sequence[Fmu] = (),
    ) -> None:
        runs = runs_of(actuator, scenario, mode, seed)
        self.many = not isinstance(actuator, (Actuator, str, os.PathLike))
        prepared = [prepare(run, fidelity, "output_position@every") for run in runs]
        report([item.notices for item in prepared], strict=False)
        self.wiring, self.fidelity = _one_wiring(prepared), fidelity
        self.actuators = tuple(item.actuator for item in prepared)
        self._modes = [item.core["command_mode"] for item in prepared]
        self._units = [port_units(mode, self.wiring) for mode in self._modes]
        self._faults: tuple[dict[str, int], ...] = tuple(fault_places(run.scenario) for run in runs)
        self.step = solver_step(self.actuators[0], fidelity)
        self._signals = SignalIndex(self.wiring, fidelity)
        from elevon import _core

        self._core = _core.Session(
            self.wiring,
            fidelity,
            [{**item.core, "duration": _FOREVER * self.step} for item in prepared],
            announced(self.wiring, tunable, faults),
            [self._signals.known(name) for name in texts(signals, "signals")],
            text(lanes, "lanes"),
        )
        self._driven: set[str] = set()
        self._diverged: set[int] = set()
        self._coupling = None
        self._coupling = coupled(self, controller, loads)

    @property
    def _kind(self) -> tuple[Any, ...]:
        coupled = () if self._coupling is None else ("coupled",)
        return (self.wiring, self.fidelity, self.step, *self._modes, *coupled)

    def __repr__(self) -> str:
        names = dict.fromkeys(actuator.name for actuator in self.actuators)
        runs = f"{len(self)} runs, " if self.many else ""
        return f"<Session {', '.join(names)}, {self.fidelity}: {runs}at {self.time:.6g} s>"

    def __len__(self) -> int:
        return len(self.actuators)

    def __copy__(self) -> Self:
        """Return a session of its own at the same instant: each then goes on by itself."""
        if self._coupling is not None:
            raise InputError("copy: the state of a coupled FMU is no part of the session's")
        twin = object.__new__(type(self))
        vars(twin).update(vars(self))
        twin._core = self._core.copy()
        twin._faults = tuple(dict(item) for item in self._faults)
        twin._signals = SignalIndex(self.wiring, self.fidelity)
        twin._driven, twin._diverged = set(self._driven), set(self._diverged)
        return twin

    def __deepcopy__(self, _memo: dict[int, object]) -> Self:
        return self.__copy__()

    def __reduce__(self) -> NoReturn:
        raise ArgumentTypeError(
            "a session cannot be pickled: it lives in this process's memory; keep the scenario and "
            "the acts, and run them again"
        )

    @property
    def time(self) -> float:
        """Time in s since the start."""
        return float(self._core.steps * self.step)

    @property
    def status(self) -> str | list[str]:
        """`ok`, `tripped` or `diverged`; of a batch a list. A diverged run stands still."""
        status = [self._core.status(run)[0] for run in range(len(self))]
        return status if self.many else str(status[0])

    @property
    def messages(self) -> list[str]:
        """The message of each run's status; empty where it is `ok`."""
        return [self._core.status(run)[1] for run in range(len(self))]

    def state_of(self, run: int) -> tuple[str, str]:
        """Return status and message of one run."""
        status, message = self._core.status(run)
        return status, message

    def unit(self, port: str, run: int = 0) -> str:
        """Return the SI unit of an input; that of the command goes with its mode."""
        if text(port, "input") not in self._units[run]:
            raise unknown("input", port, self._units[run], "session")
        return self._units[run][port]

    @property
    def names(self) -> list[str]:
        """The signals that exist."""
        return list(self._signals.places)

    def advance(self, duration: float | str) -> None:
        """Step on.

        Parameters
        ----------
        duration : float or str
            s, or with a unit (``"1 ms"``): a whole number of solver steps. What the drive does at
            the instant reached waits for the next call: a command set now still reaches it.

        Raises
        ------
        InputError
            Not positive, or no whole number of steps.
        DivergedError
            The run has left the finite numbers, and stands where that was found. Of a batch: the
            runs that newly have (`runs`); the others have been stepped, and the next call goes on
            with them. With none left, every call raises.
        """
        seconds = parse_quantity(duration, "s", "advance")
        steps = whole_steps(seconds, self.step, _FOREVER - self._core.steps)
        if self._coupling is None:
            self._advance(steps)
            return
        for portion in self._coupling.portions(self, steps, self._core.steps):
            self._advance(portion)

    def _advance(self, steps: int) -> None:
        diverged = self._core.advance(steps)
        if diverged:
            self._raise_diverged(diverged)

    def _raise_diverged(self, diverged: Sequence[int]) -> None:
        """Raise for the runs of a batch that have newly diverged, or where none is left to step."""
        if len(diverged) < len(self):
            diverged = [run for run in diverged if run not in self._diverged]
        self._diverged.update(diverged)
        if diverged:
            raise diverged_error(self._core, diverged, many=self.many)

    def read(self, *names: str) -> dict[str, Any]:
        """Return signals as they stand now, SI: name to a number, or to an array of a batch.

        Raises
        ------
        UnknownNameError
            No such signal, with the nearest names.
        InputError
            A signal that needs equations the session left out.
        """
        table = self._core.read([self._signals.place(name, self._core) for name in names])
        if self.many:
            return {name: table[:, column] for column, name in enumerate(names)}
        return {name: float(value) for name, value in zip(names, table[0], strict=True)}

    def __getitem__(self, name: str) -> object:
        return self.read(name)[name]

    def _ipython_key_completions_(self) -> list[str]:
        return self.names

    def set(self, **inputs: Value | Mapping[str, object]) -> None:
        """Set inputs, held from now on: ``command``, ``supply``, ``output``, ``ambient``...

        Parameters
        ----------
        **inputs : float, str, array_like of shape (runs,), or mapping
            SI, or a text with a unit; a mapping is a waveform of a scenario file, or a sum of them
            (``{"terms": [...]}``), in time from the session's start.

        Raises
        ------
        InputError
            No such input, a unit of another kind, a value that is not a number.
        """
        for port in inputs:
            self.unit(port)
        changes = {
            port: input_change(self._core, port, value, self._units)
            for port, value in inputs.items()
        }
        with nullcontext() if self._driven.issuperset(changes) else self._whole():
            for port, change in changes.items():
                if not change():
                    how = "announce it with a scenario that drives it from the start"
                    raise InputError(f"{port}: the equations in use leave this input out; {how}")
        self._driven.update(changes)

    def set_parameter(self, path: str, value: Value) -> None:
        """Change a parameter from now on; faults act on the new value.

        Raises
        ------
        UnknownNameError, UnitError, RangeError
            The message names the path, the value, the limit, the nearest paths.
        InputError
            A value no run may have with the others, or one that needs equations that the session
            left out (see `tunable`).
        """
        record = record_of(self.wiring, text(path, "parameter"))
        changed = [
            actuator.with_values({path: given}, source="set in a session")
            for actuator, given in zip(
                self.actuators, one_each(value, len(self), path), strict=True
            )
        ]
        with self._whole():
            for run, actuator in enumerate(changed):
                number = record.number(actuator.parameters[path].value)
                if not self._core.set_parameter(run, path, number):
                    raise left_out(path, "tunable")
            self.actuators = tuple(changed)

    def set_fault(self, name: str, severity: Value, **attributes: float | str) -> None:
        """Set the severity of a fault, from now on; 0 clears it.

        Parameters
        ----------
        name : str
            ``KIND@PLACE``, such as ``"short@motor.phase_a"``.
        severity : float, str or array_like of shape (runs,)
            In the catalogue's unit, or with a unit.
        **attributes : float or str
            As in a scenario.

        Raises
        ------
        InputError
            No such fault, out of range, or one that needs equations the session left out.
        """
        kind, _, place = text(name, "fault").partition("@")
        faults = [
            Fault.from_dict({"kind": kind, "place": place, "severity": given, **attributes}, name)
            for given in one_each(severity, len(self), name)
        ]
        resolved = [fault.resolved(self.wiring, self.fidelity, name) for fault in faults]
        with self._whole():
            for run, fault in enumerate(resolved):
                places = self._faults[run]
                at = places.get(name, len(places))
                if not self._core.set_fault(run, at, fault):
                    raise left_out(name, "faults")
                places.setdefault(name, len(places))

    def announce(
        self,
        *,
        tunable: Iterable[str] = (),
        faults: Iterable[str] = (),
        signals: Iterable[str] = (),
    ) -> None:
        """Announce what will be changed or read from now on, as at the start; no state changes.

        What has run so far goes on bit for bit. Equations that were left out begin at the values
        of a healthy unit at rest.

        Parameters
        ----------
        tunable, faults, signals : iterable of str
            As for the session itself.

        Raises
        ------
        UnknownNameError
            No such parameter, fault or signal.
        """
        paths = announced(self.wiring, tunable, faults)
        names = [self._signals.known(name) for name in texts(signals, "signals")]
        self._core.announce(paths, names)
        self._signals.renew()

    def run(
        self,
        duration: float | str,
        controller: Callable[[Session], object] | None = None,
        *,
        period: float | str = "1 ms",
        record: Iterable[str] = ("command", "output_position"),
        progress: Progress | None = None,
    ) -> list[Recording]:
        """Run on, calling an own controller at each tick of `period`; see `run_loop`."""
        return run_loop(self, duration, controller, period=period, record=record, progress=progress)

    def save(self) -> SessionState:
        """Return a copy of the present state; the session continues independently of it."""
        if self._coupling is not None:
            raise InputError("save: the state of a coupled FMU is no part of the session's")
        return self._state()

    def _state(self) -> SessionState:
        faults = tuple(dict(item) for item in self._faults)
        return SessionState(self._core.copy(), self.actuators, faults, self._kind)

    def restore(self, state: SessionState) -> None:
        """Restore a state saved by this session or by one created in the same way."""
        if not isinstance(state, SessionState):
            raise ArgumentTypeError(f"state: a {type(state).__name__} is no SessionState")
        if state.kind != self._kind:
            raise InputError(
                "state: it was saved by a session of another kind (wiring, fidelity, solver step, "
                f"modes of its runs): {state.kind}, this one has {self._kind}"
            )
        self._core = state.core.copy()
        self.actuators = state.actuators
        self._faults = tuple(dict(item) for item in state.faults)
        self._signals.renew()
        self._driven.clear()
        self._diverged = diverged_runs(self._core, len(self))

    @contextmanager
    def _whole(self) -> Iterator[None]:
        """Undo what a change has done to some inputs or runs when another one refuses it."""
        state = self._state()
        try:
            yield
        except BaseException:
            self.restore(state)
            raise


def _one_wiring(prepared: Sequence[Prepared]) -> str:
    wirings = {item.actuator.wiring for item in prepared}
    if len(wirings) > 1:
        raise InputError(f"the runs of a session have one wiring; got {', '.join(wirings)}")
    return wirings.pop()


def coupled(session: Session, controller: Fmu | None, loads: Sequence[Fmu]) -> Coupling | None:
    """Return what is coupled to a session that begins; None of nothing."""
    if controller is None and not len(loads):
        return None
    coupling = Coupling(controller, loads)
    coupling.bind(session)
    return coupling


class Coupling:
    """Foreign FMUs beside a session.

    Parameters
    ----------
    controller : Fmu, optional
        Steps first, so that it acts from the tick on at which it reads.
    loads : sequence of Fmu
        Act with what they put out at a tick, and step beside the actuator.
    """

    def __init__(self, controller: Fmu | None, loads: Sequence[Fmu]) -> None:
        given: list[Any] = [*([] if controller is None else [controller]), *loads]
        wrong = [item for item in given if not isinstance(item, Fmu)]
        if wrong:
            raise ArgumentTypeError(f"controller, loads: {wrong[0]!r:.60} is no elevon.Fmu")
        self._controller, self._loads = controller, list(loads)
        self._all: list[Fmu] = given

    def bind(self, session: Session) -> None:
        """Join them to a session that begins."""
        for item in self._all:
            item.bind(session)
        joined = [port for item in self._all for port in item.outputs()]
        twice = next((port for port in joined if joined.count(port) > 1), None)
        if twice is not None:
            raise InputError(f"{twice}: two outputs of FMUs are joined to it")

    def portions(self, session: Session, steps: int, done: int) -> Iterator[int]:
        """Yield the solver steps from tick to tick; before each the FMUs whose tick it is act."""
        every = {id(item): round(item.period / session.step) for item in self._all}
        while steps:
            self._act(session, [item for item in self._all if done % every[id(item)] == 0])
            count = min(steps, *(size - done % size for size in every.values()))
            yield count
            steps, done = steps - count, done + count

    def _act(self, session: Session, due: Sequence[Fmu]) -> None:
        loads = [item for item in self._loads if item in due]
        for item in loads:
            session.set(**item.outputs())
        if self._controller in due and self._controller is not None:
            self._controller.advance(session)
            session.set(**self._controller.outputs())
        for item in loads:
            item.advance(session)


Controller = Callable[["Session"], Any]


def run_loop(
    session: Session,
    duration: float | str,
    controller: Controller | None = None,
    *,
    period: float | str = "1 ms",
    record: Iterable[str] = ("command", "output_position"),
    progress: Progress | None = None,
) -> list[Recording]:
    """Run a session, calling a controller at each of its ticks.

    Parameters
    ----------
    session : Session
        One run or a batch; it stands at the end afterwards.
    duration : float or str
        s, or with a unit: a whole number of periods.
    controller : callable, optional
        Called with the session at every tick, before the drive sees that instant. What it returns
        is the command, in the SI unit of its mode (of a batch shape (runs,)); or a mapping of
        inputs, as for `Session.set`; or None: nothing changes.
    period : float or str
        Of the ticks: a whole number of solver steps.
    record : iterable of str
        Signals sampled at every tick, before the controller is called.
    progress : callable, optional
        Called with the done fraction; returning False interrupts.

    Returns
    -------
    list of Recording
        One a run, on one clock of that period, the last instant included.

    Raises
    ------
    InputError
        As `Session.advance`, `Session.set` and `Session.read`.
    DivergedError
        As `Session.advance`: a loop does not go on without one of its runs.
    Interrupted
        `progress` returned False.
    """
    seconds = positive_seconds(period, "period")
    ticks = round(positive_seconds(duration, "duration") / seconds)
    if ticks < 1:
        raise InputError(f"duration = {duration} is shorter than a period ({seconds:g} s)")
    names = texts(record, "record")
    callable_or_none(controller, "controller")
    callable_or_none(progress, "progress")
    start = session.time
    table = np.empty((ticks + 1, len(session), len(names)))
    for tick in range(ticks):
        table[tick] = _sample(session, names)
        _act(session, controller)
        session.advance(seconds)
        if progress is not None and progress((tick + 1) / ticks) is False:
            raise Interrupted(f"interrupted at {session.time:.6g} s of simulated time")
    table[ticks] = _sample(session, names)
    time = start + seconds * np.arange(ticks + 1)
    return [_recording(session, run, time, names, table[:, run]) for run in range(len(session))]


def _sample(session: Session, names: list[str]) -> Any:
    read = session.read(*names)
    return np.column_stack([np.atleast_1d(read[name]) for name in names])


def _act(session: Session, controller: Controller | None) -> None:
    answer = None if controller is None else controller(session)
    if isinstance(answer, Mapping):
        session.set(**{text(name, "input"): value for name, value in answer.items()})
    elif answer is not None:
        session.set(command=answer)


def _recording(session: Session, run: int, time: Any, names: list[str], values: Any) -> Recording:
    from elevon.scenario.compile import signal_units

    units = dict(signal_units(session.wiring, session.fidelity))
    units["command"] = session.unit("command", run) or units["command"]
    actuator = session.actuators[run]
    status, message = session.state_of(run)
    return Recording.build(
        time,
        {name: values[:, column] for column, name in enumerate(names)},
        {name: units[name] or "1" for name in names},
        clock="controller",
        rate=1.0 / (time[1] - time[0]),
        meta={
            "status": status,
            "message": message,
            "actuator": actuator.name,
            "fidelity": session.fidelity,
            "parameter_hash": actuator.hash,
        },
    )
