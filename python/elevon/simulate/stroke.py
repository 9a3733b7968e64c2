"""A travelling output is not sent beyond its end stops."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from elevon.actuator import Actuator
from elevon.errors import RangeError
from elevon.scenario.compile import CompiledScenario
from elevon.waveforms import TABLE, wave_records


def check_stroke(compiled: CompiledScenario, actuator: Actuator) -> None:
    """Check the position command of an actuator that travels against its stroke.

    Only a command of one waveform has a range that is known without running it; a sum is left to
    the stops. A turning output may be driven into its stops on purpose: that is a test.

    Raises
    ------
    RangeError
        The message names the command's range and the stop.
    """
    terms = [term for term in compiled.inputs["command"] if term["enabled"]]
    if compiled.command_mode != "position" or compiled.command_unit != "m" or len(terms) != 1:
        return
    low, high = _range(terms[0])
    for path, value, beyond in (
        ("stop.lower", low, low < actuator.parameters.value("stop.lower")),
        ("stop.upper", high, high > actuator.parameters.value("stop.upper")),
    ):
        if beyond:
            limit = actuator.parameters.value(path)
            raise RangeError(
                f"command: reaches {1e3 * value:.6g} mm, beyond {path}, {1e3 * limit:.6g} mm"
            )


def _range(term: Mapping[str, Any]) -> tuple[float, float]:
    """Return the lowest and the highest value of a waveform."""
    kind = term["kind"]
    values = dict(zip(wave_records()[kind].names, term["parameters"], strict=True))
    if kind == TABLE:
        points = [values["gain"] * float(value) for value in term["values"]]
        return min(points), max(points)
    if "amplitude" in values:
        size, bias = abs(values["amplitude"]), values["bias"]
        return bias - size, bias + size
    # A ramp without an end has no range; its end is the solver's business.
    levels = [values[n] for n in ("value", "initial", "final", "low", "high") if n in values]
    return min(levels), max(levels)
