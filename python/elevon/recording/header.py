"""What a recording file says beside its numbers: one JSON text, the same in every format.

Numbers that JSON cannot write (NaN, infinities) are written ``{"$float": "nan"}``. The entry
``sha256`` is that of the description without it and of every time and value: whatever bit of a
file changes, loading it is an error or gives back what was saved.
"""

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.errors import DamageError, FormatError, InputError, VersionError

if TYPE_CHECKING:
    from elevon.recording.recording import Recording

SCHEMA = 3
"""Version of the files' layout, apart from the version of the package."""
_READ = (2, SCHEMA)
"""What is read: version 2 has names that were replaced since."""

_LONGEST = 64 * 2**20
_DEEPEST = 50


@dataclass(frozen=True)
class ClockHeader:
    """A clock as its file describes it; `channels` maps names to (unit, text)."""

    name: str
    rate: float | None
    gaps: list[int]
    samples: int
    channels: dict[str, tuple[str, str]]


@dataclass(frozen=True)
class Header:
    """Everything of a recording but its time and values."""

    clocks: list[ClockHeader]
    meta: dict[str, Any] = field(default_factory=dict)
    labels: Any = None
    final: dict[str, float] = field(default_factory=dict)
    sha256: str = ""
    schema: int = SCHEMA

    @classmethod
    def of(cls, recording: "Recording") -> "Header":
        """Describe a recording."""
        clocks = []
        for clock in recording.clocks.values():
            channels = {c.name: (c.unit, c.text) for c in recording.on_clock(clock.name)}
            clocks.append(
                ClockHeader(clock.name, clock.rate, list(clock.gaps), len(clock), channels)
            )
        return cls(clocks, recording.meta, recording.labels, recording.final)

    @classmethod
    def sealed(cls, recording: "Recording") -> "Header":
        """Describe a recording for a file, with the SHA-256 of all its content."""
        header = cls.of(recording)
        arrays = [
            values
            for clock in recording.clocks.values()
            for values in (clock.time, *(c.values for c in recording.on_clock(clock.name)))
        ]
        return replace(header, sha256=header.digest(arrays))

    def digest(self, arrays: "Iterable[Floats]") -> str:
        """Return the SHA-256 of this description and of times and values, clock by clock.

        Every NaN counts as the plain one: text knows no other.
        """
        mark = hashlib.sha256(replace(self, sha256="").to_json().encode("ascii"))
        for values in arrays:
            missing = np.isnan(values)
            plain_values = np.where(missing, np.nan, values) if missing.any() else values
            mark.update(np.ascontiguousarray(plain_values, dtype="<f8").tobytes())
        return mark.hexdigest()

    def to_json(self) -> str:
        """Return the text written into files (ASCII)."""
        document = {
            "schema": self.schema,
            "clocks": [
                {
                    "name": clock.name,
                    "rate": clock.rate,
                    "gaps": clock.gaps,
                    "samples": clock.samples,
                    "channels": [
                        {"name": name, "unit": unit, "text": text}
                        for name, (unit, text) in clock.channels.items()
                    ],
                }
                for clock in self.clocks
            ],
            "meta": self.meta,
            "labels": self.labels,
            "final": self.final,
            **({"sha256": self.sha256} if self.sha256 else {}),
        }
        return json.dumps(_encoded(document), allow_nan=False, separators=(",", ":"))

    @classmethod
    def from_json(cls, text: str | bytes, place: str) -> "Header":
        """Read the text of a file, trusting nothing in it.

        Raises
        ------
        DamageError
            Not the JSON of a recording: no log of somebody else's either.
        VersionError
            Of a later schema.
        """
        if len(text) > _LONGEST:
            raise DamageError(f"{place}: its description is longer than {_LONGEST} bytes")
        try:
            document = _decoded(json.loads(text))
            if document["schema"] not in _READ:
                raise VersionError(
                    f"{place}: its layout has version {document['schema']!r}, "
                    f"this Elevon reads version {' and '.join(str(number) for number in _READ)}"
                )
            clocks = [_clock(entry) for entry in document["clocks"]]
            meta, final = dict(document["meta"]), dict(document["final"])
            mark, schema = str(document["sha256"]), int(document["schema"])
            return cls(clocks, meta, document["labels"], final, mark, schema)
        except FormatError:
            raise
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError) as error:
            raise DamageError(f"{place}: its description is damaged: {error!r}") from error


def _clock(entry: Mapping[str, Any]) -> ClockHeader:
    """Read one clock; lengths and ranges are checked again when the clock is built."""
    channels: dict[str, tuple[str, str]] = {}
    for channel in entry["channels"]:
        name, unit, text = channel["name"], channel["unit"], channel["text"]
        if not all(isinstance(item, str) for item in (name, unit, text)) or name in channels:
            raise FormatError(f"clock {entry['name']!r}: channel {name!r} is not described once")
        channels[name] = (unit, text)
    rate, gaps, samples = entry["rate"], entry["gaps"], entry["samples"]
    if not isinstance(samples, int) or not all(isinstance(gap, int) for gap in gaps):
        raise TypeError("samples and gaps must be integers")
    return ClockHeader(str(entry["name"]), rate, list(gaps), samples, channels)


_PLAIN = frozenset({str, int, float, bool, type(None)})
_TEXT = frozenset({str})


def plain(value: Any, place: str, depth: int = 0) -> Any:
    """Return a private copy in JSON's own types, so that files give back what they were given.

    Raises
    ------
    InputError
        Something in it is not text, a number, a truth value, None, a sequence or a mapping; or a
        NumPy array; or it is nested deeper than 50 levels.
    """
    if type(value) in _PLAIN:
        return value
    if depth > _DEEPEST:
        raise InputError(f"{place}: nested deeper than {_DEEPEST} levels")
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    # Most items are plain already: their places are not written out.
    if isinstance(value, Mapping):
        if _PLAIN.issuperset(map(type, value.values())) and _TEXT.issuperset(map(type, value)):
            return dict(value)
        return {
            str(k): v if type(v) in _PLAIN else plain(v, f"{place}.{k}", depth + 1)
            for k, v in value.items()
        }
    if isinstance(value, (list, tuple)):
        return [
            v if type(v) in _PLAIN else plain(v, f"{place}[{k}]", depth + 1)
            for k, v in enumerate(value)
        ]
    raise InputError(f"{place}: a {type(value).__name__} cannot be written to a file")


def _encoded(value: Any) -> Any:
    if isinstance(value, float) and not math.isfinite(value):
        return {"$float": repr(value)}
    if isinstance(value, dict):
        return {key: _encoded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_encoded(item) for item in value]
    return value


def _decoded(value: Any) -> Any:
    if isinstance(value, dict):
        if value.keys() == {"$float"}:
            return float(value["$float"])
        return {key: _decoded(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_decoded(item) for item in value]
    return value
