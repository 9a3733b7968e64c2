"""A data set for other programs: one file a run, and a table of the runs beside them."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from elevon.campaign.dataset import Dataset
from elevon.errors import InputError, Interrupted
from elevon.files import atomic_path, check_output
from elevon.recording import Channel, Recording
from elevon.recording.channel import LONGEST_NAME
from elevon.recording.formats import check_ending, files_of
from elevon.report.cells import quoted_columns

_ITEM = re.compile(r"(\d+)(?:-(\d+))?")


def export(
    ds: Dataset,
    out: Path,
    ending: str,
    runs: Sequence[int] | None = None,
    *,
    force: bool = False,
    progress: Callable[[float], object] | None = None,
) -> list[Path]:
    """Write runs as files of their own: ``run_NNNNNN.mat`` and ``runs.mat``, or other formats.

    Faults are channels ``friction_at_transmission``, 0 where absent, in every run. ``runs`` holds
    the table of the runs: MATLAB gets a struct of columns and one of their units; CSV, Parquet and
    NetCDF a table of their own kind (in CSV the units stand behind the names, ``age [1]``).

    Parameters
    ----------
    ds : Dataset
        The data set.
    out : path
        Folder, made when absent.
    ending : str
        ``mat``, ``csv``, ``nc`` or ``parquet``.
    runs : sequence of int, optional
        Which; default all.
    force : bool
        Whether existing files may be replaced.
    progress : callable, optional
        Called with the done fraction; returning False interrupts. Files written stay.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    InputError
        No such run, or a format that cannot hold it.
    OutputError
        A file exists already or cannot be written.
    """
    suffix = check_ending(f"x.{ending}")
    if not ds.clocks:
        raise InputError(f"{ds.folder}: holds no signals, features only; read features/*.parquet")
    numbers = list(range(len(ds))) if runs is None else list(runs)
    table = out / f"runs{suffix}"
    check_output(table, force=force)
    written: list[Path] = []
    for done, number in enumerate(numbers):
        recording = with_named_faults(ds.recording(number), ds)
        saved = recording.save(out / f"run_{number:06d}{suffix}", force=force)
        written.extend(files_of(saved))
        if progress is not None and progress((done + 1) / (len(numbers) + 1)) is False:
            raise Interrupted(f"interrupted after run {number}")
    _write_table(ds, table, numbers, force=force)
    return [*written, table]


def run_numbers(text: str, total: int) -> list[int]:
    """Read a list of runs such as ``0-99,250``.

    Raises
    ------
    InputError
        Not of that form, or a run that is not there.
    """
    numbers: dict[int, None] = {}
    for part in text.split(","):
        match = _ITEM.fullmatch(part.strip())
        if match is None:
            raise InputError(f"--runs {text!r} is not of the form 0-99,250")
        first, last = int(match[1]), int(match[2] or match[1])
        if last >= total or first > last:
            raise InputError(f"--runs {part.strip()}: the runs are 0 to {total - 1}")
        numbers.update(dict.fromkeys(range(first, last + 1)))
    return list(numbers)


def identifiers(names: Iterable[str]) -> dict[str, str]:
    """Return for each name one that Python, MATLAB and FMI accept, all different."""
    chosen: dict[str, str] = {}
    for name in names:
        plain = re.sub(r"\W+", "_", name.replace("@", "_at_"), flags=re.ASCII).strip("_")
        plain = plain if plain[:1].isalpha() else f"x_{plain}"
        short, number = plain[:LONGEST_NAME], 1
        while short.lower() in {other.lower() for other in chosen.values()}:
            number += 1
            short = f"{plain[: LONGEST_NAME - len(str(number)) - 1]}_{number}"
        chosen[name] = short
    return chosen


def with_named_faults(recording: Recording, ds: Dataset) -> Recording:
    """Return a run's recording whose fault channels are named by the faults, 0 where absent."""
    clock = next(iter(recording.clocks.values()))
    labels = {f"{label['kind']}@{label['place']}": label for label in recording.labels}
    old = {label["channel"]: name for name, label in labels.items()}
    named = identifiers(item["name"] for item in ds.manifest.faults)
    channels = [channel for channel in recording.channels if channel.name not in old]
    for item in ds.manifest.faults:
        name = item["name"]
        channel = labels[name]["channel"] if name in labels else None
        values = np.zeros(len(clock)) if channel is None else recording[channel].values
        channels.append(
            Channel(named[name], item["unit"], values, clock, f"severity of {name}; 0: absent")
        )
    renamed = [{**label, "channel": named[name]} for name, label in labels.items()]
    clocks = list(recording.clocks.values())
    return Recording(channels, clocks=clocks, meta=recording.meta, labels=renamed)


def _write_table(ds: Dataset, path: Path, numbers: Sequence[int], *, force: bool) -> None:
    table = ds.runs.to_arrow(runs=numbers)
    with atomic_path(path, force=force) as temporary:
        if path.suffix == ".parquet":
            import pyarrow.parquet as pq

            pq.write_table(table, temporary, write_page_checksum=True)
        elif path.suffix == ".csv":
            from pyarrow.csv import write_csv

            units = ds.runs.units
            heads = [f"{c} [{units[c]}]" if units.get(c) else c for c in table.column_names]
            write_csv(quoted_columns(table.rename_columns(heads)), temporary)
        elif path.suffix == ".nc":
            ds.runs.to_xarray(runs=numbers).to_netcdf(temporary, engine="h5netcdf")
        else:
            _write_mat(table, ds.runs.units, temporary)


def _write_mat(table: Any, units: dict[str, str], path: Path) -> None:
    """Write the struct ``runs`` of columns, and ``names`` and ``units`` of these."""
    from elevon.recording.mat import write_structs

    named = identifiers(table.column_names)
    columns = {}
    for name, short in named.items():
        values = table[name].to_pylist()
        text = any(isinstance(value, str) for value in values)
        cells = np.array(values, dtype=object) if text else table[name].to_numpy()
        columns[short] = cells.reshape(-1, 1)
    content = {
        "runs": columns,
        "names": {short: name for name, short in named.items()},
        "units": {short: units.get(name, "") for name, short in named.items()},
    }
    write_structs(path, content)
