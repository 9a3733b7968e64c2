"""A requirement's own value, measured at an inspection: beside what diagnosis says of faults."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elevon.errors import InputError, quoted, unknown
from elevon.prognose.requirement import SEVERITY
from elevon.units import parse_quantity

if TYPE_CHECKING:
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
