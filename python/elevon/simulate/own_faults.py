"""The fault catalogue of one actuator: what can act in it, in the ranges that it has."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

from elevon.actuator import Actuator
from elevon.faults import FaultRecord, catalogue

__all__ = ["own_faults"]


def own_faults(actuator: Actuator) -> list[FaultRecord]:
    """Return the catalogue as it is for an actuator, not only for its wiring.

    A place is left out where the fault changes no signal of this actuator at either fidelity (a
    sensor that nothing reads); a range ends where a whole severity becomes impossible (more
    blocked circuits than the nut has).

    Parameters
    ----------
    actuator : Actuator
        With the drive, control mode and sensors of its own scenario.
    """
    records = []
    for record in catalogue(actuator.wiring):
        places = tuple(place for place in record.places if _acts(actuator, record, place))
        if places:
            maximum = _largest(actuator, record)
            records.append(dataclasses.replace(record, places=places, maximum=maximum))
    return records


def _acts(actuator: Actuator, record: FaultRecord, place: str) -> bool:
    """Whether a fault moves anything at its place, at any fidelity that carries it."""
    from elevon import _core

    severity = record.maximum if math.isfinite(record.maximum) else 1.0
    given: dict[str, Any] = {
        "kind": record.kind,
        "place": place,
        "severity": severity,
        "attributes": {},
        "profile": {"kind": "constant", "parameters": [], "times": [], "values": []},
    }
    targets = record.targets[place]
    for fidelity in record.fidelities:
        rows = _core.not_acting(actuator.wiring, fidelity, actuator.parameters.vector(), [given])
        if not all(path in {row["path"] for row in rows} for path in targets):
            return True
    return False


def _largest(actuator: Actuator, record: FaultRecord) -> float:
    """Return the largest severity that the actuator's own numbers allow."""
    from elevon import _core

    paths = {path for place in record.places for path in record.targets[place]}
    if not math.isfinite(record.maximum):
        return record.maximum
    order = [item["path"] for item in _core.parameters(actuator.wiring)]
    vector = actuator.parameters.vector().copy()
    for path in paths:
        vector[order.index(path)] = record.maximum
    findings = _core.check(actuator.wiring, record.fidelities[0], vector)
    limits = [float(f["limit"]) for f in findings if f["path"] in paths]
    inside = [limit for limit in limits if record.minimum < limit < record.maximum]
    return min(inside, default=record.maximum)
