"""One recorded quantity."""

from dataclasses import dataclass
from functools import lru_cache

import numpy.typing as npt

from elevon.arrays import Floats
from elevon.errors import InputError, UnitError
from elevon.recording.clock import Clock, frozen
from elevon.recording.names import check_name
from elevon.units import check_kind, parse_unit, si_unit, to_display, to_si

_LONGEST_TEXT = 1000


@dataclass(frozen=True, eq=False)
class Channel:
    """A named quantity sampled on a clock, in SI units.

    Parameters
    ----------
    name : str
        ASCII identifier of at most 31 characters.
    unit : str
        SI unit (``"rad"``, ``"N m"``, ``"1"``). `Recording.build` converts other units.
    values : array_like, shape (n,)
        One value for each instant of the clock; NaN marks a missing sample.
    clock : Clock
        The time base.
    text : str
        What the quantity is, for labels and documentation; printable, at most 1000 characters.

    Raises
    ------
    InputError
        Bad name or text, not one value an instant, values that are not numbers.
    UnitError
        Unknown unit, or one that is not of the SI.
    """

    name: str
    unit: str
    values: Floats
    clock: Clock
    text: str = ""

    def __init__(
        self, name: str, unit: str, values: npt.ArrayLike, clock: Clock, text: str = ""
    ) -> None:
        _check_description(name, unit, text)
        vector = frozen(values, f"channel {name!r}")
        if vector.size != len(clock):
            raise InputError(
                f"channel {name!r}: {vector.size} values for the {len(clock)} instants "
                f"of clock {clock.name!r}"
            )
        fields = self.__dict__
        fields["name"], fields["unit"], fields["text"] = name, unit, text
        fields["values"], fields["clock"] = vector, clock

    @property
    def time(self) -> Floats:
        """Instants of the samples in s, shape (n,), read-only."""
        return self.clock.time

    def __len__(self) -> int:
        return int(self.values.size)

    def __repr__(self) -> str:
        return f"Channel({self.name!r}, {self.unit!r}, {len(self)} samples on {self.clock.name!r})"

    def to(self, unit: str) -> Floats:
        """Return the values in another unit of the same kind, shape (n,).

        Raises
        ------
        UnitError
            Unknown unit, or one of another kind.
        """
        check_kind(unit, self.unit, f"channel {self.name!r}")
        return to_display(self.values, unit)

    def equals(self, other: "Channel") -> bool:
        """Return whether two channels are the same, to the last bit of every value."""
        same = (self.name, self.unit, self.text) == (other.name, other.unit, other.text)
        return (
            same
            and self.clock.equals(other.clock)
            and self.values.tobytes() == other.values.tobytes()
        )


@lru_cache(maxsize=4096)
def _check_description(name: str, unit: str, text: str) -> None:
    """Raise where a name, a unit or a text cannot be; the runs of a batch have the same ones."""
    check_name(name)
    parsed = parse_unit(unit, f"channel {name!r}")
    if parsed.factor != 1.0 or parsed.offset:
        raise UnitError(f"channel {name!r}: unit {unit!r} is not SI; Recording.build converts")
    if len(text) > _LONGEST_TEXT or not text.isprintable():
        raise InputError(
            f"channel {name!r}: its text has control characters or more than {_LONGEST_TEXT}"
        )


def in_si(name: str, unit: str, values: npt.ArrayLike, clock: Clock) -> Channel:
    """Make a channel of values in any unit; those already SI keep every bit and their unit."""
    parsed = parse_unit(unit, f"channel {name!r}")
    if parsed.factor == 1.0 and not parsed.offset:
        return Channel(name, unit or "1", values, clock)
    return Channel(name, si_unit(unit), to_si(values, unit), clock)
