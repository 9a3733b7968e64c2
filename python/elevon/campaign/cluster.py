"""The same campaign on many machines: blocks as tasks of a Dask cluster.

The folder must be one that all machines see. Every worker reads the plan from it, writes its blocks
there, each whole, and returns what goes into the log; only this process writes the log.
"""

from __future__ import annotations

import logging
import re
import socket
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib import import_module
from itertools import islice
from pathlib import Path
from threading import Thread
from typing import TYPE_CHECKING, Any

from elevon.campaign.block import check_there, run_block
from elevon.campaign.resolved import Resolved
from elevon.campaign.resolved_file import read_resolved
from elevon.campaign.store import core_hash
from elevon.errors import ElevonError, InputError, Interrupted, OutputError

if TYPE_CHECKING:
    from distributed import Client

    from elevon.campaign.folder import CampaignWork
    from elevon.worklog import Item


LIMIT = 10.0
"""Seconds within which a wrong address is reported, in all."""

_ADDRESS = re.compile(r"(?:(tcp|tls)://)?(\[[0-9A-Fa-f:.]+\]|[^\s/:\[\]]+):(\d{1,5})")

_GREETING = 2**16
"""Bytes of a scheduler's first message, at most; it has some 100."""


def check_scheduler(address: str) -> None:
    """Raise `InputError` where no Dask scheduler answers at an address, within half of `LIMIT`.

    A scheduler greets whoever connects: eight bytes with the length of its message, then the
    message. Whatever else listens there is silent, or sends what is no such length; the library
    would wait for the one and make room for the other. Behind ``tls://`` only the connection is
    tried.
    """
    parts = _ADDRESS.fullmatch(address)
    if parts is None or not 0 < int(parts[3]) < 2**16:
        raise InputError(
            f"--scheduler {address!r}: is no address; give tcp://HOST:PORT, such as "
            "tcp://localhost:8786"
        )
    tls = parts[1] == "tls"
    outcome: list[bytes | OSError | UnicodeError] = []
    place = (parts[2].strip("[]"), int(parts[3]))
    # In a thread of its own: to look up a name may take longer than any limit of a connection.
    probe = Thread(target=lambda: outcome.append(_probe(place, tls=tls)), daemon=True)
    probe.start()
    probe.join(LIMIT / 2.0)
    answer = outcome[0] if outcome else TimeoutError()
    if isinstance(answer, TimeoutError):
        raise InputError(f"--scheduler {address}: no scheduler answers within {LIMIT / 2.0:g} s")
    if isinstance(answer, (OSError, UnicodeError)):
        why = getattr(answer, "strerror", None) or answer
        raise InputError(f"--scheduler {address}: no scheduler answers: {why}")
    length = int.from_bytes(answer, "little")
    if not tls and (len(answer) < 8 or not 0 < length < _GREETING):
        raise InputError(f"--scheduler {address}: what answers there is no Dask scheduler")


def _probe(place: tuple[str, int], *, tls: bool) -> bytes | OSError | UnicodeError:
    """Return the first bytes of whoever listens at a place, or the error."""
    try:
        with socket.create_connection(place, timeout=LIMIT / 4.0) as peer:
            return b"" if tls else _read_first_bytes(peer)
    except (OSError, UnicodeError) as error:
        return error


def _read_first_bytes(peer: socket.socket) -> bytes:
    """Return the first eight bytes of a peer, fewer where it closes."""
    data = b""
    while len(data) < 8:
        more = peer.recv(8 - len(data))
        if not more:
            break
        data += more
    return data


_LOCAL = re.compile(r"local:(\d+)")
#: Workers of one machine, at most; more is a slip.
_MOST_WORKERS = 1024
#: Tasks given out at once for each worker: enough that none waits, few enough to stop soon.
_AHEAD = 3
#: Seconds between two looks at the scheduler while no block is done.
_MOMENT = 1.0
#: Seconds between two looks at the blocks given out.
_PAUSE = 0.02
#: What the library raises for a result that nobody can bring.
_GONE = frozenset({"CommClosedError", "FutureCancelledError", "CancelledError"})


