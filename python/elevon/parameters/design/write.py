"""The one page of a new actuator: its few numbers, and what the rules assume beside them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from importlib.resources import files
from string import Template

from elevon.parameters.set import Parameter
from elevon.parameters.write import checked_name

_TAIL = "# Not given, so assumed or derived; take away the # to state another value:\n"


def design_text(
    name: str,
    base: str,
    title: str,
    given: Mapping[str, str],
    design: Mapping[str, Parameter],
    *,
    source: str | None = None,
) -> str:
    """Return the text of an actuator file that states a design.

    Parameters
    ----------
    name, base, title, source : str
        Of the file; the source is that of the numbers, None where nobody says.
    given : mapping
        Name to text, as the caller wrote it.
    design : mapping
        Name to `Parameter`, the derived ones included: they stand as comments.

    Raises
    ------
    InputError
        The name cannot be one of an actuator.
    """
    template = files("elevon.parameters.design") / "head.txt"
    head = Template(template.read_text("utf-8")).substitute(
        name=checked_name(name),
        base=json.dumps(base),
        title=json.dumps(title, ensure_ascii=False),
    )
    lines = [] if source is None else [f"source = {json.dumps(source, ensure_ascii=False)}"]
    lines += [f"{key} = {_literal(text)}" for key, text in given.items()]
    comments = [
        f"# {key} = {_literal(_short(item))}".ljust(34) + f"# {_reason(item)}"
        for key, item in design.items()
        if key not in given and key != "current"
    ]
    tail = _TAIL + "\n".join(comments) + "\n" if comments else ""
    return head + "\n".join(lines) + "\n" + tail


def _literal(text: str) -> str:
    try:
        float(text)
    except ValueError:
        return json.dumps(text, ensure_ascii=False)
    return text


def _short(item: Parameter) -> str:
    number, space, unit = item.text.partition(" ")
    return f"{float(number):.4g}{space}{unit}"


def _reason(item: Parameter) -> str:
    return item.source if item.confidence == "assumed" else f"{item.source}: {item.note}"
