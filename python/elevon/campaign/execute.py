"""Run a campaign block by block; what is done stays done."""

from __future__ import annotations

import os
import socket
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from elevon.campaign.block import check_there, finish_block, simulate_block
from elevon.campaign.card import counted
from elevon.campaign.check import Cost, check, estimate
from elevon.campaign.folder import CampaignWork, begin, finish, finished, open_folder
from elevon.campaign.resolved import Resolved
from elevon.campaign.resolved_file import read_resolved
from elevon.campaign.store import JOURNAL, LOG, Manifest, read_manifest
from elevon.errors import ElevonError, InputError, OutputError
from elevon.files import open_owned
from elevon.simulate.batch import checked_threads
from elevon.worklog import Item, locked, sweep

Report = Callable[[float], Any]

SILENT_AFTER = 30.0
"""Seconds without a sign of life of a worker, by default; ASSUMED: sixty heartbeats of Dask."""


@dataclass(frozen=True)
class CampaignResult:
    """Result of running a campaign.

    Attributes
    ----------
    manifest : Manifest
        As it stands in the folder.
    outcome : dict
        ``status`` and ``reason`` of every run.
    skipped : int
        Runs that were done before.
    wall_s : float
        Of this call.
    """

    manifest: Manifest
    outcome: dict[str, list[Any]]
    skipped: int
    wall_s: float

    @property
    def counts(self) -> dict[str, int]:
        """Number of runs by status."""
        return counted(self.outcome["status"])

    @property
    def failed(self) -> list[int]:
        """The runs that diverged or were refused by the core."""
        return [n for n, s in enumerate(self.outcome["status"]) if s in {"diverged", "refused"}]

    @property
    def bytes(self) -> int:
        """Bytes of the data."""
        return sum(f["bytes"] for b in self.manifest.blocks for f in b["files"].values())


def run_campaign(
    resolved: Resolved,
    text: str,
    out: str | os.PathLike[str],
    *,
    threads: int | None = None,
    cluster: str | None = None,
    progress: Report | None = None,
    announce: Callable[[str], object] | None = None,
    silent_after: float = SILENT_AFTER,
) -> CampaignResult:
    """Run a plan into a folder, or go on with one that was interrupted.

    Parameters
    ----------
    resolved : Resolved
        The plan, from `resolve_plan`.
    text : str
        The plan file's text, kept as given.
    out : path
        The folder; made when absent.
    threads : int, optional
        Default, and most: one a core.
    cluster : str, optional
        Address of a Dask scheduler, or ``local:N`` for N workers on this machine.
    progress : callable, optional
        Called with the done fraction; returning False interrupts.
    announce : callable, optional
        Called, before anything runs, with what the campaign will take.
    silent_after : float
        Seconds after which a worker of a cluster that gives no sign is named with its blocks;
        after as many again they are given to others.

    Returns
    -------
    CampaignResult
        Also when some runs failed: they are marked, with their reason.

    Raises
    ------
    InputError
        Wrong input; the folder holds another campaign or something else; too little memory or
        disk.
    BusyError
        Another process works in the folder.
    OutputError
        The folder cannot be written, or has gone.
    Interrupted
        `progress` returned False. What is done is kept.
    """
    start = time.perf_counter()
    folder, count = Path(out).expanduser(), checked_threads(threads)
    known = open_folder(folder, resolved, text)
    need = None if known else estimate(resolved, check(resolved), folder, count)
    with locked(folder):
        sweep(folder)
        work = begin(folder, resolved, text, need)
        return _simulate_missing(
            work,
            count,
            cluster=cluster,
            progress=progress,
            announce=announce,
            silent_after=silent_after,
            start=start,
        )


def resume_campaign(
    out: str | os.PathLike[str],
    *,
    threads: int | None = None,
    cluster: str | None = None,
    progress: Report | None = None,
    announce: Callable[[str], object] | None = None,
    silent_after: float = SILENT_AFTER,
) -> CampaignResult:
    """Go on with a campaign from what its folder says; the plan file is not needed.

    Arguments, result and errors as `run_campaign`.
    """
    start = time.perf_counter()
    folder, count = Path(out).expanduser(), checked_threads(threads)
    resolved = _read_or_repair(folder, announce)
    with locked(folder):
        sweep(folder)
        work = begin(folder, resolved, None, None)
        return _simulate_missing(
            work,
            count,
            cluster=cluster,
            progress=progress,
            announce=announce,
            silent_after=silent_after,
            start=start,
        )


