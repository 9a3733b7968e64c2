"""What must hold of the faults of a cell; each function returns what does not, named."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np

from tests.contract import sets
from tests.contract.cells import Cell, Outcome, Variant, drives, fault, load, severe

#: Parts of the severe severity: none, a trace, two away from whole counts so that rounding shows,
#: all.
PARTS = (0.0, 0.0023, 0.23, 0.61, 1.0)
FEW = (0.0, 1.0)

#: A fault is there from a twentieth to three twentieths of the run; it must be forgotten in its
#: last tenth: within three quarters of the run, 1.5 s of a swing.
ONSET, CLEARED, LOOKED = 0.05, 0.15, 0.9
SWING_S = 2.0
#: Largest distance from the healthy way then, of its range: what relays in another phase make.
FORGOTTEN = 0.02

#: High and low: agreement in sign and within this factor ...
FACTOR = 1.5
#: ... where the high model's change is this many of its own floors (two steps, no fault) and this
#: part of the healthy value.
FLOORS, SEEN = 5.0, 0.05


def cells(*, every: bool) -> list[Cell]:
    """One drive and no load; or every drive, each with no load, an opposing and an aiding one."""
    return [
        Cell(name, fidelity, choices, push)
        for name in sets.names()
        for fidelity in sets.fidelities(name)
        for choices in (drives(name) if every else [()])
        for push in ((0.0, load(name), -load(name)) if every else (0.0,))
    ]


@dataclass(frozen=True)
class Row:
    """One fault of a cell: its variants, their outcomes, and whether the program says it rests."""

    name: str
    variants: tuple[Variant, ...]
    outcomes: tuple[Outcome, ...]
    rests: bool


@cache
def rows(cell: Cell, parts: tuple[float, ...]) -> tuple[Outcome, tuple[Row, ...]]:
    """The healthy outcome, and every fault at each part of its severe severity."""
    asked = [
        [
            Variant(
                f"{kind}@{place}={part}",
                faults=(fault(kind, place, record, part * severe(record)),),
            )
            for part in parts
        ]
        for kind, place, record in cell.faults()
    ]
    asked = [variants for variants in asked if not any(map(cell.refused, variants))]
    flat = [variant for variants in asked for variant in variants]
    healthy, *broken = cell.run([Variant(), *flat])
    size = len(parts)
    found = [
        Row(
            variants[0].name.rpartition("=")[0],
            tuple(variants),
            tuple(broken[i * size : (i + 1) * size]),
            bool(cell.resting(variants[-1])),
        )
        for i, variants in enumerate(asked)
    ]
    return healthy, tuple(found)


def wrong(cell: Cell, parts: tuple[float, ...]) -> Iterator[str]:
    """Severity zero, doing something, and the label, over every fault of a cell."""
    healthy, found = rows(cell, parts)
    if healthy.status != "ok":
        yield f"the healthy run ended as {healthy.status}: {healthy.message}"
        return
    for row in found:
        if changed := row.outcomes[0].differs(healthy):
            yield f"{row.name}: severity 0 changes {', '.join(changed[:3])}"
        last = row.outcomes[-1]
        if last.status not in {"ok", "tripped"}:
            yield f"{row.name}: ended as {last.status}: {last.message}"
        if row.rests and last.differs(healthy):
            changed = ", ".join(last.differs(healthy)[:3])
            yield f"{row.name}: is said not to act, yet changes {changed}"
        if not row.rests and not last.differs(healthy):
            yield f"{row.name}: changes nothing, and nothing says so"
        yield from _labels(row)


def _labels(row: Row) -> Iterator[str]:
    """Two severities have one label where they act alike to the bit, and two where they do not."""
    if row.rests or not row.outcomes[-1].differs(row.outcomes[0]):
        return
    pairs = [(i, j) for j in range(len(row.outcomes)) for i in range(j)]
    for i, j in pairs:
        one, other = row.outcomes[i], row.outcomes[j]
        size = min(one.severity.size, other.severity.size)
        labelled = one.severity[:size].tobytes() != other.severity[:size].tobytes()
        acting = bool(one.differs(other))
        names = f"{row.variants[i].name} and {row.variants[j].name.rpartition('=')[2]}"
        if acting and not labelled:
            yield f"{names}: act differently under one label, {one.severity[-1]:g}"
        full = not one.differs(row.outcomes[-1])  # more does no more: the way is all in the play
        if labelled and not acting and not row.rests and not full:
            yield f"{names}: labels {one.severity[-1]:g} and {other.severity[-1]:g} act alike"


def lasting(cell: Cell) -> Iterator[str]:
    """Faults that, once gone, leave the actuator elsewhere than the healthy one."""
    first = cell.scenario().seconds
    whole = max(SWING_S, first)
    profile = {
        "kind": "intermittent",
        "start": ONSET * whole,
        "period": 10.0 * whole,
        "duty": 0.1 * (CLEARED - ONSET),
    }
    asked = [
        Variant(
            f"{kind}@{place}", faults=(fault(kind, place, record, 0.61 * severe(record), profile),)
        )
        for kind, place, record in cell.faults()
    ]
    asked = [variant for variant in asked if not cell.refused(variant)]
    healthy, *broken = cell.run([Variant(), *asked], whole)
    for variant, outcome in zip(asked, broken, strict=True):
        if outcome.status != "ok" or _latched(outcome):
            continue
        way, right = outcome.signals["user_position"], healthy.signals["user_position"]
        late = healthy.time > LOOKED * whole
        off = float(np.max(np.abs(way - right)[late])) / max(float(np.ptp(right)), 1e-12)
        if off > FORGOTTEN:
            late_s = (LOOKED - CLEARED) * whole
            yield f"{variant.name}: {100 * off:.1f} % of the way off {late_s:g} s after it is gone"


def _latched(outcome: Outcome) -> bool:
    """A drive or control unit that has stopped for good says so in a signal of its own."""
    return any(
        bool(outcome.signals[name][-1])
        for name in ("tripped", "fault_code")
        if name in outcome.signals
    )


def apart(name: str, choices: tuple[tuple[str, str], ...], push: float) -> Iterator[str]:
    """Faults that both models carry and in which they part: sign, or a factor of 1.5."""
    high, low = (Cell(name, fidelity, choices, push) for fidelity in ("high", "low"))
    healthy, found = rows(high, FEW)
    healthy_low, found_low = rows(low, FEW)
    lows = {row.name: row for row in found_low if not row.rests}
    other = high.run([Variant(values=_other_step(high))])[0]
    before, before_low = features(healthy), features(healthy_low)
    floors = {key: abs(value - before[key]) for key, value in features(other).items()}
    for row in found:
        if row.name not in lows or row.rests:
            continue
        broken, broken_low = row.outcomes[-1], lows[row.name].outcomes[-1]
        if broken.status != broken_low.status:
            yield f"{row.name}: high ends as {broken.status}, low as {broken_low.status}"
            continue
        if broken.status != "ok":
            continue
        after, after_low = features(broken), features(broken_low)
        for key in before.keys() & before_low.keys():
            change, change_low = after[key] - before[key], after_low[key] - before_low[key]
            if abs(change) <= max(FLOORS * floors[key], SEEN * abs(before[key])):
                continue
            ratio = change_low / change
            if not 1.0 / FACTOR <= ratio <= FACTOR:
                yield f"{row.name}: {key} {change:+.3g} high, {change_low:+.3g} low ({ratio:.2f})"


def features(outcome: Outcome) -> dict[str, float]:
    """The mean size of each mechanical signal and of the torque current, over the whole run."""
    wanted = ("user_position", "motor_speed", "motor_torque", "current_q", "current_mean")
    return {
        name: float(np.mean(np.abs(outcome.signals[name])))
        for name in wanted
        if name in outcome.signals
    }


def _other_step(cell: Cell) -> dict[str, float]:
    return {"solver.step": 0.5 * cell.actuator().parameters.value("solver.step")}


__all__ = ["FEW", "PARTS", "apart", "cells", "lasting", "rows", "wrong"]
