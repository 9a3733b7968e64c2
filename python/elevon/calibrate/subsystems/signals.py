"""What a log shows of a drive: measured effort, measured motion, command; derivatives in a band."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.stages.context import motor_ratio
from elevon.errors import InputError
from elevon.logs.log import Log, bridged
from elevon.parameters.relations import emf_constant, motor_torque_constant
from elevon.scenario.compile import signal_records
from elevon.units import parse_quantity

#: What drives the mechanics, the most direct first, with the unit of a role that states none.
EFFORTS = {
    "effort": "", "torque_current": "A", "torque_ref": "N m", "current_ref": "A",
    "torque_voltage": "V",
}  # fmt: skip
MOTIONS = ("motor_position", "output_position", "motor_speed", "output_speed")
#: The name of the scale on the command line, and its units: torque, or force at a linear output.
SCALE = "motor.torque_constant"
FEWEST = 200  # samples. ASSUMED: 4 numbers and their covariance need some tens of blocks
#: Share of a derivative's variance that may be noise: an attenuation of as much. ASSUMED: below
#: the 1 % that a mass is to be known to
NOISE_SHARE = 0.003
LOWEST_BAND, HIGHEST_BAND = 0.02, 0.2  # of the sampling rate
JITTER = 0.3  # of a period: stamps that differ by less are those of a regular clock. ASSUMED
GAP = 3.0  # periods: a longer pause between two samples is a gap
#: Samples of a log that are read, and stretches that a longer one is read in: its time and memory
#: grow no further. ASSUMED: a minute at 1 kHz determines what ten do, but for the root of ten.
MOST, STRETCHES = 60_000, 6
REST_SPEED = 0.01  # of the largest speed: below it friction is whatever holds


@dataclass(frozen=True)
class Effort:
    """What the effort of logs is, and what it makes of torque.

    Attributes
    ----------
    role, unit : str
        Of its channel.
    scale : float
        Torque at the motor for one unit [N m].
    known : bool
        Whether the scale is known; else everything is known up to it.
    given : tuple of str
        What the scale stands on.
    """

    role: str
    unit: str
    scale: float
    known: bool
    given: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class DriveSignals:
    """A log on an even clock, motion in the motor's coordinate.

    Attributes
    ----------
    name : str
        Of the log.
    time : ndarray, shape (n,)
        s.
    period : float
        s.
    good : ndarray of bool, shape (n,)
        Samples beside which nothing is missing.
    effort : ndarray, shape (n,)
        In its own unit.
    position : ndarray or None
        rad.
    speed : ndarray or None
        As measured, rad/s.
    command, speed_ref, effort_ref, load : ndarray or None
        Commanded position [rad], speed [rad/s] and effort [its unit]; the load as logged.
    load_cell : ndarray or None
        As logged.
    model_speed : ndarray or None
        Of the model driven by the measured effort [rad/s], where that was run.
    """

    name: str
    time: Floats
    period: float
    good: Bools
    effort: Floats
    position: Floats | None
    speed: Floats | None
    command: Floats | None
    speed_ref: Floats | None
    effort_ref: Floats | None
    load: Floats | None
    load_cell: Floats | None = None
    model_speed: Floats | None = None

    @property
    def rate(self) -> float:
        """Hz."""
        return 1.0 / self.period

    def derivatives(self, band: float) -> tuple[Floats, Floats, Floats]:
        """Return position, speed and acceleration, zero-phase within a band [Hz]."""
        if self.position is not None:
            smooth = low_pass(self.position, band, self.rate)
            speed = derivative(smooth, self.period)
        else:
            assert self.speed is not None
            speed = low_pass(self.speed, band, self.rate)
            smooth = np.cumsum(speed) * self.period
        return smooth, speed, derivative(speed, self.period)

    def noiseless(self, band: float) -> tuple[Floats, Floats] | None:
        """Return speed and acceleration without a sensor's noise: commanded, or of the model."""
        if self.command is not None:
            speed = derivative(low_pass(self.command, band, self.rate), self.period)
        elif self.speed_ref is not None:
            speed = low_pass(self.speed_ref, band, self.rate)
        elif self.model_speed is not None:
            speed = low_pass(self.model_speed, band, self.rate)
        else:
            return None
        return speed, derivative(speed, self.period)


