"""Sensors of the stand that contradict what stands beside them: of force, heat, vibration.

A fault of the actuator moves what the actuator does; it does not change what two sensors of one
quantity say of each other. So the load cell is held against the stand's own force, a thermocouple
against the other one and against what silicon and copper can be, an accelerometer against its own
recorder. Each number has its healthy unit in the baselines of the same test.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import Cause, FaultPlace
from elevon.diagnose.signs import EVERYTHING, Sign, sign_of

if TYPE_CHECKING:
    from elevon.logs.log import Log

PLACE = "stand"
GAIN = 0.01
"""Least change of a load cell's gain that is told; ASSUMED: the class of a cell in use."""
FORCE = 0.005
"""The same of its offset, over the force's size."""
KELVIN = 3.0
"""The same of a thermocouple's offset [K]: class 2 of type K is 2.5 K; ASSUMED."""
RANGE = (200.0, 500.0)
"""K beyond which a thermocouple on a motor says nothing of the motor."""
_DEVIATIONS = 4.0
_FOLLOWS = 0.2  # of a force's spread: what the cell of a healthy stand may miss it by
_BLOCKS = 12  # stretches from which a regression's deviation is taken
_FLAT = 0.2  # of the baseline's noise: below it a channel does not move
_ISOLATED = (
    "a sensor of the stand contradicts another one of it, which no fault of the actuator does"
)
_THERMOCOUPLES = ("surface_temperature", "nut_temperature")


def stand_signs(log: Log, baselines: Sequence[Log]) -> list[Sign]:
    """Return the stand's sensors that contradict the others in a log, against healthy ones.

    Parameters
    ----------
    log : Log
        Of the unit.
    baselines : sequence of Log
        Of the same test on a healthy unit and stand.
    """
    healthy = [item for item in baselines if item.has(*_present(log)) and _witnessed(item)]
    if not healthy:
        return []
    return _silent(log, healthy) or _load_cell(log, healthy) or _thermocouples(log, healthy)


def _sign(
    kind: str,
    channel: str,
    unit: str,
    *,
    seen: tuple[float, float],
    size: float = 1.0,
    deviation: float = 0.0,
    or_else: str = "",
) -> Sign:
    """Return the sign of a channel: what is seen of it, over the limit; 1 of what is there or not.

    `or_else` is the role that says the same with the other sign. A load that may be wrong moves all
    that is read with it.
    """
    both = (FaultPlace(kind, f"{PLACE}.{or_else}"),) if or_else else ()
    interval = (size - 1.645 * deviation, size + 1.645 * deviation)
    cause = Cause(kind, f"{PLACE}.{channel}", unit, 0.0, size, interval, both)
    moves = EVERYTHING if "load" in (channel, or_else) else (channel,)
    return sign_of(cause, *seen, moves=moves, text=_ISOLATED, error=deviation)


def _present(log: Log) -> list[str]:
    return [role for role in ("load_cell", "load", *_THERMOCOUPLES, "vibration") if log.has(role)]


def _witnessed(log: Log) -> bool:
    """Tell whether a log's load cell follows the stand's force; without a cell there is no doubt.

    A cell that measures something else, such as a friction rig's, has no witness here.
    """
    if not log.has("load_cell"):
        return True
    if not log.has("load", "motor_speed"):
        return False
    (gain, *_), _ = _regression(log)
    off = float(np.std(log["load_cell"] - gain * log["load"]))
    return 0.5 < gain < 2.0 and off < _FOLLOWS * float(np.std(log["load"]))


def _roughness(values: Floats) -> float:
    """Return the size of what changes from sample to sample."""
    return float(np.median(np.abs(np.diff(values))))


def _silent(log: Log, healthy: Sequence[Log]) -> list[Sign]:
    """Return channels that do not move although the baseline's do, or that cannot be."""
    suspects = []
    for role in _present(log):
        if role == "load":
            continue
        values = log[role]
        usual = min(float(np.std(item[role])) for item in healthy)
        noise = min(_roughness(item[role]) for item in healthy)
        level = float(np.median(values))
        if role in _THERMOCOUPLES and not RANGE[0] < level < RANGE[1]:
            warm = float(np.median(healthy[0][role]))
            suspects.append(_sign("dead", role, "1", seen=(abs(level - warm), KELVIN)))
        elif usual > 5.0 * noise and float(np.std(values)) < _FLAT * usual:
            kind = "dead" if abs(level) < 3.0 * noise else "stuck"
            quieter = float(np.log(usual / max(float(np.std(values)), 1e-3 * _FLAT * usual)))
            seen = (quieter, float(-np.log(_FLAT)))
            suspects.append(_sign(kind, role, "1", seen=seen))
    return suspects


