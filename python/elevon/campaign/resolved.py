"""A resolved plan: the table of its runs, and each run as the core takes it."""

from __future__ import annotations

import copy
import hashlib
import itertools
import re
from collections import OrderedDict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.campaign.draw import Column
from elevon.errors import InputError, unknown
from elevon.faults import Fault, FaultRecord, find_record
from elevon.files import read_regular
from elevon.parameters.records import positions
from elevon.scenario import Scenario
from elevon.series import LONGEST, read_series
from elevon.simulate import Run
from elevon.simulate.prepare import Prepared, prepare

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
            else self._embed_files(value, f"{place}.{key}")
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
        return self._embed_files(item, place)

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

    def _embed_files(self, value: Any, place: str) -> Any:
        if isinstance(value, (list, tuple)):
            return [self._embed_files(item, f"{place}[{k}]") for k, item in enumerate(value)]
        if not isinstance(value, Mapping):
            return value
        inner = {key: self._embed_files(item, f"{place}.{key}") for key, item in value.items()}
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


Ints = npt.NDArray[np.int64]


@dataclass(frozen=True)
class CaseChanges:
    """What a case of the plan changes."""

    name: str = ""
    faults: list[dict[str, Any]] = field(default_factory=list)
    parameters: dict[str, Any] = field(default_factory=dict)
    scenario: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Index:
    """What each run is, beside the varied quantities; every array has shape (runs,).

    Attributes
    ----------
    unit, draw, block, replicate, seed, variant : ndarray of int
        Numbers; a unit of -1 means that the plan has no population.
    age : ndarray of float
        Of the unit, 0 to 1; NaN without a population.
    split : ndarray of str
        Part of the data; empty without a split.
    """

    unit: Ints
    age: npt.NDArray[np.float64]
    variant: Ints
    draw: Ints
    block: Ints
    replicate: Ints
    seed: Ints
    split: npt.NDArray[Any]


