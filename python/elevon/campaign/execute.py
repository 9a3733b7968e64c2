"""Run a campaign block by block; what is done stays done."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from elevon.campaign.card import data_card
from elevon.campaign.folder import SCHEMA, Manifest, read_manifest, write_block
from elevon.campaign.plan import Plan
from elevon.campaign.resolve import PlannedRun
from elevon.errors import InputError
from elevon.files import write_text
from elevon.memory import available_bytes, format_bytes
from elevon.recording import Recording
from elevon.simulate import batch_bytes, simulate_batch

__all__ = ["CampaignResult", "Estimate", "estimate", "run_campaign"]

#: A block takes at most this part of the memory there is, and never more than that many bytes.
_BLOCK_SHARE, _BLOCK_BYTES = 0.4, 512_000_000


@dataclass(frozen=True)
class Estimate:
    """What a campaign will take, known before it starts.

    Attributes
    ----------
    blocks : list of (int, int)
        First and one past the last run of each block.
    memory, disk : int
        Bytes: the largest block in memory, and all data before compression.
    """

    blocks: list[tuple[int, int]]
    memory: int
    disk: int

    def __str__(self) -> str:
        return (
            f"{self.blocks[-1][1]} runs in {len(self.blocks)} block(s); at most "
            f"{format_bytes(self.memory)} of memory at a time, {format_bytes(self.disk)} of data"
        )


@dataclass(frozen=True)
class CampaignResult:
    """What a campaign did.

    Attributes
    ----------
    manifest : Manifest
        As it stands in the folder.
    skipped : int
        Runs that were done before.
    wall_s : float
        Of this call.
    """

    manifest: Manifest
    skipped: int
    wall_s: float

    @property
    def counts(self) -> dict[str, int]:
        """Number of runs by status."""
        found: dict[str, int] = {}
        for run in self.manifest.runs:
            found[run["status"]] = found.get(run["status"], 0) + 1
        return found


def estimate(plan: Plan, planned: Sequence[PlannedRun]) -> Estimate:
    """Check every run, and say what the campaign will take.

    Raises
    ------
    InputError
        A run is wrong (it is named), or does not fit in memory alone (both amounts are named).
    """
    sizes = []
    for item in planned:
        try:
            sizes.append(
                batch_bytes(
                    [item.run],
                    fidelity=plan.fidelity,
                    record=_record(plan),
                    strict=not plan.allow_not_acting,
                )
            )
        except InputError as error:
            raise InputError(f"run {item.run.number}: {error}") from error
    free = available_bytes()
    limit = _BLOCK_BYTES if free is None else min(_BLOCK_BYTES, int(_BLOCK_SHARE * free))
    largest = max(sizes)
    if free is not None and largest > 0.8 * free:
        raise InputError(
            f"run {sizes.index(largest)} alone would take {format_bytes(largest)} of memory, of "
            f"the {format_bytes(free)} available (all {len(sizes)} runs: "
            f"{format_bytes(sum(sizes))}); record fewer signals, at a lower rate, or for less time"
        )
    blocks = _blocks(sizes, plan.runs_per_file, limit)
    return Estimate(blocks, max(sum(sizes[a:b]) for a, b in blocks), sum(sizes))


def run_campaign(
    plan: Plan,
    planned: Sequence[PlannedRun],
    text: str,
    out: str | os.PathLike[str],
    *,
    threads: int | None = None,
    progress: Callable[[float], Any] | None = None,
    announce: Callable[[str], Any] | None = None,
) -> CampaignResult:
    """Run a plan into a folder, or go on with one that was interrupted.

    Parameters
    ----------
    plan : Plan
        As read.
    planned : sequence of PlannedRun
        Its runs.
    text : str
        The plan file's text, kept as given.
    out : path
        The folder; made when absent.
    threads : int, optional
        Default: one a core.
    progress : callable, optional
        Called with the done fraction; returning False interrupts.
    announce : callable, optional
        Told, before anything runs, what the campaign will take.

    Returns
    -------
    CampaignResult
        Also when some runs diverged: they are marked.

    Raises
    ------
    InputError
        Wrong input; the folder holds another campaign or something else; too little memory or
        disk.
    Interrupted
        `progress` returned False. What is done is kept.
    """
    begin = time.perf_counter()
    folder = Path(out)
    need = estimate(plan, planned)
    manifest = _open(folder, plan, planned, text)
    done = manifest.done(folder)
    _check_disk(folder, need)
    if announce is not None:
        announce(str(need))
    manifest.blocks = [block for block in manifest.blocks if block["block"] in done]
    manifest.runs = [run for run in manifest.runs if run["block"] in done]
    skipped = len(manifest.runs)
    for index, (first, last) in enumerate(need.blocks):
        if index in done:
            continue
        share = _part(progress, first, last, len(planned))
        part = planned[first:last]
        recordings = _simulate(plan, part, threads, share)
        _keep(folder, manifest, index, part, recordings)
    manifest.runs.sort(key=lambda run: run["run"])
    failed = any(run["status"] == "diverged" for run in manifest.runs)
    manifest.status = "failed" if failed else "ok"
    manifest.write(folder)
    write_text(folder / "README.md", data_card(plan, manifest, folder), force=True)
    return CampaignResult(manifest, skipped, time.perf_counter() - begin)


def _simulate(
    plan: Plan,
    part: Sequence[PlannedRun],
    threads: int | None,
    progress: Callable[[float], bool],
) -> list[Recording]:
    return simulate_batch(
        [item.run for item in part],
        fidelity=plan.fidelity,
        record=_record(plan),
        threads=threads,
        progress=progress,
    )


def _keep(
    folder: Path,
    manifest: Manifest,
    index: int,
    part: Sequence[PlannedRun],
    recordings: Sequence[Recording],
) -> None:
    """Write a block's data first, then the manifest that tells of it."""
    numbers = [item.run.number for item in part]
    files = write_block(folder, index, numbers, recordings)
    manifest.blocks.append(
        {"block": index, "first": numbers[0], "last": numbers[-1], "files": files}
    )
    manifest.runs.extend(_row(i, index, r) for i, r in zip(part, recordings, strict=True))
    manifest.write(folder)


