"""The servo's own closed loop on recorded demands, and where a search of it begins."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.model_runs import ModelRuns
from elevon.calibrate.stages.closed_loop.log import (
    CHANNELS,
    NAMES,
    STICK,
    motion,
    unsigned,
    window,
)
from elevon.calibrate.stages.context import motor_ratio
from elevon.estimate import Free
from elevon.estimate.free import inner
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


_WINDOW = 6.0  # s
_SETTLE = 0.4  # s
_PLACES = (0.6, 0.95)  # quantiles of unrest at which windows of a log are taken
#: Bandwidths that a servo may have, rad/s: speed loop, position loop, integral action.
_SPEED, _POSITION, _INTEGRAL = (10.0, 1500.0), (1.0, 80.0), (0.05, 20.0)


def windows(logs: Sequence[Log], per_output: float) -> list[Log]:
    """Return short stretches of the logs: a busy one and a calmer one of each."""
    parts = []
    for log in logs:
        if log.duration <= 2.0 * _WINDOW:
            parts.append(log)
            continue
        speed = motion(log, per_output)[0]
        begins = np.arange(0.0, log.duration - _WINDOW, 0.5 * _WINDOW)
        unrest = []
        for begin in begins:
            inside = (log.time >= begin) & (log.time < begin + _WINDOW)
            unrest.append(float(np.sqrt(np.nanmean(speed[inside] ** 2))))
        order = np.argsort(unrest)
        chosen = {int(order[round(q * (len(order) - 1))]) for q in _PLACES}
        parts += [window(log, begins[k], begins[k] + _WINDOW, _SETTLE) for k in sorted(chosen)]
    return parts


def first_values(model: LoopModel) -> dict[str, float]:
    """Return what currents and speeds suggest; only paths the signals speak of."""
    constant = model.actuator.parameters.value("control.torque_constant")
    top = max(float(np.nanmax(np.abs(motion(log, model.per_output)[0]))) for log in model.logs)
    values: dict[str, float] = {}
    if top > 0.0 and np.isfinite(top):
        values["control.speed_limit"] = 1.05 * top
    current = [log.current[log.good] for log in model.logs if log.has("torque_current")]
    if current:
        peak = float(np.nanmax(np.abs(np.concatenate(current))))
        values["control.current_limit"] = max(1.05 * peak, 1e-3)
        values.update(_friction(model, constant))
    return values


def _friction(model: LoopModel, constant: float) -> dict[str, float]:
    """Dry friction and a constant load, from the current while it moves in either direction."""
    levels: dict[int, list[Floats]] = {1: [], -1: []}
    for log in model.logs:
        if not log.has("torque_current"):
            continue
        speed = motion(log, model.per_output)[0]
        slow = 0.05 * float(np.nanmax(np.abs(speed)))
        for direction, level in levels.items():
            level.append(log.current[log.good & (direction * speed > slow)])
    forth, back = (np.concatenate(levels[direction]) for direction in (1, -1))
    if len(forth) < 10 or len(back) < 10:
        return {}
    a, b = constant * float(np.nanmedian(forth)), constant * float(np.nanmedian(back))
    signed = not any(unsigned(log) for log in model.logs)
    values = {"friction.dynamic": max(0.5 * (abs(a) + abs(b)), 1e-6)}
    if signed:
        values["friction.dynamic"] = max(0.5 * (a - b), 0.1 * values["friction.dynamic"])
        values["load.constant"] = 0.5 * (a + b) * model.per_output
    return values


def cloud(free: Sequence[Free], model: LoopModel, number: int, seed: int) -> Floats:
    """Return starts, shape (number, p): loops of every bandwidth, the plant about its first values.

    Gains are drawn through the bandwidths they give to the inertia that each start has.
    """
    from scipy.stats import qmc

    base = {item.path: item.start for item in free}
    rows = qmc.Sobol(7, seed=seed).random(1 << (number - 1).bit_length())[:number]
    points = []
    for row in rows:
        values = dict(base)
        inertia = base["motor.inertia"] * 3.0 ** (2.0 * row[0] - 1.0)
        values["motor.inertia"] = inertia
        values["friction.dynamic"] = base["friction.dynamic"] * 3.0 ** (row[1] - 0.7)
        values["friction.viscous"] = base["friction.viscous"] * 10.0 ** (2.0 * row[2] - 1.0)
        whole = inertia + _fixed_inertia(model)
        values.update(_gains(row[3:], whole, model.per_output))
        points.append(inner(free, values))
    return np.array(points)


def _gains(row: Floats, inertia: float, per_output: float) -> Mapping[str, float]:
    """Gains of both structures from bandwidths drawn evenly over their logarithms."""
    speed, position, integral = (
        low * (high / low) ** share
        for (low, high), share in zip((_SPEED, _POSITION, _INTEGRAL), row, strict=False)
    )
    damping = inertia * speed
    return {
        "control.speed_gain": damping,
        "control.position_gain": position * per_output,
        "control.integral_time": 1.0 / integral,
        "control.pid_gain": damping * per_output * position,
        "control.pid_derivative_time": 1.0 / position,
        "control.pid_integral_time": 1.0 / integral,
    }


def _fixed_inertia(model: LoopModel) -> float:
    """What turns with the motor beside its own inertia."""
    value = model.actuator.parameters.value
    load = value("load.mass" if model.actuator.wiring == "ballscrew" else "load.inertia")
    screw = value("screw.inertia") if model.actuator.wiring == "ballscrew" else 0.0
    return float(
        value("gear.inertia") + screw / value("gear.ratio") ** 2 + load / model.per_output**2
    )
