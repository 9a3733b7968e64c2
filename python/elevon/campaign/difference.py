"""How a plan differs from the one that a folder was begun with, in words."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from elevon.campaign.resolved import Resolved
from elevon.campaign.resolved_file import LONGEST, resolved_text
from elevon.campaign.store import RESOLVED
from elevon.files import read_regular

_MOST = 3


def difference(folder: Path, resolved: Resolved) -> str:
    """Return the first differences between a plan and the one a folder holds."""
    try:
        old = json.loads(read_regular(folder / RESOLVED, LONGEST))
    except (OSError, ValueError):
        return "its resolved plan cannot be read"
    new = json.loads(resolved_text(resolved))
    places = list(_places(old, new, ""))
    changed = [
        f"the points of {name} have changed"
        for name, mark in new["sources"].items()
        if old.get("sources", {}).get(name, mark) != mark
    ]
    places = [place for place in places if not place.startswith("sources")]
    if not changed and not places:
        return "the drawn values differ"
    return "; ".join([*changed, *(f"{place} differs" for place in places)][:_MOST])


def _places(old: Any, new: Any, place: str) -> Iterator[str]:
    """Yield the places at which two JSON values differ."""
    if isinstance(old, Mapping) and isinstance(new, Mapping):
        for key in dict.fromkeys([*old, *new]):
            inner = f"{place}.{key}" if place else str(key)
            yield from _places(old.get(key), new.get(key), inner)
    elif isinstance(old, list) and isinstance(new, list) and len(old) == len(new):
        for index, (first, second) in enumerate(zip(old, new, strict=True)):
            named = first.get("path", index) if isinstance(first, Mapping) else index
            yield from _places(first, second, f"{place}[{named}]")
    elif old != new:
        yield place
