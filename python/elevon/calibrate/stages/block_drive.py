"""Motor constants while the drive pushes: balance of voltage, or of power.

``V = 2 k w + (2 (R + R_on) + c p |w| L) i + (1 - d) V_f`` between the demanded voltage and the
current of the pair, the commutations a resistance that grows with speed. Where no voltage is
recorded, ``P = 2 k w i + 2 (R + R_on) i^2 + (1 - d) V_f |i|`` between the link's power and the same
current. The pair's current is the line's less what the third phase draws (`third_phase`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.stages.log import motor_ratio
from elevon.calibrate.stages.moves import Move, moves_of
from elevon.estimate import Estimate
from elevon.estimate.regression import Regression, regressed
from elevon.estimate.signals import local_polynomial
from elevon.logs.log import Log

_ANGLES = (np.arange(32) + 0.5) / 32.0  # shares of half a sector


@dataclass(frozen=True)
class ThirdPhase:
    """The circuit.

    Attributes
    ----------
    emf : float
        Flat top of one phase's EMF [V s/rad].
    inductance : float
        Of one phase [H].
    period : float
        Of the carrier [s].
    drop : float
        Of a diode [V].
    """

    emf: float
    inductance: float
    period: float
    drop: float

    def means(self, speed: Floats, duty: Floats, link: Floats) -> tuple[Floats, Floats]:
        """Return means of line current [A] and braking torque [N m], both as sizes.

        Parameters
        ----------
        speed, duty, link : ndarray, shape (n,)
            Of the motor [rad/s]; share of the time in which the pair is on; voltage [V].
        """
        back = self.emf * np.abs(speed)[:, None] * _ANGLES
        on, rail = duty[:, None], link[:, None]
        above = np.maximum(back - 0.5 * self.drop, 0.0)
        against = np.maximum(0.5 * (rail + self.drop) - above, 1e-3 * rail)
        slope = self.period / (1.5 * self.inductance)
        peak = slope * above * (1.0 - on)
        falls = np.minimum(peak / (slope * against), on)
        mean = 0.5 * peak * (1.0 - on) + falls * (peak - 0.5 * slope * against * falls)
        # It flows in half of each sector, and half of it in each of the pair.
        brakes = 0.5 * np.mean(mean * self.emf * _ANGLES, axis=1)
        return 0.25 * np.mean(mean, axis=1), brakes


_START = 0.1  # s after the drive begins ...
_END = 0.06  # ... and before it ends
_SLOWEST = 100.0  # rad/s
_LEAST = 1.0  # A, motoring
_WIDTH = 0.1  # s of the polynomials that smooth all channels alike
_FEWEST = 300  # samples
_CARRIES = 0.7  # of the nut's speed: the ram goes with it
_PATHS = ("motor.emf_constant", "motor.winding_resistance", "motor.winding_inductance")
_ROUNDS = 3  # of the third phase's part, which needs what the balance determines
_INDUCTANCE = (0.3, 3.0)  # of the actuator file's, for that part
_OPEN = 0.1  # of the third phase's part: ASSUMED, its form agrees with three phases to a fiftieth
_LEAST_STD = 5e-4  # relative


@dataclass(frozen=True)
class Driving:
    """Samples in which the motor drives in continuous current, all through one smoother.

    Attributes
    ----------
    log : Log
        Of them.
    move : Move
        Of them.
    used : ndarray of bool
        Samples of the log.
    channels : dict of str to ndarray
        Smoothed, whole log: ``speed``, ``acceleration``, ``current``, ``voltage``, ``link``,
        ``power``, ``duty`` as far as the roles go.
    """

    log: Log
    move: Move
    used: Bools
    channels: dict[str, Floats]

    def __getitem__(self, name: str) -> Floats:
        return self.channels[name][self.used]


@dataclass(frozen=True)
class Motor:
    """What the balances say.

    Attributes
    ----------
    levels : dict of str to Estimate
        By path.
    reasons : dict of str to str
        Why one is not determined.
    torque : float
        Torque of each ampere of the pair [N m/A].
    torque_std : float
        Its deviation.
    third : ThirdPhase or None
        What the phase that is not used draws; None: nothing shows the share of the time off.
    given : bool
        Whether the torque is the actuator file's own: nothing showed it.
    """

    levels: dict[str, Estimate]
    reasons: dict[str, str]
    torque: float
    torque_std: float
    third: ThirdPhase | None
    given: bool

    def torque_of(self, part: Driving, scale: float = 1.0, third: float = 1.0) -> Floats:
        """Electromagnetic torque of samples [N m], with a share of the third phase's part."""
        braking, brakes = _third_phase(part, self.third)
        direction = np.sign(part["speed"])
        pair = part["current"] - third * direction * braking
        return np.asarray(scale * (self.torque * pair - third * direction * brakes))


