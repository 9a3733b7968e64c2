"""The plant in the core, driven by the measured effort; the loop closed by an identified law."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.context import LOAD_SHARE, grows_with_torque, motor_ratio
from elevon.calibrate.subsystems.controller import LawNumbers, SampledLaw
from elevon.calibrate.subsystems.signals import DriveSignals, useful_band
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
_SIGNALS = {"motor_position": "motor_position", "motor_speed": "motor_speed"}
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
    loss = numbers.get("load_loss", 0.0)
    if loss and LOAD_SHARE in known:
        values |= grows_with_torque(0.0) | {LOAD_SHARE: loss}
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
        "inverter.supply_voltage": _FAR,  # the diodes of a bridge that is off never conduct
        "stop.upper": _FAR, "stop.lower": -_FAR,
        "control.speed_gain": 0.0, "control.pid_gain": 0.0,  # no loop acts: none limits the step
        "low.step": min(actuator.parameters.value("low.step"), drive.period / _STEPS),
    }  # fmt: skip
    known = actuator.parameters
    if LOAD_SHARE in known:  # what passes the shaft from outside is the motor's torque here
        values["friction.load_external"] = known.value(LOAD_SHARE)
    model = actuator.with_values(
        {path: value for path, value in values.items() if path in known}, source="open loop"
    )
    position, speed, _ = _states(drive)
    log = Log(drive.name, drive.time, dict.fromkeys(_SIGNALS, drive.time))
    length = float(drive.time[-1]) if duration is None else duration
    zero_input = (np.array([0.0, length]), np.zeros(2))
    inputs = Inputs(
        length, "position", zero_input, loads={"shaft": (drive.time, -torque)},
        initial=_begin(float(position[0]), float(speed[0]), motor_ratio(actuator)),
    )  # fmt: skip
    return Experiment(log, model, inputs, _SIGNALS, rate="every")


def _states(drive: DriveSignals) -> tuple[Floats, Floats, Floats]:
    """Return position, speed and acceleration within the band that is free of noise."""
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
    position, speed = (np.interp(drive.time, run.log.time, run.log[name]) for name in _SIGNALS)
    return position, speed


def window_runs(
    drive: DriveSignals, actuator: Actuator, torque: Floats, window: float = WINDOW
) -> tuple[Floats, Floats]:
    """Return position [rad] and speed [rad/s] over windows that begin as measured.

    Parameters
    ----------
    drive : DriveSignals
        The log.
    actuator : Actuator
        The model.
    torque : ndarray, shape (n,)
        Measured, of the motor [N m].
    window : float
        Length of a window [s].

    Returns
    -------
    ndarray, ndarray, shape (n,)
        NaN in what is left at the end, and in a window whose run does not stay finite.
    """
    position, speed, _ = _states(drive)
    count = max(round(window / drive.period), 8)
    starts = range(0, len(drive.time) - count, count)
    experiment = plant_experiment(drive, actuator, torque, count * drive.period)
    ratio, times = motor_ratio(actuator), drive.time[: count + 1]
    variants = [
        Variant(
            loads={"shaft": (times, -torque[k : k + count + 1])},
            initial={name: float(value) for name, value in
                     _begin(float(position[k]), float(speed[k]), ratio).items()},
        )
        for k in starts
    ]  # fmt: skip
    out = np.full((2, len(drive.time)), np.nan)
    for k, run in zip(starts, experiment.run(variants), strict=True):
        if run.complete:
            for row, name in enumerate(_SIGNALS):
                out[row, k : k + count] = np.interp(times[:-1], run.log.time, run.log[name])
    return out[0], out[1]


def closed_loop(
    drive: DriveSignals, actuator: Actuator, law: LawNumbers, scale: float
) -> tuple[Floats, Floats]:
    """Return position [rad] and effort of the plant under a law, on the log's instants.

    Parameters
    ----------
    drive : DriveSignals
        Whose command the law follows; its load acts where the law has a gain for it.
    actuator : Actuator
        The plant.
    law : LawNumbers
        Of the effort.
    scale : float
        Torque of one unit of effort [N m].
    """
    assert drive.command is not None
    controller = SampledLaw(law, drive.command, drive.load)
    efforts = np.empty(len(drive.time))

    def set_torque(k: int, seen: Floats) -> float:
        efforts[k] = controller(k, seen)
        return -scale * float(efforts[k])

    experiment = plant_experiment(drive, actuator, np.zeros(len(drive.time)))
    out = experiment.stepped(set_torque, "shaft", tuple(_SIGNALS), drive.time)
    return out[:, 0], efforts
