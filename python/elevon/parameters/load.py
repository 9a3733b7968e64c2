"""Read an actuator file: header, entries, and the file it is based on."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path
from typing import Any

from elevon.documents import Document, read_toml, validated
from elevon.errors import InputError, UnknownNameError, unknown
from elevon.files import visible
from elevon.parameters.design import Derivation, Given, derive, design_scenario, read_design
from elevon.parameters.records import Record, records, wiring_names
from elevon.parameters.set import Parameter, ParameterSet
from elevon.units import parse_quantity, split_quantity

#: Folders with more actuator files, separated like PATH.
VARIABLE = "ELEVON_ACTUATORS"

_SHIPPED = Path(__file__).parent.parent / "actuators"
_NEUTRAL = Path(__file__).parent / "neutral"


def set_paths() -> dict[str, Path]:
    """Return every actuator file by name; yours hides a shipped one of the same name."""
    folders = [_SHIPPED, *_user_folders()]
    return {file.stem: file for folder in folders for file in visible(folder, "*.toml")}


def set_names() -> list[str]:
    """Return the names of the actuators that can be loaded by name, sorted."""
    return sorted(set_paths())


def is_shipped(path: Path) -> bool:
    """Return whether a file is one that the package ships."""
    return path.resolve().parent in (_SHIPPED.resolve(), _NEUTRAL.resolve())


def is_neutral(path: Path) -> bool:
    """Return whether a file is a neutral base: complete only with the rules of a design."""
    return path.resolve().parent == _NEUTRAL.resolve()


def neutral_names() -> list[str]:
    """Return the names that a file with a design may have as its base."""
    return sorted(path.stem for path in visible(_NEUTRAL, "*.toml"))


def find_set(reference: str | os.PathLike[str], folder: Path | None = None) -> Path:
    """Find an actuator file by name or by path.

    Parameters
    ----------
    reference : str or path
        The name of an actuator, or a TOML file.
    folder : Path, optional
        Where a relative file is looked for first: the folder of the file that names it as `base`.
        There, or where the program runs, ``mine`` is ``mine.toml`` too.

    Raises
    ------
    UnknownNameError
        No actuator of that name; the message holds the nearest, and the file to write.
    InputError
        The file does not exist.
    """
    text = os.fspath(reference)
    if text.endswith(".toml") or os.sep in text:
        return _file(text, folder)
    known = set_paths()
    if text in known:
        return known[text]
    if text in neutral_names():
        return _NEUTRAL / f"{text}.toml"
    near = [place / f"{text}.toml" for place in (folder or Path(), Path())]
    path = next((place for place in near if _is_file(place)), None)
    if path is None:
        error = unknown("actuator", text, known)
        where = near[0]
        raise UnknownNameError(f"{error}; or write {where}", error.name, error.nearest)
    return path


def _file(text: str, folder: Path | None) -> Path:
    path = Path(text).expanduser()
    if folder is not None and not path.is_absolute() and _is_file(folder / path):
        path = folder / path
    if not _is_file(path):
        raise InputError(f"{path}: no such actuator file")
    return path


def _is_file(path: Path) -> bool:
    try:
        return path.is_file()
    except OSError:  # longer than a name may be
        return False


def _user_folders() -> list[Path]:
    folders = [
        Path(part).expanduser() for part in os.environ.get(VARIABLE, "").split(os.pathsep) if part
    ]
    for folder in folders:
        if not folder.is_dir():
            raise InputError(f"{VARIABLE}: {folder} is not a folder")
    return folders


def base_reference(path: Path | None, name: str, target: Path) -> str:
    """Return how a new file names its base: a shipped set's name, else the path to it."""
    if path is None:
        return name
    try:
        if find_set(name).resolve() == path.resolve():
            return name
    except ValueError:
        pass
    return os.path.relpath(path.resolve(), target.resolve().parent).replace(os.sep, "/")


