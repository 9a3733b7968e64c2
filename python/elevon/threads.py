"""Threads of the linear algebra library, limited while many small problems are solved."""

from __future__ import annotations

import threading
from collections.abc import Iterator
from contextlib import contextmanager
from importlib import import_module
from typing import Any

_LOCK = threading.Lock()
_LIMITS: list[Any] = []  # of the first who entered; the last who leaves lifts it
_INSIDE = [0]


@contextmanager
def one_blas_thread() -> Iterator[None]:
    """Keep linear algebra to one thread in a block, or in calls of what this decorates.

    Handing a matrix of a hundred rows to other threads takes longer than to solve it, and they
    spin while they wait. The limit is the process's; it is lifted when the last of all blocks ends.
    """
    _enter()
    try:
        yield
    finally:
        _leave()


def _enter() -> None:
    from threadpoolctl import threadpool_limits

    import_module("scipy.linalg")  # brings a library of its own, which is limited once it is there
    with _LOCK:
        if _INSIDE[0] == 0:
            _LIMITS.append(threadpool_limits(limits=1, user_api="blas"))
        _INSIDE[0] += 1


def _leave() -> None:
    with _LOCK:
        _INSIDE[0] -= 1
        if _INSIDE[0] == 0:
            _LIMITS.pop().restore_original_limits()
