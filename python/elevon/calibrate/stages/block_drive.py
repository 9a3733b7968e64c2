"""Motor and train while the drive pushes: balances of voltage or power, and of torque.

``V = 2 k w + (2 (R + R_on) + c p |w| L) i + (1 - d) V_f`` between the demanded voltage and the
current of the pair, the commutations a resistance that grows with speed. Where no voltage is
recorded, ``P = 2 k w i + 2 (R + R_on) i^2 + (1 - d) V_f |i|`` between the link's power and the same
current. The pair's current is the line's less what the third phase draws (`third_phase`).

``(k_T i - J dw/dt)/r + F = d F(v) + d (1/eta(F) - 1)|F|`` with the direction ``d`` and the axial
load ``F`` towards extension; ``eta`` is the gear's times the screw's, which falls with the load.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.stages.context import Balance, motor_ratio
from elevon.calibrate.stages.rig import KNOTS, Move, hats, knots, moves_of
from elevon.estimate import Estimate, Free
from elevon.estimate.regression import Regression, regressed
from elevon.estimate.residual import BalanceFit, fit_balance
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


_INERTIA, _UNLOADED, _LOADED = (
    "motor.inertia", "screw.efficiency_unloaded", "screw.efficiency_loaded",
)  # fmt: skip
#: What is believed before the logs, as a share of the actuator file's value.
_BELIEF = {_INERTIA: 0.5, _UNLOADED: 0.15, _LOADED: 0.15}
_TABLE = 0.5  # the same, of a knot of the friction
_NUDGE = 1e-3  # of the torque, for what its deviation moves
_OPEN_SHARE = 0.1  # of the third phase's part, as in the motor's balance
_REACH = 0.3  # weight of a knot in the samples that come nearest to it
_FIRST_FORCE = 20.0  # N, first deviation of the residual


@dataclass(frozen=True)
class _TrainSamples:
    """Stacked samples: balance without what is free, and what it is made of."""

    data: Floats
    acceleration: Floats
    axial: Floats
    direction: Floats
    tables: Floats
    gear: float
    force: float

    def model(self, value: Floats) -> Floats:
        """Return the resistance [N] of inertia, efficiencies and free knots."""
        inertia, unloaded, loaded = value[:3]
        size = np.abs(self.axial)
        eta = self.gear * (loaded + (unloaded - loaded) * np.exp(-size / self.force))
        lost = self.direction * (1.0 / eta - 1.0) * size
        return np.asarray(inertia * self.acceleration + lost + self.tables @ value[3:])


@dataclass(frozen=True)
class Constants:
    """What the balance takes as it is.

    Attributes
    ----------
    actuator : Actuator
        Everything that is not free.
    motor : Motor
        The torque of an ampere.
    friction : mapping of str to float
        Knots that a rig has determined: they stay.
    inertia : tuple of ndarray
        Places of the ram [m] and what turns and swings beside the motor's own inertia [kg m2].
    """

    actuator: Actuator
    motor: Motor
    friction: Mapping[str, float]
    inertia: tuple[Floats, Floats]


def torque_balance(parts: Sequence[Driving], known: Constants) -> Balance:
    """BalanceFit the train to the samples in which the motor drives under a known load."""
    moves = ("extension", "retraction")
    paths = [f"friction.ffm_{direction}_{k}" for direction in moves for k in range(1, KNOTS + 1)]
    open_paths = [path for path in paths if path not in known.friction]
    factor = known.actuator.parameters.value("load.factor")
    loaded = [part for part in parts if "load" in part.channels or factor > 0.0]
    if not loaded:
        why = "no motion in which the motor drives under a known load"
        return Balance({}, dict.fromkeys((_INERTIA, _UNLOADED, _LOADED, *open_paths), why), np.nan)
    # A direction that no sample shows is not free.
    directions = {_direction(part) for part in loaded}
    free = [path for path in open_paths if path.split("_")[1] in directions]
    about = [
        Free.about(path, max(known.actuator.parameters.value(path), 1e-12), share)
        for path, share in (*_BELIEF.items(), *((path, _TABLE) for path in free))
    ]
    fit = _fitted_train(loaded, known, about)
    reach = np.abs(_train_samples(loaded, known, free).tables).max(axis=0)
    why = "the drive's logs hardly pass the speeds or loads that would show it"
    levels, reasons = fit.widened(*_choices(loaded, known, about, fit.x)).judged(lambda _path: why)
    unreached = {path: why for path, size in zip(free, reach, strict=True) if size < _REACH}
    levels = {path: item for path, item in levels.items() if path not in unreached}
    idle = {
        path: f"the motor does not drive in {path.split('_')[1]}"
        for path in open_paths
        if path not in free
    }
    return Balance(levels, reasons | unreached | idle, fit.residual)


def _fitted_train(
    parts: Sequence[Driving],
    known: Constants,
    about: Sequence[Free],
    *,
    scale: float = 1.0,
    third: float = 1.0,
) -> BalanceFit:
    samples = _train_samples(parts, known, [item.path for item in about[3:]], scale, third)
    strokes = [(p.log.time[p.used], np.ones(int(p.used.sum())), p.log.period) for p in parts]
    return fit_balance(about, samples.data, samples.model, strokes, scale=_FIRST_FORCE)


def _choices(
    parts: Sequence[Driving], known: Constants, about: Sequence[Free], x: Floats
) -> tuple[Floats, Floats]:
    """What the deviation of the torque's scale moves, and a share of the third phase's part."""
    motor = known.motor
    nudged = _fitted_train(parts, known, about, scale=1.0 + _NUDGE).x - x
    scale = nudged * (motor.torque_std / motor.torque / _NUDGE)
    return scale, _fitted_train(parts, known, about, third=1.0 - _OPEN_SHARE).x - x


def _direction(part: Driving) -> str:
    return "extension" if part.move.extending else "retraction"


def axial_load(part: Driving, actuator: Actuator) -> Floats:
    """Force on the ram towards extension: the leg's over the stroke, and what was recorded."""
    value = actuator.parameters.value
    if part.log.stand.whole_load and "load" in part.channels:
        return part["load"]
    places = np.linspace(0.0, value("lever.stroke"), 9)
    curve = [value(f"load.force_{k}") for k in range(9)]
    factor = float(_plain(part.log.stand.parameters.get("load.factor"), value("load.factor")))
    force = factor * np.interp(part["position"], places, curve)
    return force - part["load"] if "load" in part.channels else force