_HEADER_KEYS = (
    "name", "title", "wiring", "base", "references", "scenario", "compare", "validation", "design",
)  # fmt: skip


#: The source of a value that was written without one.
GIVEN = "given by the caller"


@dataclass(frozen=True)
class SetFile:
    """Parameters as loaded from its file.

    Attributes
    ----------
    name, title, wiring : str
        As in the header.
    parameters : ParameterSet
        Complete and checked.
    path : Path
        The file.
    references : mapping
        Key to citation, those of the base included.
    scenario : mapping or None
        What runs when no scenario is given.
    validation : mapping or None
        ``transient`` [s] and ``limits``: signal to largest RMS error in percent of its range.
    compare : mapping or None
        ``after`` [s], ``load`` and ``scenario``: what `elevon compare` runs.
    design : mapping
        Name to `Parameter`: the numbers that the rules derive the rest from; empty without any.
    stated : frozenset of str
        Paths that the file, or a base of the caller's own, states itself; of a shipped file all.
    """

    name: str
    title: str
    wiring: str
    parameters: ParameterSet
    path: Path
    references: Mapping[str, str]
    scenario: Mapping[str, Any] | None
    validation: Mapping[str, Any] | None = None
    compare: Mapping[str, Any] | None = None
    design: Mapping[str, Parameter] = field(default_factory=dict)
    stated: frozenset[str] = frozenset()


@dataclass(frozen=True)
class _Layer:
    """One file of a chain of bases, before the values are read."""

    document: Document
    header: Any
    entries: Mapping[str, Any]


def load_set(reference: str | os.PathLike[str], text: str | None = None) -> SetFile:
    """Load an actuator file by name or path, with the files it is based on.

    Parameters
    ----------
    reference : str or path
        Name of an actuator, or a TOML file.
    text : str, optional
        What the file will hold, before it is written.

    Returns
    -------
    SetFile
        Complete and checked.

    Raises
    ------
    InputError
        The file cannot be read, has unknown keys or paths, wrong units or values outside their
        range, or lacks a parameter; the message names file, line, path and limit.
    """
    if text is not None:
        return _loaded(Path(reference), text)
    path = find_set(reference)
    return _shipped(path) if is_shipped(path) else _loaded(path)


@cache
def _shipped(path: Path) -> SetFile:
    """Read a file of the package once: it stays as it is while it is used."""
    return _loaded(path)


def _loaded(path: Path, text: str | None = None) -> SetFile:
    layers = list(_chain(path, text))
    wiring = next((layer.header.wiring for layer in layers if layer.header.wiring), None)
    top = layers[0]
    if wiring is None:
        raise InputError(f"{top.document.place()}: 'wiring' is missing; {_wirings()}")
    if wiring not in wiring_names():
        raise InputError(
            f"{top.document.place(('wiring',))}: unknown wiring {wiring!r}; {_wirings()}"
        )
    entries, design = _resolved(layers, wiring)
    references: dict[str, str] = {}
    for layer in reversed(layers):
        references.update({item.key: item.text for item in layer.header.references})
    scenario = next((layer.header.scenario for layer in layers if layer.header.scenario), None)
    if scenario is None and design:
        scenario = design_scenario(design)
    return SetFile(
        name=top.header.name or _name_of(path),
        title=next((layer.header.title for layer in layers if layer.header.title), ""),
        wiring=wiring,
        parameters=ParameterSet(wiring, entries, str(path)),
        path=path,
        references=references,
        scenario=scenario,
        validation=_table(layers, "validation"),
        compare=_table(layers, "compare"),
        design=design,
        stated=_stated(layers),
    )


def _stated(layers: list[_Layer]) -> frozenset[str]:
    """Return what the caller's own files state, or the first shipped one where there are none."""
    callers = [layer for layer in layers if not is_shipped(Path(layer.document.origin))]
    return frozenset(path for layer in callers or layers for path, _ in _leaves(layer.entries, ()))


