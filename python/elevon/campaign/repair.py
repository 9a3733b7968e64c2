"""Rebuild what is damaged in a campaign's folder from what is whole; nothing is simulated.

Each file has its content proved by another: the resolved plan and the plan by a copy in the table
of the runs, all three by the plan's hash in the manifest; the manifest by the resolved plan and
the blocks' own descriptions; the log by these descriptions.
"""

from __future__ import annotations

import contextlib
import itertools
import json
import tomllib
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from elevon.campaign.block import block_name
from elevon.campaign.check import Cost, borders, check
from elevon.campaign.folder import (
    CampaignWork,
    describe_anew,
    drop_log,
    finish,
    new_manifest,
    stage_tables,
    whole_blocks,
)
from elevon.campaign.resolved import Resolved, split_index
from elevon.campaign.resolved_file import LONGEST, RUNS, plan_hash, planned, read_table, rebuilt
from elevon.campaign.store import (
    LOG,
    MANIFEST,
    PLAN,
    RESOLVED,
    Manifest,
    described_blocks,
    read_manifest,
    unpacked,
)
from elevon.errors import ElevonError, FormatError, InputError
from elevon.files import read_regular
from elevon.transaction import Transaction, settle
from elevon.worklog import Item, WorkLog, locked, sweep


def repair(folder: Path) -> list[str]:
    """Rebuild the manifest, the resolved plan, the plan, the table of the runs and the log.

    Returns
    -------
    list of str
        What has been done, a line each; empty where nothing was damaged.

    Raises
    ------
    InputError
        No campaign folder, or one of an earlier form.
    FormatError
        What is left does not prove what is damaged.
    """
    if not any((folder / name).exists() for name in (MANIFEST, RESOLVED, RUNS, "ends")):
        raise InputError(f"{folder}: is not a campaign folder (no {MANIFEST})")
    with locked(folder):
        sweep(folder)
        return repair_locked(folder)


@dataclass
class _Survey:
    """Contents of a damaged folder; a part that is damaged or missing is None."""

    folder: Path
    manifest: Manifest | None
    contents: list[dict[str, Any]]
    copy: dict[str, Any] | None
    table: Any
    blocks: dict[str, dict[str, Any]]
    done: list[str] = field(default_factory=list)

    @property
    def mark(self) -> str:
        """Hash of the plan, from the manifest, else from the copy or the blocks."""
        if self.manifest is not None:
            return self.manifest.plan_hash
        marks = {about["plan_hash"] for about in self.blocks.values()}
        if self.copy is not None:
            marks.add(self.copy["plan_hash"])
        if len(marks) != 1:
            raise FormatError(
                f"{self.folder}: cannot be repaired: {MANIFEST} is damaged, and "
                + ("its blocks are of several plans" if marks else "nothing else names the plan")
            )
        return str(marks.pop())


def repair_locked(folder: Path) -> list[str]:
    """Repair a folder that this process holds; see `repair`."""
    survey = _survey(folder)
    if survey.manifest is not None:
        survey.manifest.check_writable(folder)
        moved = settle(folder, survey.manifest.files)
        survey.done += [f"{name}: a change that was cut short is complete" for name in moved]
        if moved:
            survey = _survey(folder, survey.done)
    resolved = _resolved(survey)
    manifest = survey.manifest or _manifest(survey, resolved)
    split_index(resolved, manifest.split)
    resolved.mark = manifest.plan_hash
    items, recovered = whole_blocks(folder, manifest)
    names = [block_name(block) for block in range(len(manifest.edges) - 1)]
    missing = [block for block, name in enumerate(names) if name not in items]
    log = WorkLog(folder / LOG, manifest.plan_hash, items)
    work = CampaignWork(folder, resolved, manifest, log, missing, recovered)
    _write_damaged(survey, work)
    return [
        *survey.done,
        *(_lost_block_text(folder, names[block]) for block in missing if manifest.blocks),
    ]


def _survey(folder: Path, done: list[str] | None = None) -> _Survey:
    """Read everything that can be read, without checking one against the other."""
    manifest = None
    try:
        manifest = read_manifest(folder)
    except InputError as error:
        if "its form is number" in str(error):
            raise
    contents, copy, table = [], None, None
    try:
        table = read_table(folder / RUNS)
        copy = unpacked((table.schema.metadata or {}).get(b"elevon"))
    except (OSError, ValueError):
        pass
    with contextlib.suppress(InputError, ValueError, RecursionError):
        contents.append(json.loads(read_regular(folder / RESOLVED, LONGEST)))
    if copy is not None:
        contents.append(json.loads(copy["resolved"]))
    return _Survey(folder, manifest, contents, copy, table, described_blocks(folder), done or [])


def _resolved(survey: _Survey) -> Resolved:
    """Return the resolved plan that the plan's hash stands for."""
    for resolved in _plan_candidates(survey):
        if plan_hash(resolved) == survey.mark:
            return resolved
    raise FormatError(
        f"{survey.folder}: cannot be repaired: neither {RESOLVED} nor {PLAN} is that of the hash "
        f"{survey.mark[:12]}; elevon campaign run PLAN --out {survey.folder} with the plan as it "
        "was makes both again, and simulates nothing that is whole"
    )


