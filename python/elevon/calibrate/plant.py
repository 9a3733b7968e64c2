"""Regression coefficients become parameters of the model, with their intervals and conditions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.calibrate.estimate import Estimate, quantile
from elevon.calibrate.regression import Regression
from elevon.parameters.records import record_of
from elevon.parameters.relations import constant_is_tied, emf_constant, motor_torque_constant

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.calibrate.static import StaticFriction

__all__ = [
    "Torque",
    "controller_estimates",
    "plant_estimates",
    "static_estimate",
    "torque_scale",
]

Floats = npt.NDArray[np.float64]
_TIED = 0.01  # relative: closer than this the controller is taken to know the motor
_SEEN = 3.0  # deviations a controller branch must stand off zero to exist
_GIVEN = ("motor.emf_constant",)


@dataclass(frozen=True)
class Torque:
    """The scale of every torque.

    Attributes
    ----------
    constant : float
        Torque constant [N m per peak A].
    relative : float
        Its relative deviation; 0 where it is given.
    measured : bool
        Whether a load cell gave it.
    tied : bool
        Whether the controller's own torque constant follows it.
    believed : float
        The controller's own constant [N m/A].
    """

    constant: float
    relative: float
    measured: bool
    tied: bool
    believed: float


def torque_scale(actuator: Actuator, plant: Regression | None) -> Torque:
    """Return the torque constant: from the load cell where there is one, else the set's."""
    value = actuator.parameters.value
    old = motor_torque_constant(actuator.parameters)
    own = value("control.torque_constant")
    tied = constant_is_tied(actuator.parameters, _TIED)
    if plant is not None and "brake" in plant.names and plant["brake"] > _SEEN * plant.std("brake"):
        constant = 1.0 / plant["brake"]
        relative = plant.std("brake") / plant["brake"]
        return Torque(constant, relative, True, tied, constant if tied else own)
    return Torque(old, 0.0, False, tied, own)


def plant_estimates(
    actuator: Actuator, plant: Regression, torque: Torque
) -> tuple[list[Estimate], dict[str, float]]:
    """Turn the torque balance into estimates.

    Returns
    -------
    (list of Estimate, dict)
        Estimates, and values of other parameters that had to follow (path to value).
    """
    value = actuator.parameters.value
    rest = value("gear.inertia") + value("load.inertia") / value("gear.ratio") ** 2
    given = () if torque.measured else _GIVEN
    found: list[Estimate] = []

    def add(
        path: str,
        unit: str,
        function: Callable[[Floats], float],
        note: str = "",
        *,
        given: tuple[str, ...] = given,
        register: str = "plant",
        in_set: bool = True,
        floor: float = -np.inf,
    ) -> float:
        number, std = _delta(plant, function)
        half = quantile(plant.degrees) * std
        low, high = max(number - half, floor), number + half
        old = value(path) if in_set else None
        found.append(
            Estimate(
                path, number, std, (low, high), unit, register, old, "direct", given, note, in_set
            )
        )
        return number

    scale = _scale(plant, torque)
    if torque.measured:
        add(
            "motor.emf_constant",
            "V s/rad",
            lambda b: emf_constant(scale(b), value("motor.flux_fraction")),
            "from the load cell: torque constant over 1.5",
            given=(),
        )
        add("derived.torque_constant", "N m/A", scale, "per peak ampere", given=(), in_set=False)
    total = add(
        "derived.inertia",
        "kg m2",
        lambda b: scale(b) * b[0],
        "all inertia on the fast shaft",
        in_set=False,
    )
    add(
        "derived.inertia_per_torque",
        "A s2/rad",
        lambda b: float(b[0]),
        "inertia over torque constant: what the current alone tells",
        given=(),
        in_set=False,
    )
    follow = _inertia(add, actuator, scale, total, rest)
    add("friction.dynamic", "N m", lambda b: scale(b) * b[2], floor=0.0)
    add("friction.viscous", "N m s/rad", lambda b: scale(b) * b[1], floor=0.0)
    if "offset" in plant.names:
        offset = plant.names.index("offset")
        add(
            "sensor.current_offset",
            "A",
            lambda b: float(b[offset]),
            "or a constant load: the current alone cannot tell them apart",
            given=(),
            register="sensor",
            in_set=False,
        )
    if "cell" in plant.names:
        cell = plant.names.index("cell")
        add(
            "sensor.load_cell_offset",
            "N m",
            lambda b: scale(b) * float(b[cell]),
            "of the brake torque the load cell shows, the mean over its log",
            register="sensor",
            in_set=False,
        )
    _lag(add, plant)
    return found, follow


def _lag(add: Callable[..., float], plant: Regression) -> None:
    """The measured current's lag behind the torque, or the torque's behind its set point."""
    lag = len(plant.names) - 1
    if "constant" in plant.names:
        add(
            "derived.current_loop_lag",
            "s",
            lambda b: -float(b[lag]),
            "of the torque behind the current's set point: no measured current is in the logs",
            given=(),
            register="controller",
            in_set=False,
        )
        return
    add(
        "sensor.current_lag",
        "s",
        lambda b: float(b[lag]),
        "of the logged current behind the motion",
        given=(),
        register="sensor",
        in_set=False,
    )
    if plant["lag"] > _SEEN * plant.std("lag"):
        add(
            "sensor.filter_cutoff",
            "Hz",
            lambda b: 1.0 / (2.0 * np.pi * b[lag]),
            "first-order filter of this lag",
            given=(),
            register="sensor",
            floor=0.0,
        )