@dataclass
class Resolved:
    """Every run of a plan; nothing outside it is needed to simulate one.

    Attributes
    ----------
    actuator : Actuator
        With the plan's own parameters.
    scenario : dict
        Of all runs, before what a case or a column changes.
    variants : list of CaseChanges
        The plan's cases; one nameless one without.
    columns : list of Column
        The varied quantities.
    index : Index
        What each run is.
    files, sources : dict
        Points of the files among the values; path and SHA-256 of every file read.
    split : dict
        How the runs are dealt to parts: ``shares``, ``by`` and ``seed``; empty without parts.
    mark : str
        The plan's hash, as the folder that it was read from or written to has it.
    """

    name: str
    text: str
    actuator: Actuator
    fidelity: str
    record: list[str] | None
    scenario: dict[str, Any]
    variants: list[CaseChanges]
    columns: list[Column]
    index: Index
    features: list[str] = field(default_factory=list)
    responses: list[str] = field(default_factory=list)
    allow_not_acting: bool = False
    runs_per_file: int | None = None
    files: dict[str, Any] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)
    design: dict[str, Any] = field(default_factory=dict)
    split: dict[str, Any] = field(default_factory=dict)
    mark: str = field(default="", init=False, compare=False)
    _known: OrderedDict[Any, Prepared] = field(default_factory=OrderedDict, repr=False)

    def __len__(self) -> int:
        return len(self.index.seed)

    @property
    def wiring(self) -> str:
        """Name of the actuator's wiring."""
        return self.actuator.wiring

    def values(self, number: int) -> dict[str, object]:
        """Return the varied quantities of one run: SI numbers, 0 for a fault it is spared."""
        return {c.name: _python_value(c.values[number]) for c in self.columns}

    def run(self, number: int) -> Run:
        """Return one run, as `elevon.simulate` takes it.

        Raises
        ------
        InputError
            Its values cannot be; the run is named.
        """
        place = f"run {number}"
        variant = self.variants[self.index.variant[number]]
        parameters = dict(variant.parameters)
        parameters.update(
            (c.name, _python_value(c.values[number])) for c in self.columns if c.kind == "parameter"
        )
        return Run(
            self.actuator.with_values(parameters, source="plan", place=place),
            Scenario.from_dict(self._scenario(number, variant, place), place),
            int(self.index.seed[number]),
            f"{self.name}-{number:06d}",
            number,
        )

    def prepared(self, number: int) -> Prepared:
        """Return one run ready for the core; what runs share is worked out once.

        Raises
        ------
        InputError
            Its values cannot be; the run is named.
        """
        template = self._template(number)
        vector = template.core["parameters"].copy()
        place = positions(self.wiring)
        for column in self.columns:
            if column.kind == "parameter" and column.numeric:
                vector[place[column.name]] = column.values[number]
        drawn = self._severities(number)
        faults = [
            {**fault, "severity": drawn.get(f"{fault['kind']}@{fault['place']}", fault["severity"])}
            for fault in template.core["faults"]
        ]
        changed = {
            "parameters": vector,
            "faults": faults,
            "seed": int(self.index.seed[number]),
            "run": number,
        }
        return replace(template, core={**template.core, **changed})

    def structure(self, number: int) -> tuple[object, ...]:
        """Return what decides how a run is prepared, apart from numbers that are only put in."""
        key: list[Any] = [int(self.index.variant[number])]
        for column in self.columns:
            value = _python_value(column.values[number])
            if column.kind == "fault":
                key.append(value != 0.0)
            elif (
                column.kind == "scenario" or not column.numeric or _changes_preparation(column.name)
            ):
                key.append(value if isinstance(value, (float, str)) else repr(value))
        return tuple(key)

    def fault_names(self) -> dict[str, str]:
        """Return ``KIND@PLACE`` of every fault in any run, and the unit of its severity."""
        fixed = [*self.scenario.get("fault", []), *(f for v in self.variants for f in v.faults)]
        names = [f"{f['kind']}@{f['place']}" for f in fixed]
        names += [c.name for c in self.columns if c.kind == "fault"]
        return {
            name: record_of_fault(name, self.wiring).unit or "1" for name in dict.fromkeys(names)
        }

    def not_carried(self) -> dict[str, str]:
        """Return the faults that the fidelity does not carry, each with the core's reason."""
        records = {n: record_of_fault(n, self.wiring) for n in self.fault_names()}
        return {
            name: record.not_modelled.get(self.fidelity, "")
            for name, record in records.items()
            if self.fidelity not in record.fidelities
        }

    def _severities(self, number: int) -> dict[str, float]:
        return {c.name: float(c.values[number]) for c in self.columns if c.kind == "fault"}

    def _template(self, number: int) -> Prepared:
        key = self.structure(number)
        if key not in self._known:
            try:
                features = self.features or None
                run = self.run(number)
                prepared = prepare(run, self.fidelity, self.record, features, notices=False)
            except InputError as error:
                start = "" if str(error).startswith("run ") else f"run {number}: "
                raise type(error)(f"{start}{error}") from error
            self._known[key] = prepared
            if len(self._known) > _MOST_TEMPLATES:
                self._known.popitem(last=False)
        return self._known[key]

    def _scenario(self, number: int, variant: CaseChanges, place: str) -> dict[str, Any]:
        data = copy.deepcopy({**self.scenario, **variant.scenario})
        for column in self.columns:
            if column.kind == "scenario":
                set_place(
                    data, column.name, copy.deepcopy(_python_value(column.values[number])), place
                )
        faults = [*data.get("fault", []), *variant.faults, *self._faults_of_run(number)]
        dropped = self.not_carried() if self.allow_not_acting else {}
        data["fault"] = [f for f in faults if f"{f['kind']}@{f['place']}" not in dropped]
        whole: dict[str, Any] = filled(data, self.files)
        return whole if whole["fault"] else {k: v for k, v in whole.items() if k != "fault"}

    def _faults_of_run(self, number: int) -> Iterator[dict[str, Any]]:
        for column in self.columns:
            if column.kind == "fault" and column.values[number] != 0.0:
                kind, at = column.name.split("@")
                fault = {"kind": kind, "place": at, "severity": float(column.values[number])}
                profile = {} if column.profile is None else {"profile": column.profile}
                yield {**fault, **column.attributes, **profile}


#: Templates kept; of runs that each have a scenario of their own, only the last are of use.
_MOST_TEMPLATES = 512


def _changes_preparation(path: str) -> bool:
    """Whether a number decides more of a run's preparation than its own place in the vector."""
    return path.endswith((".step", ".pole_pairs")) or path.startswith("stop.")


