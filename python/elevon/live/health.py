"""Health of a running actuator: diagnosis of the last stretch a drive logs, and the monitor.

What is diagnosed are the files that a recording of the same stretch would hold; the list of faults
is nowhere near. The work is done by a process beside the simulation's, so that it slows nothing.
"""

from __future__ import annotations

import multiprocessing
import os
import signal
import tempfile
import threading
import time as clock
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import TYPE_CHECKING

from elevon.errors import ElevonError
from elevon.live.trace import LiveMotion, StreamWatch, Stretch, Watch, write_stretch
from elevon.plain import Plain

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.answer import Diagnosis
    from elevon.logs.log import Log


def remaining_life(answer: Diagnosis, actuator: Actuator, mission: str) -> str:
    """Return the prediction in a sentence, or why there is none."""
    from elevon.prognose.door import predict

    try:
        return predict([(0, answer)], actuator, mission).headline
    except ElevonError as error:
        return f"no prediction: {error}"


FALSE_ALARM = 0.005
"""Rate of one stretch at which a healthy unit may be called faulty: there are twenty a minute."""
_SHARE = 6.0  # times the last diagnosis' processor time that pass until the next one
_LEAST, _MOST = 1.0, 5.0  # s between two
_NICE = 3


@dataclass(frozen=True)
class NamedFault(Plain):
    """A cause with its severity, as in a diagnosis."""

    kind: str
    place: str
    severity: float
    unit: str
    interval: tuple[float, float]
    probability: float
    ambiguous_with: tuple[str, ...] = ()


@dataclass(frozen=True)
class Health(Plain):
    """The diagnosis of the last stretch.

    Attributes
    ----------
    status : str
        ``waiting``, or as in a diagnosis: ``healthy``, ``faulty``, ``unknown_fault``,
        ``model_does_not_fit``, ``undecided``.
    faults : tuple of NamedFault
        Most probable first.
    p_fault : float or None
        Probability of any fault.
    text : str
        The verdict in a sentence, or what is waited for.
    stretch : (float, float) or None
        What was looked at [s].
    since : float or None
        Where the change began, as the monitor has it; else the end of the first of the stretches in
        a row that are not healthy [s].
    onset : bool
        Whether `since` is the monitor's.
    watch : Watch or None
        What the monitor says; None where nothing is watched.
    remaining : str
        Remaining life where a mission is given.
    seconds : float
        Processor time it took [s].
    """

    status: str = "waiting"
    faults: tuple[NamedFault, ...] = ()
    p_fault: float | None = None
    text: str = "waiting for motion"
    stretch: tuple[float, float] | None = None
    since: float | None = None
    onset: bool = False
    watch: Watch | None = None
    remaining: str = ""
    seconds: float = 0.0


def health_of(answer: Diagnosis, *, remaining: str = "", seconds: float = 0.0) -> Health:
    """Return the health that a diagnosis states."""
    faults = tuple(
        NamedFault(
            cause.kind, cause.place, cause.severity, cause.unit, cause.interval,
            cause.probability, tuple(place.key for place in cause.ambiguous_with),
        )
        for cause in answer.faults
    )  # fmt: skip
    return Health(
        answer.status, faults, answer.p_fault, answer.headline, remaining=remaining,
        seconds=seconds,
    )  # fmt: skip


def examine(
    log: Log | str, actuator: Actuator, baselines: Sequence[str], mission: str | None
) -> Health:
    """Diagnose a log (runs in the worker process)."""
    from elevon.diagnose.by_model import diagnose
    from elevon.logs.read import as_logs

    begin = clock.process_time()
    try:
        healthy = as_logs(list(baselines)) if baselines else []
        # The page simulates this very file, so its healthy state is known by construction.
        answer = diagnose(
            as_logs(log), actuator, baselines=healthy, false_alarm=FALSE_ALARM, unit_known=True
        )
    except ElevonError as error:
        return Health(text=str(error).partition(": ")[2] or str(error))
    remaining = ""
    if mission is not None and answer.status == "faulty":
        remaining = remaining_life(answer, actuator, mission)
    return health_of(answer, remaining=remaining, seconds=clock.process_time() - begin)


@dataclass(frozen=True)
class Request:
    """Request to the worker process: the log of a stretch, and the motion that it is part of."""

    path: str
    motion: LiveMotion


