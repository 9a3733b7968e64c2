"""What the operator knows, beside a log: the command, the brake, the load cell's arm.

The command stands in one of two forms. The short one is a single waveform at the output side; its
values are in Hz, s and m, angles need their unit. Its keys are accepted in several spellings (other
software writes these files), and keys that mean nothing are reported, not refused. The full one is
a table ``[command]`` with ``terms`` or ``steps`` by the grammar of scenario files: sums, tables,
sequences of actions; unknown keys are errors.
"""

from __future__ import annotations

import json
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.data import packaged_toml
from elevon.documents import Document, check_depth, validated
from elevon.errors import FormatError, InputError, did_you_mean, quoted
from elevon.files import read_regular
from elevon.logs.command.fit import FREE
from elevon.logs.command.reconstruct import CommandTrace
from elevon.logs.formats.table import Limits, existing_file
from elevon.plain import WORKING, Plain
from elevon.scenario.compile import evaluate_terms
from elevon.scenario.scenario import Command, Scenario, check_units
from elevon.units import ambiguous, is_ambiguous, parse_quantity, si_unit
from elevon.waveforms import wave_records

_MOST_BYTES = 1_000_000
_LARGEST = 1e300  # greater whole numbers are no floats; reading the value refuses them
_MOST_TERMS = 1000
_MOST_TABLE = 50_000_000  # bytes of a table's file
_KEYS = packaged_toml("elevon.logs.command", "keys.toml")
_KINDS: Mapping[str, str] = _KEYS["units"]
_SPELLINGS: Mapping[str, str] = {
    other: name for name, others in _KEYS["spellings"].items() for other in others
}
_SUFFIX = re.compile(r"_(?:deg|degrees|hz|s|sec|seconds|m|deg_s|deg_per_s)$")
_BRAKE = {"on": True, "true": True, "yes": True, "off": False, "false": False, "no": False}


@dataclass(frozen=True)
class CommandNote(Plain):
    """A command note in SI.

    Attributes
    ----------
    source : str
        The file.
    waveform : str or None
        Kind of waveform.
    parameters : dict of str to float
        Its parameters that are known (SI).
    brake : bool or None
        Whether the brake was on.
    load_cell_arm : float or None
        Arm of the load cell [m].
    chain_ratio : float or None
        Brake shaft's chain ratio.
    current : str or None
        ``rms`` or ``peak``.
    command : Command or None
        The full form, where it was given.
    ignored : tuple of str
        Keys that mean nothing here.
    gear_ratio : float or None
        Motor over output; of a log in the bench's format, whose columns do not say it.
    """

    source: Annotated[str, WORKING] = ""
    waveform: str | None = None
    parameters: dict[str, float] = field(default_factory=dict)
    brake: bool | None = None
    load_cell_arm: float | None = None
    chain_ratio: float | None = None
    current: str | None = None
    ignored: Annotated[tuple[str, ...], WORKING] = ()
    command: Annotated[Command | None, WORKING] = None
    gear_ratio: float | None = None

    def to_dict(self, *, stored: bool = True) -> dict[str, Any]:
        """Return it as plain types for a recording's metadata."""
        command = None if self.command is None else _plain(self.command)
        return super().to_dict(stored=stored) | {"command": command}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], place: str = "") -> CommandNote:
        """Return the note that `to_dict` wrote, from a recording's metadata."""
        note = super().from_dict({key: data[key] for key in data if key != "command"}, place)
        command = data.get("command")
        full = None if command is None else _command(command, place, None)
        return replace(note, source=place, command=full)

    @classmethod
    def of_scenario(cls, scenario: Scenario, source: str) -> CommandNote:
        """Return what a simulated log's own scenario says: nothing of it has to be noted."""
        brake = any(term.enabled for term in scenario.loads.brake.terms)
        return cls(source, brake=brake, current="peak", command=scenario.command)


def _plain(command: Command) -> dict[str, Any]:
    return command.model_dump(exclude_unset=True, mode="json")


def read_command_note(path: str | Path) -> CommandNote:
    """Read a command note from TOML or JSON, distinguished by the ending or the first character.

    Raises
    ------
    InputError
        No such file, neither TOML nor JSON, a value of the wrong kind, an unknown waveform.
    """
    file = existing_file(path)
    place = str(file)
    document = dict(_document(file))
    command = None
    if _is_full(document.get("command")):
        given = document.pop("command")
        command = _command(given, place, file.parent)
    if command is not None:
        check_units(Document(place, "", {"command": given}))
    flat = _flatten(document, place)
    _check_units(flat, place)
    values: dict[str, Any] = {}
    ignored = []
    for key, value in flat.items():
        name = _canonical(key)
        if name is None:
            ignored.append(key[:60])
        elif name in values:
            raise InputError(f"{place}: {quoted(key)} gives {name} a second time")
        else:
            values[name] = value
    note = _note(place, values, tuple(ignored))
    if command is not None and note.waveform is not None:
        raise InputError(f"{place}: a waveform and a table [command] both state the command")
    return replace(note, command=command)


