"""JSON that carries its own checksum: manifests, and what blocks say of themselves."""

from __future__ import annotations

import base64
import hashlib
import json
import zlib
from collections.abc import Mapping
from typing import Any

_LARGEST = 256 * 2**20
"""Bytes that a packed text may expand to."""


def seal(content: Mapping[str, object]) -> str:
    """Return the SHA-256 of JSON content, whatever the order of its keys."""
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def packed(content: Mapping[str, object]) -> str:
    """Return JSON content as one compressed text with its checksum."""
    text = json.dumps({"check": seal(content), "content": content}, sort_keys=True)
    return base64.b85encode(zlib.compress(text.encode(), 9)).decode("ascii")


def unpacked(text: bytes | str | None) -> dict[str, Any] | None:
    """Return the content of a packed text; None where it is not as it was written."""
    if text is None:
        return None
    try:
        stream = zlib.decompressobj()
        raw = stream.decompress(base64.b85decode(text), _LARGEST)
        whole = json.loads(raw)
        content, mark = whole["content"], whole["check"]
    except (ValueError, KeyError, TypeError, RecursionError, zlib.error):
        return None
    return content if isinstance(content, dict) and seal(content) == mark else None
