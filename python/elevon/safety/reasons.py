"""Why no sensor could tell: the failures and combinations of them that remain, by hazard."""

from __future__ import annotations

from collections.abc import Callable

from elevon.safety.gear import GearRow
from elevon.safety.hazards import Hazard
from elevon.safety.rows import Row

_LOCK_SWITCH = "proximity_on@sensor.proximity_100"
_WHEELS_SWITCH = "proximity_off@sensor.weight_on_wheels"
_ORDER = {"proximity_on@sensor.proximity_75", "proximity_on@sensor.proximity_25"}
_HANGS = {
    "jam", "friction_growth", "efficiency_loss", "lock_spring_weak", "lock_not_engaging",
    "release_cable_failed",
}  # fmt: skip


def _names(row: Row) -> set[str]:
    return {failure.name for failure in row.faults}


def _fall_without_a_lock(row: GearRow) -> bool:
    kinds = {failure.kind for failure in row.faults}
    return bool(row.times("free_fall")) and _LOCK_SWITCH in _names(row) and bool(kinds & _HANGS)


def _fall_out_of_order(row: GearRow) -> bool:
    return (
        bool(row.times("free_fall")) and _LOCK_SWITCH in _names(row) and bool(_names(row) & _ORDER)
    )


def _ground_unseen(row: GearRow) -> bool:
    """Off for good while the aircraft stands: an intermittent switch is none of it."""
    lasting = {fault.name for fault in row.faults if dict(fault.profile)["kind"] != "intermittent"}
    return bool(row.wheels) and _WHEELS_SWITCH in lasting


_REASONS: tuple[tuple[str, Callable[[GearRow], bool], str], ...] = (
    ("false locked", _fall_without_a_lock,
     "free fall: the stages are apart, the Hall count is silent; of the switches only that on the "
     "lock sleeve sees the lock, and it reads on while the leg does not reach it"),
    ("false locked", _fall_out_of_order,
     "free fall: the lock's switch and the one whose time would contradict it both read on"),
    ("retraction on wheels", _ground_unseen,
     "one switch alone sees the weight; off for good it reads as in flight, and neither the place "
     "of the leg nor its current says anything of the ground"),
)  # fmt: skip


def reason(hazard: Hazard, row: Row) -> str:
    """Return why no sensor could tell the hazard of a row; empty: it is not listed.

    Parameters
    ----------
    hazard : Hazard
        What the row shows.
    row : Row
        Failures and commands; for a catastrophic hazard a single failure is never listed.
    """
    single = hazard.severity == "catastrophic" and len(row.faults) < 2
    if single or not isinstance(row, GearRow):
        return ""
    texts = (text for name, holds, text in _REASONS if name == hazard.name and holds(row))
    return next(texts, "")
