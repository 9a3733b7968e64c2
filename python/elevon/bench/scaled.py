"""A bench procedure for an actuator from few numbers: within its stroke and rating."""

from __future__ import annotations

import math
from importlib.resources import files
from string import Template

from elevon.errors import InputError
from elevon.parameters import SetFile

#: Longest cycle [s] of a ram and of a turning output.
_LONGEST = {True: 2.0, False: 4.0}


def scaled_procedure(loaded: SetFile) -> str:
    """Return the text of a procedure whose motions and loads suit an actuator's design.

    Sines reach half the rated speed, over a fifth of the stroke to either side at most, in cycles
    of at most two seconds (a ram) or four.

    Raises
    ------
    InputError
        The actuator states no design.
    """
    if not loaded.design:
        raise InputError(f"{loaded.name}: states no [design] to scale a procedure by")
    value = {
        name: float(item.value) for name, item in loaded.design.items() if name != "motor.kind"
    }
    linear = "lead" in value
    display = 1e3 if linear else 180.0 / math.pi
    speed = 0.5 * value["speed"]
    amplitude = min(0.2 * value["stroke"], _LONGEST[linear] * speed / (2.0 * math.pi))
    frequency = speed / (2.0 * math.pi * amplitude)
    small = 0.2 * amplitude
    numbers = {
        "duration": (4.0 if linear else 3.0) / frequency,
        "amplitude": amplitude * display,
        "frequency": frequency,
        "small": small * display,
        "fast": min(0.4 * value["speed"] / (2.0 * math.pi * small), 0.5 * value["bandwidth"]),
    }
    if linear:
        numbers |= {"half": 0.5 * value["thrust"], "quarter": 0.25 * value["thrust"]}
    else:
        torque = value["power"] / value["motor_speed"]
        numbers |= {"low": 0.1 * torque, "slope": 0.4 * torque / numbers["duration"]}
    template = files("elevon.bench") / "templates" / ("linear.txt" if linear else "rotary.txt")
    texts = {name: f"{number:.4g}" for name, number in numbers.items()}
    return Template(template.read_text("utf-8")).substitute(texts, name=loaded.name)
