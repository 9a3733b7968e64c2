"""The version, and the commit of which this copy was made."""

from __future__ import annotations

import subprocess
from pathlib import Path

HERE = Path(__file__).resolve().parent


def version_line() -> str:
    """Return the version, with the commit where one is known: ``0.2.0 (1a2b3c4d5e6f)``."""
    from elevon import __version__

    known = commit()
    return f"{__version__} ({known})" if known else str(__version__)


def commit() -> str:
    """Return the commit: a wheel carries it in a file, a checkout is asked; empty: unknown."""
    carried = HERE / "commit.txt"
    if carried.is_file():
        return carried.read_text("utf-8").strip()
    root = HERE.parents[2]
    if not (root / ".git").exists():
        return ""
    words = ["git", "-C", str(root), "rev-parse", "--short=12", "HEAD"]
    try:
        done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=5.0)  # noqa: S603
    except OSError:
        return ""
    return done.stdout.strip()
