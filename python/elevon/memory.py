"""How much memory there is, and refusing work that needs more."""

from __future__ import annotations

import os
from pathlib import Path

from elevon.errors import InputError

#: Part of the available memory that one piece of work may take.
_SHARE = 0.8


def available_bytes() -> int | None:
    """Return the memory that can be had without swapping, in bytes; None where unknown."""
    limits = [limit for limit in (_system(), _container()) if limit is not None]
    return min(limits) if limits else None


def check_memory(needed: int, what: str) -> None:
    """Raise `InputError` when `what` needs more memory than there is.

    Parameters
    ----------
    needed : int
        Bytes.
    what : str
        Named in the message, which states both amounts.
    """
    free = available_bytes()
    if free is not None and needed > _SHARE * free:
        raise InputError(
            f"{what} would take {format_bytes(needed)} of memory, of the {format_bytes(free)} "
            "available; record fewer signals, at a lower rate, or for a shorter time"
        )


def format_bytes(count: float) -> str:
    """Return a number of bytes for the reader: ``3.2 GB``."""
    for unit in ("B", "kB", "MB", "GB", "TB"):
        if count < 1000.0 or unit == "TB":
            return f"{count:.3g} {unit}"
        count /= 1000.0
    raise AssertionError  # the loop always returns


def _system() -> int | None:
    try:
        for line in Path("/proc/meminfo").read_text().splitlines():
            if line.startswith("MemAvailable:"):
                return int(line.split()[1]) * 1024
    except OSError:
        pass
    try:
        return os.sysconf("SC_AVPHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    except (AttributeError, OSError, ValueError):
        return None


def _container() -> int | None:
    """Memory left to the control group this process runs in, where it has a limit."""
    folder = Path("/sys/fs/cgroup")
    try:
        limit = (folder / "memory.max").read_text().strip()
        used = int((folder / "memory.current").read_text())
    except (OSError, ValueError):
        return None
    return None if limit == "max" else max(int(limit) - used, 0)
