"""What loads a test, for the model: over the position where it has a load over its stroke."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.roles.series import lines, noise_deviation, smoothed

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

_SMOOTH = 0.05  # s over which a load is averaged before it becomes straight lines
_ROUGH = 0.01  # of the load's size: what straight lines may miss
_NOISE = 5.0  # deviations of its noise that a load's RMS must reach to be one
_LOADED = 0.15  # of the load's size, RMS; a load that follows the motion differs with the unit
_PUSHED = 0.1  # of the greatest load, of the fastest motion, and share of the time
_KNOTS = 9  # of the model's load over its stroke
_TIED = 1e-3  # of a knot's neighbours, where no sample determines a knot


@dataclass(frozen=True)
class OverStroke:
    """A load that follows the position, as stands load an actuator that actions command.

    Attributes
    ----------
    stroke : float
        m; the knots lie evenly over it.
    forces : tuple of float
        At the knots, positive where they oppose positive motion, N.
    low, high : float
        Positions between which the log shows it, m.
    """

    stroke: float
    forces: tuple[float, ...]
    low: float
    high: float

    def at(self, position: Floats) -> Floats:
        """Return the load at positions, shape (n,)."""
        places = np.linspace(0.0, self.stroke, _KNOTS)
        return np.asarray(np.interp(position, places, self.forces), dtype=np.float64)

    def settings(self, actuator: Actuator) -> dict[str, float]:
        """Return the model's load over its stroke with this one in it, by path."""
        value = actuator.parameters.value
        factor = value("load.factor")
        paths = [f"load.force_{k}" for k in range(_KNOTS)]
        forces = {p: factor * value(p) - f for p, f in zip(paths, self.forces, strict=True)}
        return {"load.factor": 1.0, **forces}


def read_load(
    actuator: Actuator, time: Floats, channels: Mapping[str, Floats]
) -> tuple[tuple[Floats, Floats] | None, OverStroke | None]:
    """Return a log's load over time as straight lines, and over the position where that is known.

    With a load over the position, the one over time is what that leaves. None where the log's
    load is its noise.
    """
    load = channels["load"]
    width = max(1, round(_SMOOTH / float(time[1] - time[0])))
    smooth = smoothed(load, width)
    if float(np.sqrt(np.mean(smooth**2))) < _NOISE * noise_deviation(load) / np.sqrt(width):
        return None, None
    size = float(np.abs(smooth).max())
    known = actuator.parameters
    over = None
    if f"load.force_{_KNOTS - 1}" in known and "output_position" in channels:
        position = channels["output_position"]
        over = _over_stroke(position, load, known.value("lever.stroke"))
        smooth = smoothed(load - over.at(position), width)
    return lines(time, smooth, _ROUGH * size), over


def _over_stroke(position: Floats, load: Floats, stroke: float) -> OverStroke:
    """Least squares of straight lines between the knots."""
    places = np.linspace(0.0, stroke, _KNOTS)
    hats = np.column_stack([np.interp(position, places, row) for row in np.eye(_KNOTS)])
    tied = _TIED * np.diff(np.eye(_KNOTS), axis=0)
    forces = np.linalg.lstsq(
        np.vstack([hats / np.sqrt(len(load)), tied]),
        np.concatenate([load / np.sqrt(len(load)), np.zeros(_KNOTS - 1)]),
        rcond=None,
    )[0]
    ends = np.clip([position.min(), position.max()], 0.0, stroke)
    return OverStroke(stroke, tuple(forces.tolist()), float(ends[0]), float(ends[1]))


def load_alike(
    a: tuple[tuple[Floats, Floats] | None, OverStroke | None],
    b: tuple[tuple[Floats, Floats] | None, OverStroke | None],
    grid: Floats,
) -> bool:
    """Whether two tests were loaded alike, at the positions or the instants that both show."""
    (first, over_first), (second, over_second) = a, b
    if over_first is not None and over_second is not None:
        low = max(over_first.low, over_second.low)
        high = max(low, min(over_first.high, over_second.high))
        places = np.linspace(low, high, len(grid))
        pushes = [over_first.at(places), over_second.at(places)]
    elif (over_first is None) != (over_second is None):
        return False
    else:
        none = (np.zeros(1), np.zeros(1))
        pushes = [np.interp(grid, *(none if x is None else x)) for x in (first, second)]
    largest = max(float(np.abs(push).max()) for push in pushes)
    off = float(np.sqrt(np.mean((pushes[0] - pushes[1]) ** 2)))
    return off <= _LOADED * largest


def drives_output(log: Log, deflection: Floats | None) -> bool:
    """Whether a load drives the output of an elastic backlash over a tenth of the motion."""
    if deflection is None:
        return False
    speed = np.gradient(log["command"], log.time)
    pushed = deflection * np.sign(speed) < -_PUSHED * np.abs(deflection).max()
    moving = np.abs(speed) > _PUSHED * np.abs(speed).max()
    return bool(np.mean(pushed[moving]) > _PUSHED)
