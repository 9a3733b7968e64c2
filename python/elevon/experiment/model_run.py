"""What a model shows of a log's test."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from elevon.arrays import Floats
from elevon.logs.log import Log, on_clock


@dataclass(frozen=True)
class Sensor:
    """How a log shows a channel: behind a filter, late, offset.

    Attributes
    ----------
    delay : float
        s.
    offset : float
        In the channel's unit.
    lag : float
        Time constant of a first-order filter, s.
    unsigned : bool
        Whether its sign is lost.
    scale : float
        Of the channel over the model's signal.
    """

    delay: float = 0.0
    offset: float = 0.0
    lag: float = 0.0
    unsigned: bool = False
    scale: float = 1.0


_PLAIN = Sensor()


@dataclass(frozen=True, eq=False)
class ModelRun:
    """One run.

    Attributes
    ----------
    status : str
        ``ok``, ``tripped`` or ``diverged``.
    seconds : float
        Simulated.
    message : str
        Why it ended, where it did before its end.
    log : Log
        On the run's own clock, which begins at zero.
    """

    status: str
    seconds: float
    message: str
    log: Log

    @property
    def complete(self) -> bool:
        """Whether it stayed within the finite numbers."""
        return self.status in {"ok", "tripped"} and all(
            np.isfinite(values).all() for values in self.log.channels.values()
        )

    def seen(self, log: Log, sensors: Mapping[str, Sensor] | None = None) -> Log:
        """Return the run as a log's sensors would have shown it, on the log's instants."""
        sensors = {} if sensors is None else sensors
        channels = {
            role: self._seen(role, log.time, sensors.get(role, _PLAIN)) for role in self.log
        }
        return replace(log, channels=channels, units=self.log.units, gain=None, recording=None)

    def _seen(self, role: str, time: Floats, sensor: Sensor) -> Floats:
        clock, values = self.log.time, self.log[role]
        if sensor.unsigned:
            values = np.abs(values)
        if sensor.lag > 0.0:
            values = _late(values, sensor.lag / self.log.period)
        at = time - sensor.delay
        seen = on_clock(clock, values, at, self.log.units.get(role, ""))
        return sensor.scale * seen + sensor.offset


def _late(values: Floats, lag: float) -> Floats:
    """Return samples behind a first-order filter, `lag` in sample times, from rest."""
    from scipy.signal import lfilter

    keep = float(np.exp(-1.0 / lag))
    start = np.array([keep * values[0]])
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=start)[0])
