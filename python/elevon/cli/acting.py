"""Where a record of the core acts: what `list` and `show` choose by and print."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Protocol

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.faults import FaultRecord


class Acting(Protocol):
    """A parameter's or a fault's record."""

    @property
    def fidelities(self) -> tuple[str, ...]:
        """Those that carry it."""
        ...

    @property
    def not_modelled(self) -> Mapping[str, str]:
        """Why the others do not."""
        ...


def check(fidelity: str | None, wirings: Sequence[str]) -> None:
    """Raise `UnknownNameError` for a fidelity that a wiring has not; None requests none."""
    from elevon.simulate import check_fidelity

    for wiring in wirings if fidelity is not None else ():
        check_fidelity(wiring, str(fidelity))


def chosen(record: Acting, fidelity: str | None, not_modelled: bool) -> bool:
    """Whether `--fidelity` and `--not-modelled` leave a record in the list."""
    if not_modelled:
        return bool(record.not_modelled) if fidelity is None else fidelity in record.not_modelled
    return fidelity is None or fidelity in record.fidelities


def by_drive(actuator: Actuator, record: FaultRecord) -> dict[str, object]:
    """Drives under which a fault of an actuator acts, and where it rests with the reasons."""
    from elevon.simulate.acting import drive_kinds, resting

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
        "acts": " ".join(_words(fidelity, names) for fidelity, names in acting.items() if names),
    }


def _words(fidelity: str, drives: Sequence[str]) -> str:
    named = " ".join(name for name in drives if name)
    return f"{fidelity} ({named})" if named else fidelity
