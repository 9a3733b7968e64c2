"""A complete, checked, immutable collection of parameters of one wiring."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Literal, TypeVar

from elevon.errors import InputError, unknown
from elevon.parameters.records import positions, record_of, records
from elevon.plain import plain, read_plain
from elevon.units import format_quantity

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt
    import pandas as pd

    from elevon.report.cards import Html


Confidence = Literal[
    "published", "derived", "assumed", "calibrated", "unknown", "default", "override"
]

#: What an actuator file may give; `default` and `override` are given by the program.
CONFIDENCES = ("published", "derived", "assumed", "calibrated", "unknown")


@dataclass(frozen=True, slots=True)
class Parameter:
    """A value of an actuator, with its provenance.

    Attributes
    ----------
    path : str
        Dotted path, such as ``motor.inertia``.
    value : float or str
        SI value, or the name of a choice.
    unit : str
        The unit as written in the file; empty for choices and pure numbers.
    source : str
        Where the number comes from; starts with ``ASSUMED`` when nobody published it.
    note : str
        How it was derived, what to know before using it.
    confidence : str
        published, derived, assumed, calibrated, unknown (given without a word); ``default`` for a
        healthy value the model itself gives, ``override`` for one set by the caller.
    old : float, optional
        SI value before calibration or override.
    interval : tuple of float, optional
        SI limits of the calibrated value's interval.
    changed : bool
        The caller gave another value than the file: where it has no effect, a run reports it.
    """

    path: str
    value: float | str
    unit: str = ""
    source: str = ""
    note: str = ""
    confidence: Confidence = "assumed"
    old: float | str | None = None
    interval: tuple[float, float] | None = None
    changed: bool = False

    @property
    def text(self) -> str:
        """The value with its unit, as written: ``"7.7 kg cm2"``."""
        return self.value if isinstance(self.value, str) else format_quantity(self.value, self.unit)


Result = TypeVar("Result")


class ParameterSet(Mapping[str, Parameter]):
    """All parameters of one wiring: a mapping from path to `Parameter`.

    Parameters
    ----------
    wiring : str
        The core's wiring.
    entries : mapping
        Path to `Parameter`. Where the core has a default, the entry may be absent.
    place : str, optional
        Named in the errors: the file.

    Raises
    ------
    UnknownNameError
        A path the wiring does not have, with the nearest.
    RangeError
        A value outside its range or not finite.
    InputError
        A parameter without a default is missing.
    """

    __slots__ = ("_away", "_hash", "_items", "_known", "_vector", "wiring")

    def __init__(self, wiring: str, entries: Mapping[str, Parameter], place: str = "") -> None:
        known = records(wiring)
        start = f"{place}: " if place else ""
        for path, entry in entries.items():
            record = record_of(wiring, path, place or None)
            record.read(entry.value, f"{start}{path}")
        missing = [p for p, r in known.items() if p not in entries and r.default is None]
        if missing:
            listed = ", ".join(missing[:8]) + (" ..." if len(missing) > 8 else "")
            raise InputError(f"{start}{len(missing)} parameter(s) missing: {listed}")
        self._hold(wiring, {path: entries.get(path) or _default(wiring, path) for path in known})

    def _hold(self, wiring: str, items: dict[str, Parameter]) -> None:
        self.wiring = wiring
        self._items = MappingProxyType(items)
        self._vector: npt.NDArray[np.float64] | None = None
        self._hash: str | None = None
        self._away: Mapping[str, Parameter] | None = None
        self._known: dict[Hashable, Any] = {}

    def __getitem__(self, path: str) -> Parameter:
        try:
            return self._items[path]
        except KeyError:
            raise unknown("parameter", path, self._items) from None

    def get(self, path: str, default: Any = None) -> Any:
        """Return a parameter, or the default where the wiring has none of that path."""
        return self._items.get(path, default)

    def __contains__(self, path: object) -> bool:
        return path in self._items

    def __iter__(self) -> Iterator[str]:
        return iter(self._items)

    def __len__(self) -> int:
        return len(self._items)

    def __repr__(self) -> str:
        return f"ParameterSet(wiring={self.wiring!r}, {len(self)} parameters, hash={self.hash})"

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)

    def _repr_html_(self) -> str:
        from elevon.report.cards import card

        facts = [("wiring", self.wiring), ("hash", self.hash)]
        return card(f"{len(self)} parameters", facts, _table(self.values()))

    def __reduce__(self) -> tuple[type[ParameterSet], tuple[str, dict[str, Parameter]]]:
        return ParameterSet, (self.wiring, dict(self._items))

    def to_dict(self) -> dict[str, Any]:
        """Return wiring and entries, plain types; defaults of the model are left out."""
        entries = {p: item for p, item in self._items.items() if item.confidence != "default"}
        return {"wiring": self.wiring, "entries": plain(entries)}

    @classmethod
    def from_dict(cls, data: Mapping[str, Any], place: str = "") -> ParameterSet:
        """Read the mapping that `to_dict` returns; errors as the constructor."""
        entries = read_plain(dict[str, Parameter], data.get("entries"), place)
        return cls(str(data.get("wiring")), entries, place)

    def to_pandas(self) -> pd.DataFrame:
        """Return one row a parameter, by path: value as written, unit, where it comes from."""
        import pandas as pd

        names = ("value", "unit", "confidence", "source", "note")
        rows = [[getattr(item, name) for name in names] for item in self.values()]
        return pd.DataFrame(rows, index=pd.Index(self, name="path"), columns=list(names))

    def value(self, path: str) -> float:
        """Return one number in SI; a choice as its index."""
        return records(self.wiring)[path].number(self[path].value)

    def vector(self) -> npt.NDArray[np.float64]:
        """Return all values, shape (n,), in the core's order, SI, choices as indices; read-only."""
        if self._vector is None:
            import numpy as np

            known = records(self.wiring)
            numbers = [known[path].number(item.value) for path, item in self._items.items()]
            self._vector = np.array(numbers)
            self._vector.flags.writeable = False
        return self._vector

    def away(self) -> Mapping[str, Parameter]:
        """Return what the caller changed away from neutral, by path."""
        if self._away is None:
            known = records(self.wiring)
            self._away = MappingProxyType(
                {
                    path: item
                    for path, item in self._items.items()
                    if item.changed and item.value != known[path].default_value()
                }
            )
        return self._away

    def replaced(
        self,
        values: Mapping[str, str | float],
        *,
        source: str = "set by the caller",
        place: str = "",
        request: bool = True,
    ) -> ParameterSet:
        """Return parameters with some values changed; a number alone is SI, text may carry a unit.

        Raises
        ------
        UnknownNameError, UnitError, RangeError
            As the constructor.
        """
        items = dict(self._items)
        for path, given in values.items():
            record = record_of(self.wiring, path, place or None)
            old = items[path]
            value = record.read(given, f"{place}: {path}" if place else path, old.unit)
            items[path] = replace(
                old,
                value=value,
                unit=old.unit or record.unit,
                source=source,
                note="",
                confidence="override",
                old=old.value,
                interval=None,
                changed=old.changed or (request and value != old.value),
            )
        # Everything else was checked when these parameters were made.
        result = ParameterSet.__new__(ParameterSet)
        result._hold(self.wiring, items)
        result._vector = self._changed_vector(items, values)
        return result

    def _changed_vector(
        self, items: Mapping[str, Parameter], changed: Iterable[str]
    ) -> npt.NDArray[np.float64]:
        """Return this vector with some entries taken from other items."""
        vector = self.vector().copy()
        known = records(self.wiring)
        place = positions(self.wiring)
        for path in changed:
            vector[place[path]] = known[path].number(items[path].value)
        vector.flags.writeable = False
        return vector

    def once(self, key: Hashable, make: Callable[[], Result]) -> Result:
        """Return what `make` returns, which depends on these values and `key` alone; made once."""
        if key not in self._known:
            self._known[key] = make()
        result: Result = self._known[key]
        return result

    @property
    def hash(self) -> str:
        """Sixteen hexadecimal digits over the wiring and every value, not over the notes."""
        if self._hash is None:
            lines = [self.wiring, *(f"{path}={item.value!r}" for path, item in self._items.items())]
            self._hash = hashlib.sha256("\n".join(lines).encode()).hexdigest()[:16]
        return self._hash


def _table(parameters: Iterable[Parameter]) -> Html:
    from elevon.report.cards import table

    rows = [[p.path, p.text, p.confidence, p.source, p.note] for p in parameters]
    return table(["parameter", "value", "confidence", "source", "note"], rows)


def _default(wiring: str, path: str) -> Parameter:
    record = records(wiring)[path]
    value = record.default_value()
    assert value is not None
    unit = record.unit if record.unit != "1" and record.choices is None else ""
    return Parameter(path, value, unit, "the model's default", record.text, "default")
