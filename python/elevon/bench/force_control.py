"""A load actuator in force control: what it is commanded and what the rod gets.

The closed loop is of second order, T(s) = w^2 / (s^2 + 2 d w s + w^2). What moves with the rod but
is no load (friction and mass of the load actuator) is rejected by 1 - T. It is computed before the
run from the motion that the actuator makes, in two passes: equipment, not the actuator's physics.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from elevon.arrays import Floats
from elevon.bench.stand import ForceSpec
from elevon.bench.steps import ForceStep
from elevon.errors import InputError
from elevon.units import parse_quantity

_AT_REST = 1e-3  # m/s below which a direction fades: rest has none


@dataclass(frozen=True, slots=True)
class ForceLoop:
    """The loop in SI; see `elevon.bench.stand.ForceSpec`."""

    limit: float
    omega: float
    damping: float
    friction: float
    mass: float

    @classmethod
    def of(cls, spec: ForceSpec) -> ForceLoop:
        """Return the loop a stand's file describes."""
        return cls(
            parse_quantity(spec.limit, "N", "force.limit"),
            2.0 * math.pi * parse_quantity(spec.bandwidth, "Hz", "force.bandwidth"),
            spec.damping,
            parse_quantity(spec.friction, "N", "force.friction"),
            parse_quantity(spec.mass, "kg", "force.mass"),
        )

    def achieved(self, time: Floats, target: Floats, speed: Floats) -> Floats:
        """Return the force on the rod [N] for a commanded force and the rod's speed.

        Raises
        ------
        InputError
            More is commanded than the load actuator has.
        """
        most = float(np.abs(target).max())
        if most > self.limit:
            raise InputError(f"force of {most:.5g} N: the load actuator has {self.limit:.5g} N")
        period = float(time[1] - time[0])
        acceleration = np.gradient(speed, period)
        other = self.friction * np.tanh(speed / _AT_REST) + self.mass * acceleration
        return self._closed(target, period) + other - self._closed(other, period)

    def _closed(self, values: Floats, period: float) -> Floats:
        """Return what the closed loop makes of a signal that was steady before."""
        from scipy.signal import bilinear, lfilter, lfilter_zi

        w = self.omega
        numerator, denominator = bilinear([w**2], [1.0, 2.0 * self.damping * w, w**2], 1.0 / period)
        state = lfilter_zi(numerator, denominator) * values[0]
        return np.asarray(lfilter(numerator, denominator, values, zi=state)[0], dtype=np.float64)


def target_force(step: ForceStep, terms: Floats, position: Floats, speed: Floats) -> Floats:
    """Return the commanded force [N]: of time, direction and position.

    Parameters
    ----------
    step : ForceStep
        What the operator set.
    terms : ndarray, shape (n,)
        Values of its terms.
    position, speed : ndarray, shape (n,)
        Of the output [m], [m/s].
    """
    against: Any = parse_quantity(step.opposing, "N", "opposing")
    spring = parse_quantity(step.stiffness, "N/m", "stiffness")
    total = terms + against * np.tanh(speed / _AT_REST) + spring * position
    if step.positions:
        total = total + np.interp(position, step.positions, step.forces)
    return np.asarray(total, dtype=np.float64)
