"""What a block says of itself: its plan, its runs, and its files with their SHA-256."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from elevon.campaign.ends import ENDS, read_ends
from elevon.campaign.seal import packed, unpacked
from elevon.campaign.store import SCHEMA, core_hash
from elevon.worklog import Item, digest

KEY = b"elevon"


def block_description(
    mark: str, name: str, span: tuple[int, int], files: Mapping[str, object]
) -> dict[str, str]:
    """Return the metadata of a block's table of ends, which is written after its other files.

    Parameters
    ----------
    mark : str
        The plan's hash.
    name : str
        Of the block.
    span : tuple of int
        First and last run.
    files : mapping
        Its other files, with size and SHA-256.
    """
    from elevon import _core

    about = {
        "schema": SCHEMA,
        "plan_hash": mark,
        "name": name,
        "first": span[0],
        "last": span[1],
        "version": _core.version(),
        "core": core_hash(),
        "files": dict(files),
    }
    return {KEY.decode(): packed(about)}


def read_description(path: Path) -> dict[str, object] | None:
    """Return what a block's table of ends says of the block; None where it is not whole."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        return unpacked((pq.read_schema(path).metadata or {}).get(KEY))
    except (OSError, pa.ArrowException):
        return None


def described_blocks(folder: Path) -> dict[str, dict[str, object]]:
    """Return the descriptions of all blocks of a folder that have one, by name."""
    abouts = {}
    for path in sorted((folder / ENDS).glob("*.parquet")):
        about = read_description(path)
        if about is not None and about["name"] == path.stem:
            abouts[path.stem] = about
    return abouts


def described_item(folder: Path, about: Mapping[str, Any]) -> Item | None:
    """Return a block for the log, proved by its own description; None where it is not whole.

    The description has the SHA-256 of the block's other files; the pages of the table it stands
    in carry checksums.
    """
    import pyarrow as pa

    table_file = f"{ENDS}/{about['name']}.parquet"
    files = {**about["files"], table_file: digest(folder / table_file)}
    item = Item(about["name"], files, {"first": about["first"], "last": about["last"]})
    try:
        if not item.intact(folder) or not _readable(folder / table_file):
            return None
        ended = read_ends(folder, files)
    except (OSError, ValueError, pa.ArrowException):
        return None
    return None if ended is None else Item(item.name, files, {**item.data, **ended})


def _readable(path: Path) -> bool:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        pq.read_table(path, page_checksum_verification=True)
    except (OSError, pa.ArrowException):
        return False
    return True
