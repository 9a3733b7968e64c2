"""The bench's gear as planets with a backlash in each mesh, beside the single backlash."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.plain import WORKING, Plain
from elevon.progress import Progress
from elevon.recording import Recording
from elevon.report import Report
from elevon.report.checks import Check, CheckedResult
from elevon.report.figures import new_figure
from elevon_cases.page import BLUE, GREEN, ORANGE, table_of, with_end
from elevon_cases.torino.bench_unit import ACTUATOR, encoder_count

if TYPE_CHECKING:
    from elevon.simulate import Run

PRINTED_DEG = {"bench thesis": 0.365568, "paper": 0.3667}
"""Printed: the intrinsic backlash of the whole gear, total, at the output."""
STIFFNESS, LEAST_STIFFNESS = 1045.0, 857.0
"""Regressed from the printed drops, and the lower end of its interval [N m/rad]."""
PUSHES = (1.0, 2.0)
"""On the output while the motor is off [N m]; printed: at most 2.3."""
FRICTION = 1.0
"""Dry friction at the output of the loaded motion [N m]."""
PERIOD = 5.0
"""Printed: of the sine of 7 deg [s]."""
LUMPED, ELASTIC, PLANETS = "one backlash", "one elastic backlash", "planets"


@dataclass(frozen=True, slots=True)
class MeshRow(Plain):
    """One mesh: what of its displacement reaches the output, and its shares there."""

    mesh: str
    reaches_output: float
    lost_motion_deg: float
    compliance_percent: float


@dataclass(frozen=True, slots=True)
class GearRow(Plain):
    """One model: pushed at rest with the motor off, and in the bench's sine.

    Lost motion of the sine is that of forwards against backwards, without and with friction.
    """

    model: str
    lost_motion_deg: float
    stiffness_nm_per_rad: float | None
    moving_deg: float
    loaded_deg: float
    loaded_rms_deg: float


@dataclass(frozen=True)
class GearResult(CheckedResult):
    """Everything `elevon reproduce torino-gear` reports."""

    rows: list[GearRow]
    meshes: list[MeshRow]
    count_deg: float
    parameter_hash: str
    time: Annotated[Floats, WORKING]
    curves: Annotated[Mapping[str, Floats], WORKING]
    """Motor behind the ratio less output of the loaded sine, by model [deg]."""

    def row(self, model: str) -> GearRow:
        """Return the row of one model."""
        return next(row for row in self.rows if row.model == model)

    @property
    def checks(self) -> list[Check]:
        """Lost motion and stiffness against the prints, the chain against one backlash."""
        planets, elastic, lumped = (self.row(name) for name in (PLANETS, ELASTIC, LUMPED))
        thesis, paper = PRINTED_DEG["bench thesis"], PRINTED_DEG["paper"]
        off = abs(planets.lost_motion_deg - thesis)
        summed = sum(mesh.lost_motion_deg for mesh in self.meshes)
        stiffness = planets.stiffness_nm_per_rad or 0.0
        wound = math.degrees(2.0 * FRICTION / STIFFNESS)
        grown = planets.loaded_deg - lumped.loaded_deg
        return [
            Check("lost motion of the planets less the printed", off, paper - thesis, "deg",
                  ours=planets.lost_motion_deg),
            Check("lost motion of the planets less the sum of its meshes",
                  abs(planets.lost_motion_deg - summed), self.count_deg, "deg", ours=summed),
            Check("stiffness of the planets less that of the drops", abs(stiffness - STIFFNESS),
                  STIFFNESS - LEAST_STIFFNESS, "N m/rad", ours=stiffness),
            Check("loaded sine: planets less one elastic backlash, RMS", elastic.loaded_rms_deg,
                  self.count_deg, "deg", ours=elastic.loaded_rms_deg),
            Check("loaded sine: wind-up that one backlash leaves out", abs(grown - wound),
                  self.count_deg, "deg", ours=grown),
        ]  # fmt: skip


def reproduce_gear(*, seed: int = 0, progress: Progress | None = None) -> GearResult:
    """Push the output of three models with the motor off, and drive their sine.

    Parameters
    ----------
    seed : int
        Of the runs.
    progress : callable, optional
        As for `elevon.simulate`.
    """
    from elevon.simulate import simulate_batch

    actuator = Actuator.load(ACTUATOR)
    models = variants(actuator)
    runs = [run for model in models.values() for run in _runs(model, seed)]
    recordings = simulate_batch(
        runs, fidelity="high", record="motor_position,output_position@400 Hz", progress=progress
    )
    each = len(recordings) // len(models)
    logs = {name: recordings[k * each : (k + 1) * each] for k, name in enumerate(models)}
    ratio = actuator.parameters.value("gear.ratio")
    lags = {name: [_lag(log, ratio) for log in some[-2:]] for name, some in logs.items()}
    lost = {name: [_between(log, ratio) for log in some[-2:]] for name, some in logs.items()}
    reference = logs[PLANETS][-1]
    rows = [_row(name, some, lost[name], reference) for name, some in logs.items()]
    count = encoder_count(actuator)
    curves = {name: pair[1] for name, pair in lags.items()}
    time = reference["output_position"].time
    return GearResult(rows, mesh_rows(models[PLANETS]), count, actuator.hash,
                      time[time >= PERIOD] - PERIOD, curves)  # fmt: skip


def variants(actuator: Actuator) -> dict[str, Actuator]:
    """Return the three models: equal lost motion, equal inertia on the motor's shaft."""
    values = actuator.parameters.value
    planets = values("gear.fixed_ring_teeth") / values("gear.sun_teeth")
    orbit = 1.0 / (1.0 + planets)
    spin = orbit * (1.0 - values("gear.fixed_ring_teeth") / values("gear.planet_teeth"))
    bodies = values("gear.inertia_1") * orbit**2 + values("gear.inertia_2") * spin**2
    apart: dict[str, str | float] = {
        "gear.model": "wolfrom",
        "gear.inertia": values("gear.inertia") - bodies,
    }
    return {
        LUMPED: actuator,
        ELASTIC: actuator.with_values({"backlash.model": "elastic"}),
        PLANETS: actuator.with_values(apart),
    }


