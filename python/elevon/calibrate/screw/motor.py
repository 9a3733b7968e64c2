"""Motor constants and the load side: balances of voltage, and of the cell against the load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.level import Level
from elevon.calibrate.regression import Regression, robust_regression, with_deviations
from elevon.calibrate.screw.log import CORNERS, ScrewLog

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["load_side", "motor_constants"]

_RATE = 5e-4  # relative: what rates and clocks of a stand leave open
_WARMTH = 1.0  # K of the winding over the surface that no log of seconds shows
_FEWEST = 300  # samples


def motor_constants(
    logs: Sequence[ScrewLog], actuator: Actuator
) -> tuple[dict[str, Level], dict[str, str]]:
    """Return voltage constant and winding resistance from ``v = k w + R i``, at the log's warmth.

    Slopes of speed and current are columns of their own: the inductance, and what a filter of the
    drive makes of the voltage. What the magnets lose with the surface's warmth is taken off, where
    it was recorded.
    """
    paths = ("motor.emf_constant", "motor.winding_resistance")
    missing = dict.fromkeys(("motor.winding_inductance",), "its column carries the filters' lags")
    usable = [log for log in logs if log.quick and log.has("torque_voltage")]
    rows, data = [], []
    for log in usable:
        s, used = log.smooth, log.moving
        flux = flux_factor(log, actuator)
        columns = [flux * s["motor_speed"], s["torque_current"]]
        columns += [s["acceleration"], s["current_slope"]]
        rows.append(np.stack(columns, axis=1)[used])
        data.append(s["torque_voltage"][used])
    names = ("constant", "resistance", "lag", "inductance")
    fit = _fitted(usable, rows, data, names)
    if fit is None:
        why = "no log shows the voltage in motion"
        return {}, dict.fromkeys((*paths, "motor.winding_inductance"), why)
    constant, resistance = fit["constant"], fit["resistance"]
    levels = {
        paths[0]: Level(constant, fit.std("constant"), fit.degrees).widened(_RATE * constant),
        paths[1]: Level(resistance, fit.std("resistance"), fit.degrees).widened(
            _WARMTH * actuator.parameters.value("motor.temperature_coefficient") * resistance
        ),
    }
    return levels, missing


def flux_factor(log: ScrewLog, actuator: Actuator) -> Floats:
    """Return the magnets' factor at the surface's temperature, 1 where it was not recorded."""
    value = actuator.parameters.value
    if not log.has("surface_temperature"):
        return np.ones(len(log.time))
    # The thermocouple's noise is no warmth: a log of seconds has one.
    rise = float(np.mean(log["surface_temperature"])) - value("motor.reference_temperature")
    return np.full(len(log.time), 1.0 + value("motor.flux_temperature_coefficient") * rise)


def load_side(
    logs: Sequence[ScrewLog], actuator: Actuator
) -> tuple[dict[str, Level], dict[str, str]]:
    """Return mass, damping and friction of the load side: the cell less the stand's force."""
    paths = ("load.mass", "load.damping", "load.friction")
    usable = [log for log in logs if log.quick and log.has("load", "load_cell")]
    value = actuator.parameters.value
    # The motor's speed is quieter than the ram's position twice differentiated.
    travel = value("screw.lead") / value("gear.ratio")
    names = ("mass", "damping", "friction")

    def fitted(corner: float) -> Regression | None:
        rows, data = [], []
        for log in usable:
            s, used = log.smooth, log.apart(corner)
            speed = s["motor_speed"]
            columns = [travel * s["acceleration"], travel * speed, np.sign(speed)]
            rows.append(np.stack(columns, axis=1)[used])
            data.append((s["load_cell"] - s["load"])[used])
        return _fitted(usable, rows, data, names, corner)

    fit, other = (fitted(corner) for corner in CORNERS)
    if fit is None or other is None:
        why = "needs a load cell beside the stand's force: they differ by the load side"
        return {}, dict.fromkeys(paths, why)
    # How near to the reversals samples count is open.
    return {
        path: Level(fit[name], fit.std(name), fit.degrees).widened(other[name] - fit[name])
        for path, name in zip(paths, names, strict=True)
    }, {}


def _fitted(
    logs: Sequence[ScrewLog],
    rows: Sequence[Floats],
    data: Sequence[Floats],
    names: tuple[str, ...],
    corner: float = CORNERS[0],
) -> Regression | None:
    if sum(len(row) for row in rows) < _FEWEST:
        return None
    design = np.vstack(rows)
    value, residual, weight, _ = robust_regression(design, np.concatenate(data))
    used = [log.apart(corner) for log in logs]
    times = [
        (log.time[u], log.smooth["motor_speed"][u], log.period)
        for log, u in zip(logs, used, strict=True)
    ]
    fit = with_deviations(names, value, design, residual, weight, times=times)
    return fit if np.isfinite(fit.covariance).all() else None
