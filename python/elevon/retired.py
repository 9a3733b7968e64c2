"""Names that were replaced: what old files call things, and the words that people try.

Nothing accepts an old name but the loading of files that were written with it. Given by a person,
it is refused like any unknown name, with the present name first among the suggestions.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

_TABLE = tomllib.loads(Path(__file__).with_suffix(".toml").read_text("utf-8"))
_NAMES: Mapping[str, str] = _TABLE["names"]
_INSIDE = [(re.compile(row["pattern"]), row["name"]) for row in _TABLE["inside"]]


def current(text: str) -> str:
    """Return a text of an old file with the present names in it."""
    for pattern, name in _INSIDE:
        text = pattern.sub(name, text)
    return text


def mapped(value: Any) -> Any:
    """Return JSON content of an old file with the present names in it.

    A word that is no name by itself (``user``, the kind ``play``) is replaced only where it
    stands for one: as a port of the load, as the kind of a fault, as the choice of a parameter.
    """
    if isinstance(value, str):
        return current(value)
    if isinstance(value, list):
        return [mapped(item) for item in value]
    if not isinstance(value, Mapping):
        return value
    fault = "place" in value and isinstance(value.get("kind"), str)
    feedback = "control.position_feedback" in (value.get("path"), value.get("parameter"))
    result = {}
    for key, given in value.items():
        item = given
        if key == "load" and isinstance(given, Mapping):
            item = {_NAMES[k] if k == "user" else k: inner for k, inner in given.items()}
        word = given if isinstance(given, str) else ""
        whole = (
            (fault and key == "kind" and word in _NAMES)
            or (feedback and key in {"value", "old"} and word == "user")
            or (key == "control.position_feedback" and word == "user")
        )
        result[current(key)] = _NAMES[word] if whole else mapped(item)
    return result


def successors(name: str, candidates: Iterable[str]) -> list[str]:
    """Return the valid names that an old or a tried name stands for, the present name first."""
    word = "_".join(re.split(r"[\s_-]+", name.strip().lower()))
    head, mark, tail = re.match(r"([^.@=]*)([.@=]?)(.*)", word, re.DOTALL).groups()  # type: ignore[union-attr]
    meant = [current(word)] if current(word) != word else []
    meant += [_NAMES[word]] if word in _NAMES else []
    for new in (_NAMES.get(head), *_TABLE["tried"].get(head, ())):
        meant += [] if new is None else [f"{new}{mark}{tail}", new]
    names = list(candidates)
    meant = list(dict.fromkeys(meant))
    whole = [new for new in meant if new in names]
    return whole or [name for new in meant for name in names if name.startswith(f"{new}.")]


def remark(what: str, name: str) -> str:
    """Return what is to be said about a wrong name of a kind, such as a fault; mostly nothing."""
    return str(_TABLE["remarks"].get(what, {}).get(name.strip().lower(), ""))
