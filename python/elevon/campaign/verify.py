"""Is a data set whole: every file as written, every run once, no group in two parts."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

from elevon.campaign.dataset import Dataset, load_campaign
from elevon.campaign.resolved import leaks
from elevon.campaign.resolved_file import read_resolved
from elevon.campaign.store import ENDS, MANIFEST
from elevon.errors import FormatError, InputError
from elevon.report import Check
from elevon.worklog import Item


def verify(
    folder: str | os.PathLike[str], progress: Callable[[float], object] | None = None
) -> list[Check]:
    """Check a data set; every value is a count of what is wrong, its limit 0.

    Parameters
    ----------
    folder : path
        A campaign's folder.
    progress : callable, optional
        Called with the done fraction.

    Returns
    -------
    list of Check
        All of them passed: the set is whole.

    Raises
    ------
    InputError
        No campaign folder.
    """
    root = Path(folder).expanduser()
    if not (root / MANIFEST).is_file():
        raise InputError(f"{root}: is not a campaign folder (no {MANIFEST})")
    try:
        ds = load_campaign(root)
    except FormatError as error:
        return [_count_check(f"damage to the manifest ({error})", 1)]
    return [_count_check("damage to the manifest", 0), *_checks(ds, progress)]


def _checks(ds: Dataset, progress: Callable[[float], Any] | None) -> Iterator[Check]:
    items = ds.items
    done = sum(item.data["last"] - item.data["first"] + 1 for item in items)
    yield _count_check("runs that are not done", len(ds) - done)
    yield _count_check(
        "files missing or not as they were written", *_damaged_files(ds, items, progress)
    )
    yield _count_check("files that the manifest does not list", *_unlisted_files(ds, items))
    yield _count_check("runs of the table missing, twice or out of order", *_wrong_rows(ds))
    yield _count_check("runs whose samples are missing or twice", *_runs_without_samples(ds, items))
    try:
        read_resolved(ds.folder)
        yield _count_check("damage to the resolved plan", 0)
    except FormatError as error:
        yield _count_check("damage to the resolved plan", 1, [str(error)])
    for noun in ("unit", "draw"):
        yield _count_check(f"{noun}s in more than one part", *_divided_groups(ds, noun))


def _count_check(name: str, count: int, which: list[str] | None = None) -> Check:
    more = f": {', '.join(which[:3])}{', ...' if len(which) > 3 else ''}" if which else ""
    return Check(name + more, float(count), 0.0)


def _damaged_files(
    ds: Dataset, items: list[Item], progress: Callable[[float], Any] | None
) -> tuple[int, list[str]]:
    damaged: list[str] = Item("tables", ds.manifest.files, {}).damaged(ds.folder)
    for number, item in enumerate(items):
        damaged += item.damaged(ds.folder)
        if progress is not None:
            progress((number + 1) / len(items))
    return len(damaged), damaged


def _unlisted_files(ds: Dataset, items: list[Item]) -> tuple[int, list[str]]:
    known = {name for item in items for name in item.files}
    there = {
        path.relative_to(ds.folder).as_posix()
        for place in ("runs", "features", ENDS)
        for path in (ds.folder / place).rglob("*.parquet")
    }
    strangers = sorted(there - known)
    return len(strangers), strangers


def _wrong_rows(ds: Dataset) -> tuple[int, list[str]]:
    try:
        runs = ds.runs.to_arrow(["run"])["run"].to_pylist()
    except FormatError as error:
        return len(ds), [str(error)]
    wrong = sum(a != b for a, b in zip(runs, range(len(ds)), strict=False))
    return wrong + abs(len(runs) - len(ds)), []


def _runs_without_samples(ds: Dataset, items: list[Item]) -> tuple[int, list[str]]:
    """Count the runs without samples in their file, but for those the core refused."""
    import numpy as np

    try:
        table = ds.runs.to_arrow(["run", "status"])
    except FormatError as error:
        return len(ds), [str(error)]
    ended = dict(zip(table["run"].to_pylist(), table["status"].to_pylist(), strict=True))
    wrong: list[str] = []
    for clock in ds.clocks:
        if not any(f"runs/{clock}/" in name for item in items for name in item.files):
            continue
        signals = ds.clock(clock)
        for part in signals.parts:
            wanted = {n for n in range(part.first, part.last + 1) if ended.get(n) != "refused"}
            try:
                runs = signals.dataset([part]).to_table(columns=["run"])["run"].to_numpy()
            except (OSError, FormatError, ValueError):
                wrong += [str(number) for number in wanted]
                continue
            starts = runs[np.flatnonzero(np.diff(runs, prepend=-1))]
            counts = dict(zip(*np.unique(starts, return_counts=True), strict=True))
            wrong += [str(n) for n in wanted.symmetric_difference(counts)]
            wrong += [str(n) for n, count in counts.items() if count > 1]
    return len(wrong), wrong


def _divided_groups(ds: Dataset, noun: str) -> tuple[int, list[str]]:
    try:
        table = ds.runs.to_arrow([noun, "split"])
    except FormatError as error:
        return 1, [str(error)]
    leaking = leaks(table[noun].to_pylist(), table["split"].to_pylist())
    return len(leaking), [str(item) for item in leaking]
