"""A folder of dated logs or diagnoses of one unit.

Each inspection is a JSON file with the stamp ``usage`` (how much the unit had been used) and
``unit`` (flights, landings, cycles, hours), and optionally ``date`` (ISO), ``serial``, ``reset``
(list of ``KIND@PLACE`` whose part was made new after it). Either it is the JSON object of
``elevon diagnose`` with the stamp added, or it names the logs to be diagnosed: ``logs`` (list of
files in the folder), with ``map`` where their columns need one (a file in the folder or the name of
a map of the package; one for all, or a list of one for each). ``healthy: true`` marks logs that
serve as baseline.
"""

from __future__ import annotations

import json
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date as calendar
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.diagnose.engine.answer import Diagnosis
from elevon.diagnose.engine.candidates import CANDIDATES, CandidateFault
from elevon.errors import FormatError, InputError, Interrupted, unknown
from elevon.files import check_output, read_regular, visible
from elevon.plain import Plain, keys_of
from elevon.prognose.law import LAWS
from elevon.prognose.mission import UNITS_OF_USE
from elevon.prognose.observation import Inspection, inspection, read_measured
from elevon.prognose.predict import check_order
from elevon.results import finite

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.answer import Diagnosis
    from elevon.logs.log import Log
    from elevon.prognose.law import Law


#: A log and its column map: a file, or the name of one of the package's.
MappedLog = tuple[Path, str | Path | None]

_LONGEST = 2**24
"""Bytes of an inspection's file; it has some ten thousand."""

_MOST = 1e9
"""Greatest use: a flight a minute, two thousand years."""

#: What `elevon diagnose` writes beside the keys of its record.
_ABOUT = frozenset({"schema", "units", "method", "seconds"})


@dataclass(frozen=True)
class InspectionStamp(Plain):
    """What a history adds to a diagnosis, or says in its place; the keys of an inspection's file.

    Attributes
    ----------
    usage : float
        Use at it.
    unit : str
        Of use.
    date, serial : str
        Empty where not given.
    reset : tuple of str
        Parts made new after it.
    logs : tuple of str
        Files in the folder that are to be diagnosed.
    map : str or tuple of str
        Column map of all of them, or of each.
    healthy : bool
        Whether they serve as baseline.
    measured : object
        Requirements' own values.
    """

    usage: float
    unit: str
    date: str = ""
    serial: str = ""
    reset: tuple[str, ...] = ()
    logs: tuple[str, ...] = ()
    map: str | tuple[str, ...] = ()
    healthy: bool = False
    measured: Any = None

    def check(self, place: Path) -> InspectionStamp:
        """Return it with its date in the one form, or refuse what cannot be."""
        if not 0 <= self.usage <= _MOST:
            raise FormatError(
                f"{place}: usage = {self.usage:g} is not a number from 0 to {_MOST:g}"
            )
        if self.unit not in UNITS_OF_USE:
            raise FormatError(f"{place}: unit = {self.unit!r} is none of {', '.join(UNITS_OF_USE)}")
        try:
            date = self.date and calendar.fromisoformat(self.date).isoformat()
        except ValueError as error:
            raise FormatError(
                f"{place}: date = {self.date!r} is not of the form 2026-11-22"
            ) from error
        if isinstance(self.map, tuple) and len(self.map) not in (0, len(self.logs)):
            raise FormatError(
                f"{place}: map names {len(self.map)} for {len(self.logs)} logs; one for each"
            )
        return replace(self, date=date)


@dataclass(frozen=True)
class HistoryEntry:
    """One file of a history.

    Attributes
    ----------
    path : Path
        The file.
    usage : float
        Use at it.
    date, serial : str
        Empty where not given.
    reset : tuple of str
        Parts made new after it.
    diagnosis : mapping or None
        None where logs are to be diagnosed.
    logs : tuple of (Path, str or Path or None)
        Those logs, each with its column map.
    healthy : bool
        Whether they serve as baseline.
    measured : object
        Requirements' own values as the file gives them.
    """

    path: Path
    usage: float
    date: str
    serial: str
    reset: tuple[str, ...]
    diagnosis: Mapping[str, Any] | None
    logs: tuple[MappedLog, ...]
    healthy: bool
    measured: Any = None


