"""What is done on the bench: typed steps, read from TOML.

The package's own procedures (`procedures/*.toml`) and your own are the same kind of file. Steps
change the bench one after the other; each ``trace`` step records one log with the bench as it
stands.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib.resources import files
from pathlib import Path
from typing import Any, Self

from pydantic import (
    StrictStr,
    model_validator,
)

from elevon.bench.steps import PlainName, Step, TraceStep
from elevon.documents import read_toml, validated
from elevon.errors import unknown
from elevon.strict import Strict


class Procedure(Strict):
    """A bench procedure.

    Attributes
    ----------
    name, text : str
        What it is called and what it is for.
    stand : str, optional
        The stand it is written for (`elevon.bench.stand.stand_names`); default: any.
    step : tuple of Step
        In order; at least one of them a trace, each trace with a name of its own.
    """

    name: PlainName
    text: StrictStr = ""
    stand: StrictStr | None = None
    step: tuple[Step, ...]

    @model_validator(mode="after")
    def _traced(self) -> Self:
        names = [item.name for item in self.step if isinstance(item, TraceStep)]
        if not names:
            raise ValueError("no step of kind 'trace': nothing would be recorded")
        for name in names:
            if names.count(name) > 1:
                raise ValueError(f"two traces are named {name!r}")
        return self

    @property
    def traces(self) -> tuple[TraceStep, ...]:
        """The steps that record."""
        return tuple(item for item in self.step if isinstance(item, TraceStep))


def procedure_names(stand: str | None = None) -> list[str]:
    """Return the names of the package's own procedures, of one stand or all."""
    folder = files("elevon.bench") / "procedures"
    names = sorted(
        item.name.removesuffix(".toml") for item in folder.iterdir() if item.name.endswith(".toml")
    )
    if stand is None:
        return names
    return [name for name in names if load_procedure(name).stand in (None, stand)]


def load_procedure(reference: str | os.PathLike[str]) -> Procedure:
    """Load a procedure by its name, or from a TOML file.

    Raises
    ------
    UnknownNameError
        No procedure of that name, and no such file.
    InputError
        The file is wrong; the message holds file, line, key, limit and the nearest names.
    """
    text = os.fspath(reference)
    names = procedure_names()
    if text in names:
        path = Path(str(files("elevon.bench") / "procedures" / f"{text}.toml"))
    elif text.endswith(".toml") or os.sep in text:
        path = Path(text)
    else:
        raise unknown("procedure", text, names)
    document = read_toml(path)
    return validated(Procedure, _located(document.data, path.parent), document)


def _located(data: Any, folder: Path) -> Any:
    """Make the files named in tables relative to the procedure's folder."""
    if isinstance(data, list):
        return [_located(item, folder) for item in data]
    if not isinstance(data, Mapping):
        return data
    return {
        key: str((folder / item).resolve())
        if key == "file" and isinstance(item, str)
        else _located(item, folder)
        for key, item in data.items()
    }
