"""A plan's files go into the resolved plan: a file changed later changes nothing."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from elevon.campaign.draw import Column
from elevon.errors import InputError
from elevon.faults import Fault
from elevon.files import read_regular
from elevon.series import LONGEST, read_series

_FILE = re.compile(r"(file\s*=\s*)([^,()]+)")


@dataclass
class Embedder:
    """Reads the files that a plan names, relative to the plan.

    Attributes
    ----------
    folder : Path or None
        Of the plan.
    root : Path or None
        The files must lie in it or below; None: anywhere.
    points : dict
        File as written in the values of an axis to its ``{"times": ..., "values": ...}``.
    sources : dict
        Path to SHA-256 of everything read.
    """

    folder: Path | None
    root: Path | None = None
    points: dict[str, dict[str, list[float]]] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)

    def located(self, name: str) -> Path:
        """Return a file's path, relative ones from the plan's folder.

        Raises
        ------
        InputError
            It names no file, lies outside the folder that the plan may read from, or leads there
            by a link.
        """
        try:
            path = Path(name).expanduser()
            path = path if path.is_absolute() or self.folder is None else self.folder / path
            place = path.resolve()
        except (OSError, ValueError, RuntimeError) as error:  # a zero byte, ~nobody, a ring
            raise InputError(f"{name!a}: names no file: {error}") from error
        if self.root is not None and not place.is_relative_to(self.root.resolve()):
            raise InputError(
                f"{name}: lies outside the plan's folder {self.root}; --allow-outside "
                "(allow_outside=True) lets a plan read other files"
            )
        return path

    def series(self, name: str, place: str) -> dict[str, list[float]]:
        """Return the points of a CSV file; errors as `read_series`."""
        path = self.located(name)
        times, values = read_series(path, place)
        self.sources[str(path)] = hashlib.sha256(read_regular(path, LONGEST)).hexdigest()
        return {"times": list(times), "values": list(values)}

    def scenario(self, data: Mapping[str, object], place: str) -> dict[str, object]:
        """Return a scenario's mappings with the points of every file in them."""
        return {
            key: [self.fault(item, f"{place}.fault[{k}]") for k, item in enumerate(value)]
            if key == "fault" and isinstance(value, (list, tuple))
            else self._within(value, f"{place}.{key}")
            for key, value in data.items()
        }

    def fault(self, item: Any, place: str) -> Any:
        """Return a fault (text or table) with the points of its profile's file in it."""
        if isinstance(item, Fault):
            return item.to_dict()
        if isinstance(item, str):
            text = _FILE.sub(lambda m: m[1] + str(self.note(m[2].strip())), item)
            try:
                return Fault.parse(text).to_dict()
            except InputError as error:
                raise type(error)(f"{place}: {error}") from error
        if isinstance(item, Mapping) and "profile" in item:
            return {**item, "profile": self.profile(item["profile"], place)}
        return item

    def profile(self, item: Any, place: str) -> Any:
        """Return a profile (text or table) with the points of its file in it."""
        if isinstance(item, str) and _FILE.search(item):
            from elevon.faults import Profile

            text = _FILE.sub(lambda m: m[1] + str(self.note(m[2].strip())), item)
            return Profile.parse(text).to_dict()
        return self._within(item, place)

    def column(self, column: Column, place: str) -> Column:
        """Read the files among the values of a column, and of its fault's profile."""
        if column.kind == "scenario" and column.name.endswith(".file"):
            for name in dict.fromkeys(str(value) for value in column.values):
                self.points[name] = self.series(name, f"{place}: {column.name}")
        if column.profile is None:
            return column
        return replace(column, profile=self.profile(column.profile, place))

    def note(self, name: str) -> Path:
        """Note a file as a source, and return its path."""
        path = self.located(name)
        if path.is_file():
            self.sources[str(path)] = hashlib.sha256(read_regular(path, LONGEST)).hexdigest()
        return path

    def _within(self, value: Any, place: str) -> Any:
        if isinstance(value, (list, tuple)):
            return [self._within(item, f"{place}[{k}]") for k, item in enumerate(value)]
        if not isinstance(value, Mapping):
            return value
        inner = {key: self._within(item, f"{place}.{key}") for key, item in value.items()}
        if isinstance(name := inner.get("file"), str) and "times" not in inner:
            del inner["file"]
            inner.update(self.series(name, place))
        return inner


def filled(data: Any, points: Mapping[str, Mapping[str, list[float]]]) -> Any:
    """Return a scenario's mappings with the points of the files that an axis put there."""
    if isinstance(data, list):
        return [filled(item, points) for item in data]
    if not isinstance(data, dict):
        return data
    inner = {key: filled(item, points) for key, item in data.items()}
    if isinstance(name := inner.get("file"), str) and name in points:
        del inner["file"]
        inner.update(points[name])
    return inner