def _is_full(given: Any) -> bool:
    return isinstance(given, Mapping) and bool({"terms", "steps", "mode"} & given.keys())


def _command(given: Mapping[str, Any], place: str, folder: Path | None) -> Command:
    """Read the full form; tables in files must lie beside the note."""
    terms = given.get("terms", ())
    if not isinstance(terms, (list, tuple)):
        raise InputError(f"{place}: command: terms = {quoted(str(terms))} is no list of tables")
    terms = [dict(t) if isinstance(t, Mapping) else t for t in terms if t is not None]
    if len(terms) > _MOST_TERMS:
        raise InputError(f"{place}: command: {len(terms)} terms, at most {_MOST_TERMS}")
    for term in terms:
        name = term.get("file") if isinstance(term, dict) else None
        if isinstance(name, str) and folder is not None:
            if Path(name).name != name:
                raise InputError(f"{place}: command: file {quoted(name)} must lie beside the note")
            existing_file(folder / name, Limits(file_bytes=_MOST_TABLE))
            term["file"] = str(folder / name)
    data = {**given, "terms": terms} if terms else dict(given)
    return validated(Command, data, Document(place, "", {}, prefix=("command",)))


def _document(file: Path) -> Mapping[str, Any]:
    raw = read_regular(file, _MOST_BYTES)
    try:
        text = raw.decode("utf-8-sig")
        is_json = file.suffix.lower() == ".json" or text.lstrip().startswith("{")
        document = json.loads(text) if is_json else tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{file}: neither JSON nor TOML: {quoted(str(error))}") from error
    if not isinstance(document, dict):
        raise FormatError(f"{file}: a table of keys and values is expected")
    check_depth(document, str(file))
    return document


def _flatten(document: Mapping[str, Any], place: str) -> dict[str, Any]:
    """Lift the keys of inner tables (``waveform = {kind = ...}``, ``[command]``) one level up."""
    flat: dict[str, Any] = {}
    for key, value in document.items():
        if isinstance(value, list) and value and isinstance(value[0], dict):
            if len(value) > 1:
                raise InputError(
                    f"{place}: {quoted(key)}: the short form notes one waveform; write a sum as "
                    "[[command.terms]], by the grammar of scenario files"
                )
            value = value[0]  # noqa: PLW2901 - a list of one term is that term
        inner = value if isinstance(value, dict) else {key: value}
        for name, item in inner.items():
            if name in flat:
                raise InputError(f"{place}: {quoted(name)} stands twice")
            flat[name] = item
    return flat


def _check_units(flat: Mapping[str, Any], place: str) -> None:
    """Refuse numbers that could be degrees or radians; a key such as ``amplitude_deg`` says it."""
    for key, value in flat.items():
        kind = _KINDS.get(_canonical(key) or "")
        plain = isinstance(value, (int, float)) and not isinstance(value, bool)
        if kind is None or not plain or _SUFFIX.search(_spelt(key)):
            continue
        if abs(value) < _LARGEST and is_ambiguous(float(value), si_unit(kind), kind):
            raise ambiguous(str(value), si_unit(kind), kind, f"{place}: {key}")


def _spelt(key: str) -> str:
    return re.sub(r"[\s\-.]+", "_", key.strip()).lower()


def _canonical(key: str) -> str | None:
    text = _spelt(key)
    for name in (text, _SUFFIX.sub("", text)):
        name = _SPELLINGS.get(name, name)  # noqa: PLW2901 - one spelling for each meaning
        if name in _KINDS or name in {"waveform", "brake", "chain_ratio", "gear_ratio", "current"}:
            return name
    return None


