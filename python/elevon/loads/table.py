"""From a flight to the load terms of a scenario.

The aerodynamic moment about the hinge comes from coefficients that the user gives.
"""

from dataclasses import dataclass, fields
from typing import Any

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError, RangeError
from elevon.loads.atmosphere import dynamic_pressure, mach_number, standard_atmosphere
from elevon.loads.flight import FlightData

Array = npt.NDArray[np.float64]


@dataclass(frozen=True)
class HingeMoment:
    """H = q S c (C_0 + C_alpha alpha + C_delta delta).

    Positive moments turn the surface towards positive deflection, so a stable surface has negative
    `c_alpha` and `c_delta`. Coefficients are per radian.

    Attributes
    ----------
    area : float
        S, surface area behind the hinge line, m2.
    chord : float
        c, mean chord behind the hinge line, m.
    c_0, c_alpha, c_delta : float or sequence of float
        Coefficients; sequences give one value per breakpoint of `mach`.
    mach : sequence of float, optional
        Mach numbers at which sequences are given, strictly increasing. Between them coefficients
        are linear; outside them they are unknown, which is an error.

    Raises
    ------
    RangeError, InputError
        Area or chord not positive, a value not finite, lengths that differ.
    """

    area: float
    chord: float
    c_0: float | tuple[float, ...] = 0.0
    c_alpha: float | tuple[float, ...] = 0.0
    c_delta: float | tuple[float, ...] = 0.0
    mach: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        for name in ("area", "chord"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0.0):
                raise RangeError(f"{name}: {value!r} must be finite and above 0")
        for field in fields(self)[2:]:
            if getattr(self, field.name) is not None:
                self._check_series(field.name)
        if self.mach is not None and not (np.diff(self.mach) > 0.0).all():
            raise InputError(f"mach: breakpoints must increase strictly, got {self.mach}")

    def moment(
        self,
        pressure: npt.ArrayLike,
        mach: npt.ArrayLike,
        alpha: npt.ArrayLike,
        delta: npt.ArrayLike,
    ) -> Array:
        """Return the hinge moment.

        Parameters
        ----------
        pressure : array_like
            Dynamic pressure q, Pa.
        mach : array_like
            Mach number.
        alpha, delta : array_like
            Angle of attack and surface deflection, rad.

        Returns
        -------
        ndarray
            N m, positive towards positive deflection.

        Raises
        ------
        RangeError
            A Mach number outside the breakpoints.
        """
        number = np.asarray(mach, dtype=np.float64)
        coefficient = (
            self._at(self.c_0, number)
            + self._at(self.c_alpha, number) * np.asarray(alpha)
            + self._at(self.c_delta, number) * np.asarray(delta)
        )
        return np.asarray(np.asarray(pressure) * self.area * self.chord * coefficient)

    def _at(self, values: float | tuple[float, ...], mach: Array) -> Array:
        if not isinstance(values, tuple):
            return np.asarray(float(values))
        points = self.mach or ()
        wrong = ~((mach >= points[0]) & (mach <= points[-1]))
        if wrong.any():
            index = int(np.flatnonzero(wrong)[0])
            raise RangeError(
                f"mach: {mach.flat[index]:.4g} at sample {index} is outside the breakpoints of the "
                f"coefficients, {points[0]:g} to {points[-1]:g}"
            )
        return np.asarray(np.interp(mach, points, values))

    def _check_series(self, name: str) -> None:
        value = getattr(self, name)
        if not np.isfinite(value).all():
            raise RangeError(f"{name}: {value!r} must be finite")
        if isinstance(value, tuple):
            wanted = len(self.mach) if self.mach is not None else None
            if wanted is None:
                raise InputError(f"{name}: a series of coefficients needs `mach` breakpoints")
            if len(value) != wanted or wanted < 2:
                raise InputError(
                    f"{name}: {len(value)} values for {wanted} Mach breakpoints (at least 2)"
                )


