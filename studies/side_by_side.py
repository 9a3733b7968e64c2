"""Independent pieces of long work, given to processes that work side by side."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Mapping
from typing import TYPE_CHECKING, TypeVar

from elevon.errors import Interrupted

if TYPE_CHECKING:
    from concurrent.futures import Future

    from elevon.progress import Progress

__all__ = ["side_by_side"]

Result = TypeVar("Result")


def side_by_side(
    calls: Mapping[str, Callable[[], Result]],
    *,
    processes: int | None = None,
    progress: Progress | None = None,
) -> Iterator[tuple[str, Result]]:
    """Make calls that know nothing of each other, and yield each name with its result when ready.

    Parameters
    ----------
    calls : mapping of str to callable
        Name to what is done; with several processes it must be possible to pickle it.
    processes : int, optional
        That work side by side; default: one for each processor. One works in this process.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    Interrupted
        `progress` returned False. What was yielded before stays with the caller.
    """
    count = max(min(processes or os.cpu_count() or 1, len(calls)), 1)
    results = _one_by_one(calls) if count == 1 else _pooled(calls, count)
    done = 0
    for item in results:
        if item is not None:
            yield item
            done += 1
        if progress is not None and progress(done / len(calls)) is False:
            raise Interrupted(f"interrupted after {done} of {len(calls)}")


def _one_by_one(calls: Mapping[str, Callable[[], Result]]) -> Iterator[tuple[str, Result]]:
    for name, call in calls.items():
        yield name, call()


def _pooled(
    calls: Mapping[str, Callable[[], Result]], count: int
) -> Iterator[tuple[str, Result] | None]:
    """Yield results as they come, and None twice a second, so that the caller may stop."""
    from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
    from multiprocessing import get_context

    pool = ProcessPoolExecutor(count, get_context("spawn"), initializer=_deaf)
    try:
        pending: dict[Future[Result], str] = {pool.submit(c): name for name, c in calls.items()}
        while pending:
            ready = wait(pending, timeout=0.5, return_when=FIRST_COMPLETED).done
            yield from ((pending.pop(future), future.result()) for future in ready)
            yield None
    finally:
        pool.shutdown(cancel_futures=True)


def _deaf() -> None:
    """Ctrl-C is the parent's: it ends between two pieces."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
