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
from elevon.report import Report
from elevon.report.checks import Check, CheckedResult
from elevon.report.figures import new_figure
from elevon_cases.page import BLUE, ORANGE, table_of, with_end
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


def control_page(result: ControlResult, seed: int = 0, date: str | None = None) -> Report:
    """Return the report of root locus and speeds."""
    report = Report(
        "Root locus of the derivative branch, no-load speed",
        "The branch has one pole and a zero at the origin: its root runs along the real axis from "
        "the one to the other as the gain grows.",
        date=date,
    )
    with new_figure(1, 2, height=2.8) as (figure, (plane, growth)):
        plane.plot(result.roots, 0.0 * GAINS, color=BLUE)
        plane.plot(result.roots[:1], [0.0], "x", color=ORANGE, label="pole")
        plane.plot([0.0], [0.0], "o", mfc="none", color=ORANGE, label="zero")
        plane.set(xlabel="Real part [1/s]", ylabel="Imaginary part [1/s]")
        plane.legend(loc="upper right", ncols=2)
        growth.loglog(GAINS[1:], -result.roots[1:], color=BLUE)
        growth.set(xlabel="Gain", ylabel="-Root [1/s]")
    report.section("Root locus").figure(
        figure, "Root of 1 + K G with the printed time and filter (Figure 52)."
    )
    columns = (
        ("No-load speed of", "requirement"),
        ("Required [deg/s]", "required_deg_s"),
        ("Model [deg/s]", "speed_deg_s"),
        ("Met", "met"),
    )
    caption = "Behind 1:124 the bench's drive, limited to 500 rpm, turns no faster."
    report.section("No-load speed").table(table_of(result.rows, columns, caption, digits=4))
    made = {"Parameter hash": result.parameter_hash}
    return with_end(report, result.checks, f"torino-control --seed {seed}", made)
