"""The actuator driven by each log's measured speed set point.

Driving with the set point that was logged cuts the position loop open: the command need not be
known, positions do not drift, and backlash has no part. What is compared is the speed and the
torque current that the model's speed controller, drive, motor and friction make of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from elevon.actuator import Actuator
from elevon.calibrate.model_runs import ModelRuns
from elevon.experiment import Experiment, Inputs, Sensor, Variant
from elevon.experiment.experiment import Table
from elevon.logs.log import Log
from elevon.parameters.relations import torque_constant
from elevon.simulate.prepare import solver_step

_STEP = 1e-4  # s: the reduced-order model's own 0.25 ms costs half a per cent of damping
_SIGNALS = {"torque_current": "current_q_meas", "current_ref": "current_ref"}


class SpeedRuns(ModelRuns):
    """Runs on the logged set points of the speed.

    Parameters
    ----------
    actuator : Actuator
        Values of everything that is not free.
    logs : sequence of Log
        The data, `good` where samples count.
    fidelity : str
        ``low`` or ``high``.
    check : callable
        Called between runs; False stops.
    tied : bool
        Whether the controller's torque constant follows the motor's.
    """

    def __init__(
        self,
        actuator: Actuator,
        logs: Sequence[Log],
        fidelity: str = "low",
        check: Callable[[], bool] = lambda: True,
        *,
        tied: bool = True,
    ) -> None:
        changes: dict[str, str | float] = {}
        if fidelity == "low":
            changes["low.step"] = min(_STEP, actuator.parameters.value("low.step"))
        top = max(float(np.abs(log.speed_ref).max()) for log in logs)
        if top >= actuator.parameters.value("control.speed_limit"):
            changes["control.speed_limit"] = 1.001 * top
        self.actuator = actuator.with_values(changes, source="calibration")
        self.tied = tied
        current = "torque_current" if logs[0].has("torque_current") else "current_ref"
        shows = {"motor_speed": "motor_speed", current: _SIGNALS[current]}
        step = solver_step(self.actuator, fidelity)
        period = min(log.period for log in logs)
        experiments = [
            Experiment(
                log, self.actuator, _inputs(log, step), shows, period=period, fidelity=fidelity
            )
            for log in logs
        ]
        super().__init__(experiments, {"motor_speed": 0.02, current: 0.05}, check, belief=0.0)

    def variant(self, log: Log, values: Mapping[str, float]) -> Variant:
        """Return what a point changes; the controller's constant follows, rest holds no less."""
        known = self.actuator.parameters
        changed = {path: value for path, value in values.items() if path in known}
        if self.tied and "motor.emf_constant" in values:
            changed["control.torque_constant"] = torque_constant(values["motor.emf_constant"])
        static, dynamic = (
            changed.get(path, known.value(path)) for path in ("friction.static", "friction.dynamic")
        )
        changed["friction.static"] = max(static, dynamic)
        level = _level(log, values)
        return Variant(changed, loads={} if level is None else {"brake": level})

    def sensors(self, log: Log, values: Mapping[str, float]) -> dict[str, Sensor]:
        """Delay and offset of the speed, offset of the current."""
        delay, speed, current = (
            values.get(f"sensor.{name}", 0.0)
            for name in ("speed_delay", "speed_offset", "current_offset")
        )
        role = "torque_current" if log.has("torque_current") else "current_ref"
        return {"motor_speed": Sensor(delay, speed), role: Sensor(offset=current)}


def _inputs(log: Log, step: float) -> Inputs:
    initial: dict[str, float | str] = {"motor_speed": float(log.speed[0])}
    if log.has("motor_position"):
        initial["motor_position"] = float(log.motor[0] - np.mean(log.motor))
    brake: Table = (log.brake.time, log.brake.level)
    if not len(brake[0]):
        brake = (np.array([0.0, log.duration]), np.zeros(2))
    return Inputs(
        max(log.duration, 2.0 * step), "speed", (log.time, log.speed_ref), loads={"brake": brake},
        initial=initial,
    )  # fmt: skip


def _level(log: Log, values: Mapping[str, float]) -> Table | None:
    """Brake's level that a point says; None: as logged."""
    offset = values.get("sensor.load_cell_offset", 0.0)
    if log.brake.measured and offset:
        direction = np.sign(np.interp(log.brake.time, log.time, log.speed))
        cell_offset = offset * (log.brake.turning * direction if log.brake.turning else 1.0)
        return log.brake.time, np.maximum(log.brake.level - cell_offset, 0.0)
    knots = [v for p, v in values.items() if p.startswith(f"load.brake[{log.name}]")]
    if not knots:
        return None
    at = np.linspace(0.0, log.duration, len(knots))
    if log.brake.known == "force":
        return log.brake.time, log.brake.level * np.interp(log.brake.time, at, np.array(knots))
    return at, np.array(knots)
