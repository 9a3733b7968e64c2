"""Which columns are positions, speeds and their set points: one integrates to the other, one leads.

A position is the integral of its speed; the factor between the two settles unit or ratio. A
command is of the size of what follows it, and earlier.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import permutations

import numpy as np

from elevon.arrays import Floats
from elevon.estimate.signals import integral
from elevon.logs.maps.agreement import slope_and_fit
from elevon.units import parse_unit

Candidates = Mapping[str, tuple[str, str, Floats]]
_INTEGRAL = 0.9  # share of a position that the integral of its speed explains
_FOLLOWS = 0.5  # share of a signal that its delayed set point explains
_SAME = 0.02  # relative: a factor nearer one than this is one
_ONE_SHAFT = 0.1  # as `_SAME` where headers state both units: a noisy speed is no gear
_FAR_LESS = 0.67  # share of the motor's travel, at most, of an output behind a gear
_LINEAR = {"mm": "mm/s", "m": "m/s", "cm": "cm/s", "um": "um/s"}
_ANGULAR = {"rad": "rad/s", "deg": "deg/s", "rev": "rev/s"}
_LONGEST = 1.0  # s: latest that an output follows its command
_MOST_LAGS = 200


@dataclass(slots=True)
class ColumnFinding:
    """What the data say of one column."""

    role: str = ""
    unit: str = ""
    sign: int = 1
    reasons: list[str] = field(default_factory=list)


@dataclass(slots=True)
class MotionColumns:
    """What moves in a log.

    Attributes
    ----------
    findings : dict of str to ColumnFinding
        By column.
    position, speed : str or None
        The columns of the pair that fits best.
    smooth : ndarray, shape (n,)
        The position in the file's unit.
    gear_ratio, travel_per_turn : float or None
        Between the two, where they are on different shafts; m for one turn.
    swapped : (str, str) or None
        Columns of motor and output whose headers name the other.
    """

    findings: dict[str, ColumnFinding] = field(default_factory=dict)
    position: str | None = None
    speed: str | None = None
    smooth: Floats = field(default_factory=lambda: np.zeros(0))
    gear_ratio: float | None = None
    travel_per_turn: float | None = None
    swapped: tuple[str, str] | None = None


def find_motion(time: Floats, candidates: Candidates) -> MotionColumns:
    """Find positions, speeds and set points.

    Parameters
    ----------
    time : ndarray, shape (n,)
        s.
    candidates : mapping of str to (role, unit, values)
        Role and unit as the header says, empty where it does not; values without holes.
    """
    motion = MotionColumns()
    pair = _best_pair(time, candidates)
    if pair is None:
        named = next((n for n, c in candidates.items() if c[0] == "output_position"), None)
        if named is None:
            return motion
        motion.position, motion.smooth = named, candidates[named][2]
        _unit_of_position(motion, named, candidates)
    else:
        motion.position, motion.speed, slope, explained = pair
        motion.smooth = candidates[motion.position][2]
        _settle(motion, candidates, slope, explained)
    _set_point(time, candidates, motion, motion.position, "command")
    if motion.speed is not None:
        _set_point(time, candidates, motion, motion.speed, "speed_ref")
    return motion


def _best_pair(time: Floats, candidates: Candidates) -> tuple[str, str, float, float] | None:
    """Return the position and speed that fit best, the slope, and the share explained."""
    best = None
    for position, speed in permutations(candidates, 2):
        roles = candidates[position][0], candidates[speed][0]
        if roles[0] in {"command", "motor_speed", "output_speed", "speed_ref"}:
            continue
        if roles[1] in {"command", "output_position", "motor_position", "speed_ref"}:
            continue
        turned = integral(time, candidates[speed][2])
        slope, explained = slope_and_fit(turned, candidates[position][2])
        if explained > _INTEGRAL and (best is None or explained > best[3]):
            best = (position, speed, slope, explained)
    return best


def _settle(motion: MotionColumns, candidates: Candidates, slope: float, explained: float) -> None:
    """Settle units, sign and ratio of the pair."""
    assert motion.position is not None
    assert motion.speed is not None
    position, speed = ColumnFinding(), ColumnFinding()
    motion.findings |= {motion.position: position, motion.speed: speed}
    position.reasons.append(
        f"the integral of {motion.speed!r} explains {100 * explained:.1f} % of it"
    )
    speed.reasons.append(f"{motion.position!r} is its integral, times {slope:.4g}")
    if slope < 0.0:
        speed.sign = -1
        speed.reasons.append("runs in the other direction")
    units = (candidates[motion.position][1], candidates[motion.speed][1])
    position.unit, speed.unit = _pair_units(*units, abs(slope), speed.reasons)
    hint = candidates[motion.position][0]
    linear = parse_unit(position.unit).dimension[0] == 1
    position.role = hint if hint == "motor_position" and not linear else "output_position"
    factor = abs(slope) * parse_unit(position.unit).factor / parse_unit(speed.unit).factor
    if parse_unit(speed.unit).dimension[0] == 1:
        speed.role = "output_speed"
    elif linear:
        speed.role = "motor_speed"
        motion.travel_per_turn = 2.0 * math.pi * factor
        speed.reasons.append(f"{1e3 * motion.travel_per_turn:.4g} mm of travel for one turn")
    else:
        speed.role = "motor_speed"
        if abs(math.log(factor)) < (_ONE_SHAFT if all(units) else _SAME):
            position.role = hint or "motor_position"
            if hint == "output_position":
                _swap(motion, candidates)
        elif hint == "motor_position":  # on one shaft there is no ratio: one of the two is wrong
            speed.reasons.append("clipped, or another unit: on one shaft it would be the integral")
        else:
            motion.gear_ratio = 1.0 / factor
            speed.reasons.append(f"turns {motion.gear_ratio:.5g} times as far as the output")


def _swap(motion: MotionColumns, candidates: Candidates) -> None:
    """Give the position that moves with the motor its role, where headers name another so.

    The one named so must move far less: it is the output's.
    """
    moves = motion.position
    assert moves is not None
    named = next((n for n, c in candidates.items() if c[0] == "motor_position"), None)
    if named is None or np.ptp(candidates[named][2]) > _FAR_LESS * np.ptp(candidates[moves][2]):
        return
    motion.swapped = (moves, named)
    motion.findings[moves].role = "motor_position"
    motion.findings[moves].reasons.append(f"swapped with {named!r}: it moves as the motor does")
    motion.findings[named] = ColumnFinding(
        "output_position", candidates[named][1], 1, [f"swapped with {moves!r}: it moves less"]
    )


def _pair_units(position: str, speed: str, slope: float, reasons: list[str]) -> tuple[str, str]:
    """Return units of position and speed: stated, or those that make one the other's integral."""
    positions = (position,) if position else (*_LINEAR, *_ANGULAR)
    speeds = (speed,) if speed else (*_LINEAR.values(), *_ANGULAR.values(), "rpm")
    fits = []
    for p in positions:
        for v in speeds:
            if parse_unit(p).dimension[0] != parse_unit(v).dimension[0]:
                continue
            factor = slope * parse_unit(p).factor / parse_unit(v).factor
            if abs(math.log(factor)) < _SAME:
                fits.append((p, v))
    if fits:
        chosen = fits[0]
        if not (position and speed):
            more = ", ".join(f"{p} and {v}" for p, v in fits[1:4])
            reasons.append(
                f"{chosen[0]} and {chosen[1]} agree" + (f"; so would {more}" if more else "")
            )
        return chosen
    assumed = position or "mm", speed or "rpm"
    if not (position and speed):
        reasons.append(f"no pair of units agrees: {assumed[0]} and {assumed[1]} ASSUMED")
    return assumed