def _plain(setting: object, default: float) -> float:
    return float(setting) if isinstance(setting, (int, float)) else default


def _train_samples(
    parts: Sequence[Driving],
    known: Constants,
    free: Sequence[str],
    scale: float = 1.0,
    third: float = 1.0,
) -> _TrainSamples:
    value = known.actuator.parameters.value
    travel = 1.0 / motor_ratio(known.actuator)
    data, tables = [], []
    stacked: dict[str, list[Floats]] = {"acceleration": [], "axial": [], "direction": []}
    for part in parts:
        axial = axial_load(part, known.actuator)
        known_part, row = _friction(part, known, free)
        reflected = np.interp(part["position"], *known.inertia)
        torque = known.motor.torque_of(part, scale, third) - reflected * part["acceleration"]
        data.append(torque / travel + axial - known_part)
        tables.append(row)
        stacked["acceleration"].append(part["acceleration"] / travel)
        stacked["axial"].append(axial)
        stacked["direction"].append(np.full(len(axial), part.move.direction))
    joined = {name: np.concatenate(rows) for name, rows in stacked.items()}
    gear = value("gear.efficiency_first") * value("gear.efficiency_second")
    force = value("screw.efficiency_force")
    rows = np.vstack(tables)
    return _TrainSamples(np.concatenate(data), tables=rows, gear=gear, force=force, **joined)


def _friction(part: Driving, known: Constants, free: Sequence[str]) -> tuple[Floats, Floats]:
    """Friction of the knots that are known [N], and the weights of those that are free."""
    speed = part["speed"] / motor_ratio(known.actuator)
    weights = part.move.direction * hats(speed, knots(known.actuator))
    known_part, row = np.zeros(len(speed)), np.zeros((len(speed), len(free)))
    for k in range(KNOTS):
        path = f"friction.ffm_{_direction(part)}_{k + 1}"
        if path in known.friction:
            known_part += weights[:, k] * known.friction[path]
        else:
            row[:, list(free).index(path)] = weights[:, k]
    return known_part, row