def excerpts(drive: DriveSignals) -> list[DriveSignals]:
    """Return a log, or stretches spread evenly over it where it has more than `MOST` samples."""
    count = len(drive.time)
    if count <= MOST:
        return [drive]
    length = MOST // STRETCHES
    out = []
    for begin in np.linspace(0, count - length, STRETCHES).astype(int).tolist():
        series: dict[str, Any] = {
            item.name: value[begin : begin + length]
            for item in fields(drive)
            if isinstance(value := getattr(drive, item.name), np.ndarray)
        }
        name = f"{drive.name} from {drive.time[begin]:.4g} s"
        out.append(replace(drive, name=name, **series))
    return [replace(item, time=item.time - item.time[0]) for item in out]


#: Central difference of the eighth order: within 1 % up to a fifth of the sampling rate, where one
#: of two neighbours has lost a quarter of an acceleration.
_STENCIL = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])


def derivative(values: Floats, period: float) -> Floats:
    """Return the derivative of samples [1/s], shape (n,); coarse at the first and last four."""
    out = np.gradient(values, period)
    if len(values) > len(_STENCIL):
        out[4:-4] = np.convolve(values, _STENCIL[::-1], mode="valid")[: len(values) - 8] / period
    return np.asarray(out)


def low_pass(values: Floats, band: float, rate: float) -> Floats:
    """Return values behind a Butterworth filter that runs both ways."""
    from scipy.signal import butter, sosfiltfilt

    if band >= 0.45 * rate:
        return values
    return np.asarray(sosfiltfilt(butter(4, band, fs=rate, output="sos"), values))


def effort_role(logs: Sequence[Log]) -> str | None:
    """Return the most direct effort that all logs have."""
    return next((role for role in EFFORTS if all(log.has(role) for log in logs)), None)


def scale_of(text: str | float, actuator: Actuator, unit: str) -> float:
    """Return the torque at the motor for one unit of effort [N m], from what a user states.

    Parameters
    ----------
    text : str or float
        ``0.11 N m/A``, ``35.15 N/V``: torque at the motor, or force at a linear output.
    actuator : Actuator
        Its transmission converts a force.
    unit : str
        Of the effort.

    Raises
    ------
    InputError
        Not above zero, or of another unit than the log's effort.
    """
    number, _, stated = str(text).strip().partition(" ")
    top, _, bottom = stated.partition("/")
    if bottom and unit not in {"", "1"} and bottom.strip() != unit:
        raise InputError(
            f"--set {SCALE}={text}: the effort that the logs have is in {unit}, not in {bottom}"
        )
    try:
        force = top.strip().endswith("N") and linear(actuator)
        value = parse_quantity(f"{number} {top or 'N m'}", "N" if force else "N m", SCALE)
    except InputError as error:
        raise InputError(f"--set {SCALE}={text}: {error}") from None
    ratio = motor_ratio(actuator) if force else 1.0
    if not value > 0.0 or not math.isfinite(value):
        raise InputError(f"--set {SCALE}={text}: must be above 0")
    return value / ratio


def linear(actuator: Actuator) -> bool:
    """Return whether the output moves along a line."""
    position = signal_records(actuator.wiring, "low").get("output_position")
    return position is not None and position["unit"] == "m"


def effort_of(logs: Sequence[Log], actuator: Actuator, scale: str | float | None) -> Effort | None:
    """Return what the logs' effort makes of torque; None where no effort was logged."""
    role = effort_role(logs)
    if role is None:
        return None
    unit = logs[0].units.get(role, "") or EFFORTS[role]
    if unit in {"N m", "N"}:
        force = unit == "N" and linear(actuator)
        return Effort(role, unit, 1.0 / motor_ratio(actuator) if force else 1.0, True, ())
    if scale is not None:
        return Effort(role, unit, scale_of(scale, actuator, unit), True, (SCALE,))
    if unit == "A":
        constant = motor_torque_constant(actuator.parameters)
        return Effort(role, unit, constant, True, ("motor.emf_constant",))
    return Effort(role, unit, 1.0, False, ())


def with_scale(actuator: Actuator, effort: Effort | None, scale: str | float | None) -> Actuator:
    """Return the actuator with a torque constant that the user states."""
    if effort is None or scale is None:
        return actuator
    values: dict[str, str | float] = {"motor.emf_constant": emf_constant(effort.scale)}
    if "control.torque_constant" in actuator.parameters:
        values["control.torque_constant"] = effort.scale
    return actuator.with_values(values, source=f"--set {SCALE}={scale}", place="--set")


