"""Write values back into an actuator file, keeping its comments and order."""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

from elevon.errors import InputError
from elevon.files import write_text
from elevon.parameters.records import Record, records
from elevon.parameters.set import CONFIDENCES, Parameter
from elevon.units import parse_quantity, to_display

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.parameters.set import Parameter


def updated_set(text: str, changes: Iterable[Parameter]) -> str:
    """Return the text of an actuator file with some entries replaced or added.

    Comments, order and every untouched entry stay as they are.

    Parameters
    ----------
    text : str
        TOML text.
    changes : iterable of Parameter
        New entries; values are written in the parameter's own unit.

    Returns
    -------
    str
        TOML text.
    """
    import tomlkit

    document = tomlkit.parse(text)
    for parameter in changes:
        parts = parameter.path.split(".")
        table: Any = document
        for part in parts[:-1]:
            if part not in table:
                table.add(part, tomlkit.table(is_super_table=True))
            table = table[part]
        if parts[-1] not in table:
            table.add(parts[-1], tomlkit.table())
        _fill(table[parts[-1]], parameter)
    return tomlkit.dumps(document)


def write_set(
    path: str | os.PathLike[str],
    *,
    name: str,
    changes: Iterable[Parameter],
    base: str | None = None,
    title: str = "",
    force: bool = False,
) -> Path:
    """Write an actuator file that overrides a base (or extends the file that is there).

    Parameters
    ----------
    path : path
        The file; written whole or not at all.
    name : str
        The actuator's name.
    changes : iterable of Parameter
        Entries to write.
    base : str, optional
        The actuator or file the new one overrides.
    title : str
        One line.
    force : bool
        Whether an existing file may be replaced.

    Returns
    -------
    Path
        The file written.
    """
    import tomlkit

    head = tomlkit.document()
    head.add("name", tomlkit.item(name))
    if title:
        head.add("title", tomlkit.item(title))
    if base:
        head.add("base", tomlkit.item(base))
    return write_text(path, updated_set(tomlkit.dumps(head), changes), force=force)


def _fill(table: Any, parameter: Parameter) -> None:
    if parameter.confidence not in CONFIDENCES:
        raise InputError(
            f"{parameter.path}: a value of confidence {parameter.confidence!r} cannot be written; "
            "give it a source and a confidence first"
        )
    new = {
        "value": _written(parameter.value, parameter.unit),
        "unit": parameter.unit,
        "source": parameter.source,
        "note": parameter.note,
        "confidence": parameter.confidence,
        "old": None if parameter.old is None else _written(parameter.old, parameter.unit),
        "interval": parameter.interval
        and [_written(limit, parameter.unit) for limit in parameter.interval],
    }
    for key, value in new.items():
        if value is None or value == "":
            table.pop(key, None)
        else:
            table[key] = value


def _written(value: float | str, unit: str) -> float | str:
    """Return the shortest number in the entry's own unit that reads back as the same SI float."""
    if isinstance(value, str):
        return value

    exact = float(to_display(value, unit))
    for digits in range(6, 17):
        short = float(f"{exact:.{digits}g}")
        if parse_quantity(f"{short!r} {unit}".strip(), unit or "1") == value:
            return short
    return exact


_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9._-]*")
_WIDTH = 100
_HEAD = """\
# {name}: a variant of {base}. Remove the # of a line and change its value; the rest is the base's.
# A number needs its unit where one stands ("8 kg cm2"). To say where a value comes from, write
#   [gear.ratio]
#   value = 50
#   source = "datasheet of the gearbox"
#   confidence = "published"      # or derived, assumed, calibrated
# Then: elevon check {name}.toml; elevon show {name}.toml
base = "{base}"
title = "{title}"
"""


def variant_text(name: str, base: Actuator, reference: str) -> str:
    """Return the text of an actuator file that changes nothing yet.

    Parameters
    ----------
    name : str
        Of the variant.
    base : Actuator
        What it is a variant of.
    reference : str
        How the file names it: a name or a file.

    Raises
    ------
    InputError
        The name cannot be one of an actuator.
    """
    checked_name(name)
    known = records(base.wiring)
    title = base.title.replace("\\", "").replace('"', "'")
    lines = _HEAD.format(name=name, base=reference, title=f"Variant of {title}").splitlines()
    group = ""
    for path, parameter in base.parameters.items():
        part = path.partition(".")[0]
        if part != group:
            lines += ["", f"# {f' {part} ':-^{_WIDTH - 2}}"]
            group = part
        lines += _entry(parameter, known[path])
    return "\n".join(lines) + "\n"


def checked_name(name: str) -> str:
    """Return the name of an actuator; `InputError` where it cannot be one."""
    if not _NAME.fullmatch(name):
        raise InputError(f"{name!r}: a name has letters, digits, '.', '_' and '-'")
    return name


def _entry(parameter: Parameter, record: Record) -> list[str]:
    """Return a parameter's text, range and source as comments, then its line commented out."""
    value = parameter.text
    quoted = isinstance(parameter.value, str) or " " in value
    unit = "" if record.choices or record.unit in {"", "1"} else f" {record.unit}"
    about = [f"{record.text}; {record.range_text}{unit}", parameter.source, record.acts_text]
    text = ". ".join(part for part in about if part)
    comment = textwrap.wrap(text, _WIDTH, initial_indent="#   ", subsequent_indent="#   ")
    literal = f'"{value}"' if quoted else value
    return [*comment, f"# {parameter.path} = {literal}"]
