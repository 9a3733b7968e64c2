"""A preloaded screw: motor constants, load side, friction, preload, efficiencies, inertia.

``k_T i = J dw/dt + C w + s (T_d + b(F) T_pr) + r F + s L(F)`` with ``s`` the sign of the motion,
``T_pr = F_pr r (1/eta - eta')``, ``L = (1/eta - 1) r |F|`` where the force ``F`` on the nut opposes
the motion and ``(1 - eta') r |F|`` where it aids. ``b`` is the relieved half's share of preload: 1
without load, 0 from 2.83 F_pr on (docs/explanation/theory/ballscrew.md).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.context import CORNERS, Balance, Context, apart, loaded, quick, smooth
from elevon.estimate import Estimate, Free
from elevon.estimate.covariance import Strokes
from elevon.estimate.regression import Regression, regressed
from elevon.estimate.residual import BalanceFit, fit_balance
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


#: What is believed before the logs, as a share of the actuator file's value.
_BELIEF = {
    "motor.inertia": 0.7, "friction.viscous": 3.0, "friction.dynamic": 1.0, "screw.preload": 1.0,
    "screw.efficiency": 0.15, "screw.efficiency_aiding": 0.15,
}  # fmt: skip
_NAMES = tuple(_BELIEF)
#: What the current's sensor adds: offset [A], and lag [s] behind the motion; first value and share.
_SENSOR = {"offset": (0.1, 1.0), "lag": (1e-3, 3.0)}
_SPREAD = 0.05  # N m, first deviation of the residual
_CLOSES = 5e-5  # of the torque: ASSUMED, to which smoothed channels' balance closes at any speed
_NUDGE = 1e-3  # of the torque, for what its deviation moves
_RELIEF = 2.0 * np.sqrt(2.0)
_SERIES = (1.53960, -1.19476, 1.13376, -0.67106, 0.19246)


def relieved(force: Floats, preload: float) -> Floats:
    """Return the relieved half's share of the preload, as the core's series has it."""
    y = np.clip(1.0 - np.abs(force) / (_RELIEF * preload), 0.0, 1.0)
    root = np.sqrt(y)
    series = sum(c * root**k for k, c in enumerate(_SERIES))
    return np.asarray(y * root * series)


@dataclass(frozen=True)
class _Samples:
    current: Floats
    current_slope: Floats
    acceleration: Floats
    speed: Floats
    force: Floats
    travel: float
    other_inertia: float

    def torque(self, value: Floats) -> Floats:
        """Torque that the motor must make [N m], for values of `_NAMES` without the sensor's."""
        inertia, viscous, dry, preload, opposing, aiding = value[: len(_NAMES)]
        direction, load = np.sign(self.speed), np.abs(self.force) * self.travel
        lost = np.where(direction * self.force > 0.0, 1.0 / opposing - 1.0, 1.0 - aiding) * load
        drag = preload * self.travel * (1.0 / opposing - aiding) * relieved(self.force, preload)
        smooth = (inertia + self.other_inertia) * self.acceleration + viscous * self.speed
        return np.asarray(smooth + self.travel * self.force + direction * (dry + drag + lost))


def torque(ctx: Context) -> None:
    """Fit the screw to all logs with motion, current and force.

    The torque of an ampere is the motor's as determined, else as the actuator file has it; where no
    cell measures the force on the nut, the load side's numbers count.
    """
    known = ctx.levels.get("motor.emf_constant")
    constant = None if known is None else known.scaled(1.5)
    if constant is None:
        ctx.stands_on(_NAMES, ("motor.emf_constant",))
    balance = _balance(ctx.logs, ctx.settled(), constant)
    ctx.add(balance.levels, balance.reasons)
    residual = balance.residual
    ctx.facts["balance_residual_nm"] = None if np.isnan(residual) else residual


