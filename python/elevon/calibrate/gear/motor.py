"""Motor constants while the drive pushes: balance of voltage, and balance of power.

``V = 2 k w + R_t i + (1 - d) V_f``, and a drop with speed for the commutation, between the
demanded voltage and the mean current; ``P = k_T w i + R_t i^2 + (1 - d) V_f |i| + c (1 - d) w^2``
between the link's power and the same current. The first knows the voltage constant whatever the
commutation does to the torque; the second knows the torque that is really made: while the bridge is
off, the third phase's EMF drives a current through its diode, which brakes with the speed (``c``).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.calibrate.gear.log import GearLog, Move
from elevon.calibrate.gear.tables import per_travel
from elevon.calibrate.level import Level
from elevon.calibrate.regression import Regression, robust_regression, with_deviations

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["Driving", "Motor", "driving", "motor_constants"]

Floats = npt.NDArray[np.float64]
_START = 0.1  # s after the drive begins ...
_END = 0.06  # ... and before it ends
_SLOWEST = 100.0  # rad/s
_LEAST = 1.0  # A, motoring
_WIDTH = 0.1  # s of the polynomials that smooth all channels alike
_FEWEST = 300  # samples
_CARRIES = 0.7  # of the nut's speed: the ram goes with it


@dataclass(frozen=True)
class Driving:
    """Samples in which the motor drives in continuous current, all through one smoother.

    Attributes
    ----------
    log : GearLog
        Of them.
    move : Move
        Of them.
    used : ndarray of bool
        Samples of the log.
    channels : dict of str to ndarray
        Smoothed, whole log: ``speed``, ``acceleration``, ``current``, ``voltage``, ``link``,
        ``power``, ``duty`` as far as the roles go.
    """

    log: GearLog
    move: Move
    used: npt.NDArray[np.bool_]
    channels: dict[str, Floats]

    def __getitem__(self, name: str) -> Floats:
        return self.channels[name][self.used]


@dataclass(frozen=True)
class Motor:
    """What the balances say.

    Attributes
    ----------
    levels : dict of str to Level
        By path.
    reasons : dict of str to str
        Why one is not determined.
    torque : float
        Torque of each ampere [N m/A], with the commutation's loss where power shows it.
    torque_std : float
        Its deviation.
    drag : float
        Torque over speed and the share of the time in which the bridge is off [N m s/rad].
    given : bool
        Whether the torque is the set's own: nothing showed it.
    """

    levels: dict[str, Level]
    reasons: dict[str, str]
    torque: float
    torque_std: float
    drag: float
    given: bool

    def torque_of(self, part: Driving, scale: float = 1.0) -> Floats:
        """Electromagnetic torque of samples [N m]."""
        torque = scale * self.torque * part["current"]
        if self.drag == 0.0:
            return np.asarray(torque)
        return np.asarray(torque + self.drag * part["speed"] * (1.0 - _duty(part)))


def _smooth(values: Floats, period: float, *, slope: bool = False) -> Floats:
    from scipy.signal import savgol_filter

    width = max(5, 2 * round(0.5 * _WIDTH / period) + 1)
    out = savgol_filter(values, width, 2, deriv=int(slope), delta=period)
    return np.asarray(out, dtype=np.float64)


def driving(logs: Sequence[GearLog], actuator: Actuator) -> list[Driving]:
    """Return the stretches of all motions in which the motor drives in continuous current."""
    stretches = []
    for log in logs:
        if log.moves and log.has("torque_current"):
            channels = _channels(log, actuator)
            stretches += [
                Driving(log, m, _used(log, m, channels, actuator), channels) for m in log.moves
            ]
    return [item for item in stretches if item.used.sum() >= _FEWEST]


def _channels(log: GearLog, actuator: Actuator) -> dict[str, Floats]:
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


def _used(
    log: GearLog, move: Move, channels: dict[str, Floats], actuator: Actuator
) -> npt.NDArray[np.bool_]:
    """The motor pushes the way it turns; where the demand is shown, in continuous current."""
    used = (log.time > move.begin + _START) & (log.time < move.end - _END)
    used &= move.way * channels["speed"] > _SLOWEST
    used &= move.way * channels["current"] > _LEAST
    # Where the lock is worked the nut moves alone.
    ram = _smooth(log["output_position"], log.period, slope=True)
    used &= np.abs(ram) * per_travel(actuator) > _CARRIES * np.abs(channels["speed"])
    if "voltage" in channels and "link" in channels:
        value = actuator.parameters.value
        drop = value("inverter.diode_drop")
        emf = 2.0 * value("motor.emf_constant") * np.abs(channels["speed"])
        edge = (drop + emf) / (channels["link"] + drop)
        used &= np.abs(channels["voltage"]) / channels["link"] > edge
    return np.asarray(used)


def motor_constants(parts: Sequence[Driving], actuator: Actuator) -> Motor:
    """Return voltage constant, resistance and the torque of an ampere from what the logs show."""
    by_voltage = _voltage_balance(
        [p for p in parts if {"voltage", "link"} <= p.channels.keys()], actuator
    )
    by_power = _power_balance([p for p in parts if "power" in p.channels], actuator)
    believed = 2.0 * actuator.parameters.value("motor.emf_constant")
    levels: dict[str, Level] = {}
    switches = actuator.parameters.value("inverter.on_resistance")
    constant = by_voltage or by_power
    if constant is None:
        why = (
            "no motion in which the motor drives with current and demanded voltage or supply shown"
        )
        paths = ("motor.emf_constant", "motor.winding_resistance", "motor.winding_inductance")
        return Motor({}, dict.fromkeys(paths, why), believed, 0.0, 0.0, given=True)
    emf = 0.5 * constant["constant"]
    std = float(np.hypot(_spread(constant, "constant"), _open_choice(parts, actuator, constant)))
    levels["motor.emf_constant"] = Level(emf, 0.5 * std, constant.degrees)
    torque = by_power or constant
    resistance = 0.5 * torque["resistance"] - switches
    std = 0.5 * torque.std("resistance")
    if by_voltage is not None and by_power is not None:
        # The commutation is in both, in different parts: how far it carries them apart is open.
        apart = 0.5 * (by_voltage["resistance"] - by_power["resistance"])
        std = float(np.hypot(std, apart / np.sqrt(12.0)))
    levels["motor.winding_resistance"] = Level(max(resistance, 0.0), std, torque.degrees)
    reasons = {
        "motor.winding_inductance": "its drop in the commutation is not told from resistance"
    }
    drag = 0.0 if by_power is None else by_power["drag"]
    return Motor(
        levels, reasons, torque["constant"], _spread(torque, "constant"), drag, given=False
    )


def _duty(part: Driving) -> Floats:
    """Share of the time in which the bridge is on."""
    if "voltage" in part.channels:
        return np.asarray(np.abs(part["voltage"]) / part["link"])
    # Of the power itself: the link is connected for that share of the current.
    return np.asarray(np.clip(part["power"] / (part["link"] * np.abs(part["current"])), 0.0, 1.0))


def _open_choice(parts: Sequence[Driving], actuator: Actuator, fit: Regression) -> float:
    """What a drop with speed and the share of time off would change: no log settles its form."""
    if "commutation" not in fit.names:
        return 0.0
    shown = [p for p in parts if {"voltage", "link"} <= p.channels.keys()]
    other = _voltage_balance(shown, actuator, idle=True)
    return 0.0 if other is None else abs(other["constant"] - fit["constant"]) / np.sqrt(12.0)


def _spread(fit: Regression, name: str) -> float:
    return max(fit.std(name), 5e-4 * abs(fit[name]))


def _voltage_balance(
    parts: Sequence[Driving], actuator: Actuator, *, idle: bool = False
) -> Regression | None:
    drop = actuator.parameters.value("inverter.diode_drop")
    rows, data = [], []
    for part in parts:
        speed, current, duty = part["speed"], part["current"], _duty(part)
        columns = [speed, current, np.abs(speed) * current]
        columns += [speed * (1.0 - duty)] if idle else []
        rows.append(np.stack(columns, axis=1))
        data.append(part["voltage"] - part.move.way * (1.0 - duty) * drop)
    names = ("constant", "resistance", "commutation", "idle")[: len(rows[0][0])] if rows else ()
    return _fitted(parts, rows, data, names)


def _power_balance(parts: Sequence[Driving], actuator: Actuator) -> Regression | None:
    drop = actuator.parameters.value("inverter.diode_drop")
    rows, data = [], []
    for part in parts:
        speed, current = part["speed"], part["current"]
        off = 1.0 - _duty(part)
        rows.append(np.stack([speed * current, current**2, off * speed**2], axis=1))
        data.append(part["power"] - off * drop * np.abs(current))
    return _fitted(parts, rows, data, ("constant", "resistance", "drag"))


def _fitted(
    parts: Sequence[Driving], rows: Sequence[Floats], data: Sequence[Floats], names: tuple[str, ...]
) -> Regression | None:
    if not parts:
        return None
    design = np.vstack(rows)
    value, rest, weight, _ = robust_regression(design, np.concatenate(data))
    times = [(p.log.time[p.used], np.ones(int(p.used.sum())), p.log.period) for p in parts]
    fit = with_deviations(names, value, design, rest, weight, times=times)
    sound = fit["constant"] > 0.0 and fit["resistance"] > 0.0
    return fit if sound and np.isfinite(fit.covariance).all() else None
