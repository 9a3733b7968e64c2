"""Airspeeds of the four kinds an aircraft bus carries, to Mach number and dynamic pressure."""

from typing import Literal, get_args

import numpy as np
import numpy.typing as npt

from elevon.errors import RangeError, unknown
from elevon.loads.atmosphere import (
    SEA_LEVEL_PRESSURE,
    Atmosphere,
    standard_atmosphere,
)

Array = npt.NDArray[np.float64]
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