@dataclass(frozen=True)
class History:
    """Inspections of one unit in the order of use; ``unit`` is that of use."""

    entries: tuple[HistoryEntry, ...]
    unit: str
    serial: str

    def inspections(
        self,
        laws: Sequence[Law],
        requirements: Mapping[str, str] | None = None,
        candidates: Sequence[CandidateFault] = CANDIDATES,
    ) -> list[Inspection]:
        """Return what the filters take.

        Parameters
        ----------
        laws : sequence of Law
            Whose faults matter.
        requirements : mapping of str to str, optional
            Those that may have been measured, and the SI unit of each.
        candidates : sequence of CandidateFault
            What diagnosis looks for; default: a turning servo's.

        Raises
        ------
        InputError
            An entry has no diagnosis yet, or one that is none; a part made new that no fault has; a
            measured requirement that is none.
        """
        out = []
        for entry in self.entries:
            _check_reset(entry, laws, candidates)
            if entry.diagnosis is None:
                raise InputError(f"{entry.path.name}: its logs have not been diagnosed")
            out.append(
                inspection(
                    entry.diagnosis,
                    laws,
                    candidates=candidates,
                    usage=entry.usage,
                    name=entry.path.name,
                    date=entry.date,
                    reset=entry.reset,
                    measured=None
                    if entry.measured is None
                    else read_measured(entry.measured, requirements or {}, str(entry.path)),
                )
            )
        return out


def _check_reset(
    entry: HistoryEntry, laws: Sequence[Law], candidates: Sequence[CandidateFault]
) -> None:
    """Refuse a part made new that neither the laws nor diagnosis know: it is a slip of the pen."""
    known = {law.key for law in (*LAWS.values(), *laws)}
    known |= {f"{c.kind}@{place}" for c in candidates for place in (c.place, *c.same)}
    for key in entry.reset:
        if key not in known:
            raise unknown("fault", key, sorted(known), f"{entry.path}: reset")


def read_history(folder: str | Path, *, unit: str) -> History:
    """Read a folder.

    Parameters
    ----------
    folder : path
        Its ``*.json`` with a key ``usage`` are the inspections; other files are left alone.
    unit : str
        Of use, as the mission counts it.

    Raises
    ------
    InputError
        No inspections, two units of use or two serial numbers, another unit of use than the
        mission's, an order of dates against that of use, a log that is missing.
    FormatError
        A file that is not JSON, or a stamp that is not one.
    """
    place = Path(folder).expanduser()
    history = entries_of(place)
    if not history.entries:
        raise InputError(
            f"{place}: no inspections: no *.json in it has the key 'usage' "
            "(elevon diagnose --append HISTORY --usage N writes one)"
        )
    if history.unit != unit:
        raise InputError(f"{place}: is counted in {history.unit}, the mission in {unit}")
    return history


def entries_of(place: Path) -> History:
    """Return the inspections of a folder, none or more, in whatever unit of use."""
    if not place.is_dir():
        raise InputError(f"{place}: is not a folder")
    entries = [e for path in visible(place, "*.json") if (e := _entry(path)) is not None]
    read = [entry for entry, _ in entries]
    _one(place, "unit of use", {e.path.name: u for e, u in entries}, "histories are not mixed")
    serials = {e.path.name: e.serial for e in read if e.serial}
    _one(place, "unit", serials, "a history is that of one unit")
    dated = sorted(
        read, key=lambda e: (e.date, e.usage) if all(x.date for x in read) else ("", e.usage)
    )
    check_order([Inspection(e.usage, {}, (), e.path.name, e.date) for e in dated])
    unit = entries[0][1] if entries else ""
    return History(tuple(dated), unit, next(iter(serials.values()), ""))


def _one(place: Path, what: str, names: Mapping[str, str], why: str) -> None:
    values = list(dict.fromkeys(names.values()))
    if len(values) > 1:
        first = next(name for name, v in names.items() if v == values[0])
        other = next(name for name, v in names.items() if v == values[1])
        raise InputError(
            f"{place}: more than one {what}: {values[0]} ({first}) and {values[1]} ({other}); {why}"
        )


def _entry(path: Path) -> tuple[HistoryEntry, str] | None:
    try:
        data = json.loads(read_regular(path, _LONGEST))
    except InputError:
        raise
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{path}: is not JSON: {error}") from error
    if not isinstance(data, dict) or "usage" not in data:
        return None
    _check_keys(path, data)
    stamp = _stamp(path, data)
    if not stamp.logs and "faults" not in data:
        raise FormatError(f"{path}: has neither 'faults' (a diagnosis) nor 'logs' to be diagnosed")
    logs = _logs(path, stamp)
    missing = next((log for log, _ in logs if not log.is_file()), None)
    if missing is not None:
        raise InputError(f"{path}: the log {missing.name} is not there")
    entry = HistoryEntry(
        path, stamp.usage, stamp.date, stamp.serial, stamp.reset, None if logs else data, logs,
        stamp.healthy, stamp.measured,
    )  # fmt: skip
    return entry, stamp.unit