def _read_or_repair(folder: Path, announce: Callable[[str], Any] | None) -> Resolved:
    """Return the resolved plan of a folder; damage that what is whole can prove is repaired."""
    from elevon.campaign.repair import repair

    try:
        manifest = read_manifest(folder)
        resolved = read_resolved(folder, manifest)
        if manifest.is_old or not Item("tables", manifest.files, {}).damaged(folder):
            return resolved
    except InputError as error:
        if "repair" not in str(error):  # nothing to start from
            raise
    for line in repair(folder):
        if announce is not None:
            announce(f"repaired: {line}")
    return read_resolved(folder)


def _simulate_missing(
    work: CampaignWork,
    threads: int,
    *,
    cluster: str | None,
    progress: Report | None,
    announce: Callable[[str], Any] | None,
    silent_after: float,
    start: float,
) -> CampaignResult:
    skipped = work.done_runs
    if announce is not None and work.recovered:
        announce(f"{len(work.recovered)} block(s) found whole that {LOG} does not list")
    outcome = finished(work)
    if outcome is None:
        _note(work.folder, f"begun in {work.folder.absolute()}: {skipped} runs are there")
        if announce is not None and work.missing:
            announce(str(Cost.of(work, threads)))
        work.check_disk()
        if cluster is None:
            _simulate_in_threads(work, threads, progress)
        else:
            from elevon.campaign.cluster import in_cluster

            in_cluster(work, cluster, progress, announce, silent_after)
        outcome = finish(work)
        counts = counted(outcome["status"]).items()
        ended = ", ".join(f"{count} {status}" for status, count in counts)
        _note(work.folder, f"ended after {time.perf_counter() - start:.1f} s: {ended}")
    _close(work.folder)
    return CampaignResult(work.manifest, outcome, skipped, time.perf_counter() - start)


def _close(folder: Path) -> None:
    """Remove what killed writers left; raise `ElevonError` unless the data set verifies."""
    from elevon.campaign.verify import verify

    sweep(folder)
    wrong = [f"{item.name}: {item.value:.0f}" for item in verify(folder) if not item.passed]
    if wrong:
        raise ElevonError(
            f"{folder}: is finished, but not whole: {'; '.join(wrong)}; "
            f"elevon dataset verify {folder} shows all checks"
        )


def _note(folder: Path, text: str) -> None:
    """Add a line to the journal, with the time and the process."""
    when = datetime.now().astimezone().isoformat(timespec="seconds")
    path = folder / JOURNAL
    try:
        handle = open_owned(path, os.O_WRONLY | os.O_APPEND | os.O_CREAT)
        with os.fdopen(handle, "a", encoding="utf-8") as file:
            file.write(f"{when} {socket.gethostname()} process {os.getpid()}: {text}\n")
    except OSError as error:
        raise OutputError(f"{path}: cannot be written: {error.strerror or error}") from error


def _simulate_in_threads(work: CampaignWork, threads: int, progress: Report | None) -> None:
    """Simulate block after block; a helper prepares the next and writes the last meanwhile."""
    if not work.missing:
        return
    writing: Future[Item] | None = None
    with ThreadPoolExecutor(1, "campaign") as helper:
        ahead = helper.submit(_prepare_block, work, work.missing[0])
        try:
            for block, following in zip(work.missing, [*work.missing[1:], None], strict=True):
                prepared = ahead.result()
                if following is not None:
                    ahead = helper.submit(_prepare_block, work, following)
                share = _block_progress(progress, work, block)
                results = simulate_block(work.resolved, prepared, threads, share)
                _log_block(work, writing)
                writing = helper.submit(
                    finish_block,
                    work.resolved,
                    work.folder,
                    block,
                    work.numbers(block),
                    prepared=prepared,
                    results=results,
                )
        finally:
            _log_block(work, writing)


def _prepare_block(work: CampaignWork, block: int) -> list[Any]:
    return [work.resolved.prepared(number) for number in work.numbers(block)]


def _log_block(work: CampaignWork, writing: Future[Item] | None) -> None:
    """Add a block that has been written to the log."""
    if writing is not None:
        item = writing.result()
        check_there(work.folder)
        work.log.add(item)


def _block_progress(
    progress: Report | None, work: CampaignWork, block: int
) -> Callable[[float], bool]:
    first, last, total = work.edges[block], work.edges[block + 1], work.edges[-1]

    def report(fraction: float) -> bool:
        if progress is None:
            return True
        return progress((first + (last - first) * fraction) / total) is not False

    return report
