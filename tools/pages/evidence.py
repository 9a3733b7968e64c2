"""Evidence: the pages of measured figures, made from the records of the runs."""

from collections.abc import Iterator
from pathlib import Path


def pages(root: Path) -> Iterator[tuple[str, str]]:  # noqa: ARG001
    """Yield name and text of each page."""
    yield from ()
