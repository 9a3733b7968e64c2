"""The aerodynamic moment about a surface's hinge, from coefficients the user gives."""

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from elevon.errors import InputError, RangeError

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
