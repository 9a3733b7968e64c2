"""Names that were replaced: what old files call things, and the words that people try.

Nothing accepts an old name but the loading of files that were written with it. Given by a person,
it is refused like any unknown name, with the present name first among the suggestions.
"""

import re
from collections.abc import Iterable, Mapping
from typing import Any

#: Old name, as a whole or up to the next dot or ``@``, to the present one.
_NAMES = {
    "play": "backlash",
    "user": "output",
    "user_position": "output_position",
    "user_speed": "output_speed",
    "user_torque": "output_torque",
    "play_in_deg": "backlash_in_deg",
    "play_out_deg": "backlash_out_deg",
    "play_out_spread_deg": "backlash_out_spread_deg",
    "play_from_encoder": "backlash_from_encoder",
    "plays_differ": "backlashes_differ",
    "total_play": "total_backlash",
    "equivalents": "ambiguous_with",
    "evidence": "features",
    "winding_short": "resolver_short",
    "winding_open": "resolver_open",
}

#: Words that people try, to the names that they may mean; those that fit the place are offered.
_TRIED = {
    "freeplay": ("backlash",),
    "free_play": ("backlash",),
    "lash": ("backlash",),
    "winding_short": ("short",),
    "turn_short": ("short",),
    "wear": ("tooth_wear", "backlash"),
    "stiction": ("friction",),
    "bearing_wear": ("bearing",),
}

#: What is to be said about a word of a kind of name, beside the suggestions.
_REMARKS = {("fault", "overheat"): "not a fault: see thermal"}

#: Old names inside a text: those that no other word is, each with the present spelling.
_INSIDE = (
    (re.compile(r"(?<![\w.@])user_(position|speed|torque)(?!\w)"), r"output_\1"),
    (re.compile(r"(?<![\w.@])play(?=@transmission)"), "backlash"),
    (
        re.compile(r"(?<![\w.@])play(?=\.(?:total|extra|model|stiffness|damping)(?!\w))"),
        "backlash",
    ),
    (re.compile(r"(?<![\w.@])winding_(short|open)(?=@sensor\.resolver)"), r"resolver_\1"),
    (re.compile(r"(?<![\w.@])load\.user(?!\w)"), "load.output"),
    (re.compile(r"(?<!\w)user (position|speed|torque)(?!\w)"), r"output \1"),
)


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
    for new in (_NAMES.get(head), *_TRIED.get(head, ())):
        meant += [] if new is None else [f"{new}{mark}{tail}", new]
    names = list(candidates)
    meant = list(dict.fromkeys(meant))
    whole = [new for new in meant if new in names]
    return whole or [name for new in meant for name in names if name.startswith(f"{new}.")]


def remark(what: str, name: str) -> str:
    """Return what is to be said about a wrong name of a kind, such as a fault; mostly nothing."""
    return _REMARKS.get((what, name.strip().lower()), "")
