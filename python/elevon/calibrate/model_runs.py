"""Logs' tests on a model at many points of a fit at once, as residuals of what moves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.errors import Interrupted
from elevon.estimate import Free
from elevon.estimate.lanes import LaneChannel, Lanes
from elevon.experiment import Experiment, Sensor, Variant, run_all
from elevon.logs.log import Log


class ModelRuns:
    """What a fit moves, on the tests of some logs.

    Parameters
    ----------
    experiments : sequence of Experiment
        One a log.
    first : mapping of str to float
        Role to the first deviation of its residual, as a share of the channel's spread: the roles
        that are compared.
    check : callable
        Called between runs; False stops.
    belief : float
        Weight of what is believed before.

    Attributes
    ----------
    logs : tuple of Log
        The data.
    runs : int
        Model runs so far.
    """

    def __init__(
        self,
        experiments: Sequence[Experiment],
        first: Mapping[str, float],
        check: Callable[[], bool] = lambda: True,
        belief: float = 1.0,
    ) -> None:
        self.experiments = tuple(experiments)
        self.logs = tuple(item.log for item in experiments)
        self.check = check
        self.runs = 0
        self._first, self._belief = first, belief

    def variant(self, log: Log, values: Mapping[str, float]) -> Variant:
        """Return what a point changes in the run of a log."""
        raise NotImplementedError

    def sensors(self, log: Log, values: Mapping[str, float]) -> Mapping[str, Sensor]:
        """Return how a log shows the run of a point."""
        raise NotImplementedError

    def simulate(self, points: Sequence[Mapping[str, float]]) -> list[list[Log | None]]:
        """Run every log at every point, one batch; result[point][log], None where it diverged."""
        if not self.check():
            raise Interrupted("calibration stopped")
        wanted = [
            (item, self.variant(item.log, point)) for point in points for item in self.experiments
        ]
        self.runs += len(wanted)
        runs = iter(run_all(wanted, lambda _fraction: self.check()))
        return [
            [
                run.seen(log, self.sensors(log, point)) if (run := next(runs)).complete else None
                for log in self.logs
            ]
            for point in points
        ]

    def lanes(self, free: Sequence[Free]) -> Lanes:
        """Return the residuals of what moves, over all samples that count."""
        return Lanes(free, self._masked, self._data, self._belief)

    @cached_property
    def _masks(self) -> list[tuple[int, str, Bools]]:
        return [
            (k, role, log.good & np.isfinite(log[role]))
            for k, log in enumerate(self.logs)
            for role in self._first
            if log.has(role)
        ]

    @cached_property
    def _data(self) -> list[LaneChannel]:
        rows = []
        for k, role, mask in self._masks:
            log = self.logs[k]
            size = float(np.nanstd(log[role][log.good]))
            first = self._first[role] * size
            rows.append(
                LaneChannel(k, role, log.time[mask], log[role][mask], log.period, size, first)
            )
        return rows

    def _masked(self, points: Sequence[Mapping[str, float]]) -> list[list[Floats | None]]:
        return [
            [None if (run := runs[k]) is None else run[role][mask] for k, role, mask in self._masks]
            for runs in self.simulate(points)
        ]
