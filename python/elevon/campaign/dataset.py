"""A campaign's folder as a data set: tables that are read on demand."""

from __future__ import annotations

import os
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.campaign.resolved import Resolved
from elevon.campaign.resolved_file import RUNS, read_resolved
from elevon.campaign.store import Manifest, last_values, read_manifest, repair_hint, work_log
from elevon.errors import FormatError, InputError, unknown
from elevon.recording import Channel, Clock, Recording
from elevon.recording.contents import warn_of_old_names
from elevon.retired import current
from elevon.simulate.result import FaultLabel, fault_labels
from elevon.transaction import located
from elevon.worklog import Item, digest

if TYPE_CHECKING:
    import duckdb
    import pandas as pd
    import polars as pl
    import pyarrow as pa
    import pyarrow.dataset
    import xarray as xr

    from elevon.campaign.resolved import Resolved
    from elevon.recording import Recording


@dataclass(frozen=True)
class Part:
    """One file of a table: its runs, what it must be (size, SHA-256) if known, what mends it."""

    path: Path
    first: int
    last: int
    about: Mapping[str, Any] | None
    remedy: str = ""

    def check(self) -> None:
        """Raise `FormatError` unless the file is as it was written."""
        try:
            stat = self.path.stat()
        except OSError as error:
            raise FormatError(
                f"{self.path}: cannot be read: {error.strerror}{self.remedy}"
            ) from error
        if (
            self.about is not None
            and _file_state(self.path, stat.st_mtime_ns) != self.about["sha256"]
        ):
            raise FormatError(f"{self.path}: is not as it was written (SHA-256){self.remedy}")


@lru_cache(maxsize=4096)
def _file_state(path: Path, stamp: int) -> str:  # noqa: ARG001 - a changed file is read anew
    return str(digest(path)["sha256"])


def recorded(ds: Dataset, number: int) -> Recording:
    """Return one run of a data set; see `elevon.campaign.load_run`."""
    _check_done(ds, number)
    resolved = ds.resolved()
    prepared = resolved.prepared(number)
    labels = fault_labels(prepared)
    channels: list[Channel] = []
    clocks: list[Clock] = []
    for place, plan in enumerate(prepared.plan):
        frame = ds.clock(plan.name).to_arrow(runs=[number])
        clock = Clock(plan.name, frame["time"].to_numpy(), plan.rate)
        about = {f.name: f.metadata for f in frame.schema}
        clocks.append(clock)
        for name in plan.signals:
            unit, text = (about[name][key].decode() for key in (b"unit", b"text"))
            channels.append(Channel(name, unit, frame[name].to_numpy(), clock, text))
        if place == 0:
            channels.extend(_severities(labels, frame, clock))
    meta = _run_meta(ds, resolved, number)
    ends = ds.ends
    rows = [] if ends is None else ends.to_arrow(runs=[number]).to_pylist()
    final = last_values(rows[0]) if rows else {}
    return Recording(channels, clocks=clocks, meta=meta, labels=labels, final=final)


def _severities(labels: Sequence[FaultLabel], frame: Any, clock: Clock) -> list[Channel]:
    channels = []
    for label in labels:
        name = f"{label['kind']}@{label['place']}"
        values, text = frame[name].to_numpy(), f"severity of {name}"
        channels.append(Channel(label["channel"], label["unit"], values, clock, text))
    return channels


def _check_done(ds: Dataset, number: int) -> None:
    spans = [(item.data["first"], item.data["last"]) for item in ds.items]
    if not any(first <= number <= last for first, last in spans):
        done = sum(last - first + 1 for first, last in spans)
        raise InputError(
            f"{ds.folder}: run {number} is not there; {done} of {len(ds)} runs are done"
        )


def _run_meta(ds: Dataset, resolved: Resolved, number: int) -> dict[str, Any]:
    run = resolved.run(number)
    row = ds.runs.to_arrow(runs=[number]).to_pylist()[0]
    return {
        "status": row["status"],
        "message": row["reason"],
        "run": number,
        "label": run.label,
        "split": row["split"],
        "values": resolved.values(number),
        "actuator": run.actuator.name,
        "wiring": resolved.wiring,
        "fidelity": resolved.fidelity,
        "seed": run.seed,
        "number": number,
        "parameter_hash": run.actuator.hash,
        "version": ds.manifest.version,
        "sim_s": row["sim_s"],
        "steps": row["steps"],
        "faults": [str(fault) for fault in run.scenario.fault],
        "scenario": run.scenario.to_dict(),
    }