def _stamp(path: Path, data: Mapping[str, Any]) -> InspectionStamp:
    """The stamp alone: the JSON of a diagnosis lists its own logs, which it has been made from."""
    made = {"logs", "map"} if "faults" in data else set()
    stamp = {k: v for k, v in data.items() if k in keys_of(InspectionStamp) - made}
    return InspectionStamp.from_dict(stamp, str(path)).check(path)


def _logs(path: Path, stamp: InspectionStamp) -> tuple[MappedLog, ...]:
    """The logs, each with its map."""
    names = [stamp.map] * len(stamp.logs) if isinstance(stamp.map, str) else stamp.map
    near = [path.parent / name if (path.parent / name).is_file() else name for name in names]
    return tuple(
        (path.parent / name, near[k] if near else None) for k, name in enumerate(stamp.logs)
    )


def known_keys() -> frozenset[str]:
    """Return the keys that an inspection may have: its stamp's, and those of a diagnosis."""
    from elevon.diagnose.engine.answer import Diagnosis

    return keys_of(InspectionStamp) | _ABOUT | keys_of(Diagnosis)


def _check_keys(path: Path, data: Mapping[str, Any]) -> None:
    from elevon.errors import did_you_mean

    known = known_keys()
    for key in data:
        if key not in known:
            hint = did_you_mean(key, sorted(keys_of(InspectionStamp)))
            raise FormatError(f"{path}: unknown key {key!r}{hint}")


def diagnosed(
    history: History,
    actuator: Actuator,
    *,
    progress: Callable[[float], object] | None = None,
) -> History:
    """Diagnose the logs of a history that stand there without their diagnosis.

    All logs of an inspection are diagnosed together, as one unit in one condition. Logs of
    inspections marked healthy serve as baselines for all, each for the logs of its own test.

    Raises
    ------
    InputError
        A log that cannot be diagnosed; its inspection is named.
    Interrupted
        `progress` returned False.
    """
    if all(entry.diagnosis is not None for entry in history.entries):
        return history
    answer = _diagnosis_by(
        actuator, [log for entry in history.entries if entry.healthy for log in entry.logs]
    )
    out = []
    for k, entry in enumerate(history.entries):
        if entry.diagnosis is None:
            try:
                entry = replace(entry, diagnosis=answer(entry.logs).to_dict())  # noqa: PLW2901
            except InputError as error:
                raise InputError(f"{entry.path}: {error}") from error
        out.append(entry)
        if progress is not None and progress((k + 1) / len(history.entries)) is False:
            raise Interrupted("the diagnoses were stopped")
    return replace(history, entries=tuple(out))


def _diagnosis_by(
    actuator: Actuator, healthy: Sequence[MappedLog]
) -> Callable[[Sequence[MappedLog]], Diagnosis]:
    """Return what diagnoses logs together, against healthy ones: as `elevon diagnose` does."""
    from elevon.diagnose.door import diagnose

    others = _read(healthy)
    return lambda logs: diagnose(_read(logs), actuator, others)


def _read(logs: Sequence[MappedLog]) -> list[Log]:
    from elevon.logs.read import read_logs

    return read_logs([path for path, _ in logs], [column_map for _, column_map in logs])


def write_stamp(
    path: str | Path,
    data: Mapping[str, object],
    *,
    usage: float,
    unit: str,
    serial: str = "",
    date: str = "",
    force: bool = False,
) -> Path:
    """Write an inspection: a diagnosis or ``{"logs": [...]}``, with its stamp."""
    from elevon.files import write_text

    stamp: dict[str, Any] = {"usage": usage, "unit": unit}
    if serial:
        stamp["serial"] = serial
    if date:
        stamp["date"] = date
    text = json.dumps(finite({**stamp, **data}, words=True), allow_nan=False, indent=1)
    return write_text(path, text + "\n", force=force)


#: Answers that state no severity: written down they would read as "no fault seen".
_SILENT = ("unknown_fault", "model_does_not_fit", "undecided")


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
