"""What the caller has set where it has no effect: reported, never ignored."""

from __future__ import annotations

import dataclasses
import itertools
import math
import warnings
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.errors import (
    ElevonWarning,
    FindingWarning,
    InputError,
    NotActingError,
    NotActingWarning,
)
from elevon.faults import FaultRecord, catalogue, find_record
from elevon.parameters import records
from elevon.parameters.records import positions, wirings
from elevon.scenario import Scenario
from elevon.scenario.compile import CompiledScenario, compile_scenario
from elevon.units import format_quantity


@dataclass(frozen=True)
class Notice:
    """A notice about a run that can be simulated as it is.

    Attributes
    ----------
    category : type
        `NotActingWarning`, or `FindingWarning` for a finding of the core about values together.
    text : str
        Names the path or the fault, its value and the reason.
    """

    category: type[ElevonWarning]
    text: str


def check_values(actuator: Actuator, fidelity: str) -> list[Notice]:
    """Return the core's findings about the values together.

    Raises
    ------
    InputError
        The core refuses them.
    """
    findings = actuator.findings(fidelity)
    wrong = [item for item in findings if item.get("severity", "error") == "error"]
    if wrong:
        raise InputError("\n".join(str(finding["message"]) for finding in wrong))
    return [Notice(FindingWarning, str(finding["message"])) for finding in findings]


def not_acting(actuator: Actuator, compiled: CompiledScenario, fidelity: str) -> list[Notice]:
    """Return what the caller set away from neutral where it has no effect in this run.

    Raises
    ------
    NotActingError
        A fault that has none at any fidelity: the run would be called faulty, and is healthy.
    """
    if compiled.faults:
        _refuse_inert(actuator, compiled)
        return _resting(actuator, compiled, fidelity)
    # Without faults the values alone decide: of many runs with the same ones it is looked up once.
    key = ("not acting", fidelity, compiled.command_mode)
    return list(actuator.parameters.once(key, lambda: _resting(actuator, compiled, fidelity)))


def _resting(actuator: Actuator, compiled: CompiledScenario, fidelity: str) -> list[Notice]:
    notices = _reasons(actuator, compiled, fidelity)
    return [
        Notice(NotActingWarning, f"{name} has no effect: {reason}")
        for name, reason in notices.items()
        if reason
    ]


def _reasons(
    actuator: Actuator, compiled: CompiledScenario, fidelity: str, *, every: bool = False
) -> dict[str, str]:
    """Return what the caller set, each with why it has no effect; empty where it has one.

    Of the parameters those count that the run changes, not what an actuator file carries for
    another drive (`elevon check` lists that); of the faults those of a severity other than zero.
    Parameters that have an effect are there with `every` only: to write out their values costs more
    than the rest.
    """
    from elevon import _core

    changed = actuator.parameters.away()
    faults = [fault for fault in compiled.faults if fault["severity"] != 0.0]
    if not changed and not faults:
        return {}
    vector = _with_mode(actuator, compiled.command_mode)
    paths = [*changed, *(path for fault in faults for path in _touched(fault, actuator.wiring))]
    rows = _core.not_acting(actuator.wiring, fidelity, vector, compiled.faults, paths)
    idle = {item["path"]: item["reason"] for item in rows}
    reasons = {
        f"{path} = {item.text}": idle.get(path, "")
        for path, item in changed.items()
        if every or path in idle
    }
    for fault in faults:
        reasons.update(_of_fault(fault, actuator.wiring, idle))
    return reasons


def _refuse_inert(actuator: Actuator, compiled: CompiledScenario) -> None:
    """Refuse faults that change nothing with these values, whatever the fidelity."""
    vector = _with_mode(actuator, compiled.command_mode)
    for fault in compiled.faults:
        record = find_record(fault["kind"], fault["place"], actuator.wiring)
        paths = list(record.targets[fault["place"]])
        if fault["severity"] == 0.0 or not paths:
            continue
        idle: dict[str, str] = {}
        for fidelity in record.fidelities:
            idle = _idle(actuator.wiring, fidelity, vector, compiled.faults, paths)
            if not idle.keys() >= set(paths):
                break
        else:
            name = f"fault {record.kind}@{fault['place']}"
            raise NotActingError(
                f"{name} has no effect in {actuator.name}: {paths[0]}: {idle[paths[0]]}"
            )


def _idle(
    wiring: str,
    fidelity: str,
    vector: npt.NDArray[np.float64],
    faults: Sequence[Mapping[str, Any]],
    paths: Sequence[str],
) -> dict[str, str]:
    """Return which of the parameters have no effect at a fidelity, beside the faults it knows."""
    from elevon import _core

    known = [
        fault
        for fault in faults
        if fidelity in find_record(fault["kind"], fault["place"], wiring).fidelities
    ]
    rows = _core.not_acting(wiring, fidelity, vector, known, list(paths))
    return {item["path"]: item["reason"] for item in rows}


def _touched(fault: Mapping[str, Any], wiring: str) -> Iterator[str]:
    """Yield the parameters that a fault and its attributes set."""
    record = find_record(fault["kind"], fault["place"], wiring)
    yield from record.targets[fault["place"]]
    yield from (item["parameter"] for item in record.attributes if item.get("parameter"))


