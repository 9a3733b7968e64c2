"""The international standard atmosphere, from 2 km below sea level to 32 km.

Three layers of constant temperature gradient in geopotential altitude, hydrostatic, ideal dry air.
Source: ISO 2533:1975, equal to ICAO Doc 7488 and the U.S. Standard Atmosphere 1976 over this range.

Airspeeds of the four kinds that an aircraft bus carries become Mach number and dynamic pressure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from elevon.errors import RangeError, unknown

Array = npt.NDArray[np.float64]

GRAVITY = 9.80665  # m/s2, exact by definition
GAS_CONSTANT = 287.05287  # J/(kg K), dry air, ISO 2533
HEAT_RATIO = 1.4
EARTH_RADIUS = 6_356_766.0  # m, nominal: turns geometric into geopotential altitude
SEA_LEVEL_TEMPERATURE = 288.15  # K
SEA_LEVEL_PRESSURE = 101_325.0  # Pa
LOWEST, HIGHEST = -2_000.0, 32_000.0  # m, geopotential

_BASES = np.array([0.0, 11_000.0, 20_000.0])  # m
_GRADIENTS = np.array([-6.5e-3, 0.0, 1.0e-3])  # K/m


@dataclass(frozen=True)
class Atmosphere:
    """State of the air; four arrays of one shape.

    Attributes
    ----------
    temperature : ndarray
        K.
    pressure : ndarray
        Pa.
    density : ndarray
        kg/m3.
    speed_of_sound : ndarray
        m/s.
    """

    temperature: Array
    pressure: Array
    density: Array
    speed_of_sound: Array

    def with_density(self, density: npt.ArrayLike) -> Atmosphere:
        """Return the air of the same pressure with a measured density [kg/m3], above 0.

        The temperature and the speed of sound are those of dry air of that density.
        """
        dense = np.asarray(density, dtype=np.float64)
        temperature = self.pressure / (GAS_CONSTANT * dense)
        sound = np.sqrt(HEAT_RATIO * GAS_CONSTANT * temperature)
        return Atmosphere(temperature, self.pressure, dense, sound)


def standard_atmosphere(
    altitude: npt.ArrayLike, *, geometric: bool = False, temperature_offset: float = 0.0
) -> Atmosphere:
    """Return the standard atmosphere at an altitude.

    Parameters
    ----------
    altitude : array_like, any shape
        m. Geopotential, which is what an altimeter set to 1013.25 hPa shows.
    geometric : bool
        Whether `altitude` is geometric (GPS height) instead.
    temperature_offset : float
        K, added at constant pressure ("ISA + 15"). Pressure altitude keeps its pressure; density
        and speed of sound follow the temperature.

    Returns
    -------
    Atmosphere
        Arrays of the shape of `altitude`.

    Raises
    ------
    RangeError
        Altitude not finite or outside -2 to 32 km (geopotential), or an offset that is not finite
        or leaves the air colder than 100 K.

    Notes
    -----
    ISO 2533:1975, section 2. In a layer with gradient b, p = p_b (T/T_b)^(-g/(R b)); in the
    isothermal one, p = p_b exp(-g (H - H_b)/(R T_b)).
    """
    given = np.asarray(altitude, dtype=np.float64)
    height = EARTH_RADIUS * given / (EARTH_RADIUS + given) if geometric else given
    _check(height, temperature_offset)
    layer = np.clip(np.searchsorted(_BASES, height, side="right") - 1, 0, None)
    standard = _BASE_TEMPERATURES[layer] + _GRADIENTS[layer] * (height - _BASES[layer])
    pressure = _BASE_PRESSURES[layer] * _pressure_ratio(layer, height, standard)
    temperature = standard + temperature_offset
    return Atmosphere(
        temperature,
        pressure,
        pressure / (GAS_CONSTANT * temperature),
        np.sqrt(HEAT_RATIO * GAS_CONSTANT * temperature),
    )


def _pressure_ratio(layer: npt.NDArray[np.intp], height: Array, temperature: Array) -> Array:
    gradient = _GRADIENTS[layer]
    isothermal = gradient == 0.0
    safe = np.where(isothermal, 1.0, gradient)
    base = _BASE_TEMPERATURES[layer]
    power = (temperature / base) ** (-GRAVITY / (GAS_CONSTANT * safe))
    fall = np.exp(-GRAVITY * (height - _BASES[layer]) / (GAS_CONSTANT * base))
    return np.asarray(np.where(isothermal, fall, power), dtype=np.float64)


def _layer_bases() -> tuple[Array, Array]:
    """Temperature and pressure at the foot of each layer, from the sea level upwards."""
    temperatures, pressures = [SEA_LEVEL_TEMPERATURE], [SEA_LEVEL_PRESSURE]
    for gradient, thickness in zip(_GRADIENTS[:-1], np.diff(_BASES), strict=True):
        foot = temperatures[-1]
        top = foot + gradient * thickness
        exponent = -GRAVITY / (GAS_CONSTANT * gradient) if gradient else 0.0
        fall = np.exp(-GRAVITY * thickness / (GAS_CONSTANT * foot))
        pressures.append(pressures[-1] * ((top / foot) ** exponent if gradient else fall))
        temperatures.append(top)
    return np.array(temperatures), np.array(pressures)


def _check(height: Array, offset: float) -> None:
    wrong = ~((height >= LOWEST) & (height <= HIGHEST))  # also true for NaN
    if wrong.any():
        index = int(np.flatnonzero(wrong)[0])
        raise RangeError(
            f"altitude: {height.flat[index]:g} m at sample {index} is outside the standard "
            f"atmosphere modelled here, {LOWEST:g} to {HIGHEST:g} m (geopotential)"
        )
    if not np.isfinite(offset) or offset < -100.0:
        raise RangeError(f"temperature_offset: {offset:g} K must be finite and at least -100 K")


_BASE_TEMPERATURES, _BASE_PRESSURES = _layer_bases()


AirspeedKind = Literal["true", "equivalent", "calibrated", "mach"]
AIRSPEED_KINDS: tuple[str, ...] = get_args(AirspeedKind)


def mach_number(airspeed: npt.ArrayLike, kind: AirspeedKind, air: Atmosphere) -> Array:
    """Return the Mach number.

    Parameters
    ----------
    airspeed : array_like
        m/s, or the Mach number itself for `kind` "mach". Not negative.
    kind : {"true", "equivalent", "calibrated", "mach"}
        What the airspeed is. A calibrated airspeed is what a perfect pitot system, graduated for
        sea level, shows.
    air : Atmosphere
        Same shape, or one that broadcasts.

    Returns
    -------
    ndarray
        Mach number.

    Raises
    ------
    UnknownNameError
        No such kind.
    RangeError
        Negative or not finite; or a calibrated airspeed above Mach 1, where the isentropic relation
        no longer holds (a shock stands before the pitot tube).

    Notes
    -----
    Isentropic compression: q_c/p = (1 + 0.2 M^2)^3.5 - 1 (ISO 2533 air, ratio of heats 1.4).
    """
    if kind not in AIRSPEED_KINDS:
        raise unknown("kind of airspeed", str(kind), AIRSPEED_KINDS)
    speed = np.asarray(airspeed, dtype=np.float64)
    _check_speed(speed)
    if kind == "mach":
        return speed + np.zeros_like(air.pressure)
    if kind == "true":
        return np.asarray(speed / air.speed_of_sound)
    sea_level = float(standard_atmosphere(0.0).speed_of_sound)
    if kind == "equivalent":
        return np.asarray(speed / sea_level * np.sqrt(SEA_LEVEL_PRESSURE / air.pressure))
    return _calibrated(speed / sea_level, air.pressure / SEA_LEVEL_PRESSURE)


def dynamic_pressure(airspeed: npt.ArrayLike, kind: AirspeedKind, air: Atmosphere) -> Array:
    """Return rho V^2/2 = 0.7 p M^2 with the true airspeed.

    Parameters
    ----------
    airspeed, kind, air
        As for `mach_number`, with the same errors.

    Returns
    -------
    ndarray
        Pa.
    """
    mach = mach_number(airspeed, kind, air)
    return np.asarray(0.7 * air.pressure * mach**2)


def _calibrated(speed_ratio: Array, pressure_ratio: Array) -> Array:
    impact = ((1.0 + 0.2 * speed_ratio**2) ** 3.5 - 1.0) / pressure_ratio
    mach = np.sqrt(5.0 * ((impact + 1.0) ** (2.0 / 7.0) - 1.0))
    if (mach > 1.0).any():
        index = int(np.flatnonzero(mach > 1.0)[0])
        raise RangeError(
            f"airspeed: the calibrated airspeed at sample {index} means Mach {mach.flat[index]:.3f}"
            ", above 1: give the true airspeed or the Mach number"
        )
    return np.asarray(mach)


def _check_speed(speed: Array) -> None:
    wrong = ~((speed >= 0.0) & np.isfinite(speed))
    if wrong.any():
        index = int(np.flatnonzero(wrong)[0])
        raise RangeError(f"airspeed: {speed.flat[index]:g} at sample {index} must be at least 0")