def _third_phase(part: Driving, third: ThirdPhase | None) -> tuple[Floats, Floats]:
    """Third phase's part of the line current and of the torque, as sizes."""
    if third is None or "link" not in part.channels:
        nothing = np.zeros(len(part["speed"]))
        return nothing, nothing
    return third.means(part["speed"], _duty(part), part["link"])


def _smooth(values: Floats, period: float, *, slope: bool = False) -> Floats:
    return local_polynomial(values, period, _WIDTH, slope=slope)


def driving(logs: Sequence[Log], actuator: Actuator) -> list[Driving]:
    """Return the stretches of all motions in which the motor drives in continuous current."""
    stretches = []
    for log in logs:
        if moves_of(log) and log.has("torque_current"):
            channels = _channels(log, actuator)
            stretches += [
                Driving(log, m, _used(log, m, channels, actuator), channels) for m in moves_of(log)
            ]
    return [item for item in stretches if item.used.sum() >= _FEWEST]


def _channels(log: Log, actuator: Actuator) -> dict[str, Floats]:
    h = log.period
    channels = {
        "speed": _smooth(log["motor_speed"], h),
        "acceleration": _smooth(log["motor_speed"], h, slope=True),
        "current": _smooth(log["torque_current"], h),
        "position": _smooth(log["output_position"], h),
    }
    if log.has("load"):
        channels["load"] = _smooth(log["load"], h)
    if log.has("supply_voltage"):
        channels["link"] = _smooth(log["supply_voltage"], h)
    if log.has("torque_voltage"):
        channels["voltage"] = _smooth(log["torque_voltage"], h)
    if log.has("supply_voltage", "supply_current"):
        stored = actuator.parameters.value("supply.capacitance") * _smooth(
            log["supply_voltage"], h, slope=True
        )
        channels["power"] = channels["link"] * (_smooth(log["supply_current"], h) - stored)
    return channels


def _used(log: Log, move: Move, channels: dict[str, Floats], actuator: Actuator) -> Bools:
    """The motor pushes as it turns; where the demand is recorded, in continuous current."""
    used = (log.time > move.begin + _START) & (log.time < move.end - _END)
    used &= move.direction * channels["speed"] > _SLOWEST
    used &= move.direction * channels["current"] > _LEAST
    # Where the lock is worked the nut moves alone.
    ram = _smooth(log["output_position"], log.period, slope=True)
    used &= np.abs(ram) * motor_ratio(actuator) > _CARRIES * np.abs(channels["speed"])
    if "voltage" in channels and "link" in channels:
        value = actuator.parameters.value
        drop = value("inverter.diode_drop")
        emf = 2.0 * value("motor.emf_constant") * np.abs(channels["speed"])
        edge = (drop + emf) / (channels["link"] + drop)
        used &= np.abs(channels["voltage"]) / channels["link"] > edge
    return np.asarray(used)


def motor_constants(parts: Sequence[Driving], actuator: Actuator) -> Motor:
    """Return voltage constant, resistance and the torque of an ampere from what the logs show."""
    given = _third(actuator)
    believed = Motor({}, {}, 2.0 * given.emf, 0.0, None, given=True)
    by_voltage = [p for p in parts if {"voltage", "link"} <= p.channels.keys()]
    by_power = [p for p in parts if {"power", "link"} <= p.channels.keys()]
    if by_voltage:
        result = _by_voltage(by_voltage, actuator, given)
    else:
        result = _by_power(by_power, actuator, given)
    if result is None:
        why = "no motion in which the motor drives with its current and voltage or supply recorded"
        return replace(believed, reasons=dict.fromkeys(_PATHS, why))
    return result


def _third(actuator: Actuator) -> ThirdPhase:
    value = actuator.parameters.value
    paths = (_PATHS[0], _PATHS[2], "inverter.switching_period", "inverter.diode_drop")
    return ThirdPhase(*(value(path) for path in paths))


