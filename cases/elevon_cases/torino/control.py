"""The root locus of the controller's derivative branch, and the no-load speed as a requirement."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.plain import WORKING, Plain
from elevon.progress import Progress
from elevon.report.checks import Check, CheckedResult
from elevon_cases.torino.bench_unit import ACTUATOR

TIME, FILTER = 0.01, 1000.0
"""Printed: derivative time [s] and filter of ``G = Td s / (Td s / N + 1)``."""
GAINS = np.concatenate([[0.0], np.geomspace(1e-6, 1e3, 181)])
LIMIT_RPM = 500.0
"""Printed: limit of the motor's speed on the bench."""
REQUIRED: Mapping[str, float] = {
    "primary controls": 60.0, "secondary controls that assist them": 15.0,
    "secondary controls": 6.0,
}  # fmt: skip
"""Printed: no-load speeds [deg/s]."""


@dataclass(frozen=True, slots=True)
class SpeedRow(Plain):
    """One requirement: no-load speed of the model beside it [deg/s]."""

    requirement: str
    required_deg_s: float
    speed_deg_s: float
    met: bool


@dataclass(frozen=True)
class ControlResult(CheckedResult):
    """Everything `elevon reproduce torino-control` reports."""

    rows: list[SpeedRow]
    speed_deg_s: float
    limit_deg_s: float
    parameter_hash: str
    roots: Annotated[Floats, WORKING]
    """Of ``1 + K G``, one a gain [1/s]."""

    @property
    def checks(self) -> list[Check]:
        """Both ends of the locus, its direction; the speed at its limit, what it must be."""
        first, last = float(self.roots[0]), float(self.roots[-1])
        speed = abs(self.speed_deg_s / self.limit_deg_s - 1.0)
        least = REQUIRED["secondary controls that assist them"]
        return [
            Check("root at no gain less the filter's pole", abs(first * TIME / FILTER + 1.0), 1e-9,
                  "1", ours=first, ours_unit="1/s"),
            Check("root at the largest gain, over the pole", last / first, 1e-3, "1", ours=last,
                  ours_unit="1/s"),
            Check("least step of the root towards zero", float(np.min(np.diff(self.roots))), 0.0,
                  "1/s", at_least=True),
            Check("no-load speed less the drive's limit", speed, 0.01, "1", ours=self.speed_deg_s,
                  ours_unit="deg/s"),
            Check("no-load speed, secondary controls that assist", self.speed_deg_s, least, "deg/s",
                  at_least=True),
        ]  # fmt: skip


def reproduce_control(*, seed: int = 0, progress: Progress | None = None) -> ControlResult:
    """Follow the root of the derivative branch over its gain, and run a step without load.

    Parameters
    ----------
    seed : int
        Of the run.
    progress : callable, optional
        As for `elevon.simulate`.
    """
    from elevon.scenario import Scenario
    from elevon.simulate import simulate

    actuator = Actuator.load(ACTUATOR)
    step = {"kind": "constant", "value": "60 deg"}
    scenario = Scenario.from_dict({"duration": "2 s", "command": {"terms": [step]}})
    run = simulate(actuator, scenario, fidelity="high", record="output_position@400 Hz", seed=seed,
                   progress=progress)  # fmt: skip
    position = run["output_position"]
    late = (position.time > 0.5) & (position.time < 1.5)
    slope = float(np.polyfit(position.time[late], position.values[late], 1)[0])
    speed = math.degrees(slope)
    limit = 6.0 * LIMIT_RPM / actuator.parameters.value("gear.ratio")
    rows = [SpeedRow(name, needed, speed, speed >= needed) for name, needed in REQUIRED.items()]
    return ControlResult(rows, speed, limit, actuator.hash, root_locus())


def root_locus() -> Floats:
    """Return the root of ``1 + K G`` at each gain [1/s], shape of `GAINS`."""
    return np.array([np.roots([TIME / FILTER + gain * TIME, 1.0])[0] for gain in GAINS])
