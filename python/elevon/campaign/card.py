"""The data card of a campaign folder: what is in it and how to read it."""

from __future__ import annotations

from pathlib import Path

from elevon.campaign.store import Manifest
from elevon.files import write_text

__all__ = ["write_cards"]


def write_cards(folder: Path, manifest: Manifest) -> None:
    """Write ``README.md``."""
    write_text(folder / "README.md", f"# {manifest.name}\n", force=True)
