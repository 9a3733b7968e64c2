"""Own controllers: a Python function called at its tick, on one actuator or on many."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.errors import InputError, Interrupted
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.session.values import callable_or_none, positive_seconds, text, texts

if TYPE_CHECKING:
    from elevon.session.session import Session

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
