"""One file of a data set's table, checked before it is read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from elevon.errors import FormatError
from elevon.worklog import digest


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
        if self.about is not None and _mark(self.path, stat.st_mtime_ns) != self.about["sha256"]:
            raise FormatError(f"{self.path}: is not as it was written (SHA-256){self.remedy}")


@lru_cache(maxsize=4096)
def _mark(path: Path, stamp: int) -> str:  # noqa: ARG001 - a changed file is read anew
    return str(digest(path)["sha256"])
