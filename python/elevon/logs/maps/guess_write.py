"""A guessed column map as TOML, each entry with its reasons, for you to correct."""

from __future__ import annotations

import json

from elevon.logs.maps.guess import Guess
from elevon.logs.maps.hints import GuessedColumn

_HEAD = """# A first map of {source}: guessed, to be read and corrected.
# Roles: `role`; what is wrong is refused at the import where the data contradict it.
# A column whose meaning is not known stands at the end as a comment.
"""


def guess_text(guess: Guess) -> str:
    """Return the map's file."""
    text = _HEAD.format(source=ascii(guess.source)[1:-1])
    if guess.travel_per_turn is not None:
        text += f'travel_per_turn = "{1e3 * guess.travel_per_turn:.6g} mm"  # as the data show\n'
    if guess.gear_ratio is not None:
        text += f"gear_ratio = {guess.gear_ratio:.6g}  # as the data show\n"
    if any(item.role in _CURRENTS for item in guess.columns):
        text += 'current = "peak"  # ASSUMED; "rms" where the drive logs effective values\n'
    for item in guess.columns:
        text += "\n" + (_entry(item) if item.role else _unknown(item))
    return text


_CURRENTS = {"torque_current", "current_ref", "direct_current", "torque_voltage"}


def _entry(item: GuessedColumn) -> str:
    lines = [f"# {_comment(reason)}" for reason in item.reasons]
    lines += ["[[column]]", f"name = {json.dumps(item.name)}", f'role = "{item.role}"']
    if item.unit:
        lines.append(f"unit = {json.dumps(item.unit)}")
    if item.sign < 0:
        lines.append("sign = -1")
    return "\n".join(lines) + "\n"


def _unknown(item: GuessedColumn) -> str:
    lines = [f"# not known: {_comment(item.name)}"]
    lines += [f"# {_comment(reason)}" for reason in item.reasons]
    return "\n".join(lines) + "\n"


def _comment(text: str) -> str:
    """Foreign text on one line, without control characters."""
    return "".join(c if c.isprintable() else "?" for c in text)[:200]
