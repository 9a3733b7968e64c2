"""Measurement files of other tools: ASAM MDF 4, TDMS and MCAP, each read by its own library.

Such a file holds groups of channels, each on a clock of its own. The group with most samples makes
the table; what other groups hold is read at its instants along straight lines, and the notes name
them. Sizes are checked by what a file declares, before anything is expanded.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import FormatError, quoted
from elevon.logs.formats.table import DEFAULT_LIMITS, Limits, RawTable, existing_file, split_unit

_DEEPEST = 8  # levels of a message
_CLOCK = "time"


@dataclass
class ChannelGroup:
    """Channels on one clock.

    Attributes
    ----------
    name : str
        Group or topic.
    time : ndarray, shape (n,), or None
        s; None where one of the channels is the time.
    columns : dict of str to ndarray, shape (n,)
        By channel.
    units : dict of str to str
        Where the file states them.
    """

    name: str
    time: Floats | None
    columns: dict[str, Floats] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)

    @property
    def rows(self) -> int:
        """Number of samples."""
        return len(next(iter(self.columns.values()))) if self.columns else 0


def read_mdf(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> RawTable:
    """Read the channels of numbers of an ASAM MDF file, converted, with their units.

    Raises
    ------
    FormatError
        Damaged, without a channel of numbers, or larger than the limits.
    ModuleNotFoundError
        asammdf is not installed.
    """
    from asammdf import MDF

    file, notes = existing_file(path, limits), list[str]()
    if file.stat().st_size < _HEADER:
        raise FormatError(f"{file}: damaged mdf: cut off in its header")

    def groups() -> Iterator[ChannelGroup]:
        with MDF(file) as content:
            declared = sum(g.channel_group.cycles_nr * len(g.channels) for g in content.groups)
            limits.check_shape(str(file), int(declared), 1)
            for number, group in enumerate(content.groups):
                channels = ChannelGroup(
                    str(group.channel_group.acq_name or f"group {number}"), None
                )
                for index, channel in enumerate(group.channels):
                    if channel.channel_type in _MASTERS:
                        continue
                    signal = content.get(group=number, index=index)
                    channels.time = np.asarray(signal.timestamps, dtype=np.float64)
                    _add(channels, channel.name, signal.samples, str(signal.unit or ""), notes)
                yield channels

    return _table(file, "mdf", groups, limits, notes)


_MASTERS = (2, 3)  # channel types of ASAM MDF: master and virtual master
_HEADER = 168  # bytes of its identification and header blocks


def read_tdms(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> RawTable:
    """Read the channels of numbers of a TDMS file with their units; errors as `read_mdf`."""
    from nptdms import TdmsFile

    file, notes = existing_file(path, limits), list[str]()

    def groups() -> Iterator[ChannelGroup]:
        with TdmsFile.open(file) as content:
            declared = sum(len(c) for group in content.groups() for c in group.channels())
            limits.check_shape(str(file), declared, 1)
            for group in content.groups():
                by_length: dict[int, ChannelGroup] = {}
                for channel in group.channels():
                    channels = by_length.setdefault(len(channel), ChannelGroup(group.name, None))
                    if channels.time is None and "wf_increment" in channel.properties:
                        channels.time = np.asarray(channel.time_track(), dtype=np.float64)
                    unit = str(channel.properties.get("unit_string", ""))
                    _add(channels, channel.name, channel[:], unit, notes)
                yield from by_length.values()

    return _table(file, "tdms", groups, limits, notes)


def read_mcap(path: str | Path, *, limits: Limits = DEFAULT_LIMITS) -> RawTable:
    """Read the numbers in the messages of an MCAP file (JSON and ROS 2), a topic a group.

    Instants are those at which the messages were logged. Topics of other encodings are named in the
    notes; errors as `read_mdf`.
    """
    from mcap.reader import make_reader
    from mcap_ros2.decoder import DecoderFactory

    file, notes = existing_file(path, limits), list[str]()

    def groups() -> Iterator[ChannelGroup]:
        with file.open("rb") as stream:
            reader, ros = make_reader(stream), DecoderFactory()
            summary = reader.get_summary()
            for chunk in summary.chunk_indexes if summary else ():
                limits.check_bytes(str(file), chunk.uncompressed_size)
            topics: dict[str, tuple[list[int], list[dict[str, float]]]] = {}
            size = 0
            for schema, channel, message in reader.iter_messages():
                decode: Callable[[bytes], object] | None = (
                    json.loads
                    if channel.message_encoding == "json"
                    else ros.decoder_for(channel.message_encoding, schema)
                )
                if decode is None:
                    text = f"{quoted(channel.topic)} passed over: as {channel.message_encoding}"
                    if text not in notes:
                        notes.append(text)
                    continue
                times, rows = topics.setdefault(channel.topic, ([], []))
                row = dict(_numbers_in(decode(message.data)))
                size += len(row)
                limits.check_shape(str(file), size, 1)
                times.append(message.log_time)
                rows.append(row)
        begin = min((times[0] for times, _ in topics.values()), default=0)
        for topic, (times, rows) in topics.items():
            names = dict.fromkeys(name for row in rows for name in row)
            channels = ChannelGroup(topic, 1e-9 * np.array([at - begin for at in times]))
            for name in names:
                _add(channels, name, np.array([row.get(name, np.nan) for row in rows]), "", notes)
            yield channels

    return _table(file, "mcap", groups, limits, notes)


def _numbers_in(value: object, name: str = "", depth: int = 0) -> Iterator[tuple[str, float]]:
    """Yield name and value of every number in a message, down to eight levels."""
    if isinstance(value, (bool, int, float)):
        yield name or "value", float(value)
        return
    inner: Sequence[tuple[object, object]] = ()
    if isinstance(value, Mapping):
        inner = list(value.items())
    elif isinstance(value, (list, tuple, np.ndarray)):
        inner = [(k + 1, item) for k, item in enumerate(value)]
    elif hasattr(value, "__slots__"):
        inner = [(key, getattr(value, key)) for key in value.__slots__ if hasattr(value, key)]
    for key, item in inner if depth < _DEEPEST else ():
        yield from _numbers_in(item, f"{name}.{key}" if name else str(key), depth + 1)


def _add(
    group: ChannelGroup, name: str, values: npt.ArrayLike, unit: str, notes: list[str]
) -> None:
    """Add a channel to its group; anything but numbers is named in the notes."""
    array = np.asarray(values)
    label, stated = split_unit(name)
    if array.dtype.kind == "M":
        array = (array - array[:1]).astype("timedelta64[ns]").astype(np.float64) * 1e-9
        unit = "s"
    if array.dtype.kind not in "fiub" or array.ndim != 1:
        notes.append(f"{quoted(f'{group.name}/{name}')} passed over: no numbers one a sample")
        return
    group.columns[label] = array.astype(np.float64)
    if unit or stated:
        group.units[label] = unit or stated


def _table(
    file: Path,
    file_format: str,
    groups: Callable[[], Iterator[ChannelGroup]],
    limits: Limits,
    notes: list[str],
) -> RawTable:
    """Return the table of a file's groups on the clock of the one with most samples."""
    try:
        clocked = [group for group in groups() if group.rows > 0]
    except (FormatError, ModuleNotFoundError):
        raise
    except Exception as error:
        raise FormatError(f"{file}: damaged {file_format}: {quoted(str(error))}") from error
    if not clocked:
        raise FormatError(f"{file}: no channel of numbers")
    base = max(clocked, key=lambda group: group.rows)
    columns: dict[str, Floats] = {}
    units: dict[str, str] = {}
    if base.time is not None:
        columns[_CLOCK], units[_CLOCK] = base.time, "s"
    for group in (base, *(g for g in clocked if g is not base)):
        shared = {name for other in clocked if other is not group for name in other.columns}
        for name, values in group.columns.items():
            label = f"{group.name}/{name}" if name in shared or name in columns else name
            read = _on_base(group, values, base)
            if read is None:
                notes.append(f"{quoted(label)} passed over: {len(values)} values, not {base.rows}")
                continue
            columns[label] = read
            if name in group.units:
                units[label] = group.units[name]
        if group is not base and group.time is not None:
            notes.append(
                f"{quoted(group.name)} ({group.rows} samples) is read at the instants of "
                f"{quoted(base.name)} along straight lines"
            )
    limits.check_shape(str(file), base.rows, len(columns))
    return RawTable(str(file), columns, units, tuple(notes), file_format)


def _on_base(group: ChannelGroup, values: Floats, base: ChannelGroup) -> Floats | None:
    """Return a group's channel at the base's instants, NaN outside its own; None: no clock says."""
    if group is base or (group.time is None and len(values) == base.rows):
        return values
    if group.time is None or base.time is None:
        return None
    with suppress(ValueError):
        return np.interp(base.time, group.time, values, left=np.nan, right=np.nan)
    return None
