"""The words for the codes of a control unit, as the core's own records give them."""

from __future__ import annotations

import re
from functools import lru_cache


@lru_cache
def code_names(wiring: str, signal: str) -> dict[int, str]:
    """Return the words for the codes of a signal, read from the core's own record of it.

    Parameters
    ----------
    wiring : str
        Such as ``landing_gear``.
    signal : str
        Such as ``state``.

    Returns
    -------
    dict
        Word by code; empty for a signal without codes, or a wiring or signal that does not exist.
    """
    from elevon import _core

    if wiring not in {item["name"] for item in _core.wirings()}:
        return {}
    texts = {item["name"]: item["text"] for item in _core.signals(wiring, "high")}
    codes = re.findall(r"(\d+) ([^,;:]+)", texts.get(signal, ""))
    return {int(code): word.strip() for code, word in codes}
