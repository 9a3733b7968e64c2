"""The catalogue's page of detection limits, in Markdown."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from elevon.diagnose.learning.fit import share_interval

if TYPE_CHECKING:
    from studies.fault_limits.limits import FaultLimits, Limit

__all__ = ["limits_table"]

_HEAD = """# Detection limits

Made by a command, not by hand:

    {command} --table FILE

Least severity of each fault that moves a test's numbers by three deviations of a healthy unit with
one healthy log of another day as baseline ([how](../reference/faults.md#detection-limits)). `-`:
no severity does in this test. Why stands below each table. A fault that is there or not has the
limit 0.5. Logs of the {fidelity} model, seed {seed}.
"""


def limits_table(result: FaultLimits, command: str) -> str:
    """Return the page: a table of faults by tests for each actuator, its checks, its reasons."""
    parts = [_HEAD.format(command=command, fidelity=result.fidelity, seed=result.seed)]
    for name in dict.fromkeys(row.actuator for row in result.limits):
        rows = [row for row in result.limits if row.actuator == name]
        parts += [f"## `{name}`\n", _checked(result, name, rows), _limits(rows), _reasons(rows)]
    return "\n".join(parts)


def _checked(result: FaultLimits, name: str, rows: Sequence[Limit]) -> str:
    alarms, logs = result.healthy[name]
    text = f"{_share(alarms, logs)} healthy logs called faulty."
    tried = [row for row in rows if row.named is not None]
    if tried:
        seen, named = sum(bool(r.alarm) for r in tried), sum(bool(r.named) for r in tried)
        text += f" Faults of twice their limit: {_share(seen, len(tried))} called faulty, "
        text += f"{_share(named, len(tried))} named."
    return text + "\n"


def _share(count: int, of: int) -> str:
    low, high = (100.0 * end for end in share_interval(count, of))
    return f"{count} of {of} ({low:.0f} to {high:.0f} %)"


def _limits(rows: Sequence[Limit]) -> str:
    tests = list(dict.fromkeys(row.test for row in rows))
    known = {(row.kind, row.place, row.test): row for row in rows}
    seen = [row for row in rows if row.limit is not None]
    lines = ["| fault | " + " | ".join(tests) + " |", "|---" * (len(tests) + 1) + "|"]
    for kind, place, unit in dict.fromkeys((r.kind, r.place, r.unit) for r in seen):
        cells = [_cell(known.get((kind, place, test))) for test in tests]
        bracket = "" if unit in ("", "1") else f" [{unit}]"
        lines.append(f"| `{kind}@{place}`{bracket} | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _cell(row: Limit | None) -> str:
    return "-" if row is None or row.limit is None else f"{row.limit:.2g}"


def _reasons(rows: Sequence[Limit]) -> str:
    """Why what is not seen is not, faults of one reason together."""
    groups: dict[str, list[str]] = {}
    seen = {(row.kind, row.place) for row in rows if row.limit is not None}
    for row in rows:
        if row.limit is None:
            key = f"{row.kind}@{row.place}"
            where = f" ({row.test})" if (row.kind, row.place) in seen else ""
            names = groups.setdefault(row.reason, [])
            if f"`{key}`{where}" not in names:
                names.append(f"`{key}`{where}")
    lines = [f"* {', '.join(names)}: {reason}" for reason, names in groups.items()]
    return "Not seen:\n\n" + "\n".join(lines) + "\n"
