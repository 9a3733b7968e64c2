"""What the phase that is not used draws while the pair freewheels: line current and braking torque.

With low-side chopping the pair lies at the upper rail while it is off. For half of each sector the
EMF of the third phase, ``k w u`` with ``u`` from 0 to 1 (trapezoid with flats of 120 degrees), is
above it: ``x = k w u - V_f/2`` over ``3/2 L`` drives a current through that phase's diode, which
falls by ``(V + V_f)/2 - x`` while the pair is on. Half of it is in the line current; it brakes
(docs/explanation/theory/landing-gear.md). While the pair's current is continuous, which is where
the balances look.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats

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