def _row(item: PlannedRun, block: int, recording: Recording) -> dict[str, Any]:
    meta = recording.meta
    keys = ("status", "message", "actuator", "fidelity", "seed", "parameter_hash", "version")
    return {
        "run": item.run.number,
        "block": block,
        "label": item.run.label,
        "split": item.split,
        "values": dict(item.values),
        **{key: meta[key] for key in keys},
        "sim_s": meta["sim_s"],
        "steps": meta["steps"],
        "faults": meta["faults"],
        "labels": recording.labels,
        "final": {k: v if v - v == 0.0 else None for k, v in recording.final.items()},
    }


def _open(folder: Path, plan: Plan, planned: Sequence[PlannedRun], text: str) -> Manifest:
    """Make the folder, or find the campaign in it that is to go on."""
    from elevon import _core

    resolved = _resolved(plan, planned)
    digest = hashlib.sha256(resolved.encode()).hexdigest()
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, not a folder")
    if folder.is_dir() and any(folder.iterdir()):
        manifest = read_manifest(folder)
        if manifest.plan_hash != digest:
            raise InputError(
                f"{folder}: holds another campaign ({manifest.name}, {manifest.total} runs); "
                "give a new folder"
            )
        return manifest
    manifest = Manifest(plan.name, digest, len(planned), _core.version())
    write_text(folder / "plan.toml", text, force=True)
    write_text(folder / "resolved.json", resolved, force=True)
    manifest.write(folder)
    return manifest


def _resolved(plan: Plan, planned: Sequence[PlannedRun]) -> str:
    """The plan with everything decided: what a reader needs to repeat it without this program."""
    from elevon import _core

    first = planned[0].run.actuator
    base = {path: item.value for path, item in first.parameters.items()}
    runs = [
        {
            "run": item.run.number,
            "seed": item.run.seed,
            "split": item.split,
            "values": dict(item.values),
            "parameter_hash": item.run.actuator.hash,
            "parameters": {
                path: entry.value
                for path, entry in item.run.actuator.parameters.items()
                if entry.value != base[path]
            },
            "scenario": item.run.scenario.to_dict(),
        }
        for item in planned
    ]
    head = {
        "schema": SCHEMA,
        "name": plan.name,
        "version": _core.version(),
        "actuator": first.name,
        "wiring": first.wiring,
        "fidelity": plan.fidelity,
        "record": _record(plan),
        "parameters": base,
    }
    return json.dumps({**head, "runs": runs}, indent=1) + "\n"


def _record(plan: Plan) -> str | list[str] | None:
    return list(plan.record) if isinstance(plan.record, tuple) else plan.record


def _blocks(sizes: Sequence[int], most: int, limit: int) -> list[tuple[int, int]]:
    """Cut the runs into blocks of at most `most` runs and `limit` bytes (but one run at least)."""
    blocks: list[tuple[int, int]] = []
    first = total = 0
    for index, size in enumerate(sizes):
        if index > first and (index - first >= most or total + size > limit):
            blocks.append((first, index))
            first, total = index, 0
        total += size
    return [*blocks, (first, len(sizes))]


def _check_disk(folder: Path, need: Estimate) -> None:
    free = shutil.disk_usage(folder).free
    if need.disk > free:
        raise InputError(
            f"{folder}: the data would take up to {format_bytes(need.disk)}, of the "
            f"{format_bytes(free)} free on the disk"
        )


def _part(
    progress: Callable[[float], Any] | None, first: int, last: int, total: int
) -> Callable[[float], bool]:
    def report(fraction: float) -> bool:
        if progress is None:
            return True
        return progress((first + (last - first) * fraction) / total) is not False

    return report