@dataclass(frozen=True)
class Table:
    """One table of a data set, in one or several Parquet files; nothing is read too early.

    What this class reads into memory is compared with the SHA-256 of its files first. The lazy
    tables of polars and DuckDB read the files themselves; ``elevon dataset verify`` checks them.

    Attributes
    ----------
    path : str
        A file, or a pattern that names all files: for ``pandas.read_parquet``, ``polars`` or a
        query of DuckDB.
    parts : list of Part
        Its files.
    clock : str
        Whose samples these are; empty for tables without time.
    is_old : bool
        Whether the files have names that were replaced since; all but `dataset` give the present.
    """

    path: str
    parts: Sequence[Part]
    clock: str = ""
    is_old: bool = False

    @property
    def files(self) -> list[Path]:
        """The files, in the order of their runs."""
        return [part.path for part in self.parts]

    def dataset(self, parts: Sequence[Part] | None = None) -> pyarrow.dataset.Dataset:
        """Return the files (or some of them) as an Arrow data set.

        Raises
        ------
        FormatError
            A file cannot be read. Damaged pages are errors when they are read.
        """
        import pyarrow as pa
        import pyarrow.dataset as ds

        options = ds.ParquetFragmentScanOptions(page_checksum_verification=True)
        kind = ds.ParquetFileFormat(default_fragment_scan_options=options)
        names = [str(part.path) for part in (self.parts if parts is None else parts)]
        try:
            return ds.dataset(names, format=kind)
        except (OSError, pa.ArrowException) as error:
            raise FormatError(f"{self.path}: cannot be read: {error}") from error

    @property
    def schema(self) -> pa.Schema:
        """Columns, with ``unit`` and ``text`` in each field's metadata."""
        import pyarrow as pa

        schema = self.dataset().schema
        if not self.is_old:
            return schema
        return pa.schema([_present_name(item) for item in schema], metadata=schema.metadata)

    @property
    def columns(self) -> list[str]:
        """Names of the columns."""
        return list(self.schema.names)

    @property
    def units(self) -> dict[str, str]:
        """Unit of each column."""
        return {f.name: (f.metadata or {}).get(b"unit", b"").decode() for f in self.schema}

    def to_arrow(
        self, columns: Sequence[str] | None = None, runs: Iterable[int] | None = None
    ) -> pa.Table:
        """Return rows as an Arrow table.

        Parameters
        ----------
        columns : sequence of str, optional
            Which; default all.
        runs : iterable of int, optional
            Only the rows of these runs.

        Raises
        ------
        UnknownNameError
            No such column.
        FormatError
            A file is not as it was written.
        """
        import pyarrow as pa
        import pyarrow.dataset as ds

        numbers = None if runs is None else [int(number) for number in runs]
        parts = self._parts_of(numbers)
        for part in parts:
            part.check()
        data = self.dataset(parts or self.parts[:1])
        stored = self._stored(data.schema.names)
        for name in columns or ():
            if name not in stored:
                raise unknown("column", name, stored, self.path)
        wanted = None if numbers is None else ds.field("run").isin(numbers)
        chosen = list(stored) if columns is None else list(columns)
        try:
            table: pa.Table = data.to_table([stored[name] for name in chosen], filter=wanted)
        except (OSError, pa.ArrowException) as error:
            raise FormatError(f"{self.path}: cannot be read: {error}") from error
        if not self.is_old:
            return table
        return pa.Table.from_arrays(
            table.columns, schema=pa.schema([_present_name(item) for item in table.schema])
        )

    def _stored(self, names: Iterable[str]) -> dict[str, str]:
        """Return the present name of each column, with the one in the files."""
        return {current(name) if self.is_old else name: name for name in names}

    def to_pandas(
        self, columns: Sequence[str] | None = None, runs: Iterable[int] | None = None
    ) -> pd.DataFrame:
        """Return rows as a pandas table; units in ``attrs["units"]``. Errors as `to_arrow`."""
        frame: pd.DataFrame = self.to_arrow(columns, runs).to_pandas()
        frame.attrs["units"] = {name: self.units[name] for name in frame.columns}
        return frame

    def to_polars(self) -> pl.LazyFrame:
        """Return a lazy polars table over all files."""
        import polars

        frame = polars.scan_parquet([str(path) for path in self.files])
        names = {old: new for new, old in self._stored(self.dataset().schema.names).items()}
        return frame.rename(names) if self.is_old else frame

    def to_duckdb(self) -> duckdb.DuckDBPyRelation:
        """Return a lazy DuckDB relation over all files."""
        import duckdb

        relation = duckdb.read_parquet([str(path) for path in self.files])
        if not self.is_old:
            return relation
        names = self._stored(relation.columns).items()
        return relation.project(", ".join(f'"{old}" AS "{new}"' for new, old in names))

    def to_xarray(
        self, columns: Sequence[str] | None = None, runs: Iterable[int] | None = None
    ) -> xr.Dataset:
        """Return an xarray data set: dimensions run and time, or run alone.

        Runs of several lengths are filled up with NaN. Errors as `to_arrow`.
        """
        import xarray

        index = ["run", "time"] if "time" in self.columns else ["run"]
        wanted = None if columns is None else list(dict.fromkeys([*index, *columns]))
        frame = self.to_pandas(wanted, runs).set_index(index)
        whole: xr.Dataset = xarray.Dataset.from_dataframe(frame)
        for name, unit in self.units.items():
            if name in whole.variables:
                whole[name].attrs["units"] = unit
        return whole

    def _parts_of(self, runs: Sequence[int] | None) -> Sequence[Part]:
        """Return the files that hold some runs."""
        if runs is None:
            return self.parts
        wanted = sorted(runs)
        return [
            part
            for part in self.parts
            if bisect_left(wanted, part.first) < bisect_right(wanted, part.last)
        ]


