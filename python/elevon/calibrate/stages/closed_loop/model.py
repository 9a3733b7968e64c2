"""The servo's own closed loop on recorded demands: many parameter vectors, one batch."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from elevon.actuator import Actuator
from elevon.calibrate.model_runs import ModelRuns
from elevon.calibrate.stages.closed_loop.free import STICK
from elevon.calibrate.stages.closed_loop.log import CHANNELS, NAMES, motion, unsigned
from elevon.calibrate.stages.log import motor_ratio
from elevon.experiment import Experiment, Inputs, Sensor, Variant
from elevon.logs.command.curve import command_curve
from elevon.logs.log import Log

#: Role to the model's signal, the sensors' own; and first deviations, as shares of a channel's
#: spread: what a fair model of an unknown drive leaves.
_FINE = 2  # recorded samples a sample of the log


class LoopModel(ModelRuns):
    """Runs of one servo on some logs, under one structure of its controller.

    Parameters
    ----------
    actuator : Actuator
        Everything that is not moved.
    logs : sequence of Log
        Demands, clocks, initial positions.
    structure : str
        ``cascade`` or ``pid``.
    check : callable
        Asked while running; False stops.
    """

    def __init__(
        self,
        actuator: Actuator,
        logs: Sequence[Log],
        structure: str,
        check: Callable[[], bool] = lambda: True,
    ) -> None:
        self.actuator = actuator.with_values({"control.structure": structure}, source="calibration")
        self.structure = structure
        self.per_output = motor_ratio(actuator)
        # The gains of the actuator file are another machine's, perhaps: the fit brings its own.
        calm = self.actuator.with_values({"control.speed_gain": 0.0}, source="calibration")
        period = min(log.period for log in logs) / _FINE
        served = {role for log in logs for role in log.channels}
        shows = {role: item.signal for role, item in CHANNELS.items() if role in served}
        experiments = [
            Experiment(log, calm, self._inputs(log), shows, period=period) for log in logs
        ]
        super().__init__(experiments, {r: item.first for r, item in CHANNELS.items()}, check)

    def on(self, logs: Sequence[Log]) -> LoopModel:
        """Return the same servo on other logs."""
        return LoopModel(self.actuator, logs, self.structure, self.check)

    def _inputs(self, log: Log) -> Inputs:
        at = self._start(log)
        speed = motion(log, self.per_output)[0]
        top = float(np.nanmax(np.abs(speed), initial=0.0))
        moving = float(np.nanmean(speed[:3])) if np.isfinite(speed[:3]).any() else 0.0
        initial: dict[str, float | str] = {
            "motor_position": at * self.per_output, "output_position": at,
        }  # fmt: skip
        if abs(moving) > 0.1 * top:
            initial["motor_speed"] = moving
        loads = {"output": (log.time, log["load"])} if log.has("load") else {}
        end = log.duration + 4.0 * log.period
        return Inputs(end, "position", command_curve(log).points, loads=loads, initial=initial)

    def _start(self, log: Log) -> float:
        """Where the output stood when the log began: as recorded, else as demanded."""
        first = slice(0, 3)
        if log.has("output_position"):
            return float(np.nanmean(log.output[first]))
        if log.has("motor_position"):
            return float(np.nanmean(log.motor[first])) / self.per_output
        return float(log["command"][0])

    def variant(self, log: Log, values: Mapping[str, float]) -> Variant:  # noqa: ARG002 - alike
        """Return what a point changes; the speed gain is the file's own where it is not searched.

        Rest never holds less than motion.
        """
        known = self.actuator.parameters
        changed = {"control.speed_gain": known.value("control.speed_gain")}
        changed |= {path: value for path, value in values.items() if path in known}
        dynamic = changed.get("friction.dynamic", known.value("friction.dynamic"))
        static = changed.get("friction.static", known.value("friction.static"))
        if STICK in values:
            static = values[STICK] * dynamic
        changed["friction.static"] = max(static, dynamic)
        return Variant(changed)

    def sensors(self, log: Log, values: Mapping[str, float]) -> dict[str, Sensor]:
        """Delays, lags and offsets of the logger, the current's sign."""
        out = {}
        for role, name in NAMES.items():
            delay, offset, lag = (
                values.get(f"sensor.{name}_{what}", 0.0) for what in ("delay", "offset", "lag")
            )
            scale = 1.0 / self.per_output if role == "output_speed" else 1.0
            no_sign = role == "torque_current" and unsigned(log)
            out[role] = Sensor(delay, offset, lag, unsigned=no_sign, scale=scale)
        return out
