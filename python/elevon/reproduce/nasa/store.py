"""Finished cells of a long reproduction, kept in its folder so that an interrupted one goes on."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.errors import OutputExistsError
from elevon.files import write_text


def made_of(actuator: Actuator) -> dict[str, str]:
    """Return what else decides a cell: the actuator's numbers and the program."""
    import elevon

    return {"parameter_hash": actuator.parameters.hash, "version": elevon.__version__}


def work_key(**facts: object) -> str:
    """Return digits that tell one piece of work from any other: equal facts, equal digits."""
    text = json.dumps(facts, sort_keys=True, default=str)
    return hashlib.sha256(text.encode()).hexdigest()[:16]


class CellStore:
    """Arrays by name in ``runs.json``, written whole after every cell.

    Parameters
    ----------
    folder : Path or None
        None keeps them in memory only.
    key : str
        Of the work (`work_key`): cells of another one are not used.

    Raises
    ------
    OutputExistsError
        ``runs.json`` cannot be read.
    """

    def __init__(self, folder: Path | None, key: str) -> None:
        self._path = None if folder is None else folder / "runs.json"
        self._key = key
        self._cells: dict[str, list[Any]] = {}
        if self._path is not None and self._path.is_file():
            self._cells = self._read(self._path)

    def _read(self, path: Path) -> dict[str, list[Any]]:
        try:
            content = json.loads(path.read_text("utf-8"))
            same = content["work"] == self._key
            return dict(content["cells"]) if same else {}
        except (OSError, ValueError, KeyError, TypeError) as error:
            raise OutputExistsError(
                f"{path}: cannot be read ({error}); remove it to begin again"
            ) from error

    def get(self, name: str) -> Floats | None:
        """Return a finished cell, None where it is not there."""
        values = self._cells.get(name)
        return None if values is None else np.array(values, dtype=float)

    def put(self, name: str, values: Floats) -> None:
        """Keep a finished cell."""
        self._cells[name] = values.tolist()
        if self._path is not None:
            content = {"work": self._key, "cells": self._cells}
            write_text(self._path, json.dumps(content) + "\n", force=True)
