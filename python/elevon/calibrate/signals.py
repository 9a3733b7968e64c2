"""The stage of the signals: what regressions and positions determine, without model runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.calibrate.balance import torque_balance
from elevon.calibrate.estimate import Estimate
from elevon.calibrate.kinematics import CommandFit, command_fit
from elevon.calibrate.law import controller_law
from elevon.calibrate.log import BenchLog
from elevon.calibrate.plant import (
    Torque,
    controller_estimates,
    plant_estimates,
    static_estimate,
    torque_scale,
)
from elevon.calibrate.regression import Regression
from elevon.calibrate.static import static_friction
from elevon.calibrate.zeros import encoder_count, gain_estimate, position_estimates

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["CalibrationSignals", "signal_stage"]

Bools = npt.NDArray[np.bool_]
_DOUBTFUL = 0.2  # share of the current below which a regression explains nothing


@dataclass(frozen=True)
class CalibrationSignals:
    """Result of the stage.

    Attributes
    ----------
    estimates : tuple of Estimate
        All of them, the loose ones too.
    followed : mapping of str to float
        Values of other parameters that had to follow.
    torque : Torque
        Where the scale of all torques comes from.
    plant, law : Regression or None
        The two regressions; None where one explains nothing.
    commands : tuple of CommandFit
        Commands reconstructed.
    findings : tuple of str
        What the positions say in words.
    """

    estimates: tuple[Estimate, ...]
    followed: Mapping[str, float]
    torque: Torque
    plant: Regression | None
    law: Regression | None
    commands: tuple[CommandFit, ...]
    findings: tuple[str, ...] = ()


def signal_stage(
    logs: Sequence[BenchLog],
    keeps: Sequence[Bools],
    actuator: Actuator,
    advance: Callable[[float], object] = lambda _f: None,
    per_log: Sequence[str] = (),
) -> CalibrationSignals:
    """Estimate what the signals themselves determine.

    Parameters
    ----------
    logs : sequence of BenchLog
        The data.
    keeps : sequence of ndarray of bool
        Samples that may be used, one a log.
    actuator : Actuator
        Values before.
    advance : callable
        Called with the done fraction; may raise to stop.
    per_log : sequence of str
        Paths to estimate for each log: of `elevon.calibrate.backlashes.PER_LOG`.
    """
    estimates, findings = position_estimates(logs, actuator, per_log)
    advance(0.25)
    plant = _explaining(torque_balance(logs, keeps))
    advance(0.5)
    lag = plant["lag"] if plant is not None else 0.0
    law = _explaining(controller_law(logs, keeps, lag))
    if plant is not None and law is not None and "constant" in plant.names:
        plant = _sampled(plant, law, logs, keeps)
    advance(0.7)
    torque = torque_scale(actuator, plant)
    followed: dict[str, float] = {}
    if plant is not None:
        of_plant, followed = plant_estimates(actuator, plant, torque)
        estimates += of_plant
        dry = next((i.value for i in of_plant if i.path == "friction.dynamic"), None)
        static = static_friction(logs, keeps, plant, torque.constant)
        estimates += static_estimate(actuator, static, dry, torque)
    if law is not None:
        estimates += controller_estimates(actuator, law, torque, [log.name for log in logs])
    commands = _commands(logs, actuator, estimates)
    advance(1.0)
    return CalibrationSignals(
        tuple(estimates), followed, torque, plant, law, tuple(commands), findings
    )


def _explaining(regression: Regression | None) -> Regression | None:
    """Drop a regression that explains nothing: its coefficients are noise."""
    return regression if regression and regression.explained > _DOUBTFUL else None


def _sampled(
    plant: Regression, law: Regression, logs: Sequence[BenchLog], keeps: Sequence[Bools]
) -> Regression:
    """Add to the deviations what a set point in the current's place may owe to its samples.

    Samples in step with the drive catch the derivative's spikes too often or too seldom. The
    controller's law shows how much of that goes with the motion; friction would take it up, the
    viscous part in one direction and the dry part in the other.
    """
    speeds = [log.speed[keep & log.good] for log, keep in zip(logs, keeps, strict=True)]
    spread = float(np.sqrt(np.mean(np.concatenate(speeds) ** 2)))
    gap = np.zeros(len(plant.names))
    gap[plant.names.index("viscous")] = law.std("motion")
    gap[plant.names.index("dry")] = -spread * law.std("motion")
    return replace(plant, covariance=plant.covariance + np.outer(gap, gap))


def _commands(
    logs: Sequence[BenchLog], actuator: Actuator, estimates: list[Estimate]
) -> list[CommandFit]:
    """Commands, and the position gain pooled over them."""
    value = actuator.parameters.value
    limit = next(
        (i.value for i in estimates if i.path == "control.speed_limit"),
        value("control.speed_limit"),
    )
    gain = value("control.position_gain")
    fits = [fit for log in logs if (fit := command_fit(log, gain, limit)) is not None]
    pooled = gain_estimate(fits, gain, encoder_count(actuator))
    if pooled is not None:
        estimates.append(pooled)
    return fits
