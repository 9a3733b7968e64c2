"""Motions of an actuator with a control unit, and what a rig that moves its ram shows of friction.

At a constant speed the load cell shows ``d F(v) - m g`` (d: direction), and what repeats over the
pitch. Free fall (the stages apart) shows the screw side, modified free fall (the motor turns, its
brake open) the whole train, and a set brake what it holds.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.context import motor_ratio
from elevon.estimate import Estimate
from elevon.estimate.covariance import block_covariance
from elevon.estimate.regression import huber
from elevon.logs.log import Log, per_log

#: States of the control unit that mean a motion, and the state it ends in.
EXTENDING, LOCKED, RETRACTING = 1, 2, 3
_RIG_MOTION = 2e-3  # m at least that a rig has moved the ram
_FOLLOWS = 0.5  # of the ram's speed: a motor that turns with it
_RESTS = 0.02  # of the highest speed, below which a motor rests
_SHORTEST = 0.5  # s of a motion
_DRIVEN = 1.0  # A that drive a motor


@dataclass(frozen=True)
class Move:
    """One motion under the unit's drive: direction, begin and end [s], and what it ended in."""

    extending: bool
    begin: float
    end: float
    after: int | None

    @property
    def direction(self) -> float:
        """1 extending, -1 retracting."""
        return 1.0 if self.extending else -1.0


@per_log
def moves_of(log: Log) -> tuple[Move, ...]:
    """Motions under drive, by the unit's state if recorded, else by speed and current."""
    if not log.has("state"):
        return _by_speed(log)
    state = np.rint(log["state"]).astype(int)
    edges = np.concatenate(([0], np.flatnonzero(np.diff(state)) + 1, [len(state)]))
    moves = []
    for first, last in itertools.pairwise(edges.tolist()):
        if state[first] not in (EXTENDING, RETRACTING):
            continue
        after = int(state[last]) if last < len(state) else None
        ends = float(log.time[min(last, len(state) - 1)])
        moves.append(Move(state[first] == EXTENDING, float(log.time[first]), ends, after))
    return tuple(moves)


def _by_speed(log: Log) -> tuple[Move, ...]:
    """Motions between two rests in which a current drove the motor: no rig moved it."""
    if not log.has("torque_current"):
        return ()
    speed, time = log["motor_speed"], log.time
    moving = np.abs(speed) > _RESTS * float(np.max(np.abs(speed)))
    edges = np.concatenate(([0], np.flatnonzero(np.diff(moving)) + 1, [len(moving)]))
    moves = []
    for first, last in itertools.pairwise(edges.tolist()):
        long = time[last - 1] - time[first] > _SHORTEST
        driven = np.median(np.abs(log["torque_current"][first:last])) > _DRIVEN
        if moving[first] and long and driven:
            direction = bool(np.mean(speed[first:last]) > 0.0)
            moves.append(Move(direction, float(time[first]), float(time[last - 1]), None))
    return tuple(moves)


@per_log
def rig_moves(log: Log) -> bool:
    """Whether a rig moved the ram: a load cell, motion at one speed, and no drive."""
    if not log.has("load_cell") or moves_of(log):
        return False
    return float(np.ptp(log["output_position"])) > _RIG_MOTION


def connected(log: Log, per_travel: float) -> bool:
    """Whether the motor turned with the ram that a rig moved."""
    span = float(log.time[-1])
    ram = float(np.ptp(log["output_position"])) / span
    motor = abs(float(np.mean(log["motor_speed"]))) / per_travel
    return motor > _FOLLOWS * ram


HARMONICS = 5
_SETTLED = 0.3  # s left out: the rig's start
_BAND = 0.25  # of the log's rate: a detent above it is damped by the recorder's filter
_BLOCKS = 12
_TRIES = 41  # frequencies of the detent that are tried, within what the speed leaves open


@dataclass(frozen=True)
class RigTest:
    """One run of the rig.

    Attributes
    ----------
    log : str
        Name.
    kind : str
        ``ff``, ``ffm`` or ``brake``.
    speed : float
        Of the ram, signed [m/s].
    level, level_std : float
        Mean force of the cell and its deviation [N].
    harmonics, harmonics_std : ndarray, shape (HARMONICS,)
        Amplitudes over the pitch, positive with the resistance [N].
    detent, detent_std : float or None
        Amplitude of the detent at the ram [N], where the log's rate shows it.
    """

    log: str
    kind: str
    speed: float
    level: float
    level_std: float
    harmonics: Floats
    harmonics_std: Floats
    detent: float | None
    detent_std: float | None

    @property
    def direction(self) -> float:
        """1 extending, -1 retracting."""
        return float(np.sign(self.speed))


