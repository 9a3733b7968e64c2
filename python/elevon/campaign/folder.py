"""A campaign's folder: begun, recognised, gone on with, finished."""

from __future__ import annotations

import itertools
import json
import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from elevon.campaign.block import block_name, signal_schema, write_rows
from elevon.campaign.card import card_texts
from elevon.campaign.check import Cost, check_disk
from elevon.campaign.dataset import Dataset
from elevon.campaign.resolved import Resolved, split_index
from elevon.campaign.resolved_file import (
    LONGEST,
    RUNS,
    plan_hash,
    planned,
    read_outcome,
    read_resolved,
    resolved_text,
    runs_table,
    with_copy,
)
from elevon.campaign.store import (
    ENDS,
    JOURNAL,
    LOG,
    MANIFEST,
    PLAN,
    RESOLVED,
    Manifest,
    core_hash,
    described_item,
    read_description,
    read_ends,
    read_manifest,
    repair_hint,
    work_log,
)
from elevon.errors import ElevonWarning, FormatError, InputError, OutputError
from elevon.files import read_regular, write_text
from elevon.record_plan import ClockPlan
from elevon.transaction import Transaction, is_staged, settle
from elevon.worklog import LOCK, Item, WorkLog, digest, locked, sweep

_MOST = 3


def difference(folder: Path, resolved: Resolved) -> str:
    """Return the first differences between a plan and the one a folder holds."""
    try:
        old = json.loads(read_regular(folder / RESOLVED, LONGEST))
    except (OSError, ValueError):
        return "its resolved plan cannot be read"
    new = json.loads(resolved_text(resolved))
    places = list(_differing_places(old, new, ""))
    changed = [
        f"the points of {name} have changed"
        for name, mark in new["sources"].items()
        if old.get("sources", {}).get(name, mark) != mark
    ]
    places = [place for place in places if not place.startswith("sources")]
    if not changed and not places:
        return "the drawn values differ"
    return "; ".join([*changed, *(f"{place} differs" for place in places)][:_MOST])


def _differing_places(old: Any, new: Any, place: str) -> Iterator[str]:
    """Yield the places at which two JSON values differ."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in dict.fromkeys([*old, *new]):
            inner = f"{place}.{key}" if place else str(key)
            yield from _differing_places(old.get(key), new.get(key), inner)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, (first, second) in enumerate(zip(old, new, strict=True)):
            named = first.get("path", index) if isinstance(first, Mapping) else index
            yield from _differing_places(first, second, f"{place}[{named}]")
    elif old != new:
        yield place


_LONGEST = 2**30


@dataclass
class CampaignWork:
    """A campaign that is carried out: its folder, its plan, what is done and what is missing."""

    folder: Path
    resolved: Resolved
    manifest: Manifest
    log: WorkLog
    missing: list[int]
    recovered: list[str] = field(default_factory=list)

    @property
    def edges(self) -> list[int]:
        """First run of each block, and one past the last run."""
        return self.manifest.edges

    @property
    def done_runs(self) -> int:
        """Number of runs whose data are there."""
        return len(self.resolved) - sum(len(self.numbers(block)) for block in self.missing)

    @property
    def missing_bytes(self) -> int:
        """Bytes of the data that are still to be made, before compression."""
        part = 1.0 - self.done_runs / len(self.resolved)
        return int(self.manifest.estimate["disk"] * part)

    def numbers(self, block: int) -> range:
        """Return the runs of a block."""
        return range(self.edges[block], self.edges[block + 1])

    def check_disk(self) -> None:
        """Raise `InputError` when the disk has no room for what is missing."""
        check_disk(self.folder, self.missing_bytes)


def open_folder(folder: Path, resolved: Resolved, text: str) -> bool:
    """Return whether a folder holds this very campaign, begun before; nothing is written.

    Raises
    ------
    InputError
        It holds another campaign, or something else.
    """
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: is a file, not a folder")
    if not folder.is_dir():
        return False
    if (folder / MANIFEST).is_file():
        manifest = read_manifest(folder)
        manifest.check_writable(folder)
        _check_same(folder, manifest, resolved)
        return True
    names = {path.name for path in folder.iterdir()}
    known = {LOCK, PLAN, RESOLVED, RUNS, LOG, JOURNAL}
    plain = {name for name in names if ".part" not in name and not is_staged(name)}
    begun = plain <= known and (LOCK in plain or not plain or _is_plan(folder / PLAN, text))
    if not begun:
        hint = repair_hint(folder)
        raise InputError(f"{folder}: is not a campaign folder (no {MANIFEST}), and not empty{hint}")
    return False


def begin(folder: Path, resolved: Resolved, text: str | None, need: Cost | None) -> CampaignWork:
    """Make a folder a campaign's own, or find what is done in it; call with the lock held.

    Parameters
    ----------
    text : str or None
        The plan as given; None to go on with what is there.
    need : Cost or None
        What the campaign takes; None where it was begun before.

    Raises
    ------
    InputError
        The folder holds another campaign.
    OutputError
        It cannot be written.
    """
    if (folder / MANIFEST).is_file():
        manifest = read_manifest(folder)
        manifest.check_writable(folder)
        _check_same(folder, manifest, resolved)
        settle(folder, manifest.files)
        resolved.mark = manifest.plan_hash
        if text is not None and PLAN in Item("tables", manifest.files, {}).damaged(folder):
            write_text(folder / PLAN, text, force=True)
            manifest.files[PLAN] = digest(folder / PLAN)
        _split_as_in_folder(folder, resolved, manifest)
        return _find_blocks(folder, resolved, manifest)
    if need is None or text is None:
        raise OutputError(f"{folder}: its {MANIFEST} has gone meanwhile")
    settle(folder, {})
    manifest = new_manifest(resolved, need)
    resolved.mark = manifest.plan_hash
    change = Transaction(folder)
    change.stage_text(PLAN, text)
    stage_tables(change, resolved, text, planned(len(resolved)))
    manifest.files = change.files
    change.commit(lambda: manifest.write(folder))
    log = WorkLog.begin(folder / LOG, manifest.plan_hash)
    return CampaignWork(folder, resolved, manifest, log, list(range(len(need.edges) - 1)))


def _split_as_in_folder(folder: Path, resolved: Resolved, manifest: Manifest) -> None:
    """Deal the runs to the parts that the folder has: the plan's hash does not hold them."""
    if resolved.split and resolved.split != manifest.split:
        warnings.warn(
            f"{folder}: keeps the parts of its runs ({_shares_text(manifest.split)}), not those of "
            f"the plan ({_shares_text(resolved.split)}); elevon dataset split deals them anew",
            ElevonWarning,
            stacklevel=4,
        )
    split_index(resolved, manifest.split)


