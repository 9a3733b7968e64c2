"""The campaign folder: plan, resolved plan, manifest, Parquet blocks, data card."""

from __future__ import annotations

import hashlib
import json
import os
import re
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from elevon.errors import FormatError, InputError
from elevon.files import atomic_path, write_text
from elevon.recording import Channel, Clock, Recording

__all__ = ["SCHEMA", "Manifest", "load_run", "read_manifest", "write_block"]

#: Version of the folder's form, apart from the package's.
SCHEMA = 1
MANIFEST = "manifest.json"

_SEVERITY = re.compile(r"fault_\d+")


@dataclass
class Manifest:
    """What a campaign folder holds; written whole after every block.

    Attributes
    ----------
    plan_hash : str
        Of everything that decides the results: resuming another plan is refused.
    blocks : list of dict
        First and last run, files with size and SHA-256.
    runs : list of dict
        One a finished run: number, block, status, split, varied values, faults, seed, hash.
    status : str
        ``running``, ``ok`` or ``failed`` (some run diverged).
    """

    name: str
    plan_hash: str
    total: int
    version: str
    status: str = "running"
    blocks: list[dict[str, Any]] = field(default_factory=list)
    runs: list[dict[str, Any]] = field(default_factory=list)
    schema: int = SCHEMA

    def write(self, folder: Path) -> None:
        """Write the manifest, whole or not at all."""
        write_text(folder / MANIFEST, json.dumps(asdict(self), indent=1) + "\n", force=True)

    def done(self, folder: Path) -> set[int]:
        """Return the indices of the blocks whose files are there in full."""
        return {
            block["block"]
            for block in self.blocks
            if all(
                (folder / file["file"]).is_file()
                and (folder / file["file"]).stat().st_size == file["bytes"]
                for file in block["files"]
            )
        }


def read_manifest(folder: str | os.PathLike[str]) -> Manifest:
    """Read a campaign folder's manifest.

    Raises
    ------
    InputError
        No campaign folder.
    FormatError
        Damaged, or of a form this version does not know.
    """
    path = Path(folder) / MANIFEST
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(f"{folder}: is not a campaign folder (no {MANIFEST})") from error
    except ValueError as error:
        raise FormatError(f"{path}: damaged: {error}") from error
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise FormatError(f"{path}: its form is not number {SCHEMA}, the one this version reads")
    try:
        return Manifest(**data)
    except TypeError as error:
        raise FormatError(f"{path}: damaged: {error}") from error


def write_block(
    folder: Path, index: int, numbers: Sequence[int], recordings: Sequence[Recording]
) -> list[dict[str, Any]]:
    """Write one block: a Parquet file a clock, with the columns run, time and the channels.

    A channel that a run does not have (the severity of a fault it is spared) is NaN there.

    Returns
    -------
    list of dict
        File, bytes, sha256 and clock of each.
    """
    files = []
    clocks = dict.fromkeys(name for recording in recordings for name in recording.clocks)
    for clock in clocks:
        name = f"runs/block_{index:05d}.{clock}.parquet"
        with atomic_path(folder / name, force=True) as temporary:
            _write_parquet(temporary, clock, numbers, recordings)
        data = (folder / name).read_bytes()
        digest = hashlib.sha256(data).hexdigest()
        files.append({"file": name, "clock": clock, "bytes": len(data), "sha256": digest})
    return files


def _write_parquet(
    path: Path, clock: str, numbers: Sequence[int], recordings: Sequence[Recording]
) -> None:
    import pyarrow as pa
    import pyarrow.parquet as pq

    parts = [(n, r) for n, r in zip(numbers, recordings, strict=True) if clock in r.clocks]
    known: dict[str, Channel] = {}
    for _, recording in parts:
        known.update({c.name: c for c in recording.on_clock(clock) if c.name not in known})
    runs = [np.full(len(r.clocks[clock]), n, dtype=np.int64) for n, r in parts]
    fields = [pa.field("run", pa.int64()), pa.field("time", pa.float64(), metadata={"unit": "s"})]
    columns = [np.concatenate(runs), np.concatenate([r.clocks[clock].time for _, r in parts])]
    for name, channel in known.items():
        unit, text = _described(channel)
        values = [
            r[name].values if name in r else np.full(len(r.clocks[clock]), np.nan) for _, r in parts
        ]
        columns.append(np.concatenate(values))
        metadata = {"unit": unit, "text": text}
        fields.append(pa.field(name, pa.float64(), metadata=metadata))
    rates = {str(n): r.clocks[clock].rate for n, r in parts}
    schema = pa.schema(fields, metadata={"elevon": json.dumps({"schema": SCHEMA, "rates": rates})})
    table = pa.Table.from_arrays([pa.array(column) for column in columns], schema=schema)
    pq.write_table(table, path, compression="snappy")


def _described(channel: Channel) -> tuple[str, str]:
    """Unit and text of a column; a fault's number means another fault in another run."""
    if _SEVERITY.fullmatch(channel.name):
        number = channel.name.removeprefix("fault_")
        return "", f"severity of the run's fault {number}, in the SI unit of its label"
    return channel.unit, channel.text


def load_run(folder: str | os.PathLike[str], number: int) -> Recording:
    """Read one run of a campaign back as a recording.

    Parameters
    ----------
    folder : path
        The campaign folder.
    number : int
        Its number in the plan.

    Raises
    ------
    InputError
        No such run, or it is not done yet.
    """
    root = Path(folder)
    manifest = read_manifest(root)
    entry = next((run for run in manifest.runs if run["run"] == number), None)
    if entry is None:
        raise InputError(f"{root}: run {number} is not there; {len(manifest.runs)} runs are done")
    block = next(item for item in manifest.blocks if item["block"] == entry["block"])
    channels: list[Channel] = []
    clocks: list[Clock] = []
    labels = {label["channel"]: label for label in entry["labels"]}
    for file in block["files"]:
        found = _read_clock(root / file["file"], file["clock"], number, labels)
        clocks.append(found[0])
        channels.extend(found[1])
    meta = {key: value for key, value in entry.items() if key not in ("labels", "final")}
    return Recording(
        channels, clocks=clocks, meta=meta, labels=entry["labels"], final=entry["final"]
    )


def _read_clock(
    path: Path, name: str, number: int, labels: Mapping[str, Mapping[str, Any]]
) -> tuple[Clock, list[Channel]]:
    import pyarrow.parquet as pq

    table = pq.read_table(path, filters=[("run", "==", number)])
    about = json.loads(table.schema.metadata[b"elevon"])
    clock = Clock(name, table["time"].to_numpy(), about["rates"].get(str(number)))
    channels = []
    for item in table.schema:
        if item.name in ("run", "time"):
            continue
        values = table[item.name].to_numpy()
        unit, text = item.metadata[b"unit"].decode(), item.metadata[b"text"].decode()
        if item.name in labels:
            label = labels[item.name]
            unit, text = label["unit"], f"severity of {label['kind']}@{label['place']}"
        elif _SEVERITY.fullmatch(item.name):
            continue
        channels.append(Channel(item.name, unit, values, clock, text))
    return clock, channels
