"""What an inspection reports of the severities, as the filters take it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.diagnose.engine.answer import FaultPlace
from elevon.diagnose.engine.candidates import CANDIDATES, CandidateFault
from elevon.errors import InputError, quoted, unknown
from elevon.plain import Plain
from elevon.prognose.requirement import SEVERITY
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.prognose.law import Law
    from elevon.prognose.response import ResponseTables


@dataclass(frozen=True)
class Measured:
    """What a unit showed of a requirement, in the mission or the requirement's own scenario.

    Attributes
    ----------
    value : float
        SI.
    deviation : float
        Of it, the day's (temperature, friction) included: life ends on an average day.
    """

    value: float
    deviation: float


def read_measured(data: object, units: Mapping[str, str], place: str) -> dict[str, Measured]:
    """Read ``{NAME: {"value": ..., "deviation": ...}}``: numbers in SI, or texts with a unit.

    Parameters
    ----------
    data : object
        As it stands in the file.
    units : mapping of str to str
        Requirements of the mission, and the SI unit of each.
    place : str
        The file.

    Raises
    ------
    InputError
        It has another form, no such requirement, a deviation that is not above 0.
    """
    if not isinstance(data, dict):
        raise InputError(f"{place}: measured = {quoted(str(data))} is not a requirement's values")
    out = {}
    for name, given in data.items():
        if name not in units:
            raise unknown("requirement", name, units, f"{place}: measured")
        where = f"{place}: measured {name}"
        if not isinstance(given, dict) or given.keys() != {"value", "deviation"}:
            raise InputError(f"{where}: {quoted(str(given))} has not just a value and a deviation")
        value, deviation = (
            parse_quantity(given[key], units[name], f"{where}: {key}")
            for key in ("value", "deviation")
        )
        if not deviation > 0.0:
            raise InputError(f"{where}: deviation = {given['deviation']} must be above 0")
        out[name] = Measured(value, deviation)
    return out


def governing(response: ResponseTables, name: str) -> tuple[int, int]:
    """Return which requirement has a name, and which law moves its reserve most over its range.

    Raises
    ------
    InputError
        There is none of that name, or it is a bare limit on a fault, which diagnosis measures.
    """
    names = [item.name for item in response.requirements]
    if name not in names:
        raise unknown("requirement", name, names, "measured")
    k = names.index(name)
    if response.requirements[k].measure == SEVERITY:
        raise InputError(f"measured {name}: is a limit on a fault's severity: give a diagnosis")
    new = np.array([law.severity(np.array([law.start]))[0] for law in response.laws])
    worn = new + np.diag([law.highest for law in response.laws])
    drop = response.reserve(new[None, :])[k, 0] - response.reserve(worn)[k]
    return k, int(np.argmax(np.abs(drop)))


SIGMAS = 1.6449  # of a 90 % interval's half width
DETECTED = 3.0  # deviations at which a severity counts as seen
_AT_EDGE = 0.98
_LEAST = 0.005  # of the severity: no diagnosis is believed to be better; ASSUMED


#: What all diagnoses of a unit's fault err by alike, by kind: deviation relative to the severity,
#: and absolute [the fault's unit]. Baselines and model are the same at each inspection, so that
#: this part of the error does not average out. Measured (docs/explanation/prognosis.md); a short's
#: is the model's own, of either sign along the range.
COMMON: Mapping[str, tuple[float, float]] = {
    "backlash": (0.005, 0.0),
    "friction": (0.01, 0.02),
    "short": (0.01, 0.015),
}
_COMMON = (0.01, 0.0)  # of other faults; ASSUMED


@dataclass(frozen=True)
class Seen:
    """What is reported of one fault.

    Attributes
    ----------
    severity : float or None
        Median [the fault's unit]; None where the fault was not seen.
    low, high : float
        Deviations below and above it; of a fault not seen both are a third of what was detectable.
    common : float
        Deviation of what this and all other diagnoses of the unit's fault err by alike, from one
        and the same baselines and model; beside `low` and `high`.
    probability : float
        Of a sighting: that the fault is there, as the diagnosis states it.
    detectable : float
        Severity that every other inspection sees; 0: not stated.
    """

    severity: float | None
    low: float
    high: float
    common: float = 0.0
    probability: float = 1.0
    detectable: float = 0.0

    @property
    def limit(self) -> float:
        """The detection limit; of a fault that was not seen, at least what its deviation says."""
        if self.detectable > 0.0 or self.severity is not None:
            return self.detectable
        return DETECTED * self.high


@dataclass(frozen=True)
class Inspection:
    """One inspection.

    Attributes
    ----------
    usage : float
        Use up to it, in the mission's unit.
    seen : mapping of str to Seen
        ``KIND@PLACE`` to what is reported; a fault that is not in it was not looked for.
    reset : tuple of str
        Faults whose part was made new after the inspection.
    name : str
        Of its file.
    date : str
        ISO date, or empty.
    measured : mapping of str to Measured
        Requirements' own values, by name.
    """

    usage: float
    seen: Mapping[str, Seen]
    reset: tuple[str, ...] = ()
    name: str = ""
    date: str = ""
    measured: Mapping[str, Measured] = field(default_factory=dict)


def inspection(
    data: Mapping[str, object],
    laws: Sequence[Law],
    *,
    usage: float,
    name: str = "",
    date: str = "",
    reset: Sequence[str] = (),
    measured: Mapping[str, Measured] | None = None,
    candidates: Sequence[CandidateFault] = CANDIDATES,
) -> Inspection:
    """Build an inspection from a diagnosis.

    Parameters
    ----------
    data : mapping
        The JSON object of ``elevon diagnose``: its ``faults`` and ``detectable`` are used.
    laws : sequence of Law
        Whose faults matter.
    usage, name, date, reset, measured
        As in `Inspection`.
    candidates : sequence of CandidateFault
        What diagnosis looks for, and how far; default: a turning servo's.

    Raises
    ------
    InputError
        What should be numbers is not.
    """
    seen = {}
    for law in laws:
        cause = _cause(data, law, name)
        limit = _detectable(data, law, name)
        if cause is not None:
            read = _read(cause, law, limit, _edge(law, candidates), f"{name}: {law.key}")
        elif limit is not None:
            read = Seen(None, limit / DETECTED, limit / DETECTED, detectable=limit)
        else:
            continue
        seen[law.key] = replace(read, common=_common(law.kind, read.severity or 0.0))
    return Inspection(usage, seen, tuple(reset), name, date, measured or {})


@dataclass(frozen=True)
class _Cause(Plain):
    """What a diagnosis writes of a cause; without `unit` it is the law's."""

    kind: str
    place: str
    probability: float
    severity: float
    interval: tuple[float, float]
    unit: str = ""
    ambiguous_with: tuple[FaultPlace, ...] = ()


def _common(kind: str, severity: float) -> float:
    relative, absolute = COMMON.get(kind, _COMMON)
    return float(np.hypot(relative * severity, absolute))


def _cause(data: Mapping[str, Any], law: Law, place: str) -> _Cause | None:
    """Return the likeliest cause that is the law's fault, also by a place it is ambiguous with."""
    given = data.get("faults", [])
    if not isinstance(given, list):
        raise InputError(f"{place}: faults = {given!r} is not a list of causes")
    causes = []
    for k, item in enumerate(given):
        cause = _Cause.from_dict(item, f"{place}: faults[{k}]")
        if not 0.0 <= cause.probability <= 1.0:
            raise InputError(
                f"{place}: faults[{k}]: probability = {cause.probability:g} is outside 0 to 1"
            )
        names = (FaultPlace(cause.kind, cause.place), *cause.ambiguous_with)
        if (law.kind, law.place) in names:
            causes.append(cause)
    return max(causes, key=lambda cause: cause.probability, default=None)


def _detectable(data: Mapping[str, Any], law: Law, place: str) -> float | None:
    known = data.get("detectable", {})
    if not isinstance(known, dict):
        raise InputError(f"{place}: detectable = {known!r} is not KIND@PLACE with a severity each")
    kin = [key for key in known if key.partition("@")[0] == law.kind]
    name = law.key if law.key in known else kin[0] if len(kin) == 1 else None
    if name is None:
        return None
    try:
        limit = float(known[name])
    except (TypeError, ValueError, OverflowError):
        limit = float("nan")
    if not 0.0 < limit < np.inf:
        raise InputError(f"{place}: detectable {name} = {known[name]!r} is no number above 0")
    return limit


def _edge(law: Law, candidates: Sequence[CandidateFault]) -> float:
    """Return the greatest severity that diagnosis looks at, in the law's unit; none: infinite."""
    edges = (c.high for c in candidates if c.kind == law.kind and c.unit == law.unit)
    return max(edges, default=np.inf)


@lru_cache(maxsize=64)
def _range(kind: str, place: str, unit: str) -> tuple[float, float]:
    """Return the severities that a fault can have by the catalogues of all actuators."""
    from elevon.faults import catalogue
    from elevon.parameters.records import wiring_names

    records = [
        item
        for wiring in wiring_names()
        for item in catalogue(wiring)
        if item.kind == kind and place in item.places and item.unit == unit
    ]
    if not records:
        return -np.inf, np.inf
    return min(item.minimum for item in records), max(item.maximum for item in records)


def _read(cause: _Cause, law: Law, limit: float | None, edge: float, place: str) -> Seen:
    severity, low, high = _numbers(cause, law, place)
    if not low <= severity <= high:
        raise InputError(f"{place}: severity {severity:g} is not within {low:g} to {high:g}")
    least, most = _range(law.kind, law.place, law.unit)
    if not least <= severity <= most:
        raise InputError(
            f"{place}: severity {severity:g} {law.unit} is outside {least:g} to {most:g}"
        )
    if high >= _AT_EDGE * edge:  # it may be more than is looked at
        high = max(high, severity) + 4.0 * abs(severity)
    floor = _LEAST * max(abs(severity), limit or 0.0) or 1e-9
    return Seen(
        severity,
        max((severity - low) / SIGMAS, floor),
        max((high - severity) / SIGMAS, floor),
        probability=cause.probability,
        detectable=limit or 0.0,
    )


def _numbers(cause: _Cause, law: Law, place: str) -> list[float]:
    """Return severity and interval in the law's unit: the cause may state another of its kind."""
    given = [cause.severity, *cause.interval]
    if not np.isfinite(given).all():
        raise InputError(f"{place}: severity and interval are not numbers")
    if cause.unit in {"", law.unit}:
        return given
    return [
        parse_quantity(f"{value!r} {cause.unit}", law.unit, f"{place}: unit") for value in given
    ]
