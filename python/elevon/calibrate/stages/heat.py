"""Thermal networks from temperature logs: winding and housing, and the nut.

The winding heats by its current, the housing shows what passes on and what the air takes; the
winding itself shows in its resistance, read from voltage, speed and current over short windows.
The nut heats by its part of the screw's friction. Thermocouples come late by a lag of their own.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.context import Context, loaded
from elevon.calibrate.stages.screw import nut_force, nut_loss
from elevon.estimate import Determined, Estimate, Free
from elevon.estimate.residual import BalanceFit, fit_balance
from elevon.logs.drive import group_means
from elevon.logs.log import Log

_COPPER = 0.05  # of a resistance from a datasheet
_BIN = 2.0  # s over which channels are averaged
_WINDOW = 20.0  # s of one reading of the resistance
_SLOW = 0.2  # of the largest speed: a window reads the resistance in motion
_RISE = 2.0  # K at least that a temperature must have changed
_OPEN = 0.15  # of the nut's heat, that a determined network may leave open
_TOO_COOL = "the log is too short or too cool to determine it"
_HALF = 0.4  # of half the rate: half the band of a recorder that filters at 0.4 of the rate
_RADIATION = 5.670374419e-8  # W/(m2 K4)
_GUESS = 0.02  # of an efficiency that is given
_LAG, _START = 3.0, 1.0  # s and K: first value of a thermocouple's lag, and scale of its offset
MOTOR = (
    "thermal.winding_mass", "thermal.housing_capacity", "thermal.winding_to_surface",
    "thermal.convection",
)  # fmt: skip
NUT = ("screw.nut_capacity", "screw.nut_to_air")
_BELIEF = 0.7


@dataclass(frozen=True)
class _Bins:
    """Means over bins of a slow log."""

    time: Floats
    step: float
    heat: Floats  # W at the reference temperature, or of the nut
    surface: Floats

    @classmethod
    def of(cls, log: Log, heat: Floats, role: str) -> _Bins:
        """Average a log's heat and a temperature."""
        size = max(1, round(_BIN / log.period))
        time, means, warm = (group_means(values, size) for values in (log.time, heat, log[role]))
        return cls(time, size * log.period, means, warm)


def heat(ctx: Context) -> None:
    """The motor's two nodes and the nut, with what the stages before have determined."""
    settled, path = ctx.settled(), "motor.winding_resistance"
    given = ctx.given_value(path)
    resistance = ctx.levels.get(path, Estimate(given, _COPPER * given))
    ctx.add(*motor_heat(ctx.logs, settled, resistance))
    ctx.add(*nut_heat(ctx.logs, settled, ctx.levels))


def motor_heat(logs: Sequence[Log], actuator: Actuator, resistance: Estimate) -> Determined:
    """Return the motor's two nodes, and what the magnets lose with the surface's warmth.

    `resistance` is the winding's at the reference temperature, with what is not known of it.
    """
    flux = "motor.flux_temperature_coefficient"
    usable = [log for log in logs if log.has("torque_current")]
    log = _longest(usable, "surface_temperature")
    if log is None:
        why = "no log in which the housing's temperature changes"
        return {}, dict.fromkeys((*MOTOR, flux), why)
    windows = _windows(log)
    fit = _motor_fit(log, windows, actuator, resistance.value)
    levels, reasons = fit.judged(lambda _path: _TOO_COOL, MOTOR)
    # The heat is known to the resistance and to half of what its band missed.
    share = float(np.mean(_square(log)) / np.mean(log["torque_current"] ** 2)) - 1.0
    open_ = float(np.hypot(resistance.std / resistance.value, 0.5 * share))
    levels = {path: item.widened(open_ * item.value) for path, item in levels.items()}
    if windows is None:
        reasons[flux] = "needs the voltage beside the surface's temperature"
    else:
        levels[flux] = _flux(windows, log, actuator)
    return levels, reasons


def _rise(values: Floats, log: Log) -> float:
    size = max(1, round(10.0 * _BIN / log.period))
    return float(np.ptp(group_means(values, size))) if len(values) // size > 2 else 0.0


def _longest(logs: Sequence[Log], role: str) -> Log | None:
    """Return the longest log in which a temperature changes."""
    usable = [log for log in logs if log.has(role) and _rise(log[role], log) > _RISE]
    return max(usable, key=lambda item: item.duration, default=None)


@dataclass(frozen=True)
class _Windows:
    """Readings of voltage constant and resistance in short windows of motion."""

    time: Floats
    constant: Floats
    resistance: Floats
    spread: float


