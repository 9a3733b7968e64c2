"""Stages of a drive's logs with set points: positions, balances, loops, command, model runs."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from elevon.calibrate.acceptance import accept, missing
from elevon.calibrate.balance import torque_balance
from elevon.calibrate.dynamic import Dynamic, dynamic_stage
from elevon.calibrate.kinematics import KINEMATIC, CommandFit, command_fit
from elevon.calibrate.law import controller_law
from elevon.calibrate.plant import (
    Torque,
    controller_estimates,
    plant_estimates,
    static_estimate,
    torque_scale,
)
from elevon.calibrate.stages.context import Context, stages_of
from elevon.calibrate.static import static_friction
from elevon.calibrate.zeros import gain_estimate, position_estimates
from elevon.errors import InputError
from elevon.estimate import Estimate
from elevon.estimate.regression import Regression
from elevon.logs.log import Log
from elevon.progress import part

_DOUBTFUL = 0.2  # share of the current below which a regression explains nothing
_RUNS = (0.35, 0.8)  # of the work: model runs


@dataclass(eq=False, kw_only=True)
class DriveContext(Context):
    """What the stages of a drive's logs share beside the estimates.

    Parameters
    ----------
    logs, used : sequence of Log
        The data, whole for positions and commands; and without what leads in, for balances.
    actuator : Actuator
        Values before.
    free : sequence of str or None
        Paths requested.
    per_log : sequence of str
        Of `elevon.calibrate.backlashes.PER_LOG`: estimated for each log.
    fidelity : str or None
        Of model runs; None: only where the regressions fail.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Attributes
    ----------
    plant, law : Regression or None
        The two regressions; None where one explains nothing.
    torque : Torque
        Where the scale of all torques comes from.
    followed : dict of str to float
        Values of other parameters that had to follow.
    commands : list of CommandFit
        Commands reconstructed.
    findings : list of str
        What the positions say in words.
    accepted : list of Estimate
        What the actuator file can hold, and what it has no place for.
    dynamic : Dynamic or None
        Identifiability and the fit of model runs.
    """

    used: Sequence[Log]
    free: Sequence[str] | None
    per_log: Sequence[str]
    torque: Torque = field(init=False)
    plant: Regression | None = field(default=None, init=False)
    law: Regression | None = field(default=None, init=False)
    followed: dict[str, float] = field(default_factory=dict, init=False)
    commands: list[CommandFit] = field(default_factory=list, init=False)
    findings: list[str] = field(default_factory=list, init=False)
    accepted: list[Estimate] = field(default_factory=list, init=False)
    dynamic: Dynamic | None = field(default=None, init=False)

    def __post_init__(self) -> None:
        self.torque = torque_scale(self.actuator, None)

    def put(self, estimates: Iterable[Estimate]) -> None:
        """Take over estimates, the loose ones too."""
        self.levels |= {item.path: item for item in estimates}


def _positions(ctx: DriveContext) -> None:
    estimates, findings = position_estimates(ctx.logs, ctx.actuator, ctx.per_log)
    ctx.put(estimates)
    ctx.findings += findings


def _torque(ctx: DriveContext) -> None:
    ctx.plant = _explaining(torque_balance(ctx.used))


def _controller(ctx: DriveContext) -> None:
    plant = ctx.plant
    ctx.law = law = _explaining(controller_law(ctx.used, 0.0 if plant is None else plant["lag"]))
    if plant is not None and law is not None and "constant" in plant.names:
        ctx.plant = _sampled(plant, law, ctx.used)


def _explaining(regression: Regression | None) -> Regression | None:
    """Drop a regression that explains nothing: its coefficients are noise."""
    return regression if regression and regression.explained > _DOUBTFUL else None


def _sampled(plant: Regression, law: Regression, logs: Sequence[Log]) -> Regression:
    """Add to the deviations what a set point in the current's place may owe to its samples.

    Samples in step with the drive catch the derivative's spikes too often or too seldom. The
    controller's law shows how much of that goes with the motion; friction would take it up, the
    viscous part in one direction and the dry part in the other.
    """
    speeds = [log.speed[log.good] for log in logs]
    spread = float(np.sqrt(np.mean(np.concatenate(speeds) ** 2)))
    gap = np.zeros(len(plant.names))
    gap[plant.names.index("viscous")] = law.std("motion")
    gap[plant.names.index("dry")] = -spread * law.std("motion")
    return replace(plant, covariance=plant.covariance + np.outer(gap, gap))


def _numbers(ctx: DriveContext) -> None:
    ctx.torque = torque_scale(ctx.actuator, ctx.plant)
    if ctx.plant is not None:
        estimates, ctx.followed = plant_estimates(ctx.actuator, ctx.plant, ctx.torque)
        ctx.put(estimates)
        static = static_friction(ctx.used, ctx.plant, ctx.torque.constant)
        dry = ctx.levels.get("friction.dynamic")
        least = None if dry is None else dry.value
        ctx.put(static_estimate(ctx.actuator, static, least, ctx.torque))
    if ctx.law is not None:
        names = [log.name for log in ctx.used]
        ctx.put(controller_estimates(ctx.actuator, ctx.law, ctx.torque, names))


def _command(ctx: DriveContext) -> None:
    limit, gain = ctx.value("control.speed_limit"), ctx.given_value("control.position_gain")
    fits = [command_fit(log, gain, limit) for log in ctx.logs]
    ctx.commands = [fit for fit in fits if fit is not None]
    pooled = gain_estimate(ctx.commands, ctx.actuator)
    ctx.put([] if pooled is None else [pooled])


def _runs(ctx: DriveContext) -> None:
    """Accept what the signals say, and fit the rest on model runs (a fidelity)."""
    free = ctx.free
    ctx.accepted = accepted = accept(list(ctx.levels.values()), free, ctx.actuator)
    direct = [p for p in free or () if p in KINEMATIC or p == "motor.emf_constant"]
    missing(direct, accepted, ctx.torque)
    if ctx.fidelity is not None or ctx.plant is None or ctx.law is None:
        # Branches that the signals do not show start from nothing.
        none = {item.path: 0.0 for item in accepted if item.in_set and item.value == 0.0}
        started = ctx.actuator.with_values({**ctx.followed, **none}, source="calibration")
        ctx.dynamic = dynamic_stage(
            ctx.used, started, accepted, free, fidelity=ctx.fidelity or "low",
            progress=part(ctx.progress, *_RUNS),
        )  # fmt: skip
    if ctx.dynamic is not None:
        known = [path for path in ctx.levels if path not in (free or ())]
        known += [item.path for item in accepted]
        ctx.accepted += ctx.dynamic.estimates(ctx.actuator, known, free)
    missing(free, ctx.accepted, ctx.torque)
    if not any(item.in_set for item in ctx.accepted):
        raise InputError("the logs determine no parameter: nothing in them moves enough")


DRIVE_STAGES = stages_of("drive", {
    "positions": _positions, "torque balance": _torque, "controller's law": _controller,
    "numbers": _numbers, "command": _command, "model runs": _runs,
})  # fmt: skip