def mesh_rows(actuator: Actuator) -> list[MeshRow]:
    """Return what each mesh adds at the output, from the pitch points of the wheels.

    With the motor at rest three displacements, one a mesh, turn the planets about the gear's axis
    and their own, and the output: three equations, here solved.
    """
    value = actuator.parameters.value
    sun, fixed, ring = (
        value(f"gear.{name}_teeth") for name in ("sun", "fixed_ring", "output_ring")
    )
    planet, small = value("gear.planet_teeth"), value("gear.output_planet_teeth")
    centre = sun + planet
    points = np.array([[-centre / sun, planet / sun, 0.0], [centre / fixed, planet / fixed, 0.0],
                       [centre / ring, small / ring, -1.0]])  # fmt: skip
    reach = np.abs(np.linalg.inv(points)[2])
    backlash, stiffness = (
        np.array([value(f"gear.mesh_{what}_{k}") for k in (1, 2, 3)])
        for what in ("backlash", "stiffness")
    )
    compliance = reach**2 / stiffness
    shares = 100.0 * compliance / compliance.sum()
    lost = np.degrees(reach * backlash)
    names = ("sun and planets", "planets and fixed ring", "planets and output ring")
    return [MeshRow(name, *map(float, numbers))
            for name, *numbers in zip(names, reach, lost, shares, strict=True)]  # fmt: skip


def _runs(model: Actuator, seed: int) -> list[Run]:
    """Both pushes with the motor off, and two periods of the sine without and with friction."""
    from elevon.scenario import Scenario
    from elevon.simulate import Run

    idle = model.with_values({"drive.kind": "off"})
    pushed = [
        Scenario.from_dict({"duration": "0.5 s", "load": {"output": {"terms": [
            {"kind": "constant", "value": push}]}}})
        for push in PUSHES
    ]  # fmt: skip
    sine = {"kind": "sine", "amplitude": "7 deg", "frequency": "0.2 Hz"}
    moving = Scenario.from_dict({"duration": f"{2 * PERIOD} s", "command": {"terms": [sine]}})
    loaded = model.with_values({"load.friction": FRICTION})
    return [
        *(Run(idle, one, seed) for one in pushed),
        Run(model, moving, seed),
        Run(loaded, moving, seed),
    ]