class Examiner:
    """Diagnoses successive stretches and monitors the stream that they form.

    Parameters
    ----------
    actuator : Actuator
        The healthy unit.
    baselines : sequence of str
        Paths of healthy logs.
    mission : str, optional
        For the remaining life.
    """

    def __init__(self, actuator: Actuator, baselines: Sequence[str], mission: str | None) -> None:
        self._actuator, self._baselines, self._mission = actuator, baselines, mission
        self._stream = StreamWatch(actuator)
        self._later: Callable[[], None] | None = None

    def examine(self, request: Request) -> Health:
        """Return diagnosis and monitor result of a stretch."""
        from elevon.logs.read import read_log

        try:
            log = read_log(request.path)
        except ElevonError as error:
            return Health(text=str(error))
        health = examine(log, self._actuator, self._baselines, self._mission)
        healthy = health.status == "healthy"
        watch = self._stream.take(log, request.motion, healthy=healthy)
        if watch is None and healthy:
            self._later = lambda: self._stream.learn(log, request.motion)
        return replace(health, watch=watch)

    def learn(self) -> None:
        """Do the slow work after the answer has been given."""
        if self._later is not None:
            self._later()
            self._later = None


def _work(
    door: Connection, actuator: Actuator, baselines: Sequence[str], mission: str | None
) -> None:
    """Answer requests until the door closes.

    Ctrl-C is left to the process that asked, and the processor to the simulation.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(_NICE)
    from elevon.diagnose import door as _ready  # noqa: F401 - loaded before the first request

    examiner = Examiner(actuator, baselines, mission)
    with suppress(EOFError, OSError):
        while True:
            door.send(examiner.examine(door.recv()))
            examiner.learn()


class HealthWatch:
    """Diagnoses the last stretch, then the next one.

    Parameters
    ----------
    actuator : Actuator
        The healthy unit.
    fidelity : str
        Of what runs: which channels there are.
    stretch : callable
        Returns what a drive has logged of late, or why there is nothing to look at.
    baselines : sequence of Path
        Healthy logs.
    mission : Path, optional
        For the remaining life.
    """

    def __init__(
        self,
        actuator: Actuator,
        fidelity: str,
        stretch: Callable[[], Stretch | str],
        *,
        baselines: Sequence[Path] = (),
        mission: Path | None = None,
    ) -> None:
        self.health = Health()
        self._actuator, self._fidelity, self._stretch = actuator, fidelity, stretch
        self._baselines = [str(path) for path in baselines]
        self._mission = None if mission is None else str(mission)
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, name="health", daemon=True)

    def start(self) -> None:
        """Begin."""
        self._thread.start()

    def stop(self) -> None:
        """Stop; a running diagnosis is dropped."""
        self._stop.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        context = multiprocessing.get_context("spawn")
        door, inner = context.Pipe()
        given = (inner, self._actuator, self._baselines, self._mission)
        worker = context.Process(target=_work, args=given, name="diagnosis", daemon=True)
        worker.start()
        inner.close()
        try:
            with tempfile.TemporaryDirectory(prefix="elevon-live-") as folder:
                self._watch(door, Path(folder))
        except (EOFError, OSError):
            self.health = Health(text="the process that diagnoses has ended")
        except Exception as error:
            self.health = Health(text=f"the diagnosis has ended: {error!r}")
            raise
        finally:
            door.close()
            worker.terminate()
            worker.join()

    def _watch(self, door: Connection, folder: Path) -> None:
        pause = _LEAST
        while not self._stop.wait(pause):
            part = self._stretch()
            if isinstance(part, str):
                self.health = Health(text=part)
                pause = _LEAST
                continue
            if self.health.status == "waiting":
                self.health = Health(text="diagnosing the first stretch")
            answer = self._examined(door, part, folder / "live.csv")
            if answer is None:
                return
            self.take(answer, part)
            pause = min(max(_LEAST, _SHARE * answer.seconds), _MOST)

    def _examined(self, door: Connection, part: Stretch, path: Path) -> Health | None:
        """Return the answer on a stretch; None where the bench closes meanwhile."""
        try:
            write_stretch(path, part, self._actuator, self._fidelity, force=True)
        except ElevonError as error:
            return Health(text=str(error))
        door.send(Request(str(path), part.motion))
        while not door.poll(0.05):
            if self._stop.is_set():
                return None
        answer: Health = door.recv()
        return answer

    def take(self, answer: Health, part: Stretch) -> None:
        """Keep an answer with its stretch, and the instant since which the unit is not healthy."""
        span = (float(part.time[0]), float(part.time[-1]))
        since, onset = None, answer.watch is not None and answer.watch.alarm
        if answer.watch is not None and onset:
            since = answer.watch.since
        elif answer.status not in ("waiting", "healthy"):
            since = span[1] if self.health.since is None else self.health.since
        self.health = replace(answer, stretch=span, since=since, onset=onset)