def _shares_text(split: Mapping[str, Any]) -> str:
    shares = split.get("shares", {})
    return ", ".join(f"{name} = {share:g}" for name, share in shares.items()) or "none"


def finished(work: CampaignWork) -> dict[str, list[object]] | None:
    """Return how every run ended, None of an unfinished campaign; remove a log that is left."""
    files = Item("tables", work.manifest.files, {})
    if work.manifest.status == "running" or work.missing or not files.intact(work.folder):
        return None
    if read_manifest(work.folder) != work.manifest:
        return None
    drop_log(work.folder)
    return read_outcome(work.folder / RUNS)


def finish(work: CampaignWork, plan: str | None = None) -> dict[str, list[object]]:
    """Write the table of the runs, the cards and the manifest; return how every run ended.

    Parameters
    ----------
    plan : str, optional
        The plan's text, where the file is to be written anew.

    Raises
    ------
    OutputError
        Blocks are missing: the rows are not 0 to total - 1.
    """
    items = [work.log.items.get(block_name(block)) for block in range(len(work.edges) - 1)]
    outcome = _outcome(work, items)
    manifest = work.manifest
    change = Transaction(work.folder)
    text = _plan_text(work.folder) if plan is None else plan
    if plan is not None or PLAN not in manifest.files:
        change.stage_text(PLAN, text)
    stage_tables(change, work.resolved, text, outcome)
    manifest.blocks = [{"name": i.name, **i.data, "files": i.files} for i in items if i is not None]
    for block in manifest.blocks:
        for key in outcome:
            block.pop(key, None)
    failed = {"diverged", "refused"} & set(outcome["status"])
    manifest.status = "failed" if failed else "ok"
    manifest.split = work.resolved.split
    describe_anew(change, manifest)
    drop_log(work.folder)
    return outcome


def drop_log(folder: Path) -> bool:
    """Remove the log of work that the manifest describes, which a killed process left there."""
    there = (folder / LOG).is_file()
    (folder / LOG).unlink(missing_ok=True)
    return there


def stage_tables(
    change: Transaction, resolved: Resolved, plan: str, outcome: Mapping[str, Sequence[object]]
) -> None:
    """Stage the resolved plan and the table of the runs, which carries a copy of both plans."""
    text = resolved_text(resolved)
    change.stage_text(RESOLVED, text)
    table = with_copy(runs_table(resolved, outcome), plan, text, plan_hash(resolved))
    with change.stage(RUNS) as temporary:
        write_rows(table, temporary)


