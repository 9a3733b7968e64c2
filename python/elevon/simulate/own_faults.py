"""The fault catalogue of one actuator: what can act in it, in the ranges that it has."""

from __future__ import annotations

import dataclasses
import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.faults import FaultRecord, catalogue
from elevon.parameters import records
from elevon.parameters.records import positions, wirings

DRIVE = "drive.kind"


@dataclass(frozen=True)
class Resting:
    """A place of a fault, a fidelity and a drive ("" where there is no choice) in which it rests.

    `reason` is the record's own where the fidelity declines the fault.
    """

    place: str
    fidelity: str
    drive: str
    reason: str


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


def drive_kinds(actuator: Actuator) -> tuple[str, ...]:
    """Return the drives that an actuator can choose between; one without a name if none."""
    record = records(actuator.wiring).get(DRIVE)
    return (record.choices if record else None) or ("",)


def resting(actuator: Actuator, record: FaultRecord) -> list[Resting]:
    """Return where a fault has no effect: fidelities and drives, each with its reason.

    Parameters
    ----------
    actuator : Actuator
        With its own choices of everything but the drive.
    record : FaultRecord
        One of its own (`own_faults`).
    """
    cells = itertools.product(record.places, drive_kinds(actuator))
    places = []
    for place, drive in cells:
        vector = _with_drive(actuator, drive)
        for fidelity in wirings()[actuator.wiring]["fidelities"]:
            reason = record.not_modelled.get(fidelity) or _idle(
                actuator.wiring, fidelity, vector, record, place
            )
            if reason:
                places.append(Resting(place, fidelity, drive, reason))
    return places


def _with_drive(actuator: Actuator, drive: str) -> npt.NDArray[np.float64]:
    vector = actuator.parameters.vector().copy()
    if drive:
        record = records(actuator.wiring)[DRIVE]
        vector[positions(actuator.wiring)[DRIVE]] = record.number(drive)
    return vector


def _acts(actuator: Actuator, record: FaultRecord, place: str) -> bool:
    """Whether a fault moves anything at its place, at any fidelity that carries it."""
    vector = actuator.parameters.vector()
    return any(
        not _idle(actuator.wiring, fidelity, vector, record, place)
        for fidelity in record.fidelities
    )


def _idle(
    wiring: str,
    fidelity: str,
    vector: npt.NDArray[np.float64],
    record: FaultRecord,
    place: str,
) -> str:
    """Why a fault moves nothing at its place; empty when it does."""
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
    rows = _core.not_acting(wiring, fidelity, vector, [given], list(targets))
    reasons = {row["path"]: row["reason"] for row in rows}
    return reasons[targets[0]] if all(path in reasons for path in targets) else ""


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