def _by_voltage(parts: Sequence[Driving], actuator: Actuator, given: ThirdPhase) -> Motor | None:
    value = actuator.parameters.value
    commutation = value("low.commutation_factor") * value("motor.pole_pairs")

    def fitted(share: float) -> tuple[Regression | None, ThirdPhase]:
        third, fit = given, None
        for _ in range(_ROUNDS):
            fit = _voltage_balance(parts, third, share)
            if fit is None:
                break
            inductance = np.clip(fit["commutation"] / commutation / given.inductance, *_INDUCTANCE)
            emf = 0.5 * fit["constant"]
            third = replace(third, emf=emf, inductance=float(inductance) * given.inductance)
        return fit, third

    (fit, third), (other, _) = fitted(1.0), fitted(1.0 - _OPEN)
    if fit is None or other is None:
        return None
    reasons: dict[str, str] = {}
    levels = _levels(fit, other, value("inverter.on_resistance"))
    slope = _open(fit, other, "commutation")
    inductance = slope.value / commutation
    if inductance > 0.0:
        levels[_PATHS[2]] = Estimate(inductance, slope.std / commutation, slope.degrees)
    else:
        reasons[_PATHS[2]] = "the commutation's drop is below the noise"
    constant = _open(fit, other, "constant")
    return Motor(levels, reasons, constant.value, constant.std, third, given=False)


def _by_power(parts: Sequence[Driving], actuator: Actuator, given: ThirdPhase) -> Motor | None:
    fit, other = (_power_balance(parts, given, share) for share in (1.0, 1.0 - _OPEN))
    if fit is None or other is None:
        return None
    levels = _levels(fit, other, actuator.parameters.value("inverter.on_resistance"))
    constant = _open(fit, other, "constant")
    reasons = {_PATHS[2]: "needs the demanded voltage: the commutation shows in it"}
    third = replace(given, emf=0.5 * constant.value)
    return Motor(levels, reasons, constant.value, constant.std, third, given=False)


def _levels(fit: Regression, other: Regression, switches: float) -> dict[str, Estimate]:
    constant, total = _open(fit, other, "constant"), _open(fit, other, "resistance")
    resistance = max(0.5 * total.value - switches, 0.0)
    return {
        _PATHS[0]: Estimate(0.5 * constant.value, 0.5 * constant.std, constant.degrees),
        _PATHS[1]: Estimate(resistance, 0.5 * total.std, total.degrees),
    }


def _open(fit: Regression, other: Regression, name: str) -> Estimate:
    """A coefficient, with what a share of the third phase's part would change."""
    std = max(fit.std(name), _LEAST_STD * abs(fit[name]))
    return Estimate(fit[name], float(np.hypot(std, other[name] - fit[name])), fit.degrees)


def _duty(part: Driving) -> Floats:
    """Share of the time in which the bridge is on."""
    if "voltage" in part.channels:
        return np.asarray(np.clip(np.abs(part["voltage"]) / part["link"], 0.0, 1.0))
    # Of the power itself: the link is connected for that share of the current.
    return np.asarray(np.clip(part["power"] / (part["link"] * np.abs(part["current"])), 0.0, 1.0))


def _pair(part: Driving, third: ThirdPhase, share: float) -> Floats:
    braking, _ = _third_phase(part, third)
    return np.asarray(np.abs(part["current"]) - share * braking)


def _voltage_balance(
    parts: Sequence[Driving], third: ThirdPhase, share: float
) -> Regression | None:
    rows, data = [], []
    for part in parts:
        speed, current = np.abs(part["speed"]), _pair(part, third, share)
        rows.append(np.stack([speed, current, speed * current], axis=1))
        data.append(part.move.direction * part["voltage"] - (1.0 - _duty(part)) * third.drop)
    return _fitted(parts, rows, data, ("constant", "resistance", "commutation"))


def _power_balance(parts: Sequence[Driving], third: ThirdPhase, share: float) -> Regression | None:
    rows, data = [], []
    for part in parts:
        speed, current = np.abs(part["speed"]), _pair(part, third, share)
        rows.append(np.stack([speed * current, current**2], axis=1))
        data.append(part["power"] - (1.0 - _duty(part)) * third.drop * current)
    return _fitted(parts, rows, data, ("constant", "resistance"))


def _fitted(
    parts: Sequence[Driving], rows: Sequence[Floats], data: Sequence[Floats], names: tuple[str, ...]
) -> Regression | None:
    if not parts:
        return None
    strokes = [(p.log.time[p.used], np.ones(int(p.used.sum())), p.log.period) for p in parts]
    fit = regressed(names, rows, data, strokes)
    sound = fit["constant"] > 0.0 and fit["resistance"] > 0.0
    return fit if sound and np.isfinite(fit.covariance).all() else None