def _load_cell(log: Log, healthy: Sequence[Log]) -> list[Sign]:
    """Regress the cell on the stand's force, inertia and friction of the load side."""
    if not log.has("load_cell", "load", "motor_speed"):
        return []
    here, spread = _regression(log)
    others = np.array([_regression(item)[0] for item in healthy])
    usual = others.mean(axis=0)
    deviation = np.hypot(spread, np.std(others, axis=0))
    gain, offset = float(here[0] / usual[0] - 1.0), float(here[1] - usual[1])
    error, seen = float(deviation[0] / usual[0]), (abs(float(here[0] / usual[0] - 1.0)), GAIN)
    if abs(gain) > max(GAIN, _DEVIATIONS * error):
        cell, force = (_torque_moved(log, healthy, role) for role in ("load_cell", "load"))
        if cell < 0.5 * abs(gain) < force:  # the motor agrees with the cell
            size = 1.0 / (1.0 + gain) - 1.0
            return [_sign("gain", "load", "1", seen=seen, size=size, deviation=error)]
        other = "" if force < 0.5 * abs(gain) < cell else "load"
        return [
            _sign("gain", "load_cell", "1", seen=seen, size=gain, deviation=error, or_else=other)
        ]
    least = FORCE * float(np.sqrt(np.mean(log["load"] ** 2)))
    if abs(offset) > max(least, _DEVIATIONS * deviation[1]):
        error, seen = float(deviation[1]), (abs(offset), least)
        return [
            _sign(
                "offset", "load_cell", "N", seen=seen, size=offset, deviation=error, or_else="load"
            )
        ]
    return []


def _torque_moved(log: Log, healthy: Sequence[Log], role: str) -> float:
    """Return by what share the motor's current a force has changed; infinite without current."""
    if not log.has("torque_current"):
        return float("inf")
    slopes = [np.polyfit(item[role], item["torque_current"], 1)[0] for item in (log, *healthy)]
    usual = float(np.mean(slopes[1:]))
    return abs(float(slopes[0]) / usual - 1.0) if usual != 0.0 else float("inf")


def _regression(log: Log) -> tuple[Floats, Floats]:
    """Return gain, offset and what the load side adds, and their deviations over stretches."""
    speed = log["motor_speed"]
    design = np.column_stack(
        [log["load"], np.ones(len(speed)), np.gradient(speed, log.time),
         np.tanh(speed / max(0.05 * float(np.abs(speed).max()), 1e-9))]
    )  # fmt: skip
    scale = np.abs(design).max(axis=0) + 1e-12
    whole = np.linalg.lstsq(design / scale, log["load_cell"], rcond=None)[0] / scale
    left = log["load_cell"] - design @ whole
    inverse = np.linalg.pinv((design / scale).T @ (design / scale))
    parts = np.array_split(np.arange(len(speed)), _BLOCKS)
    scores = np.array([(design[p] / scale).T @ left[p] for p in parts])
    spread = np.sqrt(np.diag(inverse @ (scores.T @ scores) @ inverse)) / scale
    return whole, spread


def _thermocouples(log: Log, healthy: Sequence[Log]) -> list[Sign]:
    """Compare both at the log's beginning, where a stand that has rested is as warm as its air."""
    if not log.has(*_THERMOCOUPLES):
        return []
    first = {role: _begin(log, role) for role in _THERMOCOUPLES}
    usual = {role: np.array([_begin(item, role) for item in healthy]) for role in _THERMOCOUPLES}
    apart = first[_THERMOCOUPLES[0]] - first[_THERMOCOUPLES[1]]
    before = usual[_THERMOCOUPLES[0]] - usual[_THERMOCOUPLES[1]]
    offset = float(apart - before.mean())
    if abs(offset) < KELVIN:
        return []
    # The one that left what both were before; of a warmer day both do.
    moved = [abs(first[role] - float(usual[role].mean())) for role in _THERMOCOUPLES]
    at = int(np.argmax(moved))
    role, other = _THERMOCOUPLES[at], _THERMOCOUPLES[1 - at]
    alone = min(moved) < 0.5 * KELVIN
    size = offset if at == 0 else -offset
    error = float(np.hypot(0.1, np.std(before)))
    seen, or_else = (abs(size), KELVIN), "" if alone else other
    return [_sign("offset", role, "K", seen=seen, size=size, deviation=error, or_else=or_else)]


def _begin(log: Log, role: str) -> float:
    return float(np.median(log[role][: max(10, len(log.time) // 50)]))
