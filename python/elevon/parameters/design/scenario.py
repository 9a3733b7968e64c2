"""What an actuator from few numbers runs when no scenario is given: a sine."""

from __future__ import annotations

import math
from collections.abc import Mapping

from elevon.parameters.parameter import Parameter


def design_scenario(design: Mapping[str, Parameter]) -> Mapping[str, object]:
    """Return a sine over a fifth of the stroke whose peak rate is half the rated speed.

    Parameters
    ----------
    design : mapping
        Name to `Parameter`, derived ones included.

    Returns
    -------
    mapping
        In the form of a scenario file: three cycles.
    """
    unit = "m" if "lead" in design else "rad"
    stroke, speed = (float(design[name].value) for name in ("stroke", "speed"))
    amplitude = 0.1 * stroke
    frequency = 0.5 * speed / (2.0 * math.pi * amplitude)
    sine = {"kind": "sine", "amplitude": f"{amplitude!r} {unit}", "frequency": f"{frequency!r} Hz"}
    return {"duration": f"{3.0 / frequency!r} s", "command": {"mode": "position", "terms": [sine]}}
