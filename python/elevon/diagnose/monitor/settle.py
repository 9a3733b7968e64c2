"""The cause of an alarm, from whole windows behind the one in which the fault began.

That window holds a part of the fault only, and what its beginning does besides: it gives the alarm,
and would give a wrong cause.
"""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from dataclasses import dataclass

from elevon.arrays import Floats
from elevon.diagnose.monitor.filter import Change, ChangeFilter

MOST = 3  # windows that a cause rests on at last
_PREFIX = "cause_"  # before the names of its filter's arrays in a state


@dataclass
class AlarmCause:
    """A filter that has not seen the window of an onset.

    Attributes
    ----------
    watch : ChangeFilter
        As the monitor's, up to the window with the onset; goes on behind it.
    first : int
        Number of the window from which the fault counts.
    """

    watch: ChangeFilter
    first: int

    @classmethod
    def behind(cls, change: Change, before: ChangeFilter, after: ChangeFilter) -> AlarmCause:
        """Return what goes on behind an alarm.

        Parameters
        ----------
        change : Change
            What the alarm is of.
        before, after : ChangeFilter
            The monitor's without and with the alarm's window.
        """
        if change.window == before.windows and not change.opening:
            return cls(deepcopy(before), before.windows)
        return cls(deepcopy(after), change.window)

    @property
    def at(self) -> tuple[int, int]:
        """Windows that the filter has seen, and `first`."""
        return self.watch.windows, self.first

    def step(self, deviations: Floats) -> Change | None:
        """Take a window, shape (1, k); return the change, None where it is too long ago."""
        self.watch.step(deviations)
        return next((c for c in self.watch.changes if c.window == self.first), None)

    def arrays(self) -> dict[str, Floats]:
        """Return where it stands, as arrays."""
        return {_PREFIX + name: array for name, array in self.watch.arrays().items()}

    @classmethod
    def stored(
        cls, watch: ChangeFilter, arrays: Mapping[str, Floats], at: tuple[int, int], place: str
    ) -> AlarmCause:
        """Return what `arrays` were taken of, from a new filter, its windows and first one."""
        named = {n.removeprefix(_PREFIX): a for n, a in arrays.items() if n.startswith(_PREFIX)}
        watch.take_arrays(named, at[0], place)
        return cls(watch, at[1])