def _windows(log: Log) -> _Windows | None:
    if not log.has("torque_voltage", "motor_speed"):
        return None
    size = round(_WINDOW / log.period)
    speed, current, voltage = log["motor_speed"], log["torque_current"], log["torque_voltage"]
    fast = _SLOW * float(np.max(np.abs(speed)))
    rows = []
    for begin in range(0, len(speed) - size, size):
        part = slice(begin, begin + size)
        used = np.abs(speed[part]) > fast
        if used.sum() < size // 4:
            continue
        w, i = speed[part], current[part]
        columns = [w, i, np.gradient(w, log.period), np.gradient(i, log.period)]
        design = np.stack(columns, axis=1)[used]
        value, *_ = np.linalg.lstsq(design, voltage[part][used], rcond=None)
        rows.append((float(np.mean(log.time[part])), value[0], value[1]))
    if len(rows) < 10:
        return None
    time, constant, resistance = np.array(rows).T
    spread = float(np.std(np.diff(resistance))) / np.sqrt(2.0)
    return _Windows(time, constant, resistance, spread)


def _flux(windows: _Windows, log: Log, actuator: Actuator) -> Estimate:
    """Relative change of the voltage constant with the surface's temperature."""
    reference = actuator.parameters.value("motor.reference_temperature")
    size = max(1, round(_WINDOW / log.period))
    smooth = np.convolve(log["surface_temperature"], np.ones(size) / size, mode="same")
    rise = np.interp(windows.time, log.time, smooth) - reference
    design = np.stack([np.ones_like(rise), rise], axis=1)
    value, *_ = np.linalg.lstsq(design, windows.constant, rcond=None)
    residual = windows.constant - design @ value
    # What is left is coloured: a tenth of the windows count.
    covariance = (
        np.linalg.inv(design.T @ design) * float(residual @ residual) / len(residual) * 10.0
    )
    slope = float(value[1] / value[0])
    return Estimate(
        slope, float(np.sqrt(covariance[1, 1])) / value[0], max(len(residual) / 10.0 - 2, 2)
    )


def _motor_fit(
    log: Log, windows: _Windows | None, actuator: Actuator, resistance: float
) -> BalanceFit:
    value = actuator.parameters.value
    bins = _Bins.of(log, 1.5 * resistance * _square(log), "surface_temperature")
    noise = _spread(bins.surface)
    readings, weight = np.empty(0), 0.0
    if windows is not None:
        # The resistance says how warm the winding is, in units of the housing's noise.
        share = value("motor.temperature_coefficient") * resistance
        weight = noise / max(windows.spread / share, 1e-6)
        readings = (windows.resistance / resistance - 1.0) / value("motor.temperature_coefficient")
    data = np.concatenate([bins.surface - value("thermal.ambient"), weight * readings])
    reading = Free.about("reading", _START, 3.0, signed=True)
    free = [*_believed(MOTOR, actuator), reading]

    def model(values: Floats) -> Floats:
        winding, sensed = _network(bins, values[:-1], actuator)
        if windows is None:
            return sensed
        warm = np.interp(windows.time, bins.time, winding) + value("thermal.ambient")
        # The resistance of the other logs is known to a kelvin's worth.
        warm += values[-1] - value("motor.reference_temperature")
        return np.concatenate([sensed, weight * warm])

    strokes = [(bins.time, np.ones(len(bins.time)), bins.step)]
    if windows is not None:
        strokes.append((windows.time, np.ones(len(windows.time)), _WINDOW))
    return fit_balance(free, data, model, strokes, scale=noise)


def _believed(paths: Sequence[str], actuator: Actuator) -> list[Free]:
    """Numbers of a network, a thermocouple's lag [s] and how warm it is at first [K]."""
    free = [Free.about(path, actuator.parameters.value(path), _BELIEF) for path in paths]
    start = Free.about("start", _START, 1.0, signed=True)
    return [*free, Free.about("lag", _LAG, _BELIEF), start]


def _square(log: Log) -> Floats:
    """Square of the current with what the log's band misses of it at its steps.

    A step loses in proportion to the time that the filter takes: what half of the band loses more
    is what the band itself has lost.
    """
    from scipy.signal import butter, sosfiltfilt

    current = log["torque_current"]
    half = sosfiltfilt(butter(4, _HALF, output="sos"), current)
    return np.asarray(2.0 * current**2 - half**2, dtype=np.float64)


