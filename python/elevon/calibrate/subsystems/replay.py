"""The plant in the core, driven by the measured effort; the loop closed by an identified law."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.log import motor_ratio
from elevon.calibrate.subsystems.signals import DriveSignals
from elevon.errors import InputError
from elevon.experiment import Experiment, Inputs, Variant
from elevon.logs.log import Log

#: What the motor's effort moves, and nothing else: for a run with numbers of its own.
_NOTHING = (
    "gear.inertia", "screw.inertia", "screw.preload", "load.inertia", "load.mass",
    "load.stiffness", "load.damping", "load.friction", "friction.jam_torque",
    "friction.viscous_slope", "backlash.total", "backlash.extra",
)  # fmt: skip
_WHOLE = (
    "gear.efficiency",
    "gear.efficiency_aiding",
    "screw.efficiency",
    "screw.efficiency_aiding",
)
_FAR = 1e6  # output's coordinate: stops that no log reaches
_STEPS = 4  # of the solver a sample, at least
_SHOWN = {"motor_position": "motor_position", "motor_speed": "motor_speed"}
WINDOW = 0.5  # s: a window of the open-loop prediction


def bare(actuator: Actuator, numbers: Mapping[str, float]) -> Actuator:
    """Return the model of a shaft with inertia, friction and constant load, nothing else acting."""
    known, ratio = actuator.parameters, motor_ratio(actuator)
    coulomb = numbers.get("coulomb", 0.0)
    values: dict[str, str | float] = {path: 0.0 for path in _NOTHING if path in known}
    values |= {path: 1.0 for path in _WHOLE if path in known}
    values |= {
        "motor.inertia": numbers["inertia"],
        "friction.viscous": numbers["viscous"],
        "friction.dynamic": coulomb,
        "friction.static": coulomb,
    }
    if "load.constant" in known:
        values["load.constant"] = numbers.get("offset", 0.0) * ratio
    return actuator.with_values(values, source="the inverse model's numbers")


def plant_experiment(
    drive: DriveSignals, actuator: Actuator, torque: Floats, duration: float | None = None
) -> Experiment:
    """Return the run of the plant whose drive is off and whose shaft takes the measured torque.

    Parameters
    ----------
    drive : DriveSignals
        The log.
    actuator : Actuator
        The model.
    torque : ndarray, shape (n,)
        Of the motor on the log's instants [N m].
    duration : float, optional
        s; default: the whole log.
    """
    values: dict[str, str | float] = {
        "drive.kind": "off", "thermal.model": "off",
        "stop.upper": _FAR, "stop.lower": -_FAR,
        "low.step": min(actuator.parameters.value("low.step"), drive.period / _STEPS),
    }  # fmt: skip
    known = actuator.parameters
    model = actuator.with_values(
        {path: value for path, value in values.items() if path in known}, source="open loop"
    )
    position, speed, _ = _states(drive)
    log = Log(drive.name, drive.time, dict.fromkeys(_SHOWN, drive.time))
    length = float(drive.time[-1]) if duration is None else duration
    rest = (np.array([0.0, length]), np.zeros(2))
    inputs = Inputs(
        length, "position", rest, loads={"shaft": (drive.time, -torque)},
        initial=_begin(float(position[0]), float(speed[0]), motor_ratio(actuator)),
    )  # fmt: skip
    return Experiment(log, model, inputs, _SHOWN, rate="every")


def _states(drive: DriveSignals) -> tuple[Floats, Floats, Floats]:
    """Return position, speed and acceleration in a band that keeps a window's start free of noise."""
    from elevon.calibrate.subsystems.signals import useful_band

    return drive.derivatives(useful_band(drive))


def _begin(position: float, speed: float, ratio: float) -> dict[str, float | str]:
    return {
        "motor_position": position, "motor_speed": speed, "output_position": position / ratio,
    }  # fmt: skip


