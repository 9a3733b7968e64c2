"""The stage of the signals: everything that regressions and positions tell, without model runs."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.calibrate.balance import torque_balance
from elevon.calibrate.breakaway import static_friction
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
from elevon.calibrate.zeros import encoder_count, gain_estimate, position_estimates

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["Signals", "signal_stage"]

Bools = npt.NDArray[np.bool_]
_DOUBTFUL = 0.2  # share of the current below which a regression explains nothing


@dataclass(frozen=True)
class Signals:
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
    """

    estimates: tuple[Estimate, ...]
    followed: Mapping[str, float]
    torque: Torque
    plant: Regression | None
    law: Regression | None
    commands: tuple[CommandFit, ...]


def signal_stage(
    logs: Sequence[BenchLog],
    keeps: Sequence[Bools],
    actuator: Actuator,
    advance: Callable[[float], object] = lambda _f: None,
) -> Signals:
    """Estimate what the signals themselves tell.

    Parameters
    ----------
    logs : sequence of BenchLog
        The data.
    keeps : sequence of ndarray of bool
        Samples that may be used, one a log.
    actuator : Actuator
        Values before.
    advance : callable
        Told the done fraction; may raise to stop.
    """
    found = position_estimates(logs, actuator)
    advance(0.25)
    plant = _telling(torque_balance(logs, keeps))
    advance(0.5)
    lag = plant["lag"] if plant is not None else 0.0
    law = _telling(controller_law(logs, keeps, lag))
    if plant is not None and law is not None and "constant" in plant.names:
        plant = _sampled(plant, law, logs, keeps)
    advance(0.7)
    torque = torque_scale(actuator, plant)
    followed: dict[str, float] = {}
    if plant is not None:
        estimates, followed = plant_estimates(actuator, plant, torque)
        found += estimates
        dry = next((i.value for i in estimates if i.path == "friction.dynamic"), None)
        shift = plant["offset" if "offset" in plant.names else "constant"]
        static = static_friction(
            logs, keeps, constant=torque.constant, offset=shift, lag=plant["lag"]
        )
        found += static_estimate(actuator, static, dry, torque)
    if law is not None:
        found += controller_estimates(actuator, law, torque, [log.name for log in logs])
    commands = _commands(logs, actuator, found)
    advance(1.0)
    return Signals(tuple(found), followed, torque, plant, law, tuple(commands))


def _telling(regression: Regression | None) -> Regression | None:
    """Drop a regression that explains nothing: its coefficients are noise."""
    return regression if regression and regression.explained > _DOUBTFUL else None


def _sampled(
    plant: Regression, law: Regression, logs: Sequence[BenchLog], keeps: Sequence[Bools]
) -> Regression:
    """Add to the deviations what a set point in the current's place may owe to its samples.

    Samples in step with the drive catch the derivative's spikes too often or too seldom. The
    controller's law shows how much of that goes with the motion; friction would take it up, the
    viscous part one way and the dry part the other.
    """
    speeds = [log.speed[keep & log.good] for log, keep in zip(logs, keeps, strict=True)]
    spread = float(np.sqrt(np.mean(np.concatenate(speeds) ** 2)))
    gap = np.zeros(len(plant.names))
    gap[plant.names.index("viscous")] = law.std("motion")
    gap[plant.names.index("dry")] = -spread * law.std("motion")
    return replace(plant, covariance=plant.covariance + np.outer(gap, gap))


def _commands(
    logs: Sequence[BenchLog], actuator: Actuator, found: list[Estimate]
) -> list[CommandFit]:
    """Commands, and the position gain pooled over them."""
    value = actuator.parameters.value
    limit = next(
        (i.value for i in found if i.path == "control.speed_limit"), value("control.speed_limit")
    )
    gain = value("control.position_gain")
    fits = [fit for log in logs if (fit := command_fit(log, gain, limit)) is not None]
    pooled = gain_estimate(fits, gain, encoder_count(actuator))
    if pooled is not None:
        found.append(pooled)
    return fits