def _row(name: str, logs: list[Recording], lost: list[float], reference: Recording) -> GearRow:
    """One model's answers: two pushes at rest, then two motions."""
    lost_at_rest, stiffness = _statics(logs)
    free, loaded = lost
    return GearRow(name, lost_at_rest, stiffness, free, loaded, _rms(logs[-1], reference))


def _statics(logs: list[Recording]) -> tuple[float, float | None]:
    """Lost motion [deg] and stiffness of what two pushes leave; without give none."""
    near, far = (-float(log["output_position"].values[-1]) for log in logs[:2])
    give = (far - near) / (PUSHES[1] - PUSHES[0])
    lost = 2.0 * (near - PUSHES[0] * give)
    return math.degrees(lost), 1.0 / give if give > 1e-7 else None


def _lag(log: Recording, ratio: float) -> Floats:
    """Motor behind the ratio less output over the last period [deg]."""
    motor, output = log["motor_position"], log["output_position"]
    late = motor.time >= PERIOD
    return np.degrees(motor.values[late] / ratio - output.values[late])


def _between(log: Recording, ratio: float) -> float:
    """Lag of the motion forwards less that backwards, medians over the last period [deg]."""
    lag, motor = _lag(log, ratio), log["motor_position"]
    forwards = np.gradient(motor.values[motor.time >= PERIOD]) > 0.0
    return float(np.median(lag[forwards]) - np.median(lag[~forwards]))


def _rms(log: Recording, other: Recording) -> float:
    """RMS of what two outputs differ by over the last period [deg]."""
    one, two = log["output_position"], other["output_position"]
    late = one.time >= PERIOD
    return math.degrees(float(np.sqrt(np.mean((one.values[late] - two.values[late]) ** 2))))


def gear_page(result: GearResult, seed: int = 0, date: str | None = None) -> Report:
    """Return the report of the three models."""
    report = Report(
        "The gear as planets, a backlash in each mesh",
        "The paper lumps the gear's backlash at the output and leaves a multi-body gear to the "
        "future (3.1.5). Here is that gear beside the single backlash of equal lost motion. How "
        "the lost motion is shared by the meshes is ASSUMED: one backlash along all pitch circles.",
        date=date,
    )
    models = (
        ("Model", "model"),
        ("Lost motion [deg]", "lost_motion_deg"),
        ("Stiffness [N m/rad]", "stiffness_nm_per_rad"),
        ("In the sine [deg]", "moving_deg"),
        ("Loaded [deg]", "loaded_deg"),
        ("Loaded, RMS to planets [deg]", "loaded_rms_deg"),
    )
    caption = "Pushed with the motor off; in the sine of 7 deg, 0.2 Hz, without and with friction."
    section = report.section("Models").table(table_of(result.rows, models, caption))
    with new_figure(width=6.0, height=2.8) as (figure, axes):
        for model, colour in ((LUMPED, BLUE), (ELASTIC, ORANGE), (PLANETS, GREEN)):
            axes.plot(result.time, result.curves[model], color=colour, label=model)
        axes.set(xlabel="Time [s]", ylabel="Motor / 124 less output [deg]")
        axes.legend(loc="upper right")
    section.figure(figure, "One period of the sine under 1 N m of friction at the output.")
    meshes = (
        ("Mesh", "mesh"),
        ("Reaches the output", "reaches_output"),
        ("Lost motion there [deg]", "lost_motion_deg"),
        ("Share of compliance [%]", "compliance_percent"),
    )
    caption = "The backlash at the fixed ring reaches the output whole, the sun's by one in 124."
    report.section("Meshes").table(table_of(result.meshes, meshes, caption, digits=4))
    made = {"Parameter hash": result.parameter_hash}
    return with_end(report, result.checks, f"torino-gear --seed {seed}", made)