def static_estimate(
    actuator: Actuator, static: StaticFriction | None, dynamic: float | None, torque: Torque
) -> list[Estimate]:
    """Static friction as an estimate; no less than the dynamic one, which it cannot be.

    Parameters
    ----------
    actuator : Actuator
        Values before.
    static : StaticFriction or None
        From `elevon.calibrate.static.static_friction`.
    dynamic : float or None
        Dynamic friction [N m], where it is estimated.
    torque : Torque
        Scale of every torque.
    """
    if static is None:
        return []
    std = float(np.hypot(static.std, torque.relative * static.value))
    half = quantile(static.degrees) * std
    least = 0.0 if dynamic is None else dynamic
    return [
        Estimate(
            "friction.static",
            max(static.value, least),
            std,
            (max(static.value - half, 0.0), max(static.value + half, least) + static.unseen),
            "N m",
            "plant",
            actuator.parameters.value("friction.static"),
            "direct",
            () if torque.measured else _GIVEN,
            static.how,
        )
    ]


def _inertia(
    add: Callable[..., float],
    actuator: Actuator,
    scale: Callable[[Floats], float],
    total: float,
    rest: float,
) -> dict[str, float]:
    """The motor's own inertia carries the sum, unless the others alone exceed it."""
    value = actuator.parameters.value
    if total > 1.05 * rest:
        add(
            "motor.inertia",
            "kg m2",
            lambda b: scale(b) * b[0] - rest,
            "only its sum with gear.inertia (and the load's) is determined: the others are kept",
            floor=0.0,
        )
        return {}
    share = value("motor.inertia") / (value("motor.inertia") + rest)
    add(
        "motor.inertia",
        "kg m2",
        lambda b: share * scale(b) * b[0],
        "the sum is less than the other inertias alone: all are scaled alike",
        floor=0.0,
    )
    factor = total / (value("motor.inertia") + rest)
    return {path: factor * value(path) for path in ("gear.inertia", "load.inertia")}


def _scale(plant: Regression, torque: Torque) -> Callable[[Floats], float]:
    if not torque.measured:
        return lambda _b: torque.constant
    at = plant.names.index("brake")
    return lambda b: 1.0 / float(b[at])


def _delta(regression: Regression, function: Callable[[Floats], float]) -> tuple[float, float]:
    """Value and deviation of a function of the coefficients."""
    beta = regression.value
    std = np.sqrt(np.maximum(np.diag(regression.covariance), 0.0))
    gradient = np.zeros(len(beta))
    for k, step in enumerate(1e-3 * std):
        if step > 0.0:
            shift = np.zeros(len(beta))
            shift[k] = step
            gradient[k] = (function(beta + shift) - function(beta - shift)) / (2.0 * step)
    variance = float(gradient @ regression.covariance @ gradient)
    return float(function(beta)), float(np.sqrt(max(variance, 0.0)))


def controller_estimates(
    actuator: Actuator, law: Regression, torque: Torque, logs: Sequence[str]
) -> list[Estimate]:
    """Turn the controller's law into gain and times."""
    value = actuator.parameters.value
    extra = torque.relative if torque.tied else 0.0
    given = () if torque.measured and torque.tied else ("control.torque_constant",)
    gain, gain_std = _delta(law, lambda b: torque.believed * float(b[0]))
    gain_std = float(np.hypot(gain_std, extra * gain))
    rows = [("control.speed_gain", gain, gain_std, given, "")]
    none = "no {} action is seen in " + ", ".join(logs)
    if law["integral"] > _SEEN * law.std("integral"):
        found_time = _delta(law, lambda b: float(b[0] / b[1]))
        rows.append(("control.integral_time", *found_time, (), ""))
    elif value("control.integral_time") > 0.0:
        rows.append(("control.integral_time", 0.0, 0.0, (), none.format("integral")))
    late, late_std = _delta(law, lambda b: float(b[2] / b[0]))
    if late > 0.0:
        rows.append(("control.derivative_time", late, late_std, (), ""))
    elif value("control.derivative_time") > 0.0:
        rows.append(("control.derivative_time", 0.0, late_std, (), none.format("derivative")))
    gains, gains_std = _delta(law, lambda b: torque.believed * float(b[1]))
    found = []
    for path, number, std, condition, note in rows:
        half = quantile(law.degrees) * std
        unit = record_of(actuator.wiring, path).unit
        found.append(
            Estimate(
                path,
                number,
                std,
                (max(number - half, 0.0), number + half),
                unit,
                "controller",
                value(path),
                "direct",
                condition,
                note,
            )
        )
    gains_std = float(np.hypot(gains_std, extra * gains))
    half = quantile(law.degrees) * gains_std
    found.append(
        Estimate(
            "derived.integral_gain",
            gains,
            gains_std,
            (gains - half, gains + half),
            "N m/rad",
            "controller",
            None,
            "direct",
            given,
            "speed gain over integral time",
            False,
        )
    )
    return found
