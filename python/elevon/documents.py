"""TOML documents: read them, say where a key stands, turn a failed validation into one message."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from elevon.errors import FormatError, InputError, did_you_mean
from elevon.files import read_regular

if TYPE_CHECKING:
    from pydantic import BaseModel, ValidationError

    Model = TypeVar("Model", bound=BaseModel)

Location = tuple[str | int, ...]

#: The kinds of plain value a key may hold, as pydantic names the branches of a union.
_BRANCHES = frozenset({"int", "float", "str", "bool"})

_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(#.*)?$")
_KEY = re.compile(r"""^\s*((?:[A-Za-z0-9_-]+|"[^"]*"|'[^']*')(?:\s*\.\s*[A-Za-z0-9_-]+)*)\s*=""")


@dataclass(frozen=True)
class Document:
    """A TOML document and where it came from."""

    origin: str
    text: str
    data: dict[str, Any]
    folder: Path | None = None
    prefix: Location = ()

    def within(self, prefix: Sequence[str | int]) -> Document:
        """Return the document seen from one of its tables: places are given from there on."""
        return replace(self, prefix=(*self.prefix, *prefix))

    def place(self, location: Sequence[str | int] = ()) -> str:
        """Name a place: the file, the line where one is found, and the dotted key."""
        location = (*self.prefix, *location)
        line = self._line(location)
        start = f"{self.origin}:{line}" if line else self.origin
        return f"{start}: {dotted(location)}" if location else start

    def _line(self, location: Location) -> int | None:
        while location:
            if location in self._lines:
                return self._lines[location]
            location = location[:-1]
        return None

    @cached_property
    def _lines(self) -> dict[Location, int]:
        """Line number of each table header and each `key =` line."""
        lines: dict[Location, int] = {}
        counts: dict[Location, int] = {}
        table: Location = ()
        for number, text in enumerate(self.text.splitlines(), start=1):
            if header := _HEADER.match(text):
                array = header.group(1) == "[["
                table = _table(_split(header.group(2)), counts, array=array)
                lines.setdefault(table, number)
            elif key := _KEY.match(text):
                lines.setdefault(table + _split(key.group(1)), number)
        return lines


_LONGEST = 16 * 2**20
"""Bytes of a TOML file: a table of a hundred thousand points takes some 4 MB."""


def read_toml(path: str | Path) -> Document:
    """Read a TOML file.

    Raises
    ------
    InputError
        The file cannot be read.
    FormatError
        It is not TOML (the message holds the line), no regular file, or longer than 16 MiB.
    """
    file = Path(path).expanduser()
    try:
        text = read_regular(file, _LONGEST).decode("utf-8")
    except UnicodeDecodeError as error:
        raise FormatError(f"{file}: is not UTF-8 text: {error}") from error
    try:
        data = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise FormatError(f"{file}: not valid TOML: {error}") from error
    except ValueError as error:  # Python's own limit
        raise FormatError(f"{file}: a whole number has more than 4300 digits") from error
    except RecursionError as error:
        raise FormatError(f"{file}: {_TOO_DEEP}") from error
    check_depth(data, str(file))
    return Document(str(file), text, data, file.parent)


#: Levels of tables and lists that any file of ours can need, with room to spare.
_DEEPEST = 32
_TOO_DEEP = f"tables and lists are nested deeper than {_DEEPEST} levels"


def check_depth(data: object, place: str) -> None:
    """Raise `FormatError` where tables and lists are nested deeper than any file of ours needs."""
    if _depth(data) > _DEEPEST:
        raise FormatError(f"{place}: {_TOO_DEEP}")


def _depth(data: Any) -> int:
    """Return how deep tables and lists are nested, counted without recursion."""
    level, depth = [data], 0
    while level and depth <= _DEEPEST:
        depth += 1
        level = [
            inner
            for item in level
            if isinstance(item, (dict, list))
            for inner in (item.values() if isinstance(item, dict) else item)
        ]
    return depth


def validated(model: type[Model], data: Mapping[str, object], document: Document) -> Model:
    """Build a pydantic model, or raise one `InputError` that lists every finding with its place."""
    from pydantic import ValidationError

    try:
        return model.model_validate(dict(data))
    except ValidationError as error:
        raise InputError(_explain(error, model, document)) from error


def dotted(location: Sequence[str | int]) -> str:
    """Write a location as a dotted key with indices: ``command.terms[0].kind``."""
    text = ""
    for part in location:
        text += f"[{part}]" if isinstance(part, int) else f".{part}" if text else str(part)
    return text


def _explain(error: ValidationError, model: type[BaseModel], document: Document) -> str:
    """List the findings, those of the branches of one union as one."""
    findings: dict[str, str] = {}
    for item in error.errors(include_url=False):
        location = tuple(item["loc"])
        if location and location[-1] in _BRANCHES:
            place, message = document.place(location[:-1]), _not_a_value(item["input"])
        else:
            place, message = document.place(location), _finding(item, location, model)
        findings[f"{place}: {message}"] = ""
    return "\n".join(findings)


def _finding(item: Any, location: Location, model: type[BaseModel]) -> str:
    if item["type"] == "extra_forbidden":
        valid = _fields(model, location[:-1])
        return f"unknown key {location[-1]!r}{did_you_mean(str(location[-1]), valid)}"
    if item["type"] == "missing":
        return "is missing"
    message = str(item["msg"]).removeprefix("Value error, ")
    return message if item["type"] == "value_error" else f"{message} (given: {item['input']!r})"


def _not_a_value(given: Any) -> str:
    if isinstance(given, float) and not math.isfinite(given):
        return f"{given} is not a finite number"
    return f"{given!r} is not a number or a text with a number and unit"


def _fields(model: Any, location: Sequence[str | int]) -> list[str]:
    """Names of the fields of the model found at a location, following lists and mappings."""
    from pydantic import BaseModel

    annotation = model
    for part in location:
        if isinstance(model, type) and issubclass(model, BaseModel):
            fields = {field.alias or name: field for name, field in model.model_fields.items()}
            if part in fields:
                annotation = fields[str(part)].annotation
                model = _inner_model(annotation)
            else:  # an index, or the tag of one of several models
                model = _tagged(annotation, part) or model
    if isinstance(model, type) and issubclass(model, BaseModel):
        return [field.alias or name for name, field in model.model_fields.items()]
    return []


def _tagged(annotation: Any, tag: str | int) -> Any:
    """Find, among the models of an annotation, the one with a literal field of that value."""
    from typing import get_args

    from pydantic import BaseModel

    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        literals = (get_args(field.annotation) for field in annotation.model_fields.values())
        return annotation if any(tag in values for values in literals) else None
    inner = (_tagged(argument, tag) for argument in get_args(annotation))
    return next((model for model in inner if model is not None), None)


def _inner_model(annotation: Any) -> Any:
    from typing import get_args

    from pydantic import BaseModel

    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    for argument in get_args(annotation):
        inner = _inner_model(argument)
        if inner is not None:
            return inner
    return None


def _split(key: str) -> Location:
    return tuple(part.strip().strip("\"'") for part in key.split("."))


def _table(path: Location, counts: dict[Location, int], *, array: bool) -> Location:
    """Location of a table header, with the index of each array of tables on the way."""
    location: Location = ()
    for depth, part in enumerate(path):
        location = (*location, part)
        last = depth == len(path) - 1
        if last and array:
            counts[location] = counts.get(location, -1) + 1
        if location in counts:
            location = (*location, counts[location])
    return location
