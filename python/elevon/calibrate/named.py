"""Where an estimated number goes: path, unit, register and old value, from the core's records."""

from __future__ import annotations

from dataclasses import replace

from elevon.actuator import Actuator
from elevon.estimate import Estimate
from elevon.parameters.records import record_of, records


def named(
    number: Estimate,
    path: str,
    actuator: Actuator,
    note: str = "",
    *,
    given: tuple[str, ...] = (),
    source: str = "signals",
    unit: str = "",
    register: str = "plant",
    in_set: bool | None = None,
) -> Estimate:
    """Return a number with its place.

    Parameters
    ----------
    number : Estimate
        Value, deviation, degrees of freedom.
    path : str
        A parameter of the actuator: unit, register and old value are its own; or a name for what no
        actuator file holds.
    actuator : Actuator
        Values before.
    note, given, source, unit, register
        As in `Estimate`.
    in_set : bool, optional
        Whether the actuator file takes it; default: where it has a place for it.
    """
    has_place = path in records(actuator.wiring)
    old = actuator.parameters.value(path) if has_place else None
    if has_place:
        record = record_of(actuator.wiring, path)
        unit, register = record.unit, record.register
        number = number.within(low=record.minimum)
    return replace(
        number, path=path, unit=unit, register=register, old=old, source=source, given=given,
        note=note, in_set=has_place if in_set is None else in_set,
    )  # fmt: skip
