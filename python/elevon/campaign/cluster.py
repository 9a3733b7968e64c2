"""The same campaign on many machines: blocks as tasks of a Dask cluster.

The folder must be one that all machines see. Every worker reads the plan from it, writes its blocks
there, each whole, and returns what goes into the log; only this process writes the log.
"""

from __future__ import annotations

import logging
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import import_module
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.campaign.block import check_there, run_block
from elevon.campaign.resolved import Resolved
from elevon.campaign.resolved_file import read_resolved
from elevon.campaign.store import core_hash
from elevon.errors import InputError, Interrupted

if TYPE_CHECKING:
    from distributed import Client

    from elevon.campaign.folder import CampaignWork
    from elevon.worklog import Item

__all__ = ["in_cluster"]

_LOCAL = re.compile(r"local:(\d+)")
#: Workers of one machine, at most; more is a slip.
_MOST_WORKERS = 1024
#: Tasks given out at once for each worker: enough that none waits, few enough to stop soon.
_AHEAD = 3


def in_cluster(work: CampaignWork, address: str, progress: Callable[[float], Any] | None) -> None:
    """Have the missing blocks of a campaign done by a cluster.

    Parameters
    ----------
    work : Work
        The campaign.
    address : str
        Of a scheduler (``tcp://host:8786``), or ``local:N`` for N workers on this machine.
    progress : callable, optional
        Called with the done fraction after each block; returning False interrupts.

    Raises
    ------
    InputError
        No such scheduler, or ``distributed`` is not installed.
    Interrupted
        `progress` returned False.
    """
    if not work.missing:
        return
    waiting = iter(work.missing)
    with _client(address) as client:
        slots = _AHEAD * max(len(client.scheduler_info()["workers"]), 1)
        futures = [_submitted(client, work, block) for block in islice(waiting, slots)]
        queue = import_module("distributed").as_completed(futures, loop=client.loop)
        for future in queue:
            check_there(work.folder)
            work.log.add(future.result())
            queue.update([_submitted(client, work, block) for block in islice(waiting, 1)])
            if progress is not None and progress(_fraction(work)) is False:
                raise Interrupted("interrupted between two blocks")


def worker_block(folder: str, core: str, index: int, first: int, last: int) -> Item:
    """Simulate one block on a worker, in one thread, and write it.

    Raises
    ------
    InputError
        The worker has another build of the core: its data might differ.
    """
    if core_hash() != core:
        raise InputError("a worker has another build of elevon than the campaign")
    return run_block(_plan(folder), Path(folder), index, range(first, last), threads=1)


@lru_cache(maxsize=2)
def _plan(folder: str) -> Resolved:
    return read_resolved(Path(folder))


def _submitted(client: Client, work: CampaignWork, block: int) -> Any:
    numbers = work.numbers(block)
    folder = str(work.folder.absolute())
    arguments = (folder, work.manifest.core, block, numbers.start, numbers.stop)
    return client.submit(worker_block, *arguments, pure=False)


def _fraction(work: CampaignWork) -> float:
    return len(work.log.items) / (len(work.edges) - 1)


@contextmanager
def _client(address: str) -> Iterator[Client]:
    try:
        distributed: Any = import_module("distributed")
    except ImportError as error:
        raise InputError("a cluster needs the extra 'cluster' (distributed)") from error
    local = _LOCAL.fullmatch(address)
    if local is None:
        try:
            client = distributed.Client(address, timeout="10 s", set_as_default=False)
        except (OSError, ValueError) as error:
            raise InputError(f"--scheduler {address}: no scheduler answers: {error}") from error
        with client:
            yield client
        return
    count = int(local[1])
    if not 1 <= count <= _MOST_WORKERS:
        raise InputError(f"--cluster {address}: {count} workers is outside 1 to {_MOST_WORKERS}")
    options: dict[str, Any] = {
        "threads_per_worker": 1,
        "dashboard_address": None,
        "processes": True,
        "silence_logs": logging.ERROR,
    }
    with (
        distributed.LocalCluster(n_workers=count, **options) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        yield client