def rig_tests(logs: Sequence[Log], actuator: Actuator) -> list[RigTest]:
    """Evaluate the logs in which a rig moved the ram; others are passed over."""
    return [_test(log, actuator) for log in logs if rig_moves(log)]


def _kind(log: Log, per_travel: float) -> str:
    if not connected(log, per_travel):
        return "ff"
    powered = str(log.stand.parameters.get("brake.powered") or "always")
    return "ffm" if powered == "always" else "brake"


def _test(log: Log, actuator: Actuator) -> RigTest:
    per_travel = motor_ratio(actuator)
    pitch = 2.0 * np.pi * actuator.parameters.value("screw.lead")
    kind = _kind(log, per_travel)
    used = log.time >= _SETTLED
    time, force = log.time[used], log["load_cell"][used]
    # The rig's speed is constant: a straight line is quieter than the position itself.
    slope, offset = np.polyfit(time, log["output_position"][used], 1)
    direction = float(np.sign(slope))
    turn = 2.0 * np.pi * (slope * time + offset) / pitch
    columns = [np.ones_like(time)]
    columns += [direction * np.cos(n * turn) for n in range(1, HARMONICS + 1)]
    frequency = actuator.parameters.value("motor.detent_periods") * abs(slope) * per_travel
    visible = kind != "ff" and 0.0 < frequency / (2.0 * np.pi) < _BAND / log.period
    if visible:
        tone = _tone(time, force, np.stack(columns, axis=1), frequency)
        columns += [np.cos(tone * time), np.sin(tone * time)]
    design = np.stack(columns, axis=1)
    value, residual, _ = huber(design, force)
    blocks = np.arange(len(force)) * _BLOCKS // len(force)
    covariance, _ = block_covariance(
        design.T @ design, design * residual[:, None], blocks, counted=1
    )
    std = np.sqrt(np.diag(covariance))
    size = (float(np.hypot(*value[-2:])), float(np.mean(std[-2:]))) if visible else (None, None)
    part = slice(1, HARMONICS + 1)
    return RigTest(
        log.name, kind, float(slope), float(value[0]), float(std[0]), value[part], std[part], *size
    )


def _tone(time: Floats, force: Floats, design: Floats, frequency: float) -> float:
    """Frequency of the detent: what the line through the position leaves open decides the phase."""
    residual = force - design @ np.linalg.lstsq(design, force, rcond=None)[0]
    width = 2.0 * np.pi / float(np.ptp(time))
    tries = frequency + np.linspace(-width, width, _TRIES)
    power = [abs(np.exp(-1j * w * time) @ residual) for w in tries]
    best = int(np.argmax(power))
    if not 0 < best < _TRIES - 1:
        return float(tries[best])
    a, b, c = power[best - 1 : best + 2]
    return float(tries[best] + 0.5 * (a - c) / (a - 2.0 * b + c) * (tries[1] - tries[0]))


KNOTS = 8
GRAVITY = 9.80665
_SEEN = 0.98  # resolution from which a knot is determined by tests
_BELIEF = 0.3  # of a table's value, as a deviation: what holds a knot that no test reaches
_SHAPE = 2.5e-4  # of a table's value: what a table of straight pieces leaves between its knots


#: Path to value.
Knot = dict[str, Estimate]


def knots(actuator: Actuator) -> Floats:
    """Return the speeds of the tables, m/s."""
    value = actuator.parameters.value
    return np.array([value(f"friction.speed_{k}") for k in range(1, KNOTS + 1)])


def hats(speed: Floats, at: Floats) -> Floats:
    """Return the weight of each knot at some speeds, shape (n, KNOTS): linear, held outside."""
    return np.stack([np.interp(np.abs(speed), at, row) for row in np.eye(len(at))], axis=1)


