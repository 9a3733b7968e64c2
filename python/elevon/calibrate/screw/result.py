"""From logs of a preloaded screw's servo to a set: what they determine, and what not and why."""

from __future__ import annotations

import time as clock
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.calibrate.by_parts import Parts, PartsCalibration, go
from elevon.calibrate.level import Level
from elevon.calibrate.screw.heat import motor_heat, nut_heat
from elevon.calibrate.screw.log import ScrewLog
from elevon.calibrate.screw.loops import position_loop, speed_control
from elevon.calibrate.screw.loops_by_current import GIVEN as LOOPS_GIVEN
from elevon.calibrate.screw.loops_by_current import PATHS as BY_CURRENT
from elevon.calibrate.screw.loops_by_current import loops_by_current
from elevon.calibrate.screw.motor import load_side, motor_constants
from elevon.calibrate.screw.torque import torque_balance
from elevon.errors import InputError
from elevon.parameters.records import record_of
from elevon.progress import Progress
from elevon.threads import one_blas_thread

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["calibrate_screw"]

#: What no log of these roles shows.
_NEVER = {
    "friction.static": "a reversal breaks away within a sample or two",
    "backlash.total": "both positions are read on one side of the joint, or too coarsely",
    "backlash.stiffness": "the joint deflects by less than the corners' own error",
    "control.current_limit": "the logs do not reach this limit for long",
    "control.speed_limit": "the logs do not reach this limit",
    "inverter.supply_voltage": "the logs do not reach this limit",
    "control.torque_constant": "the drive's own belief: only its product with the gain shows",
    "screw.inertia": "turns with the motor's own",
    "screw.nut_heat_share": "scales the nut's capacity and its resistance alike",
    "thermal.emissivity": "near the air's temperature radiation looks like convection",
}
_COPPER = 0.05  # of a resistance from a datasheet
_TORQUE = ("motor.emf_constant",)
_GIVEN = {
    "control.speed_gain": ("control.torque_constant",),
    "motor.inertia": ("screw.inertia",),
    "thermal.winding_mass": ("thermal.winding_heat",),
    "thermal.convection": ("thermal.area", "thermal.emissivity"),
    "screw.nut_capacity": ("screw.nut_heat_share",),
    "screw.nut_to_air": ("screw.nut_heat_share",),
}
_SCALED = (
    "motor.inertia", "friction.viscous", "friction.dynamic", "screw.preload", "screw.efficiency",
    "screw.efficiency_aiding",
)  # fmt: skip


@one_blas_thread()
def calibrate_screw(
    logs: Sequence[ScrewLog],
    actuator: Actuator,
    *,
    free: Sequence[str] | None = None,
    progress: Progress | None = None,
) -> PartsCalibration:
    """Estimate what logs with torque, motion and force on the ram determine.

    Parameters
    ----------
    logs : sequence of ScrewLog
        Quick ones for the balances, long ones with temperatures for the thermal networks.
    actuator : Actuator
        Values before; those that are not estimated stay.
    free : sequence of str, optional
        Paths to estimate; default: all that the logs determine.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        No log, nothing determined, or a path requested that the logs do not determine.
    Interrupted
        `progress` returned False.
    """
    begin = clock.perf_counter()
    if not logs:
        raise InputError("calibration needs at least one log")
    for path in free or ():
        record_of(actuator.wiring, path, "--free")
    go(progress, 0.05)
    work = Parts(actuator, _GIVEN, _NEVER)
    work.add(*motor_constants(logs, actuator))
    work.add(*load_side(logs, actuator))
    go(progress, 0.2)
    constant = work.levels.get("motor.emf_constant")
    torque = None if constant is None else Level(1.5 * constant.value, 1.5 * constant.std)
    if torque is None:
        work.given = {**_GIVEN, **{p: (*_GIVEN.get(p, ()), *_TORQUE) for p in _SCALED}}
    balance = torque_balance(logs, work.settled(), torque, work.value("load.mass"))
    work.add(balance.levels, balance.reasons)
    go(progress, 0.5)
    work.add(*position_loop(logs, actuator))
    work.add(*speed_control(logs, actuator))
    if BY_CURRENT[0] not in work.levels and BY_CURRENT[1] not in work.levels:
        work.add(*loops_by_current(logs, actuator))
        work.given = {**work.given, **dict.fromkeys(BY_CURRENT, LOOPS_GIVEN)}
    go(progress, 0.6)
    _thermal(work, logs)
    go(progress, 0.95)
    estimates, undetermined = work.answer(free)
    values: dict[str, str | float] = {item.path: item.value for item in estimates}
    go(progress, 1.0)
    residual = None if np.isnan(balance.residual) else balance.residual
    return PartsCalibration(
        actuator=actuator.with_values(values, source="calibration"),
        before=actuator,
        logs=tuple(logs),
        estimates=tuple(estimates),
        undetermined=undetermined,
        facts={"balance_residual_nm": residual},
        wall_s=clock.perf_counter() - begin,
    )


def _thermal(work: Parts, logs: Sequence[ScrewLog]) -> None:
    """Evaluate the motor's two nodes and the nut, with what the balances have determined."""
    settled = work.settled()
    resistance = work.levels.get("motor.winding_resistance")
    if resistance is None:
        given = work.value("motor.winding_resistance")
        resistance = Level(given, _COPPER * given)
    work.add(*motor_heat(logs, settled, resistance))
    work.add(*nut_heat(logs, settled, work.levels))
