"""Logs' tests on a model at many points of a fit at once, as residuals of what moves.

`SpeedRuns` drives the actuator with each log's measured set point of the speed. That cuts the
position loop open: the command need not be known, positions do not drift, and backlash has no part.
What is compared is the speed and the torque current that the model's speed controller, drive, motor
and friction make of it.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import cached_property

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.errors import InputError, Interrupted
from elevon.estimate import Free
from elevon.estimate.lanes import LaneChannel, Lanes
from elevon.experiment import Experiment, Inputs, Sensor, Variant, run_all
from elevon.experiment.experiment import Table
from elevon.logs.log import Log
from elevon.parameters.records import record_of
from elevon.parameters.relations import torque_constant
from elevon.simulate.prepare import solver_step


class ModelRuns:
    """What a fit moves, on the tests of some logs.

    Parameters
    ----------
    experiments : sequence of Experiment
        One a log.
    first : mapping of str to float
        Role to the first deviation of its residual, as a share of the channel's spread: the roles
        that are compared.
    check : callable
        Called between runs; False stops.
    belief : float
        Weight of what is believed before.

    Attributes
    ----------
    logs : tuple of Log
        The data.
    runs : int
        Model runs so far.
    """

    def __init__(
        self,
        experiments: Sequence[Experiment],
        first: Mapping[str, float],
        check: Callable[[], bool] = lambda: True,
        belief: float = 1.0,
    ) -> None:
        self.experiments = tuple(experiments)
        self.logs = tuple(item.log for item in experiments)
        self.check = check
        self.runs = 0
        self._first, self._belief = first, belief

    def variant(self, log: Log, values: Mapping[str, float]) -> Variant:
        """Return what a point changes in the run of a log."""
        raise NotImplementedError

    def sensors(self, log: Log, values: Mapping[str, float]) -> Mapping[str, Sensor]:
        """Return how a log shows the run of a point."""
        raise NotImplementedError

    def simulate(self, points: Sequence[Mapping[str, float]]) -> list[list[Log | None]]:
        """Run every log at every point, one batch; result[point][log], None where it diverged."""
        if not self.check():
            raise Interrupted("calibration stopped")
        wanted = [
            (item, self.variant(item.log, point)) for point in points for item in self.experiments
        ]
        self.runs += len(wanted)
        runs = iter(run_all(wanted, lambda _fraction: self.check()))
        return [
            [
                run.seen(log, self.sensors(log, point)) if (run := next(runs)).complete else None
                for log in self.logs
            ]
            for point in points
        ]

    def lanes(self, free: Sequence[Free]) -> Lanes:
        """Return the residuals of what moves, over all samples that count."""
        return Lanes(free, self._masked, self._data, self._belief)

    @cached_property
    def _masks(self) -> list[tuple[int, str, Bools]]:
        return [
            (k, role, log.good & np.isfinite(log[role]))
            for k, log in enumerate(self.logs)
            for role in self._first
            if log.has(role)
        ]

    @cached_property
    def _data(self) -> list[LaneChannel]:
        rows = []
        for k, role, mask in self._masks:
            log = self.logs[k]
            size = float(np.nanstd(log[role][log.good]))
            first = self._first[role] * size
            rows.append(
                LaneChannel(k, role, log.time[mask], log[role][mask], log.period, size, first)
            )
        return rows

    def _masked(self, points: Sequence[Mapping[str, float]]) -> list[list[Floats | None]]:
        return [
            [None if (run := runs[k]) is None else run[role][mask] for k, role, mask in self._masks]
            for runs in self.simulate(points)
        ]


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


#: What `auto` tries to free in the dynamic fit, in the model's own parameters.
AUTO = (
    "friction.dynamic",
    "friction.viscous",
    "friction.static",
    "motor.inertia",
    "motor.emf_constant",
    "control.speed_gain",
    "control.integral_time",
    "control.derivative_time",
    "sensor.filter_cutoff",
)
_FILTER = (2.0, 5000.0)  # Hz
_DELAY = 0.02  # s
_WHOLE = 0.95  # of the inertia that speed gain times derivative time may reach
_KNOTS = 4  # of an unknown brake's level over a log


def candidates(actuator: Actuator, logs: Sequence[Log], free: Sequence[str] | None) -> list[Free]:
    """List what may be freed: the caller's paths, or those of `AUTO` that the logs could determine.

    Raises
    ------
    InputError
        An unknown path, a choice, or one the model fixes (gear ratio, solver).
    """
    from elevon.calibrate.kinematics import KINEMATIC

    if free is None:
        paths = [path for path in AUTO if _sensible(path, actuator, logs)]
    else:
        paths = [path for path in free if path not in KINEMATIC]
    items = [_parameter(path, actuator) for path in paths]
    current = max(float(abs(log.current).max()) for log in logs)
    speed = max(float(abs(log.speed).max()) for log in logs)
    if not current > 0.0 or not speed > 0.0:
        raise InputError("the logs hold no motion and no current: nothing can be calibrated")
    offsets = [
        ("sensor.speed_offset", "rad/s", speed, 0.01 * speed),
        ("sensor.speed_delay", "s", _DELAY, 1e-3),
    ]
    if all(log.has("torque_current") for log in logs):
        offsets.insert(0, ("sensor.current_offset", "A", current, 0.01 * current))
    items += [
        Free(path, 0.0, size, -reach, reach, unit=unit, register="sensor", kind="output")
        for path, unit, reach, size in offsets
    ]
    return items + _brakes(logs)


def _brakes(logs: Sequence[Log]) -> list[Free]:
    """Offset of the load cell where another log shows the friction alone; unknown brakes."""
    items = []
    measured = [log for log in logs if log.brake.measured]
    if measured and any(log.brake.known == "off" for log in logs):
        top = max(float(log.brake.level.max()) for log in measured)
        items.append(
            Free("sensor.load_cell_offset", 0.0, 0.01 * top, -top, top, unit="N m",
                 register="sensor", kind="input")
        )  # fmt: skip
    items += [
        Free(f"load.brake[{log.name}][{j}]", 0.0, 0.1, 0.0, 100.0, unit="N m", register="load",
             kind="input")
        for log in logs
        if log.brake.known in {"on", "force"}
        for j in range(_KNOTS)
    ]  # fmt: skip
    return items


def _sensible(path: str, actuator: Actuator, logs: Sequence[Log]) -> bool:
    if path == "motor.emf_constant":
        return any(log.brake.measured for log in logs)
    if path == "sensor.filter_cutoff":
        return all(log.has("torque_current") for log in logs)
    if path in {"control.integral_time", "control.derivative_time"}:
        return actuator.parameters.value(path) > 0.0
    return path in actuator.parameters


def _parameter(path: str, actuator: Actuator) -> Free:
    record = record_of(actuator.wiring, path, "--free")
    if record.choices is not None:
        raise InputError(f"--free {path}: is a choice, not a number")
    if record.register == "solver" or path == "gear.ratio":
        raise InputError(f"--free {path}: belongs to the model's making, not to a log")
    value = actuator.parameters.value(path)
    unit, register = record.unit, record.register
    if path == "sensor.filter_cutoff":
        return Free(path, value, 0.3, *_FILTER, True, unit, register)
    if value > 0.0 and record.minimum >= 0.0:
        ends = max(record.minimum, 1e-3 * value), min(record.maximum, 1e3 * value)
        return Free(path, value, 0.1, *ends, True, unit, register)
    span = max(1.0, 10.0 * abs(value))
    ends = max(record.minimum, value - span), min(record.maximum, value + span)
    return Free(path, value, 0.01 * span, *ends, False, unit, register)


def within_inertia(actuator: Actuator, values: Mapping[str, str | float]) -> dict[str, float]:
    """Return a shorter derivative time where gain times it would exceed the inertia, else nothing.

    Such a pair acts like an inertia larger than the real one; a drive with a tick does not bear it.
    """

    def value(path: str) -> float:
        return float(values.get(path, actuator.parameters.value(path)))

    inertia = value("motor.inertia") + value("gear.inertia")
    gain = value("control.speed_gain") * value("control.speed_gain_scale")
    if gain * value("control.derivative_time") < _WHOLE * inertia:
        return {}
    return {"control.derivative_time": _WHOLE * inertia / gain}
