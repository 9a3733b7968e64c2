"""What a file holds, its description and columns checked against each other; neither is trusted."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from elevon.arrays import Floats
from elevon.errors import DamageError, FormatError, InputError, RetiredNamesWarning
from elevon.recording.channel import Channel, Clock
from elevon.recording.header import SCHEMA, Header
from elevon.retired import current, mapped


@dataclass(frozen=True)
class Contents:
    """Everything of which a recording is made; see `Recording`.

    `old` lists the channels whose names in the file were replaced since.
    """

    channels: list[Channel]
    clocks: list[Clock]
    meta: dict[str, Any] = field(default_factory=dict)
    labels: Any = None
    final: dict[str, float] = field(default_factory=dict)
    old: list[str] = field(default_factory=list)


def check_size(place: str, needed: int, max_bytes: int) -> None:
    """Refuse a file that would need more memory than allowed."""
    if needed > max_bytes:
        raise FormatError(
            f"{place}: would need {needed / 2**20:.0f} MiB of memory; "
            f"the limit is {max_bytes / 2**20:.0f} MiB (max_bytes)"
        )


def header_bytes(header: Header) -> int:
    """Memory needed by the time and values that a header promises."""
    return sum(8 * max(clock.samples, 0) * (1 + len(clock.channels)) for clock in header.clocks)


def rebuild(
    header: Header,
    columns: Callable[[str], Mapping[str, Floats]],
    place: str,
) -> Contents:
    """Return the contents that a header and its columns describe.

    Parameters
    ----------
    header : Header
        As read.
    columns : callable
        Clock name to its arrays by name: ``time`` and the channels.
    place : str
        The file, for the errors.

    Raises
    ------
    FormatError
        A column is missing, of another length, or breaks a rule of `Clock` or `Channel`.
    """
    clocks: list[Clock] = []
    channels: list[Channel] = []
    try:
        for entry in header.clocks:
            arrays = columns(entry.name)
            missing = [name for name in ("time", *entry.channels) if name not in arrays]
            if missing:
                raise FormatError(f"{place}: columns are missing: {', '.join(missing)}")
            clock = Clock(entry.name, arrays["time"], entry.rate, entry.gaps)
            if len(clock) != entry.samples:
                raise FormatError(
                    f"{place}: clock {entry.name!r} holds {len(clock)} of {entry.samples} samples"
                )
            clocks.append(clock)
            channels += [
                Channel(name, unit, arrays[name], clock, text)
                for name, (unit, text) in entry.channels.items()
            ]
        by_clock = [
            values
            for clock in clocks
            for values in (clock.time, *(c.values for c in channels if c.clock is clock))
        ]
        if header.digest(by_clock) != header.sha256:
            raise DamageError(f"{place}: damaged: not as it was written (SHA-256)")
        whole = Contents(channels, clocks, header.meta, header.labels, header.final)
        return whole if header.schema == SCHEMA else with_present_names(whole)
    except FormatError:
        raise
    except (InputError, TypeError, ValueError) as error:
        raise FormatError(f"{place}: {error}") from error


def with_present_names(contents: Contents) -> Contents:
    """Return the contents of an old file with the present names; what is named so already stays."""
    names = {channel.name for channel in contents.channels}
    renamed = {n: new for n in names if (new := current(n)) != n and new not in names}
    channels = [
        replace(c, name=renamed.get(c.name, c.name), text=current(c.text))
        for c in contents.channels
    ]
    meta, labels = mapped(contents.meta), mapped(contents.labels)
    final = {renamed.get(name, name): value for name, value in contents.final.items()}
    changed = sorted(renamed)
    if not changed and (meta, labels) != (contents.meta, contents.labels):
        changed = ["its description"]
    return replace(contents, channels=channels, meta=meta, labels=labels, final=final, old=changed)


def warn_of_old_names(path: str | os.PathLike[str], names: Sequence[str], stacklevel: int) -> None:
    """Say once what of a file was written with names that were replaced."""
    listed = ", ".join(names[:6]) + (", ..." if len(names) > 6 else "")
    warnings.warn(
        f"{os.fspath(path)}: was written with names that have been replaced ({listed}); "
        "it is read with the present ones",
        RetiredNamesWarning,
        stacklevel + 1,
    )