def _resolved(
    layers: list[_Layer], wiring: str
) -> tuple[dict[str, Parameter], Mapping[str, Parameter]]:
    """Return every entry of a chain of files, and the design that the rules derived some from.

    The rules act at the last file that states a number of a design, on all that the files up to it
    state themselves; what a file above states (a calibrated value) moves no rule.
    """
    neutral: dict[str, Parameter] = {}
    stated: dict[str, Parameter] = {}
    given, design = Given({}, {}), Derivation({}, {})
    last = next((layer for layer in layers if layer.header.design is not None), None)
    _check_design(layers, last)
    for layer in reversed(layers):
        if layer.header.design is not None:
            given = read_design(layer.document, wiring).over(given)
        stated.update(_parameters(layer, wiring, {**neutral, **stated}))
        if is_neutral(Path(layer.document.origin)):
            neutral, stated = stated, {}
        if layer is last:
            design = derive(wiring, given, {**neutral, **stated}, layer.document.place())
            neutral.update(design.parameters)
    return {**neutral, **stated}, design.design


def _check_design(layers: list[_Layer], last: _Layer | None) -> None:
    """Refuse a neutral base without a design, and a design without a neutral base."""
    base = Path(layers[-1].document.origin)
    if is_neutral(base) and last is None:
        raise InputError(
            f"{layers[0].document.place()}: {base.stem} is complete only with [design] and its "
            "numbers (elevon new --help)"
        )
    if not is_neutral(base) and last is not None:
        raise InputError(
            f"{last.document.place(('design',))}: the file has no neutral base for the rules to "
            f"fill ({', '.join(neutral_names())})"
        )


def _name_of(path: Path) -> str:
    """Return an actuator's name from its file's, of the characters that a name may have."""
    return re.sub(r"[^A-Za-z0-9._-]+", "-", path.stem).strip("-._") or "actuator"


def set_errors(path: str | os.PathLike[str]) -> list[str]:
    """Return everything that keeps an actuator file from loading, header and entries alike.

    Returns
    -------
    list of str
        Empty where it loads.
    """
    try:
        load_set(path)
    except InputError as error:
        lines = str(error).splitlines()
        return list(dict.fromkeys([*lines, *_entry_errors(Path(path))]))
    return []


def _entry_errors(path: Path) -> list[str]:
    """Return what is wrong with the entries of a file whose header may be wrong, too."""
    try:
        document = read_toml(path)
        base = document.data.get("base")
        below = load_set(find_set(str(base), document.folder)) if base else None
    except InputError:
        return []
    wiring = document.data.get("wiring") or (below and below.wiring)
    if wiring not in wiring_names():
        return []
    entries = {k: v for k, v in document.data.items() if isinstance(v, dict)}
    layer = _Layer(document, None, {k: v for k, v in entries.items() if k not in _HEADER_KEYS})
    try:
        _parameters(layer, str(wiring), {} if below is None else dict(below.parameters))
    except InputError as error:
        return str(error).splitlines()
    return []


def _table(layers: list[_Layer], name: str) -> Mapping[str, Any] | None:
    """Return a table of the header, the nearest one down the bases."""
    tables = (getattr(layer.header, name) for layer in layers)
    table = next((item for item in tables if item is not None), None)
    return None if table is None else table.model_dump()


def _chain(path: Path, text: str | None = None) -> Iterator[_Layer]:
    """Yield the layers from a file down to its last base."""
    from elevon.parameters.model import ActuatorHeader

    seen: list[Path] = []
    following: Path | None = path
    while following is not None:
        resolved = following.resolve()
        if resolved in seen:
            names = " -> ".join(item.name for item in [*seen, resolved])
            raise InputError(f"{path}: the bases go round in a circle: {names}")
        seen.append(resolved)
        if text is None or following is not path:
            document = read_toml(following)
        else:
            document = Document(str(path), text, tomllib.loads(text), path.parent)
        values = {
            key: value
            for key, value in document.data.items()
            if key not in _HEADER_KEYS and isinstance(value, dict)
        }
        head = {key: value for key, value in document.data.items() if key not in values}
        header = validated(ActuatorHeader, head, document)
        yield _Layer(document, header, values)
        base = header.base
        following = find_set(base, document.folder) if base else None


