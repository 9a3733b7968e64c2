"""A gear of several bodies in scipy, its equations written from the wheels: pitch radii and tooth
forces.

The core states each mesh by one row of numbers over the bodies' angles. Here every wheel is looked
at by itself: its pitch point's velocity, the force of its teeth, its moment about its own axis. The
integrator is an adaptive one, so that nothing is shared but the gear.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

#: Sun, planet at sun and fixed ring, fixed ring, planet at the output ring, output ring.
TEETH = (21, 21, 63, 20, 62)


@dataclass(frozen=True)
class Flanks:
    """A mesh: total backlash, stiffness, damping, in angles of its wheel (SI)."""

    backlash: float
    stiffness: float
    damping: float

    def force(self, apart: float, rate: float) -> float:
        """Torque between the wheels; teeth push, they never pull."""
        half = self.backlash / 2
        if apart > half:
            return max(self.stiffness * (apart - half) + self.damping * rate, 0.0)
        if apart < -half:
            return min(self.stiffness * (apart + half) + self.damping * rate, 0.0)
        return 0.0


@dataclass(frozen=True)
class Gear:
    """Inertias of motor, bodies and output, and the meshes; `ratios` of stages in a row or none."""

    inertias: Sequence[float]
    meshes: Sequence[Flanks]
    ratios: Sequence[float] = ()

    def torques(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Torque of the meshes on each body, in the order of the inertias."""
        return self._row(x, v) if self.ratios else self._planets(x, v)

    def _row(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Stages: the wheel behind mesh k lags behind the one before it over the ratio."""
        out = np.zeros(len(x))
        for k, (ratio, mesh) in enumerate(zip(self.ratios, self.meshes, strict=True)):
            torque = mesh.force(x[k] / ratio - x[k + 1], v[k] / ratio - v[k + 1])
            out[k] -= torque / ratio
            out[k + 1] += torque
        return out

    def _planets(self, x: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Planets orbit by x[1] and turn by x[2]; radii in halves of the module."""
        sun, planet, fixed, small, ring = (float(z) for z in TEETH)

        def gaps(q: np.ndarray) -> tuple[float, float, float]:
            q_sun, orbit, spin, q_ring = q
            centre = (sun + planet) * orbit
            # How far each wheel's pitch point is ahead of the one it meets.
            on_sun = sun * q_sun - (centre - planet * spin)
            on_fixed = centre + planet * spin
            on_ring = centre + small * spin - ring * q_ring
            return on_sun / sun, on_fixed / fixed, on_ring / ring

        spread = [
            mesh.force(a, b) for mesh, a, b in zip(self.meshes, gaps(x), gaps(v), strict=True)
        ]
        on_sun, on_fixed, on_ring = spread[0] / sun, spread[1] / fixed, spread[2] / ring
        # Tooth forces along the tangent: what each wheel gives and takes.
        return np.array(
            [
                -on_sun * sun,
                (sun + planet) * (on_sun - on_fixed - on_ring),
                -planet * on_sun - planet * on_fixed - small * on_ring,
                on_ring * ring,
            ]
        )

    def run(
        self,
        times: np.ndarray,
        motor: Callable[[float], float],
        output: Callable[[float], float],
        step: float = 1e-3,
    ) -> np.ndarray:
        """Angles of all bodies at `times` from rest amid every backlash; shape (bodies, n)."""
        count = len(self.inertias)
        inertia = np.asarray(self.inertias, dtype=float)

        def rates(t: float, y: np.ndarray) -> np.ndarray:
            torque = self.torques(y[:count], y[count:])
            torque[0] += motor(t)
            torque[-1] += output(t)
            return np.concatenate([y[count:], torque / inertia])

        found = solve_ivp(
            rates, (0.0, float(times[-1])), np.zeros(2 * count), method="LSODA",
            t_eval=times, rtol=1e-9, atol=1e-12, max_step=step,
        )  # fmt: skip
        assert found.success, found.message
        return np.asarray(found.y[:count])
