"""Every fault of an actuator's catalogue that its reduced-order model has, as a candidate."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

from elevon.diagnose.engine.candidates import CandidateFault
from elevon.errors import unknown

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.faults import FaultRecord

#: Largest severity considered where the catalogue's own is larger or none, by unit. ASSUMED: what a
#: unit of this size runs with at all; shares and counts are given by the catalogue.
_MOST = {"m": 0.002, "rad": 0.3, "N": 5000.0, "kg m2": 4e-4, "A": 2.0, "N m": 1.0}
_SHARE = 2.0  # of a share that the catalogue lets grow without bound
_RATE = 1e-5  # per hour, ASSUMED alike for all
_ERROR = 0.1  # of a shift, ASSUMED


def candidates_of(
    actuator: Actuator, texts: Sequence[str] | None = None
) -> tuple[CandidateFault, ...]:
    """Return the candidates, one for places that differ by a phase only.

    Parameters
    ----------
    actuator : Actuator
        Its wiring's catalogue counts.
    texts : sequence of str, optional
        ``KIND@PLACE`` of those wanted; default: all.

    Raises
    ------
    UnknownNameError
        None of that name is in the reduced-order model.
    """
    from elevon.faults import catalogue

    out = []
    switched = switched_of(actuator)
    whole = counted_of(actuator) | switched
    for record in catalogue(actuator.wiring):
        if "low" in record.fidelities:
            made = [_candidate(record, group) for group in _groups(record.places)]
            made = [replace(c, high=1.0) if c.kind in whole else c for c in made]
            out += [replace(c, switched=c.kind in switched) for c in made]
    if not texts:
        return tuple(out)
    known = {f"{c.kind}@{place}": c for c in out for place in (c.place, *c.same)}
    for text in texts:
        if text.strip() not in known:
            raise unknown("fault", text.strip(), known, "--fault")
    wanted = {id(known[text.strip()]) for text in texts}
    return tuple(c for c in out if id(c) in wanted)


def not_modelled_of(actuator: Actuator) -> list[dict[str, str]]:
    """Return the faults that the reduced-order model has not, with its reason."""
    from elevon.faults import catalogue

    return [
        {"kind": record.kind, "place": place, "reason": f"reduced-order model: {reason}"}
        for record in catalogue(actuator.wiring)
        if "low" not in record.fidelities
        for place in record.places
        for reason in [record.not_modelled.get("low", "does not have it")]
    ]


def counted_of(actuator: Actuator) -> frozenset[str]:
    """Return the kinds whose severity is a whole number; one is compared with none."""
    return frozenset(item["kind"] for item in _records(actuator.wiring) if item["whole"])


def switched_of(actuator: Actuator) -> frozenset[str]:
    """Return the kinds that are there or not: they act from a severity of one half on."""
    records = _records(actuator.wiring)
    return frozenset(item["kind"] for item in records if item["effect"].startswith("1: "))


@lru_cache(maxsize=8)
def _records(wiring: str) -> tuple[dict[str, Any], ...]:
    """The core's catalogue, which does not change."""
    from elevon import _core

    return tuple(_core.faults(wiring))


def _groups(places: Sequence[str]) -> list[tuple[str, ...]]:
    """Places that differ in the letter of a phase stand together."""
    groups: dict[str, list[str]] = {}
    for place in places:
        stem = place[:-1] if place.endswith(("_a", "_b", "_c")) else place
        groups.setdefault(stem, []).append(place)
    return [tuple(group) for group in groups.values()]


def _candidate(record: FaultRecord, places: tuple[str, ...]) -> CandidateFault:
    unit = record.unit or "1"
    most = _MOST.get(unit, _SHARE)
    top = record.maximum if math.isfinite(record.maximum) else most
    high = 0.95 * top if unit == "1" and top <= 1.0 else min(top, most)
    low = max(record.minimum, -0.5 if unit == "1" else -most) if record.minimum < 0.0 else 0.0
    return CandidateFault(record.kind, places[0], unit, low, high, _RATE, _ERROR, places[1:])