def describe_anew(change: Transaction, manifest: Manifest) -> None:
    """Stage the data card of what has been staged, and switch to all of it."""
    manifest.files = {**manifest.files, **change.files}
    for name, text in card_texts(Dataset(change.folder, manifest)).items():
        change.stage_text(name, text)
    manifest.files = {**manifest.files, **change.files}
    change.commit(lambda: manifest.write(change.folder))


def _plan_text(folder: Path) -> str:
    return read_regular(folder / PLAN, _LONGEST).decode("utf-8")


def _find_blocks(folder: Path, resolved: Resolved, manifest: Manifest) -> CampaignWork:
    """Find which blocks of a campaign are there, each file as it was written."""
    items, recovered = whole_blocks(folder, manifest)
    missing = [b for b in range(len(manifest.edges) - 1) if block_name(b) not in items]
    if items and missing:
        _check_build(folder, manifest)
    log = WorkLog(folder / LOG, manifest.plan_hash, items)
    if missing or manifest.status == "running":
        log.rewrite()
    return CampaignWork(folder, resolved, manifest, log, missing, recovered)


def whole_blocks(folder: Path, manifest: Manifest) -> tuple[dict[str, Item], list[str]]:
    """Return the blocks that are whole, and the names of those that only they themselves prove.

    A block whose SHA-256 the log or the manifest states is whole only if it is that block:
    checksums of pages, by which a block proves itself, do not cover the statistics of a file.
    """
    try:
        log = work_log(folder, manifest)
    except FormatError:
        log = None  # each block says itself what it is
    before = {} if log is None else log.items
    earlier = _finished_blocks(folder, manifest)
    stated = {*before, *(block["name"] for block in manifest.blocks)}
    items, recovered = {}, []
    for block, (first, stop) in enumerate(itertools.pairwise(manifest.edges)):
        name = block_name(block)
        item = before.get(name) or earlier.get(name)
        if item is None and name not in stated:
            item = _proved_by_itself(folder, manifest, name, (first, stop - 1))
            recovered += [] if item is None else [name]
        if item is not None and item.intact(folder):
            items[name] = item
    return items, recovered


def _proved_by_itself(
    folder: Path, manifest: Manifest, name: str, span: tuple[int, int]
) -> Item | None:
    """Return a block that the log does not know, where its own description proves it."""
    about = read_description(folder / ENDS / f"{name}.parquet")
    mine = (manifest.plan_hash, manifest.version, manifest.core, name, *span)
    keys = ("plan_hash", "version", "core", "name", "first", "last")
    if about is None or tuple(about[key] for key in keys) != mine:
        return None
    return described_item(folder, about)


def _finished_blocks(folder: Path, manifest: Manifest) -> dict[str, Item]:
    """Return the items of a finished manifest, with how their runs ended."""
    if not manifest.blocks:
        return {}
    damaged = RUNS in Item("tables", manifest.files, {}).damaged(folder)
    outcome = None if damaged else read_outcome(folder / RUNS)
    items = {}
    for block in manifest.blocks:
        first, last = block["first"], block["last"]
        if outcome is None:  # the table of the runs is not whole: each block says it as well
            ended = read_ends(folder, block["files"])
        else:
            ended = {key: values[first : last + 1] for key, values in outcome.items()}
        if ended is not None:
            data = {"first": first, "last": last, **ended}
            items[block["name"]] = Item(block["name"], block["files"], data)
    return items


def _outcome(work: CampaignWork, items: list[Item | None]) -> dict[str, list[Any]]:
    outcome: dict[str, list[Any]] = {"status": [], "reason": [], "sim_s": [], "steps": []}
    for block, item in enumerate(items):
        numbers = work.numbers(block)
        whole = item is not None and (item.data["first"], item.data["last"] + 1) == (
            numbers.start,
            numbers.stop,
        )
        if item is None or not whole or len(item.data["status"]) != len(numbers):
            raise OutputError(
                f"{work.folder}: runs {numbers.start} to {numbers.stop - 1} are not there in full"
            )
        for key, values in outcome.items():
            values.extend(item.data[key])
    return outcome


def _is_plan(path: Path, text: str) -> bool:
    try:
        return read_regular(path, _LONGEST).decode("utf-8") == text
    except ValueError:
        return False