def _balance(logs: Sequence[Log], actuator: Actuator, constant: Estimate | None) -> Balance:
    usable = [log for log in logs if quick(log) and loaded(log)]
    names = _NAMES
    if not usable:
        why = "no log of a motion with current and force on the ram"
        return Balance({}, dict.fromkeys(names, why), float("nan"))
    value = actuator.parameters.value
    given = 1.5 * value("motor.emf_constant")
    scale = given if constant is None else constant.value
    free = [
        *(Free.about(path, max(value(path), 1e-9), share) for path, share in _BELIEF.items()),
        *(Free.about(name, *pair, signed=True) for name, pair in _SENSOR.items()),
    ]

    def fitted(torque: float, corner: float = CORNERS[0]) -> BalanceFit:
        samples, strokes = _stacked(usable, actuator, corner)

        def model(value: Floats) -> Floats:
            late = value[7] * samples.current_slope
            return np.asarray(samples.torque(value) / torque + value[6] - late)

        return fit_balance(free, samples.current, model, strokes, scale=_SPREAD / torque)

    fit = fitted(scale)
    # How near to the reversals samples count is open.
    others = [fitted(scale, CORNERS[1]).x - fit.x]
    if constant is not None:
        moved = (fitted(scale * (1.0 + _NUDGE)).x - fit.x) / _NUDGE
        others.append(moved * constant.std / constant.value)
    samples = _stacked(usable, actuator, CORNERS[0])[0]
    return _judged(fit.widened(*others), samples, scale)


def _stacked(
    logs: Sequence[Log], actuator: Actuator, corner: float
) -> tuple[_Samples, list[Strokes]]:
    value = actuator.parameters.value
    travel = value("screw.lead") / value("gear.ratio")
    rows: dict[str, list[Floats]] = {
        "current": [], "current_slope": [], "acceleration": [], "speed": [], "force": [],
    }  # fmt: skip
    strokes = []
    for log in logs:
        s, used = smooth(log), apart(log, corner)
        rows["current"].append((flux_factor(log, actuator) * s["torque_current"])[used])
        rows["current_slope"].append(s["current_slope"][used])
        rows["acceleration"].append(s["acceleration"][used])
        rows["speed"].append(s["motor_speed"][used])
        rows["force"].append(nut_force(log, actuator)[used])
        strokes.append((log.time[used], s["motor_speed"][used], log.period))
    joined = {name: np.concatenate(parts) for name, parts in rows.items()}
    other_inertia = value("gear.inertia") + value("screw.inertia") / value("gear.ratio") ** 2
    return _Samples(travel=travel, other_inertia=other_inertia, **joined), strokes


def nut_force(log: Log, actuator: Actuator) -> Floats:
    """Force on the nut, positive against extension: the cell's, else the load and its side's."""
    s, value = smooth(log), actuator.parameters.value
    if log.has("load_cell"):
        return s["load_cell"]
    travel = value("screw.lead") / value("gear.ratio")
    speed, acceleration = travel * s["motor_speed"], travel * s["acceleration"]
    side = value("load.mass") * acceleration + value("load.damping") * speed
    return np.asarray(s["load"] + side + value("load.friction") * np.sign(speed))


def nut_loss(speed: Floats, force: Floats, actuator: Actuator) -> Floats:
    """Heat that the screw makes of its load and its preload [W]."""
    value = actuator.parameters.value
    travel = value("screw.lead") / value("gear.ratio")
    opposing, aiding = value("screw.efficiency"), value("screw.efficiency_aiding")
    lost = np.where(speed * force > 0.0, 1.0 / opposing - 1.0, 1.0 - aiding) * np.abs(force)
    preload = value("screw.preload")
    drag = preload * (1.0 / opposing - aiding) * relieved(force, preload)
    return np.asarray(travel * (lost + drag) * np.abs(speed))


def _judged(fit: BalanceFit, samples: _Samples, scale: float) -> Balance:
    levels, reasons = fit.judged(lambda path: _why(path, samples), _NAMES)
    if viscous := levels.get("friction.viscous"):
        # Viscous torque may be half a hundredth of all: what the balance leaves open counts.
        open_ = _CLOSES * _rms(samples.torque(fit.values)) / _rms(samples.speed)
        levels["friction.viscous"] = viscous.widened(open_)
    opposing, aiding = levels.get("screw.efficiency"), levels.get("screw.efficiency_aiding")
    if opposing is not None and aiding is not None and aiding.value > opposing.value:
        # No screw gives back more than it takes: the difference is noise.
        levels["screw.efficiency_aiding"] = Estimate(opposing.value, aiding.std, aiding.degrees)
    return Balance(levels, reasons, fit.residual * scale)


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _why(name: str, samples: _Samples) -> str:
    direction = np.sign(samples.speed) * samples.force
    if name == "screw.efficiency" and float(np.max(direction)) < 500.0:
        return "no force that opposes the motion"
    if name == "screw.efficiency_aiding" and float(np.min(direction)) > -500.0:
        return "no force that aids the motion"
    if name in ("screw.preload", "friction.dynamic"):
        return "drag and dry friction are separated by forces on both sides of the relief only"
    return "the logs' noise is larger than its effect"
