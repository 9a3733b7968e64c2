"""What must hold of the faults of a cell; each function returns what does not, named."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from tests.contract import shipped
from tests.contract.cells import Cell, Outcome, Variant, drives, fault, load, severe

#: Parts of the severe severity: none, a trace, two away from whole counts so that rounding shows,
#: all.
PARTS = (0.0, 0.0023, 0.23, 0.61, 1.0)
FEW = (0.0, 1.0)

#: A fault is there from a twentieth to three twentieths of the run; it should be forgotten in its
#: last tenth: within three quarters of the run, 1.5 s of a swing, or in the time of `recovery`.
ONSET, CLEARED, LOOKED = 0.05, 0.15, 0.9
SWING_S = 2.0
#: Largest distance from the healthy way then, of its range: what relays in another phase make.
FORGOTTEN = 0.02


def cells(*, every: bool) -> list[Cell]:
    """One drive and no load; or every drive, each with no load, an opposing and an aiding one."""
    return [
        Cell(name, fidelity, choices, push)
        for name in shipped.names()
        for fidelity in shipped.fidelities(name)
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
    #: The severity is a count or switches something: its label says how much acts.
    counts: bool


@cache
def rows(cell: Cell, parts: tuple[float, ...]) -> tuple[Outcome, tuple[Row, ...]]:
    """The healthy outcome, and every fault at each part of its severe severity."""
    tried = [
        [
            Variant(
                f"{kind}@{place}={part}",
                faults=(fault(kind, place, record, part * severe(record)),),
            )
            for part in parts
        ]
        for kind, place, record in cell.faults()
    ]
    tried = [variants for variants in tried if not any(map(cell.refused, variants))]
    counted = {
        f"{kind}@{place}": record["whole"] or "1: " in record["effect"]
        for kind, place, record in cell.faults()
    }
    flat = [variant for variants in tried for variant in variants]
    healthy, *broken = cell.run([Variant(), *flat])
    size = len(parts)
    found = [
        Row(
            variants[0].name.rpartition("=")[0],
            tuple(variants),
            tuple(broken[i * size : (i + 1) * size]),
            bool(cell.resting(variants[-1])),
            counted[variants[0].name.rpartition("=")[0]],
        )
        for i, variants in enumerate(tried)
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
            yield f"{row.name}: is reported to have no effect, yet changes {changed}"
        yield from _labels(row)


def silent(cells: Sequence[Cell], parts: tuple[float, ...]) -> Iterator[str]:
    """Faults that change nothing in any of some cells, the same drive under its loads.

    What shows only in an event (a lock, a stop) need not show where a load keeps that away.
    """
    effects: dict[str, bool] = {}
    for cell in cells:
        healthy, found = rows(cell, parts)
        for row in found:
            shows = row.rests or bool(row.outcomes[-1].differs(healthy))
            effects[row.name] = effects.get(row.name, False) or shows
    yield from (
        f"{name}: changes nothing, and nothing says so"
        for name, shows in effects.items()
        if not shows
    )


def of_one_drive(cells: Sequence[Cell]) -> list[list[Cell]]:
    """Cells that differ in their load only."""
    groups: dict[tuple[Any, ...], list[Cell]] = {}
    for cell in cells:
        groups.setdefault((cell.name, cell.fidelity, cell.choices), []).append(cell)
    return list(groups.values())


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
        full = not one.differs(
            row.outcomes[-1]
        )  # more does no more: the way is all in the backlash
        # A gap that closes without touching yet is there, though nothing feels it.
        unfelt = not row.counts and not other.differs(row.outcomes[0])
        if labelled and not acting and not row.rests and not full and not unfelt:
            yield f"{names}: labels {one.severity[-1]:g} and {other.severity[-1]:g} act alike"


def lasting(cell: Cell) -> Iterator[str]:
    """Faults that, once gone, leave the actuator elsewhere than the healthy one.

    Those that have not gone after the common run get the time that `recovery` states.
    """
    whole = max(SWING_S, cell.scenario().seconds)
    profile = {
        "kind": "intermittent",
        "start": ONSET * whole,
        "period": 100.0 * whole,
        "duty": 0.01 * (CLEARED - ONSET),
    }
    tried = [
        Variant(
            f"{kind}@{place}", faults=(fault(kind, place, record, 0.61 * severe(record), profile),)
        )
        for kind, place, record in cell.faults()
    ]
    tried = [variant for variant in tried if not cell.refused(variant)]
    for variant, outcome, healthy in _pairs(cell, tried, whole):
        if _distance(outcome, healthy) <= FORGOTTEN:
            continue
        stated = recovery(cell, outcome, healthy)
        longer = (CLEARED * whole + stated) / LOOKED
        ((_, late, right),) = _pairs(cell, [variant], longer)
        off = _distance(late, right)
        if off > FORGOTTEN:
            # A run with such a fault may have other equations at low: their way without it counts.
            (same,) = cell.run([_later(variant, 2.0 * longer)], longer)
            off = _distance(late, same)
        if off > FORGOTTEN:
            yield f"{variant.name}: {100 * off:.1f} % of the way off {stated:.2g} s after its end"


def _later(variant: Variant, time: float) -> Variant:
    """The same fault coming only at a time (s): until then it only chooses the equations."""
    (whole,) = variant.faults
    coming = {**whole, "profile": {"kind": "step", "time": time}}
    return Variant(f"later {variant.name}", variant.values, (coming,))


def _pairs(
    cell: Cell, variants: Sequence[Variant], duration: float
) -> Iterator[tuple[Variant, Outcome, Outcome]]:
    """Yield each variant that ended well and may move on, its outcome and the healthy one."""
    healthy, *broken = cell.run([Variant(), *variants], duration)
    for variant, outcome in zip(variants, broken, strict=True):
        if outcome.status == "ok" and not _latched(outcome):
            yield variant, outcome, healthy


def _distance(outcome: Outcome, healthy: Outcome) -> float:
    """Largest distance of the output's way from the healthy one late in a run, of its range."""
    way, right = outcome.signals["output_position"], healthy.signals["output_position"]
    late = healthy.time > LOOKED * healthy.time[-1]
    return float(np.max(np.abs(way - right)[late])) / max(float(np.ptp(right)), 1e-12)