def _plan_candidates(survey: _Survey) -> Iterator[Resolved]:
    """Yield what may be the resolved plan: its file, its copy, and the plan resolved anew."""
    for content in survey.contents if survey.table is not None else []:
        try:
            yield rebuilt(content, survey.table)
        except (ElevonError, KeyError, TypeError, ValueError, AttributeError):
            continue
    texts = [] if survey.copy is None else [survey.copy["plan"]]
    with contextlib.suppress(InputError, ValueError):
        texts.append(read_regular(survey.folder / PLAN, LONGEST).decode("utf-8"))
    for text in texts:
        try:
            yield _resolve_again(survey.folder, text)
        except (ElevonError, ValueError):
            continue


def _resolve_again(folder: Path, text: str) -> Resolved:
    from elevon.campaign.grammar import checked_plan
    from elevon.campaign.resolve import resolve_plan
    from elevon.documents import Document

    document = Document(str(folder / PLAN), text, tomllib.loads(text), folder)
    return resolve_plan(checked_plan(document), document)  # its folder holds no other files


def _manifest(survey: _Survey, resolved: Resolved) -> Manifest:
    """Return the manifest of a folder, made again from its plan and blocks."""
    checked = check(resolved)
    edges = borders(checked.sizes, resolved.runs_per_file)
    spans = sorted((about["first"], about["last"] + 1) for about in survey.blocks.values())
    ends = [0, *(stop for _, stop in spans)]
    if [first for first, _ in spans] == ends[:-1] and ends[-1] == len(resolved):
        edges = ends
    disk = int(checked.sizes.sum())
    memory = max(int(checked.sizes[a:b].sum()) for a, b in itertools.pairwise(edges))
    cost = Cost(len(resolved), len(edges) - 1, edges, disk, memory, 0.0, checked)
    manifest = new_manifest(resolved, cost)
    builds = {(about["version"], about["core"]) for about in survey.blocks.values()}
    if len(builds) > 1:
        raise FormatError(f"{survey.folder}: cannot be repaired: its blocks are of several builds")
    for version, core in builds:
        manifest.version, manifest.core = version, core
    survey.done.append(
        f"{MANIFEST}: rebuilt from {RESOLVED}, {RUNS} and {len(survey.blocks)} block(s)"
    )
    return manifest


def _write_damaged(survey: _Survey, work: CampaignWork) -> None:
    """Write what is damaged; all that changes together, by one switch."""
    folder, manifest = work.folder, work.manifest
    damaged = Item("tables", manifest.files, {}).damaged(folder)
    anew = survey.manifest is None or bool(damaged)
    survey.done += [f"{name}: rebuilt" for name in damaged]
    running = manifest.status == "running"
    if anew:
        plan = _plan_text(survey, work, damaged)
        if running and not work.missing:
            finish(work, plan)
            survey.done.append("all blocks are whole: the campaign is finished")
            return
        _write_tables(work, plan, damaged)
    if running and work.missing and _log_differs(work):
        work.log.rewrite()
        survey.done.append(f"{LOG}: rebuilt, {len(work.log.items)} block(s) are whole")
    if not (running or work.missing) and drop_log(folder):
        survey.done.append(f"{LOG}: removed, {MANIFEST} describes what it lists")


def _write_tables(work: CampaignWork, plan: str, damaged: list[str]) -> None:
    change = Transaction(work.folder)
    if PLAN in damaged or PLAN not in work.manifest.files:
        change.stage_text(PLAN, plan)
    stage_tables(change, work.resolved, plan, _outcome(work))
    if work.manifest.status == "running":
        work.manifest.files = {**work.manifest.files, **change.files}
        change.commit(lambda: work.manifest.write(work.folder))
    else:
        describe_anew(change, work.manifest)


def _plan_text(survey: _Survey, work: CampaignWork, damaged: list[str]) -> str:
    """Return the plan's text: the file where it is whole, else its copy."""
    if survey.manifest is not None and PLAN not in damaged:
        return read_regular(work.folder / PLAN, LONGEST).decode("utf-8")
    if survey.copy is not None:
        return str(survey.copy["plan"])
    text = read_regular(work.folder / PLAN, LONGEST).decode("utf-8")
    if plan_hash(_resolve_again(work.folder, text)) != survey.mark:
        raise FormatError(f"{work.folder}: cannot be repaired: {PLAN} is not as it was written")
    return text


def _outcome(work: CampaignWork) -> dict[str, list[Any]]:
    """Return how every run ended, planned where its block is not whole."""
    outcome = planned(len(work.resolved))
    if work.manifest.status == "running":
        return outcome
    for block, (first, stop) in enumerate(zip(work.edges, work.edges[1:], strict=False)):
        item = work.log.items.get(block_name(block))
        for key, values in outcome.items():
            if item is not None:
                values[first:stop] = item.data[key]
    return outcome


def _log_differs(work: CampaignWork) -> bool:
    try:
        log = WorkLog.read(work.log.path)
    except FormatError:
        return True
    return log is None or log.cut or log.items.keys() != work.log.items.keys()


def _lost_block_text(folder: Path, name: str) -> str:
    return f"{name}: is damaged or has gone; elevon campaign resume {folder} simulates it again"