@dataclass(frozen=True)
class Dataset:
    """A campaign's folder.

    Attributes
    ----------
    folder : Path
        Where it is.
    manifest : Manifest
        What it says of itself.
    """

    folder: Path
    manifest: Manifest

    def __len__(self) -> int:
        return self.manifest.total

    def __repr__(self) -> str:
        return f"<Dataset {self.manifest.name}: {len(self)} runs, {self.manifest.status}>"

    @property
    def runs(self) -> Table:
        """One row a run: unit, split, seed, status, reason, faults and other drawn values."""
        about = None if self.manifest.status == "running" else self.manifest.files.get(RUNS)
        path = located(self.folder, RUNS, about)
        part = Part(path, 0, len(self) - 1, about, repair_hint(self.folder))
        return Table(str(path), [part], is_old=self.manifest.is_old)

    @property
    def signals(self) -> Table:
        """The samples of the first clock: run, time, the channels, the faults' severities.

        Raises
        ------
        InputError
            The campaign kept features only.
        """
        if not self.clocks:
            raise InputError(f"{self.folder}: holds no signals, features only")
        return self.clock(self.clocks[0])

    @property
    def features(self) -> Table:
        """One row a run: what was computed of its signals.

        Raises
        ------
        InputError
            The campaign computed none.
        """
        return self._table("features", "")

    @property
    def ends(self) -> Table | None:
        """One row a run: how it ended, and the last value of every signal; None in older sets."""
        try:
            return self._table("ends", "")
        except InputError:
            return None

    @property
    def clocks(self) -> list[str]:
        """Names of the clocks."""
        return [clock["name"] for clock in self.manifest.clocks]

    @property
    def items(self) -> list[Item]:
        """The finished blocks, in order."""
        if self.manifest.blocks:
            return [
                Item(block["name"], block["files"], {k: block[k] for k in ("first", "last")})
                for block in self.manifest.blocks
            ]
        log = work_log(self.folder, self.manifest)
        return [] if log is None else [log.items[name] for name in sorted(log.items)]

    def clock(self, name: str) -> Table:
        """Return the samples of one clock.

        Raises
        ------
        UnknownNameError
            No such clock.
        InputError
            No run is finished yet.
        """
        if name not in self.clocks:
            raise unknown("clock", name, self.clocks, str(self.folder))
        return self._table(f"runs/{name}", name)

    def resolved(self) -> Resolved:
        """Return the plan with everything decided; errors as `read_resolved`."""
        return read_resolved(self.folder, self.manifest)

    def recording(self, number: int) -> Recording:
        """Return one run as a recording; errors as `elevon.campaign.load_run`."""
        return recorded(self, number)

    def _table(self, place: str, clock: str) -> Table:
        remedy = f"; elevon campaign resume {self.folder} simulates its runs again"
        parts = [
            Part(self.folder / name, item.data["first"], item.data["last"], about, remedy)
            for item in self.items
            for name, about in item.files.items()
            if name.startswith(f"{place}/")
        ]
        if not parts:
            raise InputError(f"{self.folder}: holds no {place}")
        return Table(str(self.folder / place / "*.parquet"), parts, clock, self.manifest.is_old)


def _present_name(item: pa.Field) -> pa.Field:
    """Return a column of an old file with the present name and text."""
    about = item.metadata or {}
    text = {b"text": current(about[b"text"].decode()).encode()} if b"text" in about else {}
    return item.with_name(current(item.name)).with_metadata({**about, **text})


def load_campaign(folder: str | os.PathLike[str]) -> Dataset:
    """Open a campaign's folder; nothing but its manifest is read.

    Parameters
    ----------
    folder : path
        As ``elevon campaign run`` wrote it; it may still run.

    Returns
    -------
    Dataset
        ``runs``, ``signals`` and ``features``, each with ``to_pandas()``, ``to_polars()``,
        ``to_duckdb()``, ``to_xarray()`` and ``to_arrow()``.

    Raises
    ------
    InputError
        No campaign folder.
    FormatError
        Its manifest is damaged.

    Examples
    --------
    >>> ds = elevon.load_campaign("DIR")  # doctest: +SKIP
    >>> ds.runs.to_pandas().groupby("split").size()  # doctest: +SKIP
    """
    path = Path(folder).expanduser()
    manifest = read_manifest(path)
    if manifest.is_old:
        warn_of_old_names(path, [f"form {manifest.schema}"], 2)
    return Dataset(path, manifest)


def load_run(folder: str | os.PathLike[str], number: int) -> Recording:
    """Read one run of a campaign back as a recording.

    Parameters
    ----------
    folder : path
        The campaign folder.
    number : int
        Its number in the plan.

    Returns
    -------
    Recording
        Channels, clocks and labels as `elevon.simulate` gives them for this run.

    Raises
    ------
    InputError
        No such run, or it is not done yet.
    FormatError
        A file is not as it was written.
    """
    return load_campaign(folder).recording(number)
