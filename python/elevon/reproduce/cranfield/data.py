"""What a folder of the Cranfield data holds, named file by file."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from elevon.errors import ElevonError, InputError, Interrupted
from elevon.logs.formats.cranfield import DATA_DOI, read_cranfield
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.reproduce.cranfield.features import FeatureTable, feature_table

CONDITIONS = (
    "normal", "backlash1", "backlash2", "lackLubrication1", "lackLubrication2",
    *(f"spalling{stage}" for stage in range(1, 9)),
)  # fmt: skip
FAMILIES = ("normal", "backlash", "lackLubrication", "spalling")
_PROFILE = "trap"


def family(condition: str) -> str:
    """Return the family of a condition: its name without the stage."""
    return condition.rstrip("0123456789")


@dataclass(frozen=True, slots=True)
class CranfieldData:
    """Features of every usable recording.

    Attributes
    ----------
    table : FeatureTable
        One row a recording.
    condition : array of str, (recordings,)
        Such as ``backlash1``.
    load : array, (recordings,)
        As the files state it [kgf]; the sign is its direction.
    run : array of int, (recordings,)
        Number of the recording within its condition and load.
    skipped : list of str
        What was left out, and why.
    """

    table: FeatureTable
    condition: npt.NDArray[np.str_]
    load: npt.NDArray[np.float64]
    run: npt.NDArray[np.int64]
    skipped: list[str]

    def present(self) -> list[dict[str, object]]:
        """Return the runs of each condition and load."""
        cells = sorted({(c, x) for c, x in zip(self.condition, self.load, strict=True)},
                       key=lambda cell: (CONDITIONS.index(cell[0]), cell[1]))  # fmt: skip
        return [
            {"condition": str(c), "load_kgf": float(x),
             "runs": sorted(self.run[(self.condition == c) & (self.load == x)].tolist())}
            for c, x in cells
        ]  # fmt: skip


def read_folder(folder: Path, *, progress: Progress | None = None) -> CranfieldData:
    """Read every condition of a folder.

    Parameters
    ----------
    folder : path
        Holds ``CONDITION.csv`` or ``CONDITION.csv.gz``; other files are named as skipped.
    progress : callable, optional
        As everywhere.

    Returns
    -------
    CranfieldData
        The trapezoidal recordings whose features exist.

    Raises
    ------
    InputError
        The folder is absent or holds no condition.
    FormatError
        A condition's file is damaged.
    """
    files, skipped = _files(folder)
    usable: list[tuple[Recording, FeatureTable]] = []
    for index, path in enumerate(files):
        usable += _usable(path, skipped)
        if progress is not None and not progress((index + 1) / len(files)):
            raise Interrupted("interrupted while reading")
    usable = _once(usable, skipped)
    if not usable:
        raise InputError(f"{folder}: no trapezoidal recording that can be used")
    meta = [recording.meta for recording, _ in usable]
    return CranfieldData(
        FeatureTable.joined([table for _, table in usable]),
        np.array([m["condition"] for m in meta]),
        np.array([float(m["load_kgf"]) for m in meta]),
        np.array([int(m["run"]) for m in meta]),
        skipped,
    )


def _files(folder: Path) -> tuple[list[Path], list[str]]:
    if not folder.is_dir():
        raise InputError(
            f"{folder}: no such folder; the data are not part of this package, see doi {DATA_DOI}"
        )
    chosen: dict[str, Path] = {}
    skipped = []
    for path in sorted(folder.iterdir()):
        name = path.name.removesuffix(".gz").removesuffix(".csv")
        if not path.name.endswith((".csv", ".csv.gz")) or name not in CONDITIONS:
            skipped.append(f"{path.name}: not a table of one of the {len(CONDITIONS)} conditions")
        elif name in chosen:
            skipped.append(f"{path.name}: {chosen[name].name} holds the same condition")
        else:
            chosen[name] = path
    if not chosen:
        raise InputError(f"{folder}: holds none of {', '.join(CONDITIONS)} as .csv or .csv.gz")
    skipped += [f"{name}: absent" for name in CONDITIONS if name not in chosen]
    return [chosen[name] for name in CONDITIONS if name in chosen], skipped


def _usable(path: Path, skipped: list[str]) -> list[tuple[Recording, FeatureTable]]:
    usable = []
    for recording in read_cranfield(path):
        meta = recording.meta
        place = f"{path.name}, load {meta['load_kgf']:g}, run {meta['run']}"
        if meta["profile"] != _PROFILE:
            skipped.append(f"{place}: profile {meta['profile']!r}, not {_PROFILE!r}")
            continue
        try:
            table = feature_table([recording])
        except ElevonError as error:
            skipped.append(f"{place}: {error}")
        else:
            usable.append((recording, table))
    return usable


def _once(
    usable: list[tuple[Recording, FeatureTable]], skipped: list[str]
) -> list[tuple[Recording, FeatureTable]]:
    """Leave out a run that stands twice in a file: a copy in training would be a leak."""
    seen: set[tuple[object, ...]] = set()
    result = []
    for recording, table in usable:
        meta = recording.meta
        key = (meta["condition"], meta["load_kgf"], meta["run"])
        if key in seen:
            skipped.append(f"{key[0]}, load {key[1]:g}, run {key[2]}: a second part of this run")
            continue
        seen.add(key)
        result.append((recording, table))
    return result
