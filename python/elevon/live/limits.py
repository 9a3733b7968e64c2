"""What may be set while it runs, in which range: from the actuator's own values."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from elevon.errors import RangeError
from elevon.scenario.compile import evaluate_terms, port_units
from elevon.units import format_quantity

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.scenario import Terms


_COLDEST, _HOTTEST = 213.15, 393.15  # K: -60 to 120 degC, beyond what flies. ASSUMED
_SUPPLY = 1.5  # times the nominal voltage. ASSUMED: beyond it no drive of these lives
_RAM = 25e3  # N on a landing gear's ram. ASSUMED: as the hydraulic rig's limit
_AHEAD, _GRID = 120.0, 24_001  # s of a waveform that are looked at, and at how many instants


@dataclass(frozen=True)
class InputRange:
    """Within which an input may be set, SI."""

    low: float
    high: float
    unit: str


def input_ranges(actuator: Actuator, mode: str) -> dict[str, InputRange]:
    """Return the range of each input; that of the command goes with its mode."""
    units = port_units(mode, actuator.wiring)
    torque = _value(actuator, "motor.torque_limit", math.inf)
    output = torque * _ratio(actuator) if units.get("output") != "N" else _force(actuator, torque)
    supply = _value(actuator, "inverter.supply_voltage", math.inf)
    spans = {
        "command": _command(actuator, mode),
        "output": (-output, output),
        "brake": (0.0, output if units.get("brake") == "N" else torque),
        "shaft": (-torque, torque),
        "supply": (0.0, _SUPPLY * supply),
        "ambient": (_COLDEST, _HOTTEST),
        "weight_on_wheels": (0.0, 1.0),
    }
    return {port: InputRange(*spans[port], units[port]) for port in units if port in spans}


def check_value(name: str, value: float, span: InputRange) -> None:
    """Raise `RangeError` for a value outside its range."""
    if not span.low <= value <= span.high:
        low, high = format_quantity(span.low, span.unit), format_quantity(span.high, span.unit)
        raise RangeError(
            f"{name} = {format_quantity(value, span.unit)}: the bench takes {low} to {high}"
        )


def check_waveform(name: str, terms: Terms, span: InputRange) -> None:
    """Raise `RangeError` for a sum of waveforms that leaves its range within two minutes."""
    time = np.linspace(0.0, _AHEAD, _GRID)
    values = evaluate_terms(terms.terms, span.unit, time, name)
    for value in (float(values.min()), float(values.max())):
        check_value(name, value, span)


def _command(actuator: Actuator, mode: str) -> tuple[float, float]:
    if mode == "gear":
        return 0.0, 8.0
    if mode == "speed":
        most = _value(actuator, "control.speed_limit", math.inf)
        return -most, most
    if mode == "torque":
        most = _value(actuator, "motor.torque_limit", math.inf)
        return -most, most
    return _value(actuator, "stop.lower", -math.inf), _value(actuator, "stop.upper", math.inf)


def _force(actuator: Actuator, torque: float) -> float:
    """Return the force of a screw at the motor's largest torque."""
    if "control.position_gain" not in actuator.parameters:
        return _RAM
    lead = _value(actuator, "screw.lead", math.inf)
    return torque * _ratio(actuator) / lead if math.isfinite(lead) else _RAM


def _ratio(actuator: Actuator) -> float:
    return _value(actuator, "gear.ratio", 1.0)


def _value(actuator: Actuator, path: str, other: float) -> float:
    known: Mapping[str, object] = actuator.parameters
    return float(actuator.parameters.value(path)) if path in known else other
