"""Regression coefficients become parameters of the model, with their intervals and conditions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
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

_TIED = 0.01  # relative: closer than this the controller is taken to know the motor
_SEEN = 3.0  # deviations from zero of a controller branch that exists
_GIVEN = ("motor.emf_constant",)
#: Path, value, deviation, what it stands on, note.
_Row = tuple[str, float, float, tuple[str, ...], str]


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
    """Return the torque constant: from the load cell if there is one, else the actuator file's."""
    value = actuator.parameters.value
    old = motor_torque_constant(actuator.parameters)
    nominal = value("control.torque_constant")
    tied = constant_is_tied(actuator.parameters, _TIED)
    if plant is not None and "brake" in plant.names and plant["brake"] > _SEEN * plant.std("brake"):
        constant = 1.0 / plant["brake"]
        relative = plant.std("brake") / plant["brake"]
        return Torque(constant, relative, True, tied, constant if tied else nominal)
    return Torque(old, 0.0, False, tied, nominal)


@dataclass
class _Sheet:
    """Estimates made of the torque balance, one after the other."""

    actuator: Actuator
    plant: Regression
    given: tuple[str, ...]
    estimates: list[Estimate] = field(default_factory=list)

    def add(
        self,
        path: str,
        unit: str,
        function: Callable[[Floats], float],
        note: str = "",
        *,
        given: tuple[str, ...] | None = None,
        register: str = "plant",
        in_set: bool = True,
        floor: float = -np.inf,
    ) -> float:
        """Add a function of the coefficients and return its value."""
        number, std = _delta(self.plant, function)
        half = quantile(self.plant.degrees) * std
        ends = (max(number - half, floor), number + half)
        old = self.actuator.parameters.value(path) if in_set else None
        stands_on = self.given if given is None else given
        self.estimates.append(
            Estimate(
                path, number, std, ends, unit, register, old, "direct", stands_on, note, in_set
            )
        )
        return number


def plant_estimates(
    actuator: Actuator, plant: Regression, torque: Torque
) -> tuple[list[Estimate], dict[str, float]]:
    """Turn the torque balance into estimates.

    Returns
    -------
    (list of Estimate, dict)
        Estimates, and values of other parameters that had to follow (path to value).
    """
    sheet = _Sheet(actuator, plant, () if torque.measured else _GIVEN)
    scale = _scale(plant, torque)
    if torque.measured:
        _constant(sheet, scale)
    follow = _inertia(sheet, scale, _whole_inertia(sheet, scale))
    sheet.add("friction.dynamic", "N m", lambda b: scale(b) * b[2], floor=0.0)
    sheet.add("friction.viscous", "N m s/rad", lambda b: scale(b) * b[1], floor=0.0)
    _offsets(sheet, scale)
    _lag(sheet)
    return sheet.estimates, follow


def _constant(sheet: _Sheet, scale: Callable[[Floats], float]) -> None:
    """The torque constant, from the load cell."""
    share = sheet.actuator.parameters.value("motor.flux_fraction")
    sheet.add(
        "motor.emf_constant",
        "V s/rad",
        lambda b: emf_constant(scale(b), share),
        "from the load cell: torque constant over 1.5",
        given=(),
    )
    sheet.add("derived.torque_constant", "N m/A", scale, "per peak ampere", given=(), in_set=False)


def _whole_inertia(sheet: _Sheet, scale: Callable[[Floats], float]) -> float:
    """All inertia on the motor shaft, and what the current alone tells of it."""
    total = sheet.add(
        "derived.inertia",
        "kg m2",
        lambda b: scale(b) * b[0],
        "all inertia on the motor shaft",
        in_set=False,
    )
    sheet.add(
        "derived.inertia_per_torque",
        "A s2/rad",
        lambda b: float(b[0]),
        "inertia over torque constant: what the current alone tells",
        given=(),
        in_set=False,
    )
    return total