def _unit_of_position(motion: MotionColumns, name: str, candidates: Candidates) -> None:
    if not candidates[name][1]:
        motion.findings[name] = ColumnFinding(
            "output_position", "mm", reasons=["unit not stated and no speed to tell: mm ASSUMED"]
        )


def _set_point(
    time: Floats, candidates: Candidates, motion: MotionColumns, follower: str, role: str
) -> None:
    """Find what a signal follows: of its size, and earlier; a header that says so comes first."""
    output = candidates[follower][2]
    unit = (
        motion.findings[follower].unit if follower in motion.findings else candidates[follower][1]
    )
    kind = {"command": "position", "speed_ref": "speed"}[role]
    best, most = None, _FOLLOWS
    for name, (hint, _, values) in candidates.items():
        if name == follower or name in motion.findings or hint not in {"", role}:
            continue
        lag, slope, explained = _lag(time, values, output)
        if hint != role and (lag < 0.0 or not 0.5 < slope < 2.0):
            continue
        if hint == role or explained > most:
            text = f"{follower!r} follows it {1e3 * lag:.3g} ms later, {slope:.3g} times its size"
            best, most = (name, text, explained), explained
        if hint == role:
            break
    if best is None:
        return
    name, text, explained = best
    stated = candidates[name][1] or unit
    finding = ColumnFinding(role, stated, reasons=[])
    finding.reasons.append(text if explained > _FOLLOWS else f"the {kind} hardly follows it")
    motion.findings[name] = finding


def _lag(time: Floats, ahead: Floats, behind: Floats) -> tuple[float, float, float]:
    """Return by how much (s) one signal is behind another, the slope and the share explained."""
    step = float(np.median(np.diff(time)))
    most = min(int(_LONGEST / step), len(time) // 4)
    stride = max(1, 2 * most // _MOST_LAGS)
    best = (0.0, 0.0, -1.0)
    for shift in range(-(most // 4), most + 1, stride):
        a = ahead[: len(ahead) - shift] if shift >= 0 else ahead[-shift:]
        b = behind[shift:] if shift >= 0 else behind[: len(behind) + shift]
        slope, explained = slope_and_fit(a, b)
        if explained > best[2] + 1e-9:
            best = (shift * step, slope, explained)
    return best
