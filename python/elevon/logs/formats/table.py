"""The raw table every reader returns: named columns of numbers, before any meaning is given."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from elevon.arrays import Floats
from elevon.errors import FormatError, quoted

_LARGEST = 1e100  # beyond it squares overflow; nothing measured comes near


@dataclass(frozen=True, slots=True)
class RawTable:
    """Columns of a log as they stand in the file.

    Attributes
    ----------
    source : str
        The file's path.
    columns : mapping of str to ndarray, shape (rows,)
        Float64, all of one length; a missing cell is NaN.
    units : mapping of str to str
        Units the file itself states, by column.
    notes : tuple of str
        What the reader saw and the caller should know (encoding, decimal comma, skipped variables).
    file_format : str
        Which reader it was.
    attributes : mapping of str to str
        Text the file carries beside the columns (labels, metadata), already bounded.
    """

    source: str
    columns: Mapping[str, Floats]
    units: Mapping[str, str] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    file_format: str = "csv"
    attributes: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        lengths = {values.shape for values in self.columns.values()}
        if len(lengths) > 1:
            raise FormatError(f"{self.source}: columns of different lengths {sorted(lengths)}")
        if not self.columns:
            raise FormatError(f"{self.source}: no column of numbers")
        for name, values in self.columns.items():
            bad = ~np.isnan(values) & ~(np.abs(values) < _LARGEST)
            if bad.any():
                row = int(np.argmax(bad))
                raise FormatError(
                    f"{self.source}, row {row + 1}, column {quoted(name)}: {values[row]:g} is no "
                    "finite number that anything could measure"
                )

    @property
    def rows(self) -> int:
        """Number of rows."""
        return int(next(iter(self.columns.values())).shape[0])


def unique_names(source: str, names: Iterable[str]) -> list[str]:
    """Return the names stripped, refusing an empty one and one that occurs twice.

    Raises
    ------
    FormatError
        A column without a name, or two columns of the same name.
    """
    result: list[str] = []
    for position, raw in enumerate(names, start=1):
        name = raw.strip()
        if not name:
            raise FormatError(f"{source}: column {position} has no name")
        if name in result:
            raise FormatError(
                f"{source}: columns {result.index(name) + 1} and {position} are both named "
                f"{quoted(name)}"
            )
        result.append(name)
    return result


def split_unit(name: str) -> tuple[str, str]:
    """Split ``"speed [rpm]"`` or ``"speed (rpm)"`` into name and unit; the unit may be empty.

    A bracket that holds only digits is an index (``r482[1]``), not a unit.
    """
    text = name.strip()
    for opening, closing in (("[", "]"), ("(", ")")):
        if text.endswith(closing) and opening in text:
            head, _, unit = text[:-1].rpartition(opening)
            if head.strip() and not unit.strip().isdigit():
                return head.strip(), unit.strip()
    return text, ""
