"""What a drive can hold, and a load actuator's command within it.

A load beyond a drive's largest thrust moves the output, whatever is commanded, until it stands at
its stop: nothing of the drive is learnt from such a log. An operator sets loads by the drive's
rating.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from elevon.bench.steps import ForceStep
from elevon.units import parse_quantity

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.arrays import Floats

#: Of what the drive holds at its current limit. ASSUMED: the rest accelerates and overcomes
#: friction, and a continuous thrust is about half of the peak.
SHARE = 0.5
_LIMITS = ("control.current_limit", "control.torque_constant", "gear.ratio", "screw.lead")


def holds(actuator: Actuator) -> float:
    """Return the thrust at the current limit without losses [N]; infinite where no limit is known.

    The screw's lead is in m/rad.
    """
    known = actuator.parameters
    if any(path not in known for path in _LIMITS):
        return float("inf")
    current, constant, ratio, lead = (known.value(path) for path in _LIMITS)
    return float(current * constant * ratio / lead)


def rated_factor(step: ForceStep, terms: Floats, command: Floats, most: float) -> float:
    """Return by what the forces of a step are multiplied so that they stay within `most`.

    Parameters
    ----------
    step : ForceStep
        What the procedure asks for.
    terms, command : ndarray, shape (n,)
        Its waveforms [N], the commanded positions [m].
    most : float
        N.
    """
    spring = parse_quantity(step.stiffness, "N/m", "stiffness") * command
    if step.positions:
        spring = spring + np.interp(command, step.positions, step.forces)
    against = abs(parse_quantity(step.opposing, "N", "opposing"))
    largest = float(np.max(np.abs(terms + spring))) + against
    return min(1.0, most / largest) if largest > 0.0 else 1.0
