"""What the population searches make small: the misfit of a monitor to a log.

The vector is that of the literature on these actuators: dry friction, backlash, shorted turns of
each phase, size and phase of the static eccentricity, drift of the position gain, each from 0 to 1
over its range. The misfit is the mean square difference of the torque current, as there; the gap
between the two positions and the output's position stand beside it, since backlash and gain hardly
show
in the current without load. Weights and ranges are ASSUMED: no paper at hand prints them.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.candidates import CANDIDATES
from elevon.experiment import Experiment, ModelRun, Variant

if TYPE_CHECKING:
    from elevon.bench.rig import Setup
    from elevon.logs.log import Log

__all__ = ["CAUSES", "MonitoringModel"]

#: The faults of the vector, by key; the short stands for that of any phase.
CAUSES = (
    "friction@transmission",
    "backlash@transmission",
    "short@motor.phase_a",
    "eccentricity_static@motor",
    "gain_drift@control.position",
)
_SLOTS = (
    "friction@transmission",
    "backlash@transmission",
    "short@motor.phase_a",
    "short@motor.phase_b",
    "short@motor.phase_c",
    "eccentricity_static@motor",
    "phase",
    "gain_drift@control.position",
)
#: Role to the model's signal.
_SHOWS: Mapping[str, str] = {
    "torque_current": "current_q_meas", "output_position": "encoder_position",
    "motor_position": "motor_position",
}  # fmt: skip
_RATE = 100.0  # Hz at which log and monitor are compared
_FROM = 1.0  # s left out


class MonitoringModel:
    """The reduced-order model in a log's own test, its command and start known to the last bit.

    Parameters
    ----------
    setup : Setup
        The log's test; its faults are left out.
    log : Log
        What the bench wrote.

    Attributes
    ----------
    evaluations : int
        Runs so far.
    """

    size = len(_SLOTS)

    def __init__(self, setup: Setup, log: Log) -> None:
        bare = setup.scenario.model_copy(update={"fault": ()})
        self._experiment = Experiment(log, setup.actuator, bare, _SHOWS, rate=f"{_RATE:g} Hz")
        self._ratio = setup.actuator.parameters.value("gear.ratio")
        self._limits = limits()
        self.evaluations = 0
        self._keep = np.zeros(0, dtype=np.bool_)
        self._columns = np.zeros((0, 3))
        self._columns, self._scale = self._of(log, setup)

    def _of(self, log: Log, setup: Setup) -> tuple[Floats, Floats]:
        clock = np.arange(0.0, log.duration + 1e-9, 1.0 / _RATE)
        self._keep = clock >= _FROM
        channels = (log.current, log.output, log.motor / self._ratio - log.output)
        columns = np.column_stack([np.interp(clock, log.time, c) for c in channels])
        gain = setup.actuator.parameters.value("control.position_gain")
        followed = float(np.sqrt(np.mean(log.speed_ref**2))) / gain
        sizes = (float(np.std(log.current)), followed, float(np.std(columns[2])))
        return columns[self._keep], np.array(sizes)

    def severities(self, vector: Floats) -> dict[str, float]:
        """Return the severities of a vector in [0, 1], by `CAUSES`; the worst of the phases."""
        values = dict(zip(_SLOTS, self._scaled(vector), strict=True))
        phases = [values[f"short@motor.phase_{p}"] for p in "abc"]
        return {key: max(phases) if key.startswith("short") else values[key] for key in CAUSES}

    def _scaled(self, vector: Floats) -> list[float]:
        out = []
        for key, x in zip(_SLOTS, vector, strict=True):
            low, high = (0.0, 2.0 * math.pi) if key == "phase" else self._limits[_cause(key)]
            out.append(low + float(x) * (high - low))
        return out

    def costs(self, vectors: Floats) -> Floats:
        """Return the misfit of vectors, shape (n, 8), one run of the monitor each."""
        variants = [Variant(faults=self._faults(vector)) for vector in np.atleast_2d(vectors)]
        self.evaluations += len(variants)
        return np.array([self._misfit(run) for run in self._experiment.run(variants, threads=1)])

    def _faults(self, vector: Floats) -> tuple[str, ...]:
        values = dict(zip(_SLOTS, self._scaled(vector), strict=True))
        phase = values.pop("phase")
        return tuple(
            f"{key}={value!r}" + (f",phase={phase!r}" if "ecc" in key else "")
            for key, value in values.items()
        )

    def _misfit(self, run: ModelRun) -> float:
        if run.status != "ok" or len(run.log.time) < len(self._keep):
            return 1e6
        shows = run.log
        channels = (shows.current, shows.output, shows.motor / self._ratio - shows.output)
        columns = np.column_stack([c[: len(self._keep)] for c in channels])[self._keep]
        residual = (columns - self._columns) / self._scale
        return float(np.mean(residual**2)) if np.isfinite(residual).all() else 1e6


def limits() -> dict[str, tuple[float, float]]:
    """Return the range of each cause: that of diagnosis by the model."""
    known = {c.key: c for c in CANDIDATES}
    return {key: (known[key].low, known[key].high) for key in CAUSES}


def _cause(slot: str) -> str:
    return CAUSES[2] if slot.startswith("short") else slot
