"""Recording a live run: to a log as a drive writes it, or everything that is sampled."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from elevon.arrays import Floats
from elevon.errors import InputError

KINDS = ("drive", "full")
_LONGEST = 3600.0  # s


class Recorder:
    """Takes samples from the simulation's thread until it is stopped.

    Parameters
    ----------
    kind : str
        ``drive`` or ``full``.
    names : sequence of str
        The signals that come.
    columns : sequence of int
        Those that are kept.
    period : float
        s between two samples.
    """

    def __init__(
        self, kind: str, names: Sequence[str], columns: Sequence[int], period: float
    ) -> None:
        if kind not in KINDS:
            raise InputError(f"record = {kind!r}; one of {', '.join(KINDS)}, true or false")
        self.kind = kind
        self.names = [names[i] for i in columns]
        self._columns = list(columns)
        self._most = int(_LONGEST / period)
        self._time: list[float] = []
        self._rows: list[Floats] = []

    def __len__(self) -> int:
        return len(self._time)

    @property
    def begun(self) -> float | None:
        """Instant of the first sample [s]."""
        return self._time[0] if self._time else None

    def __call__(self, time: float, values: Sequence[float]) -> None:
        """Take one sample; after an hour no more."""
        if len(self._time) < self._most:
            self._time.append(time)
            self._rows.append(np.asarray([values[i] for i in self._columns]))

    def taken(self) -> tuple[Floats, dict[str, Floats]]:
        """Return the instants, shape (n,), and the signals.

        Raises
        ------
        InputError
            Fewer than two samples.
        """
        if len(self._time) < 2:
            raise InputError("record: nothing was recorded yet")
        table = np.asarray(self._rows)
        return np.asarray(self._time), {n: table[:, i] for i, n in enumerate(self.names)}


def free_name(folder: Path, stem: str, ending: str) -> Path:
    """Return the first path of a numbered series that does not exist."""
    for number in range(1, 100_000):
        path = folder / f"{stem}-{number:03d}{ending}"
        if not path.exists():
            return path
    raise InputError(f"{folder}: too many recordings of one name")