def in_cluster(
    work: CampaignWork,
    address: str,
    progress: Callable[[float], object] | None,
    announce: Callable[[str], object] | None,
    silent_after: float,
) -> None:
    """Have the missing blocks of a campaign done by a cluster.

    Parameters
    ----------
    work : Work
        The campaign.
    address : str
        Of a scheduler (``tcp://host:8786``), or ``local:N`` for N workers on this machine.
    progress : callable, optional
        Called with the done fraction after each block; returning False interrupts.
    announce : callable, optional
        Called with a line when there are no workers, or when one is silent.
    silent_after : float
        Seconds after which a worker that gives no sign is named with its blocks; after as many
        again its blocks are given to others.

    Raises
    ------
    InputError
        No such scheduler, or ``distributed`` is not installed.
    OutputError
        The scheduler no longer answers, or workers end over a block; what is done is kept.
    Interrupted
        `progress` returned False.
    """
    if not work.missing:
        return
    waiting = iter(work.missing)
    with _connect_client(address) as client:
        workers = _Workers(client, address, announce or (lambda _: None), silent_after)
        slots = _AHEAD * max(workers.count(), 1)
        pending = {_submit(client, work, block): block for block in islice(waiting, slots)}
        while pending:
            finished = _await_blocks(pending)
            workers.look(idle=not finished)
            check_there(work.folder)
            for future in finished:
                block = pending.pop(future)
                item = _block_result(future, block, address)
                if item is None:  # it is done, and the worker that knows how is silent
                    workers.check_scheduler()
                    pending[_submit(client, work, block)] = block
                    continue
                work.log.add(item)
                for following in islice(waiting, 1):
                    pending[_submit(client, work, following)] = following
            for future, others in workers.take_from_silent(pending):
                block = pending.pop(future)
                future.cancel()
                pending[_submit(client, work, block, others)] = block
            if progress is not None and progress(_done_fraction(work)) is False:
                raise Interrupted("interrupted between two blocks")


class _Workers:
    """Watches the scheduler, whether it answers, and the workers, whether each gives signs."""

    def __init__(
        self, client: Client, address: str, announce: Callable[[str], Any], silent_after: float
    ) -> None:
        self._client, self._address, self._announce = client, address, announce
        self._silent_after = silent_after
        self._seen = self._looked = time.monotonic()
        self._waits = False
        #: Of each worker: its last sign by the scheduler's clock, and when this process saw it.
        self._signs: dict[str, tuple[float, float]] = {}
        self._named: set[str] = set()

    def count(self) -> int:
        return len(self._about())

    def _about(self) -> dict[str, Any]:
        """Return what the scheduler knows of each worker."""
        try:
            about: dict[str, Any] = self._client.scheduler_info(n_workers=-1)["workers"]
        # The library has a dozen errors for a scheduler that has gone.
        except Exception as error:
            raise _scheduler_gone(self._address) from error
        return about

    def look(self, *, idle: bool) -> None:
        """Raise where the scheduler has gone or is silent; say so where nobody works."""
        if not idle:
            self._seen, self._waits = time.monotonic(), False
            return
        if self._client.status == "running" and self._greets():
            self._seen = time.monotonic()
            waits = self.count() == 0
            if waits and not self._waits:
                self._announce("waiting for workers (0)")
            self._waits = waits
        elif self._client.status == "closed" or time.monotonic() - self._seen > LIMIT / 2.0:
            raise _scheduler_gone(self._address)

    def check_scheduler(self) -> None:
        """Raise `OutputError` where the scheduler has gone."""
        if self._client.status != "running" or not self._greets():
            raise _scheduler_gone(self._address)

    def take_from_silent(self, pending: Mapping[Any, int]) -> list[tuple[Any, list[str]]]:
        """Name the workers that give no sign; return what is to be given to which others."""
        now = time.monotonic()
        if now - self._looked < _MOMENT or not self._greets():
            return []
        self._looked = now
        for name, about in (workers := self._about()).items():
            if about["last_seen"] != self._signs.get(name, (None, now))[0]:
                self._signs[name] = (about["last_seen"], now)
                self._named.discard(name)
        ages = {name: now - self._signs[name][1] for name in workers}
        others = [name for name, age in ages.items() if age < self._silent_after]
        taken = []
        for name in ages.keys() - others:
            given = self._given_to(name, pending)
            blocks = ", ".join(str(pending[future]) for future in given) or "none"
            if name not in self._named:
                self._named.add(name)
                self._announce(
                    f"worker {name} has given no sign for {ages[name]:.0f} s; its blocks: {blocks}"
                )
            if given and others and ages[name] > 2.0 * self._silent_after:
                self._announce(f"blocks {blocks} of the silent worker {name} are given to others")
                taken += [(future, others) for future in given]
        return taken

    def _given_to(self, name: str, pending: Iterable[Any]) -> list[Any]:
        try:
            tasks: Any = self._client.processing  # has no types
            keys = set(tasks([name]).get(name, ()))
        # As above: whatever the library makes of a scheduler that has gone.
        except Exception as error:
            raise _scheduler_gone(self._address) from error
        return [future for future in pending if future.key in keys]

    def _greets(self) -> bool:
        """Return whether the scheduler greets who connects: one that is halted keeps the line."""
        if _LOCAL.fullmatch(self._address):
            return True
        try:
            check_scheduler(self._address)
        except InputError:
            return False
        return True