def _offsets(sheet: _Sheet, scale: Callable[[Floats], float]) -> None:
    """Offsets of the current's sensor and of the load cell."""
    names = sheet.plant.names
    if "offset" in names:
        offset = names.index("offset")
        sheet.add(
            "sensor.current_offset",
            "A",
            lambda b: float(b[offset]),
            "or a constant load: the current alone cannot tell them apart",
            given=(),
            register="sensor",
            in_set=False,
        )
    if "cell" in names:
        cell = names.index("cell")
        sheet.add(
            "sensor.load_cell_offset",
            "N m",
            lambda b: scale(b) * float(b[cell]),
            "of the brake torque the load cell shows, the mean over its log",
            register="sensor",
            in_set=False,
        )


def _lag(sheet: _Sheet) -> None:
    """The measured current's lag behind the torque, or the torque's behind its set point."""
    plant, add = sheet.plant, sheet.add
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


def _inertia(sheet: _Sheet, scale: Callable[[Floats], float], total: float) -> dict[str, float]:
    """The motor's own inertia carries the sum, unless the others alone exceed it."""
    value = sheet.actuator.parameters.value
    inertia = value("gear.inertia") + value("load.inertia") / value("gear.ratio") ** 2
    if total > 1.05 * inertia:
        sheet.add(
            "motor.inertia",
            "kg m2",
            lambda b: scale(b) * b[0] - inertia,
            "only its sum with gear.inertia (and the load's) is determined: the others are kept",
            floor=0.0,
        )
        return {}
    share = value("motor.inertia") / (value("motor.inertia") + inertia)
    sheet.add(
        "motor.inertia",
        "kg m2",
        lambda b: share * scale(b) * b[0],
        "the sum is less than the other inertias alone: all are scaled alike",
        floor=0.0,
    )
    factor = total / (value("motor.inertia") + inertia)
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
    extra = torque.relative if torque.tied else 0.0
    given = () if torque.measured and torque.tied else ("control.torque_constant",)
    gain, gain_std = _delta(law, lambda b: torque.believed * float(b[0]))
    std = float(np.hypot(gain_std, extra * gain))
    rows: list[_Row] = [("control.speed_gain", gain, std, given, "")]
    rows += _times(actuator, law, ", ".join(logs))
    estimates = [_of_controller(actuator, law, *row) for row in rows]
    gains, gains_std = _delta(law, lambda b: torque.believed * float(b[1]))
    gains_std = float(np.hypot(gains_std, extra * gains))
    half = quantile(law.degrees) * gains_std
    note = "speed gain over integral time"
    return [
        *estimates,
        Estimate(
            "derived.integral_gain", gains, gains_std, (gains - half, gains + half), "N m/rad",
            "controller", None, "direct", given, note, False,
        ),
    ]  # fmt: skip


def _times(actuator: Actuator, law: Regression, logs: str) -> list[_Row]:
    """Integral and derivative time: path, value, deviation, what it stands on, note."""
    value = actuator.parameters.value
    none = f"no {{}} action is seen in {logs}"
    rows: list[_Row] = []
    if law["integral"] > _SEEN * law.std("integral"):
        time, std = _delta(law, lambda b: float(b[0] / b[1]))
        rows.append(("control.integral_time", time, std, (), ""))
    elif value("control.integral_time") > 0.0:
        rows.append(("control.integral_time", 0.0, 0.0, (), none.format("integral")))
    late, late_std = _delta(law, lambda b: float(b[2] / b[0]))
    if late > 0.0:
        rows.append(("control.derivative_time", late, late_std, (), ""))
    elif value("control.derivative_time") > 0.0:
        rows.append(("control.derivative_time", 0.0, late_std, (), none.format("derivative")))
    return rows


def _of_controller(  # noqa: PLR0917 - a row of estimates
    actuator: Actuator,
    law: Regression,
    path: str,
    number: float,
    std: float,
    given: tuple[str, ...],
    note: str,
) -> Estimate:
    """One number of the controller, which cannot be negative."""
    half = quantile(law.degrees) * std
    unit, old = record_of(actuator.wiring, path).unit, actuator.parameters.value(path)
    ends = (max(number - half, 0.0), number + half)
    return Estimate(path, number, std, ends, unit, "controller", old, "direct", given, note)