def record_of_fault(name: str, wiring: str) -> FaultRecord:
    """Return the catalogue's record of ``KIND@PLACE``."""
    kind, _, place = name.partition("@")
    return find_record(kind, place, wiring)


def _python_value(value: Any) -> Any:
    return value.item() if hasattr(value, "item") else value


_STEP = re.compile(r"([A-Za-z_][A-Za-z0-9_]*)|\[(\d+)\]")


def set_place(data: Any, path: str, value: object, place: str) -> None:
    """Set one place of nested mappings and lists; the place must be one the scenario has."""
    steps: list[Any] = [m[1] if m[1] else int(m[2]) for m in _STEP.finditer(path)]
    written = "".join(f"[{s}]" if isinstance(s, int) else f".{s}" for s in steps).lstrip(".")
    if not steps or written != path:
        raise InputError(
            f"{place}: scenario = {path!r} is not a place such as command.terms[0].phase"
        )
    for step, following in itertools.pairwise(steps):
        data = _step_into(data, step, following, path, place)
    last = steps[-1]
    if isinstance(last, int) and (not isinstance(data, list) or last >= len(data)):
        raise InputError(f"{place}: the scenario has no {path!r} (no entry {last})")
    data[last] = value


def _step_into(data: Any, step: Any, following: Any, path: str, place: str) -> Any:
    if isinstance(step, int):
        if not isinstance(data, list) or step >= len(data):
            raise InputError(f"{place}: the scenario has no {path!r} (no entry {step})")
        return data[step]
    if not isinstance(data, Mapping):
        raise InputError(f"{place}: the scenario has no {path!r}")
    if step not in data and isinstance(following, int):
        raise unknown("place of the scenario", path, data, place)
    return data[step] if step in data else data.setdefault(step, {})  # type: ignore[attr-defined]


Groups = npt.NDArray[np.int64]


def dealt(
    groups: Groups, shares: Mapping[str, float], seed: int, place: str, noun: str
) -> npt.NDArray[np.object_]:
    """Return the part of each run.

    Parameters
    ----------
    groups : ndarray, shape (runs,)
        Number of the unit or draw that each run belongs to.
    shares : mapping
        Part to its share; they add up to 1.
    seed : int
        Of the dealing.
    place, noun : str
        Where the shares stand, and what the groups are (``unit``, ``draw``); for the error.

    Raises
    ------
    InputError
        So few groups that a part would get none.
    """
    known, member = np.unique(groups, return_inverse=True)
    order = np.random.default_rng(seed).permutation(len(known))
    names, limits = list(shares), np.cumsum(list(shares.values()))
    part = np.searchsorted(limits, (np.arange(len(known)) + 0.5) / len(known), side="right")
    part = np.minimum(part, len(names) - 1)
    for number, name in enumerate(names):
        if shares[name] > 0.0 and number not in part:
            raise InputError(
                f"{place}: {name} = {shares[name]:g} of {len(known)} {noun}(s) is none; "
                f"a {noun} is never divided between two parts"
            )
    of_group = np.empty(len(known), dtype=np.int64)
    of_group[order] = part
    return np.array(names, dtype=object)[of_group[member]]


def split_index(resolved: Resolved, about: Mapping[str, Any], place: str = "split") -> None:
    """Deal the runs of a resolved plan to parts.

    Parameters
    ----------
    resolved : Resolved
        Changed: its index and its `split`.
    about : mapping
        ``shares``, ``by`` (``unit`` or ``draw``) and ``seed``; empty: no parts.
    place : str
        Where the shares stand; for the error.

    Raises
    ------
    InputError
        So few groups that a part would get none.
    """
    index = resolved.index
    parts: npt.NDArray[Any] = np.full(len(index.seed), "", dtype=object)
    if about:
        groups = index.unit if about["by"] == "unit" else index.draw
        parts = dealt(groups, about["shares"], about["seed"], place, about["by"])
    resolved.index = replace(index, split=parts)
    resolved.split = dict(about)


def leaks(groups: Sequence[object], split: Sequence[str]) -> list[object]:
    """Return the groups (units or draws) whose runs stand in more than one part."""
    first: dict[Any, str] = {}
    distinct: dict[Any, None] = {}
    for group, part in zip(groups, split, strict=True):
        if first.setdefault(group, part) != part:
            distinct[group] = None
    return list(distinct)
