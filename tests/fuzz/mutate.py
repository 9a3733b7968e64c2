"""Documents changed by structure: keys, values, lists and tables, then now and then their text."""

from __future__ import annotations

import copy
import json
import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

__all__ = ["Raw", "changed", "spoiled", "to_json", "to_toml"]

_MOST = 4  # changes of one document; half have one, a quarter two
_SPOILED = 0.15  # share of the files whose text is changed, too


@dataclass(frozen=True)
class Raw:
    """Text that stands in the file as it is: what no writer of the language would write."""

    text: str


#: Values nobody would give; each may take the place of any other.
VALUES: tuple[Any, ...] = (
    "", " ", "\0", "a\0b", "\x1b[31m", "é€😀", "x" * 20_000, "../../etc/passwd", "/dev/zero",
    "~nobody/x", "a\0.csv",
    "/dev/full", "nul", "%s{}", "=1+1", "NaN", "1e400 deg", "-inf", "12 parsec", "1 deg deg",
    "0x10", "1_000", "-0 s", "1e-320 s", True, False, 0, 1, -1, 2**31, 2**63, -(2**64), 10**30,
    Raw("9" * 5000), Raw("-" + "9" * 4301), 10**400, 0.0, -0.0, 1e-320, 1e-30, 1e30, 1e308, -1e308,
    math.inf, -math.inf, math.nan, [], {}, [[]], [{}], {"": ""}, {"kind": "none"}, [0] * 3000,
    ["a", 1, None, {}], [math.nan], {"a": {"b": {"c": {}}}}, Raw("[" * 60 + "]" * 60),
    Raw("[" * 20_000 + "]" * 20_000),
)  # fmt: skip
KEYS = ("", "\0", "a b", "kind", "file", "x" * 500, "é", "0", "__class__", "value.", "[", '"')

Place = tuple[Any, Any]  # a table or list, and a key or index of it


def changed(document: Any, rng: np.random.Generator) -> Any:
    """Return a copy with one to four changes of its structure."""
    out = copy.deepcopy(document)
    for _ in range(min(int(rng.geometric(0.5)), _MOST)):
        places = list(_places(out))
        if places:
            change = _CHANGES[int(rng.integers(len(_CHANGES)))]
            change(places[int(rng.integers(len(places)))], places, rng)
    return out


def _places(item: Any) -> Iterator[Place]:
    """Yield each place of a document, outer ones first."""
    if isinstance(item, dict | list):
        for key in list(item) if isinstance(item, dict) else range(len(item)):
            yield item, key
            yield from _places(item[key])


def _drop(place: Place, _places: list[Place], _rng: np.random.Generator) -> None:
    if not isinstance(place[0], list) or place[1] < len(place[0]):
        del place[0][place[1]]


def _replace(place: Place, _places: list[Place], rng: np.random.Generator) -> None:
    place[0][place[1]] = copy.deepcopy(VALUES[int(rng.integers(len(VALUES)))])


def _scale(place: Place, _places: list[Place], rng: np.random.Generator) -> None:
    value = place[0][place[1]]
    if isinstance(value, int | float) and not isinstance(value, bool):
        factor = float(rng.choice([-1.0, 0.0, 1e-9, 0.5, 3.0, 1e9, 1e200]))
        place[0][place[1]] = float(value) * factor if abs(value) < 1e300 else 0
    else:
        _replace(place, _places, rng)


def _rename(place: Place, _places: list[Place], rng: np.random.Generator) -> None:
    if isinstance(place[0], dict):
        name = KEYS[int(rng.integers(len(KEYS)))]
        if rng.random() < 0.5:  # a slip of the pen rather than another name
            name = str(place[1])[1:] + str(place[1])[:1]
        place[0][name] = place[0].pop(place[1])


def _repeat(place: Place, _places: list[Place], rng: np.random.Generator) -> None:
    if isinstance(place[0], list):
        place[0].extend(copy.deepcopy([place[0][place[1]]]) * int(rng.integers(1, 300)))
    else:
        place[0][KEYS[int(rng.integers(len(KEYS)))]] = copy.deepcopy(place[0][place[1]])


def _wrap(place: Place, _places: list[Place], rng: np.random.Generator) -> None:
    value = place[0][place[1]]
    place[0][place[1]] = [value] if rng.random() < 0.5 else {"value": value}


def _swap(place: Place, places: list[Place], rng: np.random.Generator) -> None:
    other = places[int(rng.integers(len(places)))]
    value = copy.deepcopy(other[0][other[1]])
    other[0][other[1]], place[0][place[1]] = copy.deepcopy(place[0][place[1]]), value


Change = Callable[[Place, list[Place], np.random.Generator], None]
_CHANGES: tuple[Change, ...] = (_drop, _replace, _replace, _scale, _rename, _repeat, _wrap, _swap)


def to_json(item: Any) -> str:
    """Return JSON text; no number, infinity and `Raw` stand as they are."""
    if isinstance(item, Raw):
        return item.text
    if isinstance(item, dict):
        return "{" + ",".join(f"{json.dumps(str(k))}:{to_json(v)}" for k, v in item.items()) + "}"
    if isinstance(item, list):
        return "[" + ",".join(map(to_json, item)) + "]"
    return json.dumps(item)


def to_toml(document: dict[str, Any]) -> str:
    """Return TOML text, a line for each key, tables in line."""
    return "".join(f"{_key(k)} = {_toml(v)}\n" for k, v in document.items())


def _toml(item: Any) -> str:
    if isinstance(item, Raw):
        return item.text
    if isinstance(item, dict):
        return "{" + ", ".join(f"{_key(k)} = {_toml(v)}" for k, v in item.items()) + "}"
    if isinstance(item, list):
        return "[" + ", ".join(map(_toml, item)) + "]"
    if isinstance(item, bool):
        return str(item).lower()
    if isinstance(item, float):
        return repr(item)
    return "''" if item is None else str(item) if isinstance(item, int) else json.dumps(item)


def _key(name: Any) -> str:
    return json.dumps(str(name))


def spoiled(text: str, rng: np.random.Generator) -> bytes:
    """Return the file's bytes, in one of seven cases changed without regard to its structure."""
    data = text.encode("utf-8", "surrogatepass")
    if rng.random() >= _SPOILED or not data:
        return data
    at = int(rng.integers(len(data)))
    kind = int(rng.integers(7))
    if kind == 0:
        return data[:at]
    if kind == 1:
        return data[:at] + bytes([data[at] ^ (1 << int(rng.integers(8)))]) + data[at + 1 :]
    if kind == 2:
        return data[:at] + b"\0" + data[at:]
    if kind == 3:
        return b"\xef\xbb\xbf" + data.replace(b"\n", b"\r\n")
    if kind == 4:
        return data[:at] + b"\xff\xfe\x80" + data[at:]
    if kind == 5:
        return data[:at] + b"[{" * 30_000 + data[at:]
    return data * 3
