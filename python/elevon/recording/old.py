"""Recordings of an earlier version: the same content under the present names."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

from elevon.errors import RetiredNamesWarning
from elevon.retired import current, mapped

if TYPE_CHECKING:
    from elevon.recording.contents import Contents


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