def free_run(drive: DriveSignals, actuator: Actuator, torque: Floats) -> tuple[Floats, Floats]:
    """Return position and speed of the motor, driven by a torque from the log's first state.

    Raises
    ------
    InputError
        The run leaves the finite numbers.
    """
    run = next(plant_experiment(drive, actuator, torque).run())
    if not run.complete:
        raise InputError(
            f"{drive.name}: the model driven by the measured effort does not stay finite"
        )
    position, speed = (np.interp(drive.time, run.log.time, run.log[name]) for name in _SHOWN)
    return position, speed


def window_errors(
    drive: DriveSignals, actuator: Actuator, torque: Floats, window: float = WINDOW
) -> tuple[float, float]:
    """Return RMS errors of position [rad] and speed [rad/s] over windows that begin as measured."""
    position, speed, _ = _states(drive)
    count = max(round(window / drive.period), 8)
    starts = np.arange(0, len(drive.time) - count, count)
    experiment = plant_experiment(drive, actuator, torque, count * drive.period)
    ratio = motor_ratio(actuator)
    times = drive.time[: count + 1]
    variants = [
        Variant(
            loads={"shaft": (times, -torque[k : k + count + 1])},
            initial=_begin(float(position[k]), float(speed[k]), ratio),  # type: ignore[arg-type]
        )
        for k in starts
    ]
    errors = []
    for k, run in zip(starts, experiment.run(variants), strict=True):
        if not run.complete:
            continue
        part = slice(k, k + count)
        for name, data in zip(_SHOWN, (position, speed), strict=True):
            errors.append(np.interp(times[:-1], run.log.time, run.log[name]) - data[part])
    if not errors:
        return float("nan"), float("nan")
    of_position, of_speed = np.concatenate(errors[::2]), np.concatenate(errors[1::2])
    return float(np.sqrt(np.mean(of_position**2))), float(np.sqrt(np.mean(of_speed**2)))


@dataclass(frozen=True, eq=False)
class ClosedLoop:
    """A run of the plant under an identified law, on the log's instants.

    Attributes
    ----------
    name : str
        Of the log.
    time, position, effort : ndarray, shape (n,)
        s, rad, effort's unit.
    measured_position, measured_effort : ndarray, shape (n,)
        What the log has.
    position_rms : float
        RMS error of the position [rad].
    effort_share : float
        RMS error of the effort over its own RMS.
    """

    name: str
    time: Floats
    position: Floats
    effort: Floats
    measured_position: Floats
    measured_effort: Floats
    position_rms: float
    effort_share: float


def closed_loop(
    drive: DriveSignals,
    actuator: Actuator,
    law: Callable[[int, Floats], float],
    scale: float,
    disturbance: Floats | None = None,
    settle: int = 50,
) -> ClosedLoop:
    """Run the plant under a law that reads the motor's position and speed at each sample.

    Parameters
    ----------
    drive : DriveSignals
        Whose command the law follows.
    actuator : Actuator
        The plant.
    law : callable
        Of the sample's number, and position [rad] and speed [rad/s] there; the effort.
    scale : float
        Torque of one unit of effort [N m].
    disturbance : ndarray, optional
        Added to the effort, its unit.
    settle : int
        Samples at the beginning that are not compared.
    """
    assert drive.position is not None
    added = np.zeros(len(drive.time)) if disturbance is None else disturbance
    zero = np.zeros(len(drive.time))
    efforts = np.empty(len(drive.time))

    def set_torque(k: int, seen: Floats) -> float:
        efforts[k] = law(k, seen) + added[k]
        return -scale * float(efforts[k])

    experiment = plant_experiment(drive, actuator, zero)
    out = experiment.stepped(set_torque, "shaft", tuple(_SHOWN), drive.time)
    position = out[:, 0]
    part = slice(settle, None)
    error = (position - drive.position)[part]
    off = (efforts - drive.effort)[part]
    size = float(np.sqrt(np.mean(drive.effort[part] ** 2)))
    return ClosedLoop(
        drive.name, drive.time, position, efforts, drive.position, drive.effort,
        float(np.sqrt(np.mean(error**2))), float(np.sqrt(np.mean(off**2))) / max(size, 1e-300),
    )  # fmt: skip


def total(errors: Sequence[float]) -> float:
    """Return the root of the mean square of errors."""
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else float("nan")