def _with_mode(actuator: Actuator, mode: str) -> npt.NDArray[np.float64]:
    """Return the parameters as the run uses them: the command's mode is the scenario's."""
    vector = actuator.parameters.vector()
    record = records(actuator.wiring).get("control.mode")
    if record is None or record.choices is None or mode not in record.choices:
        return vector
    vector = vector.copy()
    vector[positions(actuator.wiring)["control.mode"]] = record.number(mode)
    return vector


def _of_fault(
    fault: Mapping[str, Any], wiring: str, idle: Mapping[str, str]
) -> Iterator[tuple[str, str]]:
    """Yield a fault and the attributes given with it, each with why it has no effect."""
    record = find_record(fault["kind"], fault["place"], wiring)
    name = f"fault {fault['kind']}@{fault['place']}"
    targets = record.targets[fault["place"]]
    resting = bool(targets) and all(path in idle for path in targets)
    reason = f"{targets[0]}: {idle[targets[0]]}" if resting else ""
    yield f"{name}={format_quantity(fault['severity'], record.unit or '1')}", reason
    for item in record.attributes:
        path, neutral = item.get("parameter", ""), item["default"] or 0.0
        if not resting and fault["attributes"].get(item["name"], neutral) != neutral:
            yield f"{name}: {item['name']}", f"{path}: {idle[path]}" if path in idle else ""


def idle_values(actuator: Actuator, paths: Iterable[str]) -> dict[str, str]:
    """Return which of some values, away from neutral, act at no fidelity without faults.

    Returns
    -------
    dict
        Value as written (``pwm.frequency = 4 kHz``) to the reason.
    """
    from elevon import _core
    from elevon.parameters.records import wirings

    known, vector = records(actuator.wiring), actuator.parameters.vector()
    away = [p for p in paths if actuator.parameters[p].value != known[p].default_value()]
    idle: list[dict[str, str]] = []
    for fidelity in wirings()[actuator.wiring]["fidelities"] if away else ():
        rows = _core.not_acting(actuator.wiring, fidelity, vector, [], away)
        idle.append({item["path"]: item["reason"] for item in rows})
    return {
        f"{path} = {actuator.parameters[path].text}": idle[0][path]
        for path in away
        if all(path in reasons for reasons in idle)
    }


@contextmanager
def together(runs: Iterable[tuple[Actuator, Scenario, str]]) -> Iterator[None]:
    """Report only what has an effect in none of several runs (actuator, scenario, fidelity).

    Such runs are compared with each other: what one model alone carries concerns that one.
    """
    reasons: dict[str, list[str]] = {}
    for actuator, scenario, fidelity in runs:
        whole = actuator.with_values(scenario.parameters, place="scenario parameters")
        compiled = compile_scenario(scenario, actuator.wiring, fidelity)
        for name, reason in _reasons(whole, compiled, fidelity, every=True).items():
            reasons.setdefault(name, []).append(reason)
    resting = [f"{name} has no effect: {why[0]}" for name, why in reasons.items() if all(why)]
    report([[Notice(NotActingWarning, text) for text in resting]], strict=False, stacklevel=4)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotActingWarning)
        yield


def report(
    notices_by_run: Iterable[Sequence[Notice]], *, strict: bool, stacklevel: int = 3
) -> None:
    """Warn of every notice of a batch once, or refuse.

    Raises
    ------
    NotActingError
        `strict`, and there is a notice; all of them are in the message.
    """
    notices = dict.fromkeys(notice for run in notices_by_run for notice in run)
    if strict and notices:
        raise NotActingError("\n".join(notice.text for notice in notices))
    for notice in notices:
        warnings.warn(notice.text, notice.category, stacklevel=stacklevel)


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
            reason = record.not_modelled.get(fidelity) or _changes_nothing(
                actuator.wiring, fidelity, vector, record, place
            )
            if reason:
                places.append(Resting(place, fidelity, drive, reason))
    return places


def by_drive(actuator: Actuator, record: FaultRecord) -> dict[str, object]:
    """Return the drives under which a fault of an actuator acts, and where it rests and why.

    Parameters
    ----------
    actuator, record
        As `resting`.
    """
    neutral = resting(actuator, record)
    drives = drive_kinds(actuator)
    idle = {(item.fidelity, item.drive, item.place) for item in neutral}
    acting = {
        fidelity: [
            drive
            for drive in drives
            if any((fidelity, drive, place) not in idle for place in record.places)
        ]
        for fidelity in record.fidelities
    }
    return {
        "drives": {
            fidelity: [name for name in names if name] for fidelity, names in acting.items()
        },
        "resting": [vars(item) for item in neutral],
        "acts": " ".join(
            _drive_text(fidelity, names) for fidelity, names in acting.items() if names
        ),
    }


def _drive_text(fidelity: str, drives: Sequence[str]) -> str:
    named = " ".join(name for name in drives if name)
    return f"{fidelity} ({named})" if named else fidelity


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
        not _changes_nothing(actuator.wiring, fidelity, vector, record, place)
        for fidelity in record.fidelities
    )


def _changes_nothing(
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
