"""What a page must know of an actuator: signals, inputs, faults, parameters, its mechanism."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from elevon.faults import FaultRecord, catalogue
from elevon.parameters.records import records, wirings
from elevon.scenario.compile import signal_records
from elevon.units import display_unit, to_display
from elevon.waveforms import wave_records

if TYPE_CHECKING:
    from elevon.live.unit import InputRange, LiveUnit


#: What is drawn first, of the signals that an actuator has.
PLOTS = (
    ("position", ("command", "output_position", "nut_position")),
    ("speed", ("speed_ref", "motor_speed")),
    ("current", ("current_ref", "current_q_meas", "current_mean", "current_peak")),
    ("phases", ("current_a", "current_b", "current_c")),
    ("temperature", ("winding_temperature", "surface_temperature", "ambient_temperature")),
)
_ENDLESS = {"rad": 0.1, "m": 1e-3, "N m": 20.0, "N": 5000.0, "A": 5.0}
"""Top of a slider where the catalogue has no limit. ASSUMED: far beyond what is diagnosed."""
#: Parameters that are turned while it runs; what else the record tells is reached by its path.
_LIVE = (
    "friction.static", "friction.dynamic", "friction.viscous", "load.inertia", "load.stiffness",
    "load.factor", "leg.inertia", "motor.inertia", "gear.efficiency", "screw.efficiency",
    "backlash.total", "control.position_gain", "control.speed_gain", "control.integral_time",
    "control.speed_limit", "control.current_limit", "inverter.hysteresis_band",
    "motor.winding_resistance", "lock.spring_force", "supply.current_limit",
)  # fmt: skip
_GEOMETRY = (
    "gear.ratio", "backlash.total", "stop.lower", "stop.upper", "screw.lead", "motor.pole_pairs",
    "lever.arm", "lever.pivot_x", "lever.pivot_y", "lever.length_retracted", "lever.stroke",
    "lock.travel", "gear.ratio_first", "gear.ratio_second",
)  # fmt: skip


def unit_text(unit: str) -> dict[str, object]:
    """Return the unit in which a person reads a quantity, and how SI becomes it."""
    display = "degC" if unit == "K" else display_unit(unit)
    if unit == "K":
        return {"unit": unit, "shown": "°C", "scale": 1.0, "offset": -273.15}
    text = "" if display == "1" else display.replace("deg", "°")
    scale = to_display(1.0, display) if unit != "1" else 1.0
    return {"unit": unit, "shown": text, "given": display, "scale": scale, "offset": 0.0}


def description(unit: LiveUnit) -> dict[str, object]:
    """Return what a page must know of a live unit, in plain types."""
    actuator = unit.actuator
    wiring = wirings()[actuator.wiring]
    return {
        "actuator": actuator.name,
        "title": str(getattr(actuator, "title", "") or actuator.name),
        "wiring": actuator.wiring,
        "fidelity": unit.fidelity,
        "mode": unit.mode,
        "modes": list(wiring["modes"]),
        "actions": list(wiring["actions"]),
        "period": unit.period,
        "signals": _signals(unit),
        "plots": _plots(unit),
        "inputs": {name: _range(span) for name, span in unit.ranges.items()},
        "faults": _faults(unit),
        "parameters": _parameters(unit),
        "geometry": _geometry(unit),
        "waveforms": [
            {
                "kind": record.kind,
                "parameters": [
                    {"name": p.name, "unit": p.unit, "default": _finite(p.default)}
                    for p in record.parameters
                ],
            }
            for record in wave_records().values()
            if record.kind != "table"
        ],
    }


def _signals(unit: LiveUnit) -> list[dict[str, Any]]:
    known, units = signal_records(unit.actuator.wiring, unit.fidelity), unit.units
    return [
        {"name": name, "text": known[name]["text"], **unit_text(units[name])} for name in unit.names
    ]


def _plots(unit: LiveUnit) -> list[dict[str, Any]]:
    plots = []
    for title, names in PLOTS:
        present = [name for name in names if name in unit.names]
        units = unit.units  # one axis has one unit: that of the last signal
        present = [name for name in present if units[name] == units[present[-1]]]
        if present:
            plots.append({"title": title, "signals": present})
    return plots


def _range(span: InputRange) -> dict[str, Any]:
    return {"low": _finite(span.low), "high": _finite(span.high), **unit_text(span.unit)}


def _faults(unit: LiveUnit) -> list[dict[str, Any]]:
    return [
        {
            "name": f"{record.kind}@{place}",
            "kind": record.kind,
            "place": place,
            "effect": record.effect,
            "low": _low(record),
            "high": _high(record),
            **unit_text(record.unit or "1"),
        }
        for record in catalogue(unit.actuator.wiring)
        if unit.fidelity in record.fidelities
        for place in record.places
    ]


def _high(record: FaultRecord) -> float:
    return record.maximum if math.isfinite(record.maximum) else _ENDLESS.get(record.unit, 1.0)


def _low(record: FaultRecord) -> float:
    return record.minimum if math.isfinite(record.minimum) else -_high(record)


def _parameters(unit: LiveUnit) -> list[dict[str, Any]]:
    known, values = records(unit.actuator.wiring), unit.actuator.parameters
    out = []
    for path in _LIVE:
        record = known.get(path)
        if record is None or path not in values or unit.fidelity not in record.fidelities:
            continue
        value = values.value(path)
        out.append(
            {
                "path": path,
                "text": record.text,
                "value": value,
                "low": _finite(record.minimum),
                "high": _finite(record.maximum),
                **unit_text(record.unit or "1"),
            }
        )
    return out


def _geometry(unit: LiveUnit) -> Mapping[str, float]:
    values = unit.actuator.parameters
    return {path: values.value(path) for path in _GEOMETRY if path in values}


def _finite(value: float | None) -> float | None:
    return value if value is not None and math.isfinite(value) else None
