"""What a campaign's folder says of itself: the manifest, and the log while it runs."""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import asdict, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any

from elevon.campaign.manifest_shape import shape_error
from elevon.campaign.seal import seal
from elevon.errors import FormatError, InputError
from elevon.files import read_regular, write_text
from elevon.retired import mapped
from elevon.worklog import WorkLog

SCHEMA = 3
"""Version of the folder's form, apart from the package's."""
READ = (2, SCHEMA)
"""What is read: version 2 has names that were replaced since, and is not written any more."""
MANIFEST, RESOLVED, PLAN = "manifest.json", "resolved.json", "plan.toml"
LOG = "progress.log"
"""The log of finished blocks, while the campaign runs."""
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
