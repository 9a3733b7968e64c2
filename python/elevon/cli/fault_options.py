"""Faults of the command line: each with the unit its severity needs, and said as it is read."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from elevon.cli.output import say
from elevon.errors import UnitError
from elevon.units import display_unit, format_quantity, split_quantity

if TYPE_CHECKING:
    from elevon.faults import Fault, FaultRecord


def read_faults(texts: Sequence[str] | None, wiring: str) -> list[Fault]:
    """Read ``--fault`` options; each is said as it was read.

    Raises
    ------
    UnitError
        A severity without a unit where the fault has one: 0.5 could be degrees or radians.
    InputError
        The text does not follow the grammar; a kind, place or severity that cannot be.
    """
    from elevon.faults import Fault, find_record

    faults = [Fault.parse(text) for text in texts or ()]
    for fault in faults:
        record = find_record(fault.kind, fault.place, wiring, "--fault")
        name = f"--fault {fault.kind}@{fault.place}"
        parts = split_quantity(str(fault.severity))
        unit = record.unit or "1"
        if unit != "1" and parts is not None and not parts[1] and float(parts[0]) != 0.0:
            display = display_unit(unit)
            raise UnitError(
                f"{name}: {parts[0]} has no unit; write '{parts[0]} {display}'"
                + (f" or '{parts[0]} {unit}'" if display != unit else "")
                + f" ({record.effect})"
            )
        say(f"fault {fault.kind}@{fault.place}: {_in_words(record, fault, name)}")
    return faults


def _in_words(record: FaultRecord, fault: Fault, name: str) -> str:
    """Write a severity as a person reads it: a share in percent, a growth with its sign."""
    value = record.read_severity(fault.severity, name)
    unit = record.unit or "1"
    if unit != "1":
        return format_quantity(value, display_unit(unit))
    if record.switched:
        return f"{value:g}"
    return f"{100.0 * value:{'+' if record.maximum > 1.0 else ''}.6g} %"