def _parameters(layer: _Layer, wiring: str, base: Mapping[str, Parameter]) -> dict[str, Parameter]:
    """Read a layer's entries; one error lists all that is wrong with them."""
    parameters: dict[str, Parameter] = {}
    errors: list[InputError] = []
    for path, raw in _leaves(layer.entries, ()):
        try:
            parameters[path] = _read(path, raw, layer.document, wiring, base.get(path))
        except InputError as error:
            errors.append(error)
    if len(errors) == 1:
        raise errors[0]
    if errors:
        raise InputError("\n".join(str(error) for error in errors))
    return parameters


def _read(
    path: str, raw: Any, document: Document, wiring: str, below: Parameter | None
) -> Parameter:
    from elevon.parameters.model import ParameterEntry

    known = records(wiring)
    place = document.place(tuple(path.split(".")))
    if path not in known:
        raise unknown("parameter", path, known, place)
    if not isinstance(raw, Mapping):
        return _given(path, raw, known[path], place, below)
    entry = validated(ParameterEntry, raw, document.within(tuple(path.split("."))))
    return _parameter(path, entry, known[path], place)


def _given(path: str, raw: Any, record: Record, place: str, below: Parameter | None) -> Parameter:
    """Read ``gear.ratio = 50`` or ``motor.inertia = "9 kg cm2"``: a value and no more."""
    if isinstance(raw, bool) or not isinstance(raw, (int, float, str)):
        raise InputError(
            f"{place}: a parameter is a number, a text with a unit, or a table with value, unit, "
            "source, note, confidence"
        )
    unit = record.unit if below is None or not below.unit else below.unit
    text = raw if isinstance(raw, str) else repr(raw)
    value = record.read(text, place, unit)
    written = "" if record.choices else (split_quantity(text) or ("", ""))[1]
    return Parameter(
        path=path,
        value=value,
        unit="" if record.choices else written or unit,
        source=GIVEN,
        confidence="unknown",
    )


def _leaves(table: Mapping[str, Any], prefix: tuple[str, ...]) -> Iterator[tuple[str, Any]]:
    """Yield the dotted path of each value, or table that holds one."""
    for key, item in table.items():
        location = (*prefix, key)
        if not isinstance(item, dict) or "value" in item or "source" in item:
            yield ".".join(location), item
        else:
            yield from _leaves(item, location)


def _parameter(path: str, entry: Any, record: Record, place: str) -> Parameter:
    def si(number: float | str) -> float | str:
        if record.choices is not None or isinstance(number, str):
            return record.read(number, place)
        return parse_quantity(f"{number!r} {entry.unit}".strip(), record.unit or "1", place)

    if isinstance(entry.value, str) and record.choices is None:
        raise InputError(
            f"{place}: value = {entry.value!r} is text; write value = 1.5 and unit = 'm'"
        )
    if not entry.unit and record.choices is None and record.unit not in ("", "1"):
        raise InputError(f"{place}: the unit is missing (such as {record.unit!r})")
    value = si(entry.value)
    if isinstance(value, float):
        record.check(value, place)
    return Parameter(
        path=path,
        value=value,
        unit=entry.unit,
        source=entry.source,
        note=entry.note,
        confidence=entry.confidence,
        old=None if entry.old is None else si(entry.old),
        interval=None if entry.interval is None else _interval(entry.interval, si, place),
    )


def _interval(given: tuple[float, float], si: Any, place: str) -> tuple[float, float]:
    low, high = si(given[0]), si(given[1])
    if not low <= high:
        raise InputError(f"{place}: interval [{given[0]}, {given[1]}] ends before it starts")
    return low, high


def _wirings() -> str:
    return "wirings: " + ", ".join(wiring_names())
