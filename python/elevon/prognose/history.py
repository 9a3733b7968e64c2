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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from datetime import date as calendar
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.errors import FormatError, InputError, Interrupted, unknown
from elevon.files import read_regular, visible
from elevon.plain import keys_of
from elevon.prognose.laws import LAWS
from elevon.prognose.measured import read_measured
from elevon.prognose.mission import UNITS_OF_USE
from elevon.prognose.observation import Inspection, inspection
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

_KEYS = frozenset(
    {"usage", "unit", "date", "serial", "reset", "logs", "map", "healthy", "measured"}
)
#: What `elevon diagnose` writes beside the keys of its record.
_ABOUT = frozenset({"schema", "units", "method", "seconds"})


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
        self, laws: Sequence[Law], requirements: Mapping[str, str] | None = None
    ) -> list[Inspection]:
        """Return what the filters take.

        Parameters
        ----------
        laws : sequence of Law
            Whose faults matter.
        requirements : mapping of str to str, optional
            Those that may have been measured, and the SI unit of each.

        Raises
        ------
        InputError
            An entry has no diagnosis yet, or one that is none; a part made new that no fault has; a
            measured requirement that is none.
        """
        out = []
        for entry in self.entries:
            _check_reset(entry, laws)
            if entry.diagnosis is None:
                raise InputError(f"{entry.path.name}: its logs have not been diagnosed")
            out.append(
                inspection(
                    entry.diagnosis,
                    laws,
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


def _check_reset(entry: HistoryEntry, laws: Sequence[Law]) -> None:
    """Refuse a part made new that neither the laws nor diagnosis know: it is a slip of the pen."""
    from elevon.diagnose.engine.candidates import CANDIDATES

    known = {law.key for law in (*LAWS.values(), *laws)}
    known |= {f"{c.kind}@{place}" for c in CANDIDATES for place in (c.place, *c.same)}
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
    usage = data["usage"]
    if isinstance(usage, bool) or not isinstance(usage, (int, float)) or not 0 <= usage <= _MOST:
        raise FormatError(f"{path}: usage = {usage!r} is not a number from 0 to {_MOST:g}")
    unit = data.get("unit")
    if unit not in UNITS_OF_USE:
        raise FormatError(f"{path}: unit = {unit!r} is none of {', '.join(UNITS_OF_USE)}")
    logs = _logs(path, data)
    diagnosis = None if logs else data
    if diagnosis is not None and "faults" not in data:
        raise FormatError(f"{path}: has neither 'faults' (a diagnosis) nor 'logs' to be diagnosed")
    _check_keys(path, data)
    missing = next((log for log, _ in logs if not log.is_file()), None)
    if missing is not None:
        raise InputError(f"{path}: the log {missing.name} is not there")
    entry = HistoryEntry(
        path,
        float(usage),
        _date(path, data.get("date", "")),
        str(data.get("serial", "")),
        tuple(_texts(path, data, "reset")),
        diagnosis,
        logs,
        bool(data.get("healthy", False)),
        data.get("measured"),
    )
    return entry, str(unit)


def _logs(path: Path, data: Mapping[str, Any]) -> tuple[MappedLog, ...]:
    """The logs, each with its map: ``map`` is one for all of them, or a list of one for each."""
    names = _texts(path, data, "logs")
    one = isinstance(data.get("map"), str)
    maps = [data["map"]] * len(names) if one else _texts(path, data, "map")
    if maps and len(maps) != len(names):
        raise FormatError(f"{path}: map names {len(maps)} for {len(names)} logs; one for each")
    near = [path.parent / name if (path.parent / name).is_file() else name for name in maps]
    folder = path.parent
    return tuple((folder / name, near[k] if near else None) for k, name in enumerate(names))


def known_keys() -> frozenset[str]:
    """Return the keys that an inspection may have: its stamp's, and those of a diagnosis."""
    from elevon.diagnose.engine.answer import Diagnosis

    return _KEYS | _ABOUT | keys_of(Diagnosis)


def _check_keys(path: Path, data: Mapping[str, Any]) -> None:
    from elevon.errors import did_you_mean

    known = known_keys()
    for key in data:
        if key not in known:
            hint = did_you_mean(key, sorted(_KEYS))
            raise FormatError(f"{path}: unknown key {key!r}{hint}")


def _texts(path: Path, data: Mapping[str, Any], key: str) -> list[str]:
    given = data.get(key, [])
    # The JSON of a diagnosis lists its own logs; they are only to be diagnosed where it has none.
    if key == "logs" and "faults" in data:
        return []
    if not isinstance(given, list) or not all(isinstance(item, str) for item in given):
        raise FormatError(f"{path}: {key} = {given!r} is not a list of texts")
    return given


def _date(path: Path, given: Any) -> str:
    if not given:
        return ""
    try:
        return calendar.fromisoformat(str(given)).isoformat()
    except ValueError as error:
        raise FormatError(f"{path}: date = {given!r} is not of the form 2026-11-22") from error


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
    from dataclasses import replace

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
