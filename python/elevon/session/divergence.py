"""Runs of a session that have left the finite numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from elevon.errors import DivergedError


def diverged_runs(core: Any, runs: int) -> set[int]:
    """Return the runs of a core session that have diverged."""
    return {run for run in range(runs) if core.divergence(run) is not None}


def diverged_error(core: Any, runs: Sequence[int], *, many: bool) -> DivergedError:
    """Return the error of some diverged runs; in a batch each is named."""
    time, signal = core.divergence(runs[0])
    messages = [core.status(run)[1] for run in runs]
    if many:
        messages = [f"run {run}: {text}" for run, text in zip(runs, messages, strict=True)]
    return DivergedError("; ".join(messages), time=time, signal=signal, runs=runs)
