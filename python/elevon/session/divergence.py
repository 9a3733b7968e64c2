"""Runs of a session that have left the finite numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from elevon.errors import DivergedError

if TYPE_CHECKING:
    from elevon._core import Session as CoreSession


def diverged_runs(core: CoreSession, runs: int) -> set[int]:
    """Return the runs of a core session that have diverged."""
    return {run for run in range(runs) if core.divergence(run) is not None}


def diverged_error(core: CoreSession, runs: Sequence[int], *, many: bool) -> DivergedError:
    """Return the error of some diverged runs; in a batch each is named."""
    left = core.divergence(runs[0])
    assert left is not None  # it is one of those that have
    time, signal = left
    messages = [core.status(run)[1] for run in runs]
    if many:
        messages = [f"run {run}: {text}" for run, text in zip(runs, messages, strict=True)]
    return DivergedError("; ".join(messages), time=time, signal=signal, runs=runs)
