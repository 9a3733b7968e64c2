"""Numbers of a design that cannot be together: refused, with the limit."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from elevon.errors import InputError
from elevon.parameters.design.rule import (
    load_name,
    phase_voltage,
    turns_per_output,
    useful,
)
from elevon.parameters.relations import torque_constant
from elevon.units import format_quantity

if TYPE_CHECKING:
    from elevon.parameters.design.derive import Values

_CLOSE = 1.0 + 1e-6


def check(v: Values) -> None:
    """Refuse a design that has too few numbers or some that contradict each other.

    Raises
    ------
    InputError
        Names the place, the value, the limit.
    """
    _enough(v)
    _motor(v)
    _power(v)
    _speeds(v)
    _voltage(v)
    _current(v)
    _bandwidth(v)


def _refuse(v: Values, name: str, text: str) -> None:
    raise InputError(f"{v.given.places.get(name, v.place)}: {text}")


def _enough(v: Values) -> None:
    needed = ["supply", *(["lead"] if v.linear else [])]
    missing = [name for name in needed if not v.has(name)]
    motor = v.has("motor.torque_constant") and v.has("motor.current")
    load = load_name(v)
    if not (v.has("power") or v.has(load) or motor):
        missing.append(f"power (or {load} and speed, or motor.torque_constant and motor.current)")
    if missing:
        raise InputError(f"{v.place}: [design] lacks {', '.join(missing)}")


def _motor(v: Values) -> None:
    for name in ("motor.current", "motor.peak_current"):
        if v.has(name) and not v.has("motor.torque_constant"):
            _refuse(v, name, "needs motor.torque_constant: which torque this current gives")
    if v.has("motor.peak_current") and v("control.current_limit") < v("current"):
        least = _text(v, "motor.current") if v.has("motor.current") else f"{v('current'):.4g} A"
        _refuse(
            v,
            "motor.peak_current",
            f"{_text(v, 'motor.peak_current')} is below the rated current, {least}",
        )


def _power(v: Values) -> None:
    load = load_name(v)
    if not all(v.has(name) for name in ("power", "speed", load)):
        return
    needed = v(load) * v("speed")
    if needed > useful(v) * _CLOSE:
        _refuse(
            v,
            "power",
            f"{_text(v, load)} at {_text(v, 'speed')} are {needed:.4g} W; {_text(v, 'power')} at "
            f"the motor's shaft leave {useful(v):.4g} W (efficiency {v('efficiency'):g}, a tenth "
            "to accelerate)",
        )


def _speeds(v: Values) -> None:
    if not all(v.has(name) for name in ("speed", "motor_speed", "gear")):
        return
    needed = v("speed") * turns_per_output(v)
    if needed > v("motor_speed") * _CLOSE:
        most = v("motor_speed") / turns_per_output(v)
        _refuse(
            v,
            "speed",
            f"{_text(v, 'speed')} takes {format_quantity(needed, 'rpm', 4)} of the motor, beyond "
            f"{_text(v, 'motor_speed')}: at most {_out(v, most)}",
        )


def _voltage(v: Values) -> None:
    """A given motor whose speed the supply does not give."""
    if not v.has("motor.torque_constant"):
        return
    current = v("current")
    drop, emf = v("motor.winding_resistance") * current, v("motor.emf_constant")
    coupling = v("motor.pole_pairs") * v("motor.winding_inductance") * current
    limit = phase_voltage(v)
    if drop >= limit:
        _refuse(
            v,
            "motor.resistance",
            f"the rated current takes {drop:.4g} V of a phase, the supply gives {limit:.4g} V",
        )
    speed = v("motor_speed")
    out = turns_per_output(v)
    needed = math.hypot(drop + emf * speed, coupling * speed)
    if needed > limit * _CLOSE:
        a, b, c = emf**2 + coupling**2, drop * emf, drop**2 - limit**2
        most = (-b + math.sqrt(b * b - a * c)) / a
        _refuse(
            v,
            "speed" if v.has("speed") else "motor_speed",
            f"{format_quantity(speed, 'rpm', 4)} of the motor take {needed:.4g} V of a phase, the "
            f"supply gives {limit:.4g} V: at most {format_quantity(most, 'rpm', 4)}, "
            f"{_out(v, most / out)}",
        )


def _current(v: Values) -> None:
    if not v.has("motor.current"):
        return
    needed = v("power") / v("motor_speed") / torque_constant(v("motor.emf_constant"))
    if needed > v("current") * _CLOSE:
        name = next(name for name in (load_name(v), "power", "motor.current") if v.has(name))
        _refuse(
            v,
            name,
            f"the rating takes {needed / v('current'):.4g} times the continuous current, "
            f"{_text(v, 'motor.current')}",
        )


def _bandwidth(v: Values) -> None:
    limit = v("pwm.frequency") / 20.0 / 20.0
    if v("bandwidth") > limit:
        _refuse(
            v,
            "bandwidth",
            f"{v('bandwidth'):.4g} Hz; at most {limit:.4g} Hz: the speed loop, five times as fast, "
            "must stay below a quarter of the current loop",
        )


def _text(v: Values, name: str) -> str:
    return f"{name} = {v.given.values[name].text}"


def _out(v: Values, value: float) -> str:
    return format_quantity(value, "mm/s" if v.linear else "deg/s", 4)
