"""One more inspection of a history: a diagnosis, with the use at which it was made."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path

from elevon.diagnose.engine.answer import Diagnosis
from elevon.errors import InputError, unknown
from elevon.files import check_output
from elevon.prognose.history import History, entries_of, write_stamp
from elevon.prognose.mission import UNITS_OF_USE

#: Answers that state no severity: written down they would read as "no fault seen".
_SILENT = ("unknown_fault", "model_does_not_fit")


@dataclass(frozen=True)
class NextEntry:
    """Where a history's next inspection goes; checked before the work that gives its diagnosis.

    Attributes
    ----------
    path : Path
        Its file.
    usage : float
        Use at it.
    unit, serial : str
        Of the use, and of the unit; the history's own.
    force : bool
        Whether an inspection at this very use is replaced.
    """

    path: Path
    usage: float
    unit: str
    serial: str = ""
    force: bool = False

    def write(self, answer: Diagnosis) -> Path:
        """Write the inspection, whole or not at all.

        Raises
        ------
        InputError
            The answer states no severity of any fault.
        """
        if answer.status in _SILENT:
            raise InputError(
                f"{self.path}: not written: the answer is {answer.status}, which states no "
                "severity; a history would read it as no fault seen"
            )
        return write_stamp(
            self.path, answer.to_dict(stored=False), usage=self.usage, unit=self.unit,
            serial=self.serial, force=self.force,
        )  # fmt: skip


def next_entry(
    history: str | os.PathLike[str], usage: float | str, actuator: str, *, force: bool = False
) -> NextEntry:
    """Return where the next inspection of a unit goes.

    Parameters
    ----------
    history : path
        Folder of inspections; made by the first one.
    usage : float or str
        Use at the inspection: ``1300``, in the unit of the history, or ``"1300 flights"``.
    actuator : str
        Name of the actuator that the unit is diagnosed with.
    force : bool
        Whether the last inspection may be replaced by one at the same use.

    Raises
    ------
    InputError
        A use that is none, or no later than the last inspection's; another unit of use, or another
        actuator than the history's; the first inspection without a unit.
    """
    folder = Path(history).expanduser()
    if folder.exists() and not folder.is_dir():
        raise InputError(f"--append {folder}: is a file; a history is a folder of inspections")
    past = entries_of(folder) if folder.is_dir() else History((), "", "")
    value, unit = _use(usage, past.unit)
    for entry in past.entries:
        known = (entry.diagnosis or {}).get("actuator") or actuator
        if known != actuator:
            raise InputError(
                f"--append {folder}: {entry.path.name} is of {known}, this one of {actuator}; "
                "a history is that of one unit"
            )
        if entry.usage > value or (entry.usage == value and not force):
            raise InputError(
                f"--usage {value:g}: {entry.path.name} of {folder} was made at {entry.usage:g} "
                f"{past.unit}; an inspection appended comes after it"
            )
    last = past.entries[-1] if past.entries else None
    again = last is not None and last.usage == value and last.diagnosis is not None
    path = last.path if last is not None and again else folder / f"{unit}-{value:g}.json"
    return NextEntry(check_output(path, force=force), value, unit, past.serial, force)


def _use(given: float | str, unit: str) -> tuple[float, str]:
    """Return a use and its unit: that of the history, where none is given."""
    number, _, name = str(given).strip().partition(" ")
    try:
        value = float(number)
    except ValueError:
        value = -1.0
    if not 0.0 <= value <= 1e9:
        raise InputError(
            f"--usage {str(given)!r}: is not a use such as '1300 flights', 0 to 1e9 of "
            f"{', '.join(UNITS_OF_USE)}"
        )
    name = name.strip()
    if name and name not in UNITS_OF_USE:
        raise unknown("unit of use", name, UNITS_OF_USE, "--usage")
    if not name and not unit:
        raise InputError(
            f"--usage {given}: of what? The first inspection of a history states it: "
            f"'{value:g} flights', or {', '.join(UNITS_OF_USE[1:])}"
        )
    if name and unit and name != unit:
        raise InputError(f"--usage {given}: the history is counted in {unit}")
    return value, name or unit