def drive_signals(log: Log, actuator: Actuator, role: str) -> DriveSignals:
    """Return what a log shows of the drive, on an even clock.

    Raises
    ------
    InputError
        No motion, or too few samples.
    """
    motion = next((name for name in MOTIONS if log.has(name)), None)
    if motion is None:
        raise InputError(
            f"{log.name}: nothing of the motion was recorded; one of {', '.join(MOTIONS)}"
        )
    log = log.on(motion)
    if len(log.time) < FEWEST:
        raise InputError(f"{log.name}: {len(log.time)} samples; the mechanics need {FEWEST}")
    period, ratio = log.period, motor_ratio(actuator)
    # A clock that only jitters counts the drive's samples: none is moved between its neighbours.
    ticking = bool(np.all(np.abs(np.diff(log.time) / period - 1.0) < JITTER))
    if ticking:
        period = log.duration / (len(log.time) - 1)
        log = replace(log, time=period * np.arange(len(log.time), dtype=np.float64))
    time = np.arange(0.0, log.duration + 0.5 * period, period)
    needed = np.isfinite(log[motion]) & np.isfinite(log[role]) & log.good
    known = log.time[needed]
    if len(known) < FEWEST:
        raise InputError(f"{log.name}: {len(known)} samples are complete; {FEWEST} needed")

    def at(name: str, factor: float = 1.0) -> Floats | None:
        values = log.get(name)
        if values is None or not np.isfinite(values).any():
            return None
        return np.asarray(factor * np.interp(time, log.time, bridged(log.time, values)))

    place = np.clip(np.searchsorted(known, time), 1, len(known) - 1)
    good = np.asarray(known[place] - known[place - 1] <= GAP * period)
    good &= (time >= known[0]) & (time <= known[-1])
    position = at("motor_position")
    speed = at("motor_speed")
    effort = at(role)
    assert effort is not None
    ref = "current_ref" if role == "torque_current" else ""
    return DriveSignals(
        log.name, time, period, good, effort,
        at("output_position", ratio) if position is None else position,
        at("output_speed", ratio) if speed is None else speed,
        at("command", ratio) if log.units.get("command", "") in {"", "rad", "m"} else None,
        at("speed_ref"), at(ref) if ref else None, at("load"), at("load_cell"),
    )  # fmt: skip


def evenly(drives: Sequence[DriveSignals]) -> list[DriveSignals]:
    """Return drives of which parts count where nothing is missing within a tenth of a second."""
    out = []
    for drive in drives:
        if drive.good.all():
            out.append(drive)
            continue
        reach = max(1, round(0.1 / drive.period))
        near = np.convolve(~drive.good, np.ones(2 * reach + 1), mode="same") > 0.5
        out.append(replace(drive, good=~near))
    return out


def useful_band(drive: DriveSignals) -> float:
    """Return the widest band [Hz] in which the acceleration is motion and not noise.

    The noise of the sensor is white: its density stands at the top of the spectrum. What it makes
    of the acceleration grows with the fifth power of the band (the third, of a speed).
    """
    series, order = (drive.position, 2) if drive.position is not None else (drive.speed, 1)
    assert series is not None
    density = _floor(series)
    best = LOWEST_BAND * drive.rate
    for band in np.geomspace(HIGHEST_BAND, LOWEST_BAND, 12) * drive.rate:
        _, _, acceleration = drive.derivatives(float(band))
        slope = 2 * order + 1
        noise = density * 2.0 * (2.0 * math.pi * band) ** (2 * order) * band / (slope * drive.rate)
        if noise <= NOISE_SHARE * float(np.var(acceleration)):
            best = float(band)
            break
    return best


def _floor(series: Floats) -> float:
    """Return the variance of a channel's white noise, from the top tenth of its spectrum."""
    from scipy.signal import detrend, get_window

    straight = detrend(series)
    window = get_window("blackmanharris", len(straight))
    power = np.abs(np.fft.rfft(straight * window)) ** 2 / float(np.sum(window**2))
    return float(np.median(power[int(0.9 * len(power)) :]) / math.log(2.0))
