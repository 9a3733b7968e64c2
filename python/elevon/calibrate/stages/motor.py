"""Motor constants and the load side: balances of voltage, and of the cell against the load."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.context import Context
from elevon.calibrate.stages.smooth import CORNERS, apart, quick, smooth
from elevon.estimate.regression import Regression, regressed
from elevon.logs.log import Log

_RATE = 5e-4  # relative: what rates and clocks of a stand leave open
_WARMTH = 1.0  # K of the winding over the surface that no log of seconds shows
_FEWEST = 300  # samples


def motor_constants(ctx: Context) -> None:
    """Voltage constant and winding resistance from ``v = k w + R i``, at the log's warmth.

    Slopes of speed and current are columns of their own: the inductance, and what a filter of the
    drive makes of the voltage. What the magnets lose with the surface's warmth is taken off, where
    it was recorded.
    """
    paths = ("motor.emf_constant", "motor.winding_resistance")
    missing = dict.fromkeys(("motor.winding_inductance",), "its column carries the filters' lags")
    usable = [log for log in ctx.logs if quick(log) and log.has("torque_voltage")]
    rows, data = [], []
    for log in usable:
        s, used = smooth(log), apart(log)
        flux = flux_factor(log, ctx.actuator)
        columns = [flux * s["motor_speed"], s["torque_current"]]
        columns += [s["acceleration"], s["current_slope"]]
        rows.append(np.stack(columns, axis=1)[used])
        data.append(s["torque_voltage"][used])
    names = ("constant", "resistance", "lag", "inductance")
    fit = _fitted(usable, rows, data, names)
    if fit is None:
        why = "no log shows the voltage in motion"
        ctx.add({}, dict.fromkeys((*paths, *missing), why))
        return
    constant, resistance = fit["constant"], fit["resistance"]
    levels = {
        paths[0]: fit.estimate("constant").widened(_RATE * constant),
        paths[1]: fit.estimate("resistance").widened(
            _WARMTH * ctx.given_value("motor.temperature_coefficient") * resistance
        ),
    }
    ctx.add(levels, missing)


def flux_factor(log: Log, actuator: Actuator) -> Floats:
    """Return the magnets' factor at the surface's temperature, 1 where it was not recorded."""
    value = actuator.parameters.value
    if not log.has("surface_temperature"):
        return np.ones(len(log.time))
    # The thermocouple's noise is no warmth: a log of seconds has one.
    rise = float(np.mean(log["surface_temperature"])) - value("motor.reference_temperature")
    return np.full(len(log.time), 1.0 + value("motor.flux_temperature_coefficient") * rise)


def load_side(ctx: Context) -> None:
    """Mass, damping and friction of the load side: the cell less the stand's force."""
    paths = ("load.mass", "load.damping", "load.friction")
    usable = [log for log in ctx.logs if quick(log) and log.has("load", "load_cell")]
    # The motor's speed is quieter than the ram's position twice differentiated.
    travel = 1.0 / ctx.ratio
    names = ("mass", "damping", "friction")

    def fitted(corner: float) -> Regression | None:
        rows, data = [], []
        for log in usable:
            s, used = smooth(log), apart(log, corner)
            speed = s["motor_speed"]
            columns = [travel * s["acceleration"], travel * speed, np.sign(speed)]
            rows.append(np.stack(columns, axis=1)[used])
            data.append((s["load_cell"] - s["load"])[used])
        return _fitted(usable, rows, data, names, corner)

    fit, other = (fitted(corner) for corner in CORNERS)
    if fit is None or other is None:
        why = "needs a load cell beside the stand's force: they differ by the load side"
        ctx.add({}, dict.fromkeys(paths, why))
        return
    # How near to the reversals samples count is open.
    ctx.add(
        {
            path: fit.estimate(name).widened(other[name] - fit[name])
            for path, name in zip(paths, names, strict=True)
        }
    )


def _fitted(
    logs: Sequence[Log],
    rows: Sequence[Floats],
    data: Sequence[Floats],
    names: tuple[str, ...],
    corner: float = CORNERS[0],
) -> Regression | None:
    if sum(len(row) for row in rows) < _FEWEST:
        return None
    used = [apart(log, corner) for log in logs]
    strokes = [
        (log.time[u], smooth(log)["motor_speed"][u], log.period)
        for log, u in zip(logs, used, strict=True)
    ]
    fit = regressed(names, rows, data, strokes)
    return fit if np.isfinite(fit.covariance).all() else None
