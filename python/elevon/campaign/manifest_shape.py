"""What a manifest must be made of: a checksum proves that it is whole, not that it is one."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from pathlib import PurePosixPath
from typing import TYPE_CHECKING, Annotated, Any

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError

if TYPE_CHECKING:
    from pydantic import TypeAdapter


def _below(name: str) -> str:
    """Refuse a file's name that leads out of the folder."""
    path = PurePosixPath(name)
    if path.is_absolute() or ".." in path.parts or "\0" in name or not path.parts:
        raise ValueError("does not name a file below the folder")
    return name


class _File(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow")

    bytes: int = Field(ge=0)
    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")


_Name = Annotated[str, Field(max_length=200), AfterValidator(_below)]
_Files = dict[_Name, _File]


class _Block(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow")

    name: str
    first: int = Field(ge=0)
    last: int = Field(ge=0)
    files: _Files


class _Named(BaseModel):
    model_config = ConfigDict(strict=True, extra="allow")

    name: str


#: Fields whose type says less than what readers rely on.
_CLOSER: Mapping[str, Any] = {
    "total": Annotated[int, Field(ge=0)],
    "files": _Files,
    "blocks": list[_Block],
    "clocks": list[_Named],
    "faults": list[_Named],
    "columns": list[_Named],
}


def shape_error(kind: type, content: Mapping[str, object]) -> str | None:
    """Return what is wrong with a manifest's fields, in one line; None where nothing is.

    Parameters
    ----------
    kind : type
        The dataclass whose fields they are.
    content : mapping
        Field to value.
    """
    for name, adapter in _adapters(kind).items():
        try:
            adapter.validate_python(content[name], strict=True)
        except ValidationError as error:
            first = error.errors(include_url=False, include_input=False)[0]
            place = ".".join(str(part)[:60] for part in (name, *first["loc"]))
            return f"{place}: {first['msg']}"
    return None


@lru_cache(maxsize=2)
def _adapters(kind: type) -> dict[str, TypeAdapter[Any]]:
    from typing import get_type_hints

    from pydantic import TypeAdapter

    return {
        name: TypeAdapter(_CLOSER.get(name, hint)) for name, hint in get_type_hints(kind).items()
    }
