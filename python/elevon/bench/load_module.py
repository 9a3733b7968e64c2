"""The load module: springs or weights on two cables of the winding guide, at the output's side."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from elevon.arrays import Floats
from elevon.bench.steps import SpringStep, WeightsStep
from elevon.errors import InputError
from elevon.units import parse_quantity

GRAVITY = 9.80665  # m/s2
_EDGE = 0.01  # s a weight takes to come onto its cable. ASSUMED: lowered by hand on a stiff cable
_BEARING = 0.015 * 0.020  # m, friction radius of the guide's bearing. ASSUMED: 0.015 at 20 mm


@dataclass(frozen=True, slots=True)
class Springs:
    """Two traction springs that pull in the same direction.

    Attributes
    ----------
    stiffness : float
        Of each [N/m].
    radius, extension, mover : float
        m; see `SpringStep`.
    """

    stiffness: float
    radius: float
    extension: float
    mover: float

    @property
    def torsional(self) -> float:
        """Stiffness at the output: 2 K r^2 [N m/rad]."""
        return 2.0 * self.stiffness * self.radius**2

    @property
    def preload(self) -> float:
        """Torque at the output's zero [N m]."""
        return 2.0 * self.stiffness * self.radius * self.extension

    @property
    def radial_force(self) -> float:
        """Force of the displaced mover across the guide: K dx [N]."""
        return self.stiffness * self.mover

    @property
    def bearing_torque(self) -> float:
        """Dry friction that force causes, at the output [N m]."""
        return self.radial_force * _BEARING

    def forces(self, output: Floats) -> Floats:
        """Sum of the two cables' forces [N] at output positions [rad].

        Raises
        ------
        InputError
            A cable would go slack: a cable cannot push, and a run with a slack one is not the run
            that was computed.
        """
        reach = self.extension + self.radius * output
        if reach.min() < 0.0:
            raise InputError(
                "spring: the cables go slack at an output position of "
                f"{float(output.min()):.4g} rad; "
                f"give an extension of {self.extension - float(reach.min()):.3g} m or more"
            )
        return 2.0 * self.stiffness * reach


@dataclass(frozen=True, slots=True)
class Weights:
    """Masses on the cables: torque at the output over time [s after the trigger]."""

    times: tuple[float, ...]
    forces: tuple[float, ...]
    radius: float

    def table(self, start: float) -> dict[str, object]:
        """Return the load term [N m at the output], `start` s into the log."""
        return {
            "kind": "table",
            "times": [0.0, *(start + t for t in self.times)],
            "values": [0.0, *(f * self.radius for f in self.forces)],
        }

    def at(self, time: Floats) -> Floats:
        """Sum of the cables' forces [N]."""
        return np.asarray(np.interp(time, self.times, self.forces), dtype=np.float64)


def springs_of(step: SpringStep) -> Springs | None:
    """Return the springs of a step, None when they are taken off."""
    if not step.fitted:
        return None
    return Springs(
        parse_quantity(step.stiffness, "N/m", "spring: stiffness"),
        *(parse_quantity(getattr(step, n), "m", n) for n in ("radius", "extension", "mover")),
    )


def weights_of(step: WeightsStep) -> Weights | None:
    """Return the weights of a step, None when there are none."""
    if not step.drops:
        return None
    times, forces = [0.0], [0.0]
    for drop in step.drops:
        force = step.cables * GRAVITY * parse_quantity(drop.mass, "kg", "mass")
        start, stop = parse_quantity(drop.at, "s", "at"), parse_quantity(drop.until, "s", "until")
        for instant, value in ((start, 0.0), (start + _EDGE, force), (stop, force)):
            if instant > times[-1]:
                times.append(instant)
                forces.append(value)
        times.append(stop + _EDGE)
        forces.append(0.0)
    return Weights(tuple(times), tuple(forces), parse_quantity(step.radius, "m", "radius"))
