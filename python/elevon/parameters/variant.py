"""A file for a variant of one's own: every parameter of the base, commented out."""

from __future__ import annotations

import re
import textwrap
from typing import TYPE_CHECKING

from elevon.errors import InputError
from elevon.parameters.records import Record, records

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.parameters.parameter import Parameter

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
