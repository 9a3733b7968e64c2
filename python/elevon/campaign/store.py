"""What a campaign's folder says of itself: the manifest, and the log while it runs."""

from __future__ import annotations

import base64
import hashlib
import json
import os
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path, PurePosixPath
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

from elevon.errors import FormatError, InputError
from elevon.files import read_regular, write_text
from elevon.retired import mapped
from elevon.scenario.compile import signal_records
from elevon.seam import CoreResult
from elevon.simulate.prepare import Prepared
from elevon.simulate.result import final_values
from elevon.worklog import Item, WorkLog, digest

if TYPE_CHECKING:
    import pyarrow as pa
    from pydantic import TypeAdapter

    from elevon.campaign.resolved import Resolved


def _check_below(name: str) -> str:
    """Refuse a file's name that leads out of the folder."""
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\0" in name or not path.parts:
        raise ValueError("does not name a file below the folder")
    return name


class _File(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow")

    bytes: int = Field(ge=0)
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")


_Name = Annotated[str, Field(max_length=200), AfterValidator(_check_below)]
_Files = dict[_Name, _File]


class _Block(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow")

    name: str
    first: int = Field(ge=0)
    last: int = Field(ge=0)
    files: _Files


class _Named(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow")

    name: str


#: Fields whose type says less than what readers rely on.
_CLOSER: Mapping[str, Any] = {
    "total": Annotated[int, Field(ge=0)],
    "files": _Files,
    "blocks": list[_Block],
    "clocks": list[_Named],
    "faults": list[_Named],
    "columns": list[_Named],
}


def shape_error(kind: type, content: Mapping[str, object]) -> str | None:
    """Return what is wrong with a manifest's fields, in one line; None where nothing is.

    Parameters
    ----------
    kind : type
        The dataclass whose fields they are.
    content : mapping
        Field to value.
    """
    for name, adapter in _adapters(kind).items():
        try:
            adapter.validate_python(content[name], strict=True)
        except ValidationError as error:
            first = error.errors(include_url=False, include_input=False)[0]
            place = ".".join(str(part)[:60] for part in (name, *first["loc"]))
            return f"{place}: {first['msg']}"
    return None


@lru_cache(maxsize=2)
def _adapters(kind: type) -> dict[str, TypeAdapter[Any]]:
    from typing import get_type_hints

    from pydantic import TypeAdapter

    return {
        name: TypeAdapter(_CLOSER.get(name, hint)) for name, hint in get_type_hints(kind).items()
    }


SCHEMA = 3
"""Version of the folder's form, apart from the package's."""
READ = (2, SCHEMA)
"""What is read: version 2 has names that were replaced since, and is not written any more."""
MANIFEST, RESOLVED, PLAN = "manifest.json", "resolved.json", "plan.toml"
LOG = "progress.log"
"""The log of finished blocks, while the campaign runs."""
JOURNAL = "campaign.log"
"""When and how the campaign was carried out; nothing reads it, all other files are of the plan."""
_LONGEST = 2**30


@dataclass
class Manifest:
    """What a campaign folder holds.

    Attributes
    ----------
    plan_hash : str
        Of everything that decides the results; a folder takes no other plan.
    edges : list of int
        Where the blocks begin, and the end; fixed when the campaign begins.
    status : str
        ``running``, ``ok`` or ``failed`` (some run diverged or was refused).
    version, core : str
        The program, and the SHA-256 of its compiled core.
    clocks : list of dict
        Name, rate, folder, and the columns (name, unit, text) of each clock's files.
    faults, columns : list of dict
        Label columns; varied quantities with kind, unit and role.
    not_acting : list of str
        What is set where it has no effect, allowed by the plan.
    sources : dict
        Files that the plan named, with the SHA-256 of their content.
    files : dict
        Size and SHA-256 of the tables beside the blocks.
    split : dict
        How the runs are dealt to parts: ``shares``, ``by`` and ``seed``; empty without parts.
    blocks : list of dict
        Name, first and last run, files with size and SHA-256, and how the runs ended.
    """

    name: str
    plan_hash: str
    total: int
    edges: list[int]
    version: str
    core: str
    status: str = "running"
    text: str = ""
    actuator: str = ""
    wiring: str = ""
    fidelity: str = ""
    clocks: list[dict[str, Any]] = field(default_factory=list)
    faults: list[dict[str, Any]] = field(default_factory=list)
    columns: list[dict[str, Any]] = field(default_factory=list)
    responses: list[str] = field(default_factory=list)
    not_acting: list[str] = field(default_factory=list)
    estimate: dict[str, float] = field(default_factory=dict)
    design: dict[str, Any] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)
    split: dict[str, Any] = field(default_factory=dict)
    files: dict[str, dict[str, Any]] = field(default_factory=dict)
    blocks: list[dict[str, Any]] = field(default_factory=list)
    schema: int = SCHEMA

    @property
    def is_old(self) -> bool:
        """Whether the folder is of an earlier form: it is read, and not written any more."""
        return self.schema != SCHEMA

    def check_writable(self, folder: Path) -> None:
        """Raise `InputError` for a folder of an earlier form."""
        if self.is_old:
            raise InputError(
                f"{folder}: was written by an earlier version (form {self.schema}): it can be "
                "read and exported, not changed; run its plan anew with the present names"
            )

    def write(self, folder: Path) -> None:
        """Write the manifest, whole or not at all, with a checksum of its own."""
        content = asdict(self)
        content["check"] = seal(content)
        write_text(folder / MANIFEST, json.dumps(content, indent=1) + "\n", force=True)


def read_manifest(folder: str | os.PathLike[str]) -> Manifest:
    """Read a campaign folder's manifest.

    Raises
    ------
    InputError
        No campaign folder.
    FormatError
        Damaged, or of a form this version does not know.
    """
    root = Path(folder)
    path = root / MANIFEST
    if not path.is_file():
        raise InputError(f"{folder}: is not a campaign folder (no {MANIFEST}){repair_hint(root)}")
    hint = repair_hint(root)
    try:
        data = json.loads(read_regular(path, _LONGEST))
    except (InputError, ValueError, RecursionError) as error:
        raise FormatError(f"{path}: damaged: {error}{hint}") from error
    if not isinstance(data, dict):
        raise FormatError(f"{path}: damaged: no JSON object{hint}")
    mark = data.pop("check", None)
    whole = mark == seal(data)
    if data.get("schema") not in READ and (whole or mark is None):
        raise FormatError(
            f"{path}: its form is number {data.get('schema')!r}; this version reads "
            f"{' and '.join(str(number) for number in READ)}"
        )
    if not whole:
        raise FormatError(f"{path}: damaged: its content does not match its checksum{hint}")
    try:
        manifest = Manifest(**(data if data["schema"] == SCHEMA else mapped(data)))
    except TypeError as error:
        raise FormatError(f"{path}: damaged: {error}{hint}") from error
    if wrong := shape_error(Manifest, vars(manifest)):
        raise FormatError(f"{path}: damaged: {wrong}{hint}")
    return manifest


def repair_hint(folder: Path) -> str:
    """Return what mends a damaged folder, where it holds what a repair starts from."""
    there = any((folder / name).exists() for name in (RESOLVED, "runs.parquet", "ends"))
    return f"; elevon dataset repair {folder} rebuilds what it can prove" if there else ""


def work_log(folder: Path, manifest: Manifest) -> WorkLog | None:
    """Return the log of a campaign that runs or was interrupted; None where it is finished.

    Raises
    ------
    FormatError
        It is damaged, or has gone though blocks are there.
    """
    try:
        log = WorkLog.read(folder / LOG)
    except FormatError as error:
        raise FormatError(f"{error}{repair_hint(folder)}") from error
    if log is None and manifest.status == "running" and any((folder / "ends").glob("*.parquet")):
        raise FormatError(f"{folder / LOG}: has gone{repair_hint(folder)}")
    return log if log is not None and log.key == manifest.plan_hash else None


@lru_cache(maxsize=1)
def core_hash() -> str:
    """Return the SHA-256 of the compiled core: with the plan it decides every bit."""
    from elevon import _core

    return hashlib.sha256(Path(str(_core.__file__)).read_bytes()).hexdigest()


_LARGEST = 256 * 2**20
"""Bytes that a packed text may expand to."""


def seal(content: Mapping[str, object]) -> str:
    """Return the SHA-256 of JSON content, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def packed(content: Mapping[str, object]) -> str:
    """Return JSON content as one compressed text with its checksum."""
    text = json.dumps({"check": seal(content), "content": content}, sort_keys=True)
    return base64.b85encode(zlib.compress(text.encode(), 9)).decode("ascii")


def unpacked(text: bytes | str | None) -> dict[str, Any] | None:
    """Return the content of a packed text; None where it is not as it was written."""
    if text is None:
        return None
    try:
        stream = zlib.decompressobj()
        raw = stream.decompress(base64.b85decode(text), _LARGEST)
        whole = json.loads(raw)
        content, mark = whole["content"], whole["check"]
    except (ValueError, KeyError, TypeError, RecursionError, zlib.error):
        return None
    return content if isinstance(content, dict) and seal(content) == mark else None


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
        if not item.intact(folder) or not _is_readable(folder / table_file):
            return None
        ended = read_ends(folder, files)
    except (OSError, ValueError, pa.ArrowException):
        return None
    return None if ended is None else Item(item.name, files, {**item.data, **ended})


def _is_readable(path: Path) -> bool:
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        pq.read_table(path, page_checksum_verification=True)
    except (OSError, pa.ArrowException):
        return False
    return True


ENDS = "ends"
"""Folder of the tables."""
_OUTCOME = {
    "status": ("", "ok, tripped, diverged or refused"),
    "reason": ("", "why the status is not ok"),
    "sim_s": ("s", "simulated time"),
    "steps": ("1", "solver steps"),
}


def ends_table(
    resolved: Resolved,
    numbers: Sequence[int],
    prepared: Sequence[Prepared],
    results: Sequence[CoreResult],
    outcome: Mapping[str, Sequence[object]],
) -> pa.Table:
    """Return how a block's runs ended; NaN where a run was refused."""
    import pyarrow as pa

    known = signal_records(resolved.wiring, resolved.fidelity)
    rows = [
        final_values(result["final"], {name for plan in item.plan for name in plan.signals})
        for item, result in zip(prepared, results, strict=True)
    ]
    names = dict.fromkeys(name for row in rows for name in row)
    fields = [pa.field("run", pa.int64(), metadata={"unit": "1", "text": "number of the run"})]
    arrays = [pa.array(np.asarray(numbers, dtype=np.int64))]
    for name, (unit, text) in _OUTCOME.items():
        array = pa.array(outcome[name])
        fields.append(pa.field(name, array.type, metadata={"unit": unit, "text": text}))
        arrays.append(array)
    for name in names:
        unit = prepared[0].command_unit if name == "command" else known[name]["unit"] or "1"
        about = {"unit": unit, "text": f"last value: {known[name]['text']}"}
        fields.append(pa.field(name, pa.float64(), metadata=about))
        arrays.append(pa.array(np.array([row.get(name, np.nan) for row in rows])))
    return pa.Table.from_arrays(arrays, schema=pa.schema(fields))


def last_values(row: Mapping[str, Any]) -> dict[str, float]:
    """Return the last values of a row of the table; none of a refused run."""
    if row["status"] == "refused":
        return {}
    return {name: value for name, value in row.items() if name not in {"run", *_OUTCOME}}


def read_ends(
    folder: Path, files: Mapping[str, dict[str, object]]
) -> dict[str, list[object]] | None:
    """Return how a block's runs ended, from its own table; None where that is not whole."""
    import pyarrow.parquet as pq

    mine = {name: about for name, about in files.items() if name.startswith(f"{ENDS}/")}
    if not mine or not Item(ENDS, mine, {}).intact(folder):
        return None
    table = pq.read_table(folder / next(iter(mine)), columns=list(_OUTCOME))
    return {name: table[name].to_pylist() for name in _OUTCOME}
