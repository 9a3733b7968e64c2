"""The servo's own closed loop on recorded demands: many parameter vectors, one batch."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.closed_loop.free import STICK
from elevon.calibrate.closed_loop.log import LoopLog
from elevon.errors import InputError, Interrupted
from elevon.parameters.records import positions

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["Channels", "LoopModel"]

#: Channels of one run on its log's clock; None where it left the finite numbers.
Channels = dict[str, Floats] | None

_SOURCES = {
    "position": "output_position",
    "motor_position": "motor_position",
    "speed": "motor_speed",
    "motor_speed": "motor_speed",
    "current": "current_q_meas",
    "voltage": "voltage_q_meas",
}
_FINE = 2  # recorded samples a sample of the log


class LoopModel:
    """Runs of one servo on some logs, under one structure of its controller.

    Parameters
    ----------
    actuator : Actuator
        Everything that is not moved.
    logs : sequence of LoopLog
        Demands, clocks, initial positions.
    structure : str
        ``cascade`` or ``pid``.
    check : callable
        Asked while running; False stops.
    """

    def __init__(
        self,
        actuator: Actuator,
        logs: Sequence[LoopLog],
        structure: str,
        check: Callable[[], bool] = lambda: True,
    ) -> None:
        self.actuator = actuator.with_values({"control.structure": structure}, source="calibration")
        self.logs = tuple(logs)
        self.structure = structure
        self.check = check
        self.runs = 0
        self._own_gain = self.actuator.parameters.value("control.speed_gain")
        self._place = positions(actuator.wiring)
        value = actuator.parameters.value
        lead = value("screw.lead") if actuator.wiring == "ballscrew" else 1.0
        self.per_output = value("gear.ratio") / lead
        self.channels = tuple(name for name in _SOURCES if any(name in log.signals for log in logs))
        self._prepare()

    def _prepare(self) -> None:
        from elevon.scenario import Scenario
        from elevon.simulate.prepare import Run, prepare, solver_step

        table = {"kind": "table", "times": [0.0, 1.0], "values": [0.0, 0.0]}
        zero = Scenario.from_dict(
            {
                "duration": 1.0,
                "command": {"mode": "position", "terms": [table]},
                "load": {"output": {"terms": [dict(table)]}},
            }
        )
        names = ",".join(dict.fromkeys(_SOURCES[name] for name in self.channels))
        # The gains of the actuator file are another machine's, perhaps: the fit brings its own.
        calm = self.actuator.with_values({"control.speed_gain": 0.0}, source="calibration")
        prepared = prepare(Run(calm, zero), "low", f"{names}@every")
        self._names = list(prepared.plan[0].signals)
        step = solver_step(self.actuator, "low")
        period = min(log.period for log in self.logs)
        every = max(1, int(period / _FINE / step + 1e-6))
        self._plan = [{**prepared.plan[0].to_core(), "period_steps": every}]
        self._clock = str(self._plan[0]["clock"])
        self._cores = [self._core(prepared.core, log) for log in self.logs]

    def _core(self, base: Mapping[str, Any], log: LoopLog) -> dict[str, Any]:
        inputs = dict(base["inputs"])
        times, values = log.table
        inputs["command"] = [{**inputs["command"][0], "times": times, "values": values}]
        if log.load is not None:
            inputs["output"] = [
                {**inputs["output"][0], "times": log.load[0], "values": log.load[1]}
            ]
        at = self._start(log)
        speed = log.motion(self.per_output)[0]
        top = float(np.nanmax(np.abs(speed), initial=0.0))
        moving = float(np.nanmean(speed[:3])) if np.isfinite(speed[:3]).any() else 0.0
        initial = {"motor_position": at * self.per_output, "output_position": at}
        if abs(moving) > 0.1 * top:
            initial["motor_speed"] = moving
        end = log.duration + 4.0 * log.period
        return {**base, "inputs": inputs, "initial": initial, "duration": end}

    def _start(self, log: LoopLog) -> float:
        """Where the output stood when the log began: as recorded, else as demanded."""
        first = slice(0, 3)
        if "position" in log.signals:
            return float(np.nanmean(log.signals["position"][first]))
        if "motor_position" in log.signals:
            return float(np.nanmean(log.signals["motor_position"][first])) / self.per_output
        return float(log.command[0])

    def keep_gains(self, actuator: Actuator) -> None:
        """Run with all of an actuator file's own values: where nothing is searched."""
        nominal = actuator.parameters.vector()
        for core in self._cores:
            core["parameters"] = nominal

    def vector(self, values: Mapping[str, float]) -> Floats:
        """Return the core's parameter vector with some values changed."""
        vector = np.array(self._cores[0]["parameters"])
        if "control.speed_gain" not in values:
            # Not searched: the actuator file's own.
            vector[self._place["control.speed_gain"]] = self._own_gain
        for path, value in values.items():
            if path in self._place:
                vector[self._place[path]] = value
        at = self._place
        stick = values.get(STICK)
        dynamic = vector[at["friction.dynamic"]]
        if stick is not None:
            vector[at["friction.static"]] = stick * dynamic
        vector[at["friction.static"]] = max(vector[at["friction.static"]], dynamic)
        return vector

    def simulate(self, points: Sequence[Mapping[str, float]]) -> list[list[Channels]]:
        """Run every log at every point; result[point][log]."""
        from elevon import _core

        if not self.check():
            raise Interrupted("calibration stopped")
        vectors = [self.vector(point) for point in points]
        cores = [{**core, "parameters": vector} for vector in vectors for core in self._cores]
        self.runs += len(cores)
        try:
            results = _core.simulate(
                self.actuator.wiring, "low", cores, self._plan, 0, "auto",
                lambda _fraction: self.check(),
            )  # fmt: skip
        except ValueError as error:
            raise InputError(str(error)) from error
        if any(item["status"] == "interrupted" for item in results):
            raise Interrupted("calibration stopped")
        width = len(self.logs)
        return [
            [self._traces(results[k * width + i], log, point) for i, log in enumerate(self.logs)]
            for k, point in enumerate(points)
        ]

    def _traces(
        self, result: Mapping[str, Any], log: LoopLog, values: Mapping[str, float]
    ) -> Channels:
        """What the log would show of a run: delays, offsets, the current's sign."""
        rows = result["clocks"][self._clock]
        if result["status"] not in {"ok", "tripped"} or not np.isfinite(rows["values"]).all():
            return None
        traces = {}
        for name in self.channels:
            if name not in log.signals:
                continue
            fine = rows["values"][:, self._names.index(_SOURCES[name])]
            if name == "speed":
                fine = fine / self.per_output
            if name == "current" and log.magnitude:
                fine = np.abs(fine)
            lag = values.get(f"sensor.{name}_lag", 0.0)
            if lag > 0.0:
                fine = _late(fine, lag / float(np.median(np.diff(rows["time"]))))
            at = log.time - values.get(f"sensor.{name}_delay", 0.0)
            traces[name] = np.interp(at, rows["time"], fine) + values.get(
                f"sensor.{name}_offset", 0.0
            )
        return traces


def _late(values: Floats, lag: float) -> Floats:
    """Return samples behind a first-order filter, `lag` in sample times, from rest."""
    from scipy.signal import lfilter

    keep = float(np.exp(-1.0 / lag))
    start = np.array([keep * values[0]])
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values, zi=start)[0])
