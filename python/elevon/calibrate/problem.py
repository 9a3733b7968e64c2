"""The dynamic fit's model runs: the actuator driven by each log's measured speed set point.

Driving with the set point that was logged cuts the position loop open: the command need not be
known, positions do not drift, and backlash has no part. What is compared is the speed and the
torque current that the model's speed controller, drive, motor and friction make of it.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.candidates import ParameterCandidate
from elevon.calibrate.log import BenchLog
from elevon.errors import InputError, Interrupted
from elevon.parameters.records import positions
from elevon.parameters.relations import torque_constant

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["Problem", "Simulated"]

_STEP = 1e-4  # s: the reduced-order model's own 0.25 ms costs half a per cent of damping
_BIG = 1e3  # residual of a run that left the finite numbers, in deviations


@dataclass(frozen=True)
class Simulated:
    """Speed and current of one run on the log's instants, shape (n,); None where it diverged."""

    speed: Floats
    current: Floats


@dataclass
class Problem:
    """Logs, a base actuator, the candidates, and the scale of each signal's residual.

    Attributes
    ----------
    actuator : Actuator
        Values of everything that is not free.
    logs : sequence of BenchLog
        The data.
    fidelity : str
        ``low`` or ``high``.
    check : callable
        Called between runs; raises `Interrupted` when the caller stops.
    tied : bool
        Whether the controller's torque constant follows the motor's.
    scales : list of (float, float)
        Deviation of speed and current residual of each log.
    masks : list of ndarray of bool
        Samples used of each log.
    runs : int
        Model runs so far.
    """

    actuator: Actuator
    logs: Sequence[BenchLog]
    fidelity: str = "low"
    check: Callable[[], bool] = lambda: True
    tied: bool = True
    scales: list[tuple[float, float]] = field(default_factory=list)
    masks: list[npt.NDArray[np.bool_]] = field(default_factory=list)
    runs: int = 0
    _cores: list[dict[str, Any]] = field(default_factory=list)
    _plan: list[dict[str, object]] = field(default_factory=list)
    _place: Mapping[str, int] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self._place = positions(self.actuator.wiring)
        self._prepare()
        self.masks = self.masks or [log.good.copy() for log in self.logs]
        self.scales = self.scales or [
            (max(0.02 * float(log.speed.std()), 1e-9), max(0.05 * float(log.current.std()), 1e-9))
            for log in self.logs
        ]

    def _prepare(self) -> None:
        from elevon.scenario import Scenario
        from elevon.simulate.prepare import Run, prepare, solver_step

        changes: dict[str, str | float] = {}
        if self.fidelity == "low":
            changes["low.step"] = min(_STEP, self.actuator.parameters.value("low.step"))
        top = max(float(np.abs(log.speed_ref).max()) for log in self.logs)
        if top >= self.actuator.parameters.value("control.speed_limit"):
            changes["control.speed_limit"] = 1.001 * top
        base = self.actuator.with_values(changes, source="calibration")
        step = solver_step(base, self.fidelity)
        period = max(1, int(min(log.period for log in self.logs) / step * (1.0 + 1e-9)))
        # Names and units are the scenario's; the arrays are exchanged below, without their cost.
        empty = Scenario.from_dict(_scenario(1.0))
        prepared = prepare(Run(base, empty), self.fidelity, f"{_signals(self.logs[0])}@every")
        self._plan = [{**prepared.plan[0].to_core(), "period_steps": period}]
        for log in self.logs:
            core = {**prepared.core, "duration": max(log.duration, 2.0 * step)}
            core["initial"] = {"motor_speed": float(log.speed[0])}
            if log.motor is not None:
                core["initial"]["motor_position"] = float(log.motor[0] - np.mean(log.motor))
            inputs = dict(prepared.core["inputs"])
            inputs["command"] = [_table(inputs["command"][0], log.time, log.speed_ref)]
            inputs["brake"] = [_table(inputs["brake"][0], log.brake.time, log.brake.level)]
            core["inputs"] = inputs
            self._cores.append(core)

    def vector(self, values: Mapping[str, float]) -> Floats:
        """Return the core's parameter vector with some values changed."""
        vector = np.array(self._cores[0]["parameters"])
        for path, value in values.items():
            if path in self._place:
                vector[self._place[path]] = value
        at = self._place
        if self.tied and "motor.emf_constant" in values:
            vector[at["control.torque_constant"]] = torque_constant(values["motor.emf_constant"])
        static, dynamic = at["friction.static"], at["friction.dynamic"]
        vector[static] = max(vector[static], vector[dynamic])
        return vector

    def core(self, index: int, values: Mapping[str, float]) -> dict[str, Any]:
        """Return the run of one log."""
        core = {**self._cores[index], "parameters": self.vector(values)}
        level = self._level(index, values)
        if level is not None:
            brake = [_table(core["inputs"]["brake"][0], *level)]
            core["inputs"] = {**core["inputs"], "brake": brake}
        return core

    def _level(self, index: int, values: Mapping[str, float]) -> tuple[Floats, Floats] | None:
        log = self.logs[index]
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

    def simulate(self, points: Sequence[Mapping[str, float]]) -> list[list[Simulated | None]]:
        """Run every log at every point, all in one batch; result[point][log]."""
        from elevon import _core

        if not self.check():
            raise Interrupted("calibration stopped")
        cores = [self.core(k, p) for p in points for k in range(len(self.logs))]
        self.runs += len(cores)
        try:
            results = _core.simulate(
                self.actuator.wiring,
                self.fidelity,
                cores,
                self._plan,
                _threads(),
                "auto",
                lambda _fraction: self.check(),
            )
        except ValueError as error:
            raise InputError(str(error)) from error
        if any(item["status"] == "interrupted" for item in results):
            raise Interrupted("calibration stopped")
        shaped = [
            self._read(results[i], i % len(self.logs), points[i // len(self.logs)])
            for i in range(len(results))
        ]
        width = len(self.logs)
        return [shaped[i : i + width] for i in range(0, len(shaped), width)]

    def _read(
        self, result: Mapping[str, Any], index: int, values: Mapping[str, float]
    ) -> Simulated | None:
        rows = result["clocks"]["every_step"]
        if result["status"] not in {"ok", "tripped"} or not np.isfinite(rows["values"]).all():
            return None
        return self.output(index, rows["time"], rows["values"], values)

    def output(
        self, index: int, time: Floats, signals: Floats, values: Mapping[str, float]
    ) -> Simulated:
        """What the sensors show of a run's speed and current: delay, then offset."""
        at = self.logs[index].time - values.get("sensor.speed_delay", 0.0)
        speed = np.interp(at, time, signals[:, 0]) + values.get("sensor.speed_offset", 0.0)
        current = np.interp(self.logs[index].time, time, signals[:, 1])
        return Simulated(speed, current + values.get("sensor.current_offset", 0.0))

    def residual(self, runs: Sequence[Simulated | None]) -> list[Floats]:
        """Residual of each log in deviations, shape (n, 2): speed, current; zero where masked."""
        parts = []
        for log, run, scale, mask in zip(self.logs, runs, self.scales, self.masks, strict=True):
            if run is None:
                part = np.full((len(log.time), 2), _BIG)
            else:
                part = np.column_stack(
                    ((run.speed - log.speed) / scale[0], (run.current - log.current) / scale[1])
                )
            part[~mask] = 0.0
            parts.append(np.clip(part, -_BIG, _BIG))
        return parts

    def jacobian(
        self, free: Sequence[ParameterCandidate], x: Floats, steps: Floats
    ) -> list[npt.NDArray[np.float64]]:
        """Central differences over a batch; one array (n, 2, p) a log."""
        points = []
        for k, step in enumerate(steps):
            for sign in (1.0, -1.0):
                moved = x.copy()
                moved[k] += sign * step
                points.append(values_of(free, moved))
        runs = self.simulate(points)
        jac = [np.empty((len(log.time), 2, len(free))) for log in self.logs]
        for k, step in enumerate(steps):
            up, down = self.residual(runs[2 * k]), self.residual(runs[2 * k + 1])
            for part, a, b in zip(jac, up, down, strict=True):
                part[:, :, k] = (a - b) / (2.0 * step)
        return jac

    def exact(
        self, index: int, values: Mapping[str, float], paths: Sequence[str]
    ) -> dict[str, Floats]:
        """Exact derivatives of speed and current of one log, shape (n, 2), in SI, by dual numbers.

        They are those of the branch the run takes: where friction sticks or slips they jump.
        """
        from elevon import _core

        core = self.core(index, values)
        passes = _core.sensitivities(
            self.actuator.wiring,
            self.fidelity,
            core,
            self._plan,
            list(paths),
            [],
            lambda _fraction: self.check(),
        )
        columns = {}
        count = _core.derivatives_per_pass()
        for number, item in enumerate(passes):
            chosen = paths[count * number : count * (number + 1)]
            rows = item["clocks"]["every_step"]
            array = rows["values"].reshape(len(rows["time"]), -1, 1 + len(chosen))
            for k, path in enumerate(chosen):
                at = self.logs[index].time
                columns[path] = np.column_stack(
                    [np.interp(at, rows["time"], array[:, c, 1 + k]) for c in range(2)]
                )
        return columns


def values_of(free: Sequence[ParameterCandidate], x: Floats) -> dict[str, float]:
    """Return paths and values of a point of the fit."""
    return {item.path: item.outer(float(v)) for item, v in zip(free, x, strict=True)}


def _scenario(duration: float) -> dict[str, Any]:
    table = {"kind": "table", "times": [0.0, 1.0], "values": [0.0, 0.0]}
    return {
        "duration": duration,
        "command": {"mode": "speed", "terms": [table]},
        "load": {"brake": {"terms": [dict(table)]}},
    }


def _table(term: Mapping[str, Any], times: Floats, values: Floats) -> dict[str, Any]:
    return {**term, "times": np.ascontiguousarray(times), "values": np.ascontiguousarray(values)}


def _signals(log: BenchLog) -> str:
    return f"motor_speed,{log.current_signal}"


def _threads() -> int:
    return max(1, min(len(os.sched_getaffinity(0)), 8)) if hasattr(os, "sched_getaffinity") else 0