def recovery(cell: Cell, outcome: Outcome, healthy: Outcome) -> float:
    """The time in which a servo forgets a fault, s: back at its speed limit, then its slowest pole.

    T = d / v + ln(d / d_end) / sigma with the largest distance d of the run, the output speed limit
    v, and the slowest pole sigma of the position loop (G) around the speed PID,
    J' s^3 + K_p s^2 + (K_p G + K_i) s + K_i G, J' = J + K_p T_d.
    """
    actuator = cell.actuator()
    if "control.position_gain" not in actuator.parameters:
        return (LOOKED - CLEARED) * float(healthy.time[-1])
    value = actuator.parameters.value
    gain, position = value("control.speed_gain"), value("control.position_gain")
    integral = gain / value("control.integral_time") if value("control.integral_time") else 0.0
    inertia = value("motor.inertia") + gain * value("control.derivative_time")
    poles = np.roots([inertia, gain, gain * position + integral, integral * position])
    slowest = min(-pole.real for pole in poles if pole != 0.0)
    way, right = outcome.signals["output_position"], healthy.signals["output_position"]
    moving = np.max(np.abs(outcome.signals["motor_speed"]))
    ratio = moving / np.max(np.abs(outcome.signals["output_speed"]))
    largest = float(np.max(np.abs(way - right)))
    back = largest * ratio / value("control.speed_limit")
    return float(back + np.log(largest / (FORGOTTEN * np.ptp(right))) / slowest)


def _latched(outcome: Outcome) -> bool:
    """A drive or control unit that has stopped for good says so in a signal of its own."""
    return any(
        bool(outcome.signals[name][-1])
        for name in ("tripped", "fault_code")
        if name in outcome.signals
    )


__all__ = ["FEW", "PARTS", "cells", "lasting", "of_one_drive", "rows", "silent", "wrong"]