def _spread(values: Floats) -> float:
    """Noise of a slow signal, from its second differences."""
    return float(max(np.std(np.diff(values, 2)) / np.sqrt(6.0), 1e-4))


def _network(bins: _Bins, values: Floats, actuator: Actuator) -> tuple[Floats, Floats]:
    """Winding, and surface as a late thermocouple shows it, over the air [K]."""
    value = actuator.parameters.value
    mass, housing, resistance, convection, lag, start = values
    capacity, area = mass * value("thermal.winding_heat"), value("thermal.area")
    ambient = value("thermal.ambient")
    radiation = _RADIATION * value("thermal.emissivity") * area
    warmth = value("motor.temperature_coefficient")
    apart = ambient - value("motor.reference_temperature")
    winding = surface = sensed = start
    share, h = 1.0 - np.exp(-bins.step / max(lag, 1e-3)), bins.step
    rows = np.empty((len(bins.heat), 2))
    # Both nodes at once by the middle of the step, the air's loss as it stands.
    a, b = 0.5 * h / (capacity * resistance), 0.5 * h / (housing * resistance)
    for k, heat in enumerate(bins.heat):
        power = heat * (1.0 + warmth * (winding + apart))
        hot = surface + ambient
        out = convection * area * surface + radiation * (hot**4 - ambient**4)
        apart_by = winding - surface + h * (0.5 * power / capacity + 0.5 * out / housing)
        flow = apart_by / (1 + a + b)
        before = surface
        winding += h * power / capacity - 2.0 * a * flow
        surface += 2.0 * b * flow - h * out / housing
        sensed += share * (0.5 * (before + surface) - sensed)
        rows[k] = winding, sensed
    return rows[:, 0], rows[:, 1]


def nut_heat(logs: Sequence[Log], actuator: Actuator, known: Mapping[str, Estimate]) -> Determined:
    """Return the nut's capacity and resistance to the air, for its share of the heat as given.

    `known` are levels of what makes the heat: the efficiencies and the preload.
    """
    log = _longest([log for log in logs if loaded(log)], "nut_temperature")
    if log is None:
        return {}, dict.fromkeys(NUT, "no log in which the nut's temperature changes")
    value = actuator.parameters.value
    force = nut_force(log, actuator)
    loss = value("screw.nut_heat_share") * nut_loss(log["motor_speed"], force, actuator)
    bins = _Bins.of(log, loss, "nut_temperature")
    strokes = [(bins.time, np.ones(len(bins.time)), bins.step)]
    data, free = bins.surface - value("thermal.ambient"), _believed(NUT, actuator)
    fit = fit_balance(free, data, _single(bins), strokes, scale=_spread(bins.surface))
    levels, reasons = fit.judged(lambda _path: _TOO_COOL, NUT)
    open_ = _heat_open(log["motor_speed"], force, actuator, known)
    if open_ > _OPEN:
        why = "the screw's efficiencies as given leave too much of its heat open"
        return {}, dict.fromkeys(NUT, why)
    return {path: item.widened(open_ * item.value) for path, item in levels.items()}, reasons


def _heat_open(
    speed: Floats, force: Floats, actuator: Actuator, known: Mapping[str, Estimate]
) -> float:
    """Share of the nut's heat that efficiencies and preload leave open."""
    mean = float(np.mean(nut_loss(speed, force, actuator)))
    total = 0.0
    for path in ("screw.efficiency", "screw.efficiency_aiding", "screw.preload"):
        item = known.get(path)
        value = actuator.parameters.value(path)
        std = item.std if item is not None else _GUESS * value
        moved = actuator.with_values({path: value - std}, source="calibration")
        total += (float(np.mean(nut_loss(speed, force, moved))) / mean - 1.0) ** 2
    return float(np.sqrt(total))


def _single(bins: _Bins) -> Callable[[Floats], Floats]:
    """One node, as a late thermocouple shows it, over the air [K]."""

    def model(values: Floats) -> Floats:
        from scipy.signal import lfilter

        capacity, resistance, lag, start = values
        decay = np.exp(-bins.step / (capacity * resistance))
        gain = resistance * (1.0 - decay)
        warm = lfilter([gain], [1.0, -decay], bins.heat, zi=[decay * start])[0]
        middle = 0.5 * (warm + np.concatenate(([start], warm[:-1])))
        share = 1.0 - np.exp(-bins.step / max(float(lag), 1e-3))
        late = lfilter([share], [1.0, share - 1.0], middle, zi=[(1.0 - share) * start])[0]
        return np.asarray(late, dtype=np.float64)

    return model
