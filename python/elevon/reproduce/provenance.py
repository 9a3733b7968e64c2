"""What a report must say about its own making."""

from __future__ import annotations

import sys
from collections.abc import Mapping


def provenance(command: str, **more: object) -> Mapping[str, object]:
    """Return version, interpreter and command line, and whatever else the caller names."""
    import elevon

    return {
        "Elevon": _version(elevon),
        "Python": ".".join(str(part) for part in sys.version_info[:3]),
        "Made again by": command,
    } | more


def _version(package: object) -> str:
    try:
        return str(package.__version__)  # type: ignore[attr-defined]
    except ImportError:
        return "source tree without the compiled core"