def _check_same(folder: Path, manifest: Manifest, resolved: Resolved) -> None:
    """Refuse another plan than the one a campaign was begun with."""
    if manifest.plan_hash != plan_hash(resolved):
        raise InputError(
            f"{folder}: holds another campaign ({manifest.name}, {manifest.total} runs): "
            f"{difference(folder, resolved)}; give a new folder, or go on with the plan as it was: "
            f"elevon campaign resume {folder}"
        )


def _check_build(folder: Path, manifest: Manifest) -> None:
    """Refuse to mix runs of two builds in one folder."""
    from elevon import _core

    if (manifest.version, manifest.core) != (_core.version(), core_hash()):
        raise InputError(
            f"{folder}: was begun by another build of elevon ({manifest.version}, core "
            f"{manifest.core[:12]}; this is {_core.version()}, {core_hash()[:12]}): its runs and "
            "new ones might differ; give a new folder"
        )


def new_manifest(resolved: Resolved, need: Cost) -> Manifest:
    """Return the manifest with which a campaign's folder begins."""
    from elevon import _core

    clocks = {} if need.checked is None else need.checked.clocks
    return Manifest(
        name=resolved.name,
        plan_hash=plan_hash(resolved),
        total=len(resolved),
        edges=need.edges,
        version=_core.version(),
        core=core_hash(),
        text=resolved.text,
        actuator=resolved.actuator.name,
        wiring=resolved.wiring,
        fidelity=resolved.fidelity,
        clocks=[_clock_columns(resolved, clock) for clock in clocks.values()],
        faults=[{"name": n, "unit": u} for n, u in resolved.fault_names().items()],
        columns=[
            {"name": c.name, "kind": c.kind, "unit": c.unit, "role": c.role}
            for c in resolved.columns
        ],
        responses=resolved.responses,
        not_acting=[] if need.checked is None else need.checked.idle,
        estimate={"disk": need.disk, "memory": need.memory},
        design=resolved.design,
        sources=resolved.sources,
        split=resolved.split,
    )


def _clock_columns(resolved: Resolved, clock: ClockPlan) -> dict[str, Any]:
    unit = resolved.prepared(0).command_unit
    columns = [
        {
            "name": item.name,
            "unit": item.metadata[b"unit"].decode(),
            "text": item.metadata[b"text"].decode(),
        }
        for item in signal_schema(resolved, clock, unit)
    ]
    return {
        "name": clock.name,
        "rate": clock.rate,
        "folder": f"runs/{clock.name}",
        "columns": columns,
    }


def resplit(
    folder: Path, shares: Mapping[str, float], *, by: str | None = None, seed: int = 0
) -> dict[str, int]:
    """Deal whole units, or whole draws, to other parts; the samples are not changed.

    Parameters
    ----------
    folder : path
        A finished campaign's folder.
    shares : mapping
        Part to its share; they add up to 1.
    by : str, optional
        ``unit`` or ``draw``; default ``unit`` where there is a population.
    seed : int
        Of the dealing.

    Returns
    -------
    dict
        Part to its number of runs.

    Raises
    ------
    InputError
        Shares that do not add up, a part that would be empty, a split that would leak, or a
        campaign that is not finished.
    """
    _check_shares(shares)
    with locked(folder):
        sweep(folder)
        manifest = read_manifest(folder)
        manifest.check_writable(folder)
        settle(folder, manifest.files)
        if manifest.status == "running":
            raise InputError(f"{folder}: is not finished; elevon campaign resume {folder}")
        resolved = read_resolved(folder, manifest)
        population = bool((resolved.index.unit >= 0).all())
        noun = by or ("unit" if population else "draw")
        _check_grouping(noun, population=population)
        split_index(resolved, {"shares": dict(shares), "by": noun, "seed": seed}, "--share")
        plan = read_regular(folder / PLAN, LONGEST).decode("utf-8")
        change = Transaction(folder)
        stage_tables(change, resolved, plan, read_outcome(folder / RUNS))
        manifest.split = resolved.split
        describe_anew(change, manifest)
    return {name: int((resolved.index.split == name).sum()) for name in shares}


def _check_shares(shares: Mapping[str, float]) -> None:
    values = list(shares.values())
    if not values or min(values) < 0.0 or abs(sum(values) - 1.0) > 1e-9:
        raise InputError(f"--share: the shares are {values}; they must add up to 1")


def _check_grouping(noun: str, *, population: bool) -> None:
    if noun not in {"unit", "draw"}:
        raise InputError(
            f"--by {noun} would leak: runs alike stand in two parts; valid: unit, draw"
        )
    if noun == "draw" and population:
        raise InputError("--by draw would leak: runs of one unit stand in two parts")
    if noun == "unit" and not population:
        raise InputError("--by unit: the campaign has no population")