def hanging_mass(tests: Sequence[RigTest]) -> Estimate | None:
    """Mass that hangs from the cell, from tests in both directions at several levels of friction.

    Half the sum of both directions is the weight, and half of what friction differs: that part
    grows with the friction, the weight does not.
    """
    pairs = []
    for test in tests:
        back = [
            t for t in tests
            if t.kind == test.kind and test.speed > 0.0 > t.speed
            and abs(t.speed + test.speed) < 0.02 * test.speed
        ]  # fmt: skip
        pairs += [(0.5 * (test.level + t.level), 0.5 * (test.level - t.level)) for t in back[:1]]
    if len(pairs) < 4:
        return None
    middle, size = np.array(pairs).T
    if float(np.ptp(size)) < 0.2 * float(np.mean(size)):
        return None
    design = np.stack([np.ones_like(size), size], axis=1)
    value, *_ = np.linalg.lstsq(design, middle, rcond=None)
    residual = middle - design @ value
    degrees = len(pairs) - 2
    spread = float(residual @ residual) / degrees
    std = float(np.sqrt(spread * np.linalg.inv(design.T @ design)[0, 0]))
    return Estimate(-float(value[0]) / GRAVITY, max(std / GRAVITY, 1e-3), degrees)


def friction_knots(
    tests: Sequence[RigTest], actuator: Actuator, mass: Estimate
) -> tuple[Knot, dict[str, str]]:
    """Return the knots of both tables that the tests determine, and why the others are not."""
    rows = []
    for kind in ("ff", "ffm"):
        for name, direction in (("extension", 1.0), ("retraction", -1.0)):
            mine = [t for t in tests if t.kind == kind and t.direction == direction]
            forces = [t.direction * (t.level + mass.value * GRAVITY) for t in mine]
            deviations = [np.hypot(t.level_std, _SHAPE * abs(t.level)) for t in mine]
            rows.append((f"friction.{kind}_{name}", mine, forces, deviations))
    levels, reasons = _tables(rows, actuator)
    weight = mass.std * GRAVITY  # the mass moves a whole table
    return {
        path: Estimate(item.value, float(np.hypot(item.std, weight)), mass.degrees)
        for path, item in levels.items()
    }, reasons


def harmonic_knots(tests: Sequence[RigTest], actuator: Actuator) -> tuple[Knot, dict[str, str]]:
    """Return the knots of the harmonics that the tests determine, and why not the others."""
    mine, rows = [t for t in tests if t.kind in ("ff", "ffm")], []
    for n in range(1, HARMONICS + 1):
        amplitudes = [t.harmonics[n - 1] for t in mine]
        deviations = [np.hypot(t.harmonics_std[n - 1], 0.02) for t in mine]
        rows.append((f"friction.harmonic_{n}", mine, amplitudes, deviations))
    return _tables(rows, actuator)


def _tables(
    rows: Sequence[tuple[str, Sequence[RigTest], list[float], list[float]]], actuator: Actuator
) -> tuple[Knot, dict[str, str]]:
    """Return the knots of tables: of each its name, tests, values, deviations."""
    determined: Knot = {}
    reasons: dict[str, str] = {}
    for name, tests, values, deviations in rows:
        paths = [f"{name}_{k}" for k in range(1, KNOTS + 1)]
        levels, missing = _table(paths, tests, np.array(values), np.array(deviations), actuator)
        determined |= levels
        reasons |= missing
    return determined, reasons


def _table(
    paths: Sequence[str],
    tests: Sequence[RigTest],
    values: Floats,
    deviation: Floats,
    actuator: Actuator,
) -> tuple[Knot, dict[str, str]]:
    """Weighted least squares over the knots, each held weakly by the value of the actuator file."""
    if not tests:
        return {}, dict.fromkeys(paths, "no rig test of this kind and direction")
    at = knots(actuator)
    prior = np.array([actuator.parameters.value(path) for path in paths])
    belief = _BELIEF * np.maximum(prior, 0.1 * float(prior.max()) + 1e-9)
    design = hats(np.array([t.speed for t in tests]), at) / deviation[:, None]
    normal = design.T @ design
    inverse = np.linalg.inv(normal + np.diag(belief**-2.0))
    value = prior + inverse @ (design.T @ (values / deviation - design @ prior))
    seen = np.diag(inverse @ normal)
    residual = values / deviation - design @ value
    degrees = max(len(tests) - int(np.sum(seen > _SEEN)), 1)
    inflation = max(1.0, float(residual @ residual) / degrees)
    levels, missing = {}, {}
    for k, path in enumerate(paths):
        if seen[k] > _SEEN:
            levels[path] = Estimate(
                max(float(value[k]), 0.0), float(np.sqrt(inverse[k, k] * inflation))
            )
        else:
            missing[path] = f"no rig test at or beside {1e3 * at[k]:.4g} mm/s"
    return levels, missing