@dataclass(frozen=True)
class LoadTable:
    """Load and position of an actuator over a flight, ready for a scenario.

    Attributes
    ----------
    time : ndarray, shape (n,)
        s, from 0.
    load : ndarray, shape (n,)
        N on a ram (or N m on an output shaft), after scaling; positive opposes positive motion.
    position : ndarray, shape (n,)
        m of the ram (or rad of the shaft), after scaling.
    load_scale, position_scale : float
        What the aircraft's values were multiplied by.
    dynamic_pressure, mach : ndarray, shape (n,)
        Pa, and 1; for plots and checks, never scaled.
    linear : bool
        A ram, in m and N; else a shaft, in rad and N m.
    """

    time: Array
    load: Array
    position: Array
    load_scale: float
    position_scale: float
    dynamic_pressure: Array
    mach: Array
    linear: bool = False

    def load_term(self, *, repeat: bool = False) -> dict[str, object]:
        """Return the table as one entry of ``load.output.terms``."""
        return _term(self.time, self.load, self.units[0], repeat)

    def command_term(self, *, repeat: bool = False) -> dict[str, object]:
        """Return the position as one entry of ``command.terms``."""
        return _term(self.time, self.position, self.units[1], repeat)

    @property
    def units(self) -> tuple[str, str]:
        """Units of load and position."""
        return ("N", "m") if self.linear else ("N m", "rad")

    def summary(self) -> dict[str, Any]:
        """Return the ends and scales of the table, in SI."""
        force, length = self.units
        return {
            "samples": int(self.time.size),
            "duration_s": float(self.time[-1]),
            "load": [float(self.load.min()), float(self.load.max())],
            "load_unit": force,
            "position": [float(self.position.min()), float(self.position.max())],
            "position_unit": length,
            "load_scale": self.load_scale,
            "position_scale": self.position_scale,
            "mach": float(self.mach.max()),
            "dynamic_pressure_pa": float(self.dynamic_pressure.max()),
        }

    def csv(self) -> str:
        """Return the table as a CSV, a row an instant."""
        force, length = self.units
        columns = (("time", "s"), ("load", force), ("position", length),
                   ("dynamic_pressure", "Pa"), ("mach", "1"))  # fmt: skip
        values = [getattr(self, name) for name, _ in columns]
        rows = (",".join(f"{value:.9g}" for value in row) for row in zip(*values, strict=True))
        return "\n".join([",".join(f"{name} [{unit}]" for name, unit in columns), *rows]) + "\n"

    def scenario_text(self) -> str:
        """Return the scenario as a TOML file: command, load and duration."""
        force, length = self.units

        def term(place: str, values: Array, unit: str) -> str:
            times = ", ".join(f"{t:.9g}" for t in self.time)
            numbers = ", ".join(f"{v:.9g}" for v in values)
            head = f'[[{place}]]\nkind = "table"\nunit = "{unit}"\n'
            return f"{head}times = [{times}]\nvalues = [{numbers}]\n"

        return (
            f"# A flight: load scale {self.load_scale:.6g}, "
            f"position scale {self.position_scale:.6g}\n"
            f'duration = {self.time[-1]:.9g}\n[command]\nmode = "position"\n'
            + term("command.terms", self.position, length)
            + term("load.output.terms", self.load, force)
        )

    def scenario(self) -> dict[str, object]:
        """Return a scenario that flies the flight: command, load and duration, in SI units."""
        return {
            "duration": float(self.time[-1]),
            "command": {"mode": "position", "terms": [self.command_term()]},
            "load": {"output": {"terms": [self.load_term()]}},
        }


def flight_load(
    flight: FlightData,
    surface: HingeMoment,
    *,
    arm: float | None = None,
    limit: float | None = None,
    travel: float | None = None,
    temperature_offset: float = 0.0,
) -> LoadTable:
    """Return what a flight asks of the actuator of one surface.

    Parameters
    ----------
    flight : FlightData
        The flight.
    surface : HingeMoment
        The surface's area, chord and coefficients.
    arm : float, optional
        m. Lever between hinge and ram, taken constant: position = arm * deflection, load =
        -moment/arm. Without it the actuator is rotary and sits on the hinge line. A negative arm is
        a ram that retracts when the deflection grows.
    limit : float, optional
        N (or N m). The load is scaled so that its largest magnitude is this. Without it the load is
        the aircraft's.
    travel : float, optional
        m (or rad). The position is scaled so that its largest magnitude is this.
    temperature_offset : float
        K, on the standard atmosphere; not with a flight that has its own air density.

    Returns
    -------
    LoadTable
        With the two scales used. The load follows the RECORDED deflection, not the simulated ram.

    Raises
    ------
    RangeError
        An argument out of range, an altitude outside the standard atmosphere, a calibrated airspeed
        above Mach 1, a Mach number outside the coefficients' breakpoints.
    InputError
        An offset and a measured density; a scale was requested and the load or the position is
        zero throughout.

    Notes
    -----
    The hinge moment turns the surface towards positive deflection; a load opposes positive motion
    when positive, so the sign changes: a stable surface (c_delta < 0) loads the ram against its
    deflection.
    """
    lever = 1.0 if arm is None else _finite("arm", arm)
    if lever == 0.0:
        raise RangeError("arm: 0 m carries no moment; give a lever, or none for a rotary actuator")
    air = standard_atmosphere(flight.altitude, temperature_offset=temperature_offset)
    if flight.air_density is not None:
        if temperature_offset:
            raise InputError(
                f"temperature_offset: {temperature_offset:g} K, and the flight has its own "
                "air_density; one of them decides the temperature"
            )
        air = air.with_density(flight.air_density)
    mach = mach_number(flight.airspeed, flight.airspeed_kind, air)
    pressure = dynamic_pressure(flight.airspeed, flight.airspeed_kind, air)
    moment = surface.moment(pressure, mach, flight.angle_of_attack, flight.deflection)
    load, load_scale = _scaled("limit", -moment / lever, limit)
    position, position_scale = _scaled("travel", lever * flight.deflection, travel)
    return LoadTable(
        flight.time - flight.time[0],
        load,
        position,
        load_scale,
        position_scale,
        pressure,
        mach,
        linear=arm is not None,
    )


def _scaled(name: str, values: Array, peak: float | None) -> tuple[Array, float]:
    if peak is None:
        return values, 1.0
    if _finite(name, peak) <= 0.0:
        raise RangeError(f"{name}: {peak:g} must be above 0")
    largest = float(np.abs(values).max())
    if largest == 0.0:
        raise InputError(f"{name}: what should be scaled to {peak:g} is zero in the whole flight")
    factor = peak / largest
    return np.clip(values * factor, -peak, peak), factor  # the clip is one rounding at the peak


def _finite(name: str, value: float) -> float:
    if not np.isfinite(value):
        raise RangeError(f"{name}: {value!r} is not a finite number")
    return float(value)


def _term(time: Array, values: Array, unit: str, repeat: bool) -> dict[str, Any]:
    return {
        "kind": "table",
        "times": time.tolist(),
        "values": values.tolist(),
        "unit": unit,
        "repeat": repeat,
    }