def _note(place: str, values: dict[str, Any], ignored: tuple[str, ...]) -> CommandNote:
    waveform = values.pop("waveform", None)
    if waveform is not None:
        waveform = str(waveform).strip().lower()
        if waveform not in FREE:
            raise InputError(
                f"{place}: unknown waveform {quoted(waveform)}{did_you_mean(waveform, FREE)}"
            )
    current = values.pop("current", None)
    if current is not None and str(current).lower() not in {"rms", "peak"}:
        raise InputError(f"{place}: current = {quoted(str(current))}; valid: 'rms', 'peak'")
    brake = _switch(place, values.pop("brake", None))
    ratio, geared = values.pop("chain_ratio", None), values.pop("gear_ratio", None)
    numbers = {name: _number(f"{place}: {name}", v, _KINDS[name]) for name, v in values.items()}
    arm = numbers.pop("load_cell_arm", None)
    chain = None if ratio is None else _number(f"{place}: chain_ratio", ratio, "1")
    gear = None if geared is None else _number(f"{place}: gear_ratio", geared, "1")
    for name, value in (("load_cell_arm", arm), ("chain_ratio", chain), ("gear_ratio", gear)):
        if value is not None and not value > 0.0:
            raise InputError(f"{place}: {name} = {value:g} must be above 0")
    _check_parameters(place, waveform, numbers)
    return CommandNote(
        place, waveform, numbers, brake, arm, chain,
        None if current is None else str(current).lower(), ignored, gear_ratio=gear,
    )  # fmt: skip


def _check_parameters(place: str, waveform: str | None, numbers: Mapping[str, float]) -> None:
    if waveform is None:
        return
    names = wave_records()[waveform].names
    for name in numbers:
        if name not in names:
            raise InputError(
                f"{place}: {name} is no parameter of the waveform {waveform}"
                f"{did_you_mean(name, names)}"
            )


def _number(place: str, value: Any, kind: str) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float, str)):
        raise InputError(f"{place}: {quoted(str(value))} is not a number")
    return parse_quantity(value, kind, place)


def _switch(place: str, value: Any) -> bool | None:
    if value is None or isinstance(value, bool):
        return value
    if isinstance(value, int) and value in {0, 1}:
        return bool(value)
    state = _BRAKE.get(str(value).strip().lower())
    if state is None:
        raise InputError(f"{place}: brake = {quoted(str(value))}; valid: on, off")
    return state


_MOST = 2000  # samples compared, and starts tried first
_REFINED = 4  # searches, each five times finer than the one before


@dataclass(frozen=True, slots=True)
class NotedCommand:
    """A noted command laid over a log.

    Attributes
    ----------
    start : float
        Log time [s] of the note's zero.
    values : ndarray, shape (n,)
        The command at the log's instants [rad or m].
    rms : float
        Of the difference from the trace it was laid over, in the same unit.
    """

    start: float
    values: Floats
    rms: float


def noted_values(note: CommandNote, unit: str, time: npt.ArrayLike) -> Floats:
    """Return the noted command at instants counted from the note's own zero, shape (n,).

    Raises
    ------
    InputError
        The note holds no sum of waveforms, or units of another kind.
    """
    if note.command is None or not note.command.terms:
        raise InputError(f"{note.source}: no command of waveforms is noted")
    return evaluate_terms(note.command.terms, unit, time, f"{note.source}: command")


def align_noted(trace: CommandTrace, note: CommandNote, unit: str = "rad") -> NotedCommand:
    """Find when the noted command began, from where it fits the command's trace best.

    Parameters
    ----------
    trace : CommandTrace
        Rebuilt from set point and position, or logged.
    note : CommandNote
        With a command of waveforms.
    unit : str
        ``rad`` or ``m``.

    Raises
    ------
    InputError
        As `noted_values`, or fewer than ten samples of the trace are known.
    """
    t, y = trace.time[trace.valid], trace.position[trace.valid]
    if len(t) < 10:
        raise InputError(f"{note.source}: the command's trace has {len(t)} samples; 10 needed")
    span = float(trace.time[-1] - trace.time[0])
    thin = max(1, len(t) // _MOST)
    t, y = t[::thin], y[::thin]
    begin, reach = float(trace.time[0]), span
    step = max(float(np.median(np.diff(trace.time))), 2.0 * span / _MOST)
    for _ in range(_REFINED):
        starts = begin + np.arange(-reach, reach + 0.5 * step, step)
        misfit = [float(np.mean((noted_values(note, unit, t - s) - y) ** 2)) for s in starts]
        # Of equals the one nearest the log's own zero: a constant fits anywhere.
        least = min(misfit)
        ties = [s for s, r in zip(starts, misfit, strict=True) if r <= least * (1.0 + 1e-9)]
        begin = float(min(ties, key=lambda s: abs(s - trace.time[0])))
        reach, step = 2.0 * step, 0.2 * step
    values = noted_values(note, unit, trace.time - begin)
    rest_valid = values[trace.valid] - trace.position[trace.valid]
    rms = float(np.sqrt(np.mean(rest_valid**2)))
    return NotedCommand(begin, values, rms)
