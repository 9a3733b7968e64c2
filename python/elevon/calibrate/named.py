"""Where an estimated number goes: path, unit, register and old value, from the core's records."""

from __future__ import annotations

from dataclasses import replace

from elevon.actuator import Actuator
from elevon.data import packaged_toml
from elevon.estimate import Estimate
from elevon.parameters.records import records


def named(
    number: Estimate,
    path: str,
    actuator: Actuator,
    note: str | None = None,
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
        As in `Estimate`; of what no actuator file holds by default those of ``derived.toml``.
    in_set : bool, optional
        Whether the actuator file takes it; default: where it has a place for it.
    """
    record = records(actuator.wiring).get(path)
    has_place, old = record is not None, None
    if record is not None:
        unit, register, old = record.unit, record.register, actuator.parameters.value(path)
        number = number.within(low=record.minimum)
    elif about := packaged_toml("elevon.calibrate", "derived.toml").get(path.partition("[")[0]):
        unit, register = unit or about["unit"], about.get("register", register)
        note = about["note"] if note is None and source == "signals" else note
    return replace(
        number, path=path, unit=unit, register=register, old=old, source=source, given=given,
        note=note or "", in_set=has_place if in_set is None else in_set,
    )  # fmt: skip