def _await_blocks(pending: Iterable[Any]) -> list[Any]:
    """Wait a moment for blocks that are done, or have failed; there may be none."""
    end = time.monotonic() + _MOMENT
    while time.monotonic() < end:
        if done := [future for future in pending if future.done()]:
            return done
        time.sleep(_PAUSE)
    return []


def _block_result(future: Any, block: int, address: str) -> Item | None:
    """Return what a worker has made of a block, or its error; None where nobody answers."""
    try:
        item: Item = future.result(timeout=LIMIT)
    except (ElevonError, KeyboardInterrupt):
        raise
    except MemoryError as error:
        raise OutputError(f"--scheduler {address}: a worker has not enough memory") from error
    except Exception as error:
        kind = type(error).__name__  # the library has a dozen errors for a peer that is gone
        if isinstance(error, TimeoutError) or kind in _GONE:
            return None
        why = (
            "each worker that was given it ended before it was done (too little memory, or killed)"
            if kind == "KilledWorker"
            else f"a worker failed: {kind}: {error}"
        )
        raise OutputError(
            f"--scheduler {address}: block {block}: {why}; what is done is kept"
        ) from error
    return item


def _scheduler_gone(address: str) -> OutputError:
    return OutputError(
        f"--scheduler {address}: no longer answers; what is done is kept: give the command "
        "again, or elevon campaign resume"
    )


def worker_block(folder: str, core: str, index: int, first: int, last: int) -> Item:
    """Simulate one block on a worker, in one thread, and write it.

    Raises
    ------
    InputError
        The worker has another build of the core: its data might differ.
    """
    if core_hash() != core:
        raise InputError("a worker has another build of elevon than the campaign")
    return run_block(_read_plan(folder), Path(folder), index, range(first, last), threads=1)


@lru_cache(maxsize=2)
def _read_plan(folder: str) -> Resolved:
    return read_resolved(Path(folder))


def _submit(
    client: Client, work: CampaignWork, block: int, workers: list[str] | None = None
) -> Any:
    numbers = work.numbers(block)
    folder = str(work.folder.absolute())
    arguments = (folder, work.manifest.core, block, numbers.start, numbers.stop)
    return client.submit(worker_block, *arguments, pure=False, workers=workers)


def _done_fraction(work: CampaignWork) -> float:
    return len(work.log.items) / (len(work.edges) - 1)


@contextmanager
def _connect_client(address: str) -> Iterator[Client]:
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise InputError("a cluster needs the extra 'cluster' (distributed)") from error
    local = _LOCAL.fullmatch(address)
    wait = {"distributed.comm.timeouts.connect": LIMIT / 2.0, "distributed.comm.retry.count": 0}
    with _silence_library_log(), import_module("dask").config.set(wait):
        if local is None:
            check_scheduler(address)
            with _connect(distributed, address) as client:
                yield client
            return
        with (
            distributed.LocalCluster(
                n_workers=_check_workers(address, int(local[1])), **_OPTIONS
            ) as cluster,
            distributed.Client(cluster, set_as_default=False) as client,
        ):
            yield client


_OPTIONS = {
    "threads_per_worker": 1,
    "dashboard_address": None,
    "processes": True,
    "silence_logs": logging.ERROR,
}


def _check_workers(address: str, count: int) -> int:
    if not 1 <= count <= _MOST_WORKERS:
        raise InputError(f"--cluster {address}: {count} workers is outside 1 to {_MOST_WORKERS}")
    return count


@contextmanager
def _connect(distributed: Any, address: str) -> Iterator[Client]:
    """Connect to a scheduler that has answered already; leave it without waiting for it."""
    try:
        client = distributed.Client(address, timeout=LIMIT / 2.0, set_as_default=False)
    # Whatever the library makes of a peer that is no scheduler of its version.
    except Exception as error:
        why = f"{type(error).__name__}: {error}".splitlines()[0]
        raise InputError(f"--scheduler {address}: no scheduler answers: {why}") from error
    try:
        yield client
    finally:
        with suppress(Exception):  # a scheduler that has gone cannot be told
            client.close(timeout=_MOMENT)


@contextmanager
def _silence_library_log() -> Iterator[None]:
    """Keep the library's own log, with its tracebacks, off standard error."""
    log = logging.getLogger("distributed")
    before, log.level = log.level, logging.CRITICAL + 1
    others = {name: logging.getLogger(name) for name in logging.root.manager.loggerDict
              if name.startswith(("distributed.", "tornado"))}  # fmt: skip
    levels = {name: item.level for name, item in others.items()}
    for item in others.values():
        item.setLevel(logging.CRITICAL + 1)
    try:
        yield
    finally:
        log.setLevel(before)
        for name, item in others.items():
            item.setLevel(levels[name])
