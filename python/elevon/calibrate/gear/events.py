"""Down-lock and brake: where the lock acts, how far the nut runs on, what the set brake holds.

The nut's place beyond the stroke is counted from the motor; the ram shows it until it rests.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from elevon.arrays import Floats
from elevon.calibrate.gear.log import GearLog, Move
from elevon.calibrate.gear.rig import RigTest
from elevon.calibrate.gear.tables import GRAVITY, per_travel
from elevon.calibrate.level import Level

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["brake_delays", "brake_torque", "lock_travels"]

_BEFORE = (0.02, 1.0)  # s between nut and ram, over which both are held together
_DELAY = 0.5  # s: a change of the brake later than this is another one's


def lock_travels(
    logs: Sequence[GearLog], actuator: Actuator
) -> tuple[dict[str, Level], dict[str, str]]:
    """Return the nut's travel beyond the stroke at which the lock engages and lets go."""
    engaged: list[tuple[float, float]] = []
    released: list[tuple[float, float]] = []
    for log in logs:
        switch = _lock_switch(log)
        if switch is None:
            continue
        for move in log.moves:
            inside = (log.time >= move.begin) & (log.time <= move.end + 0.1)
            beyond = _beyond(log, move, actuator)
            if beyond is None:
                continue
            changed = np.flatnonzero(inside[1:] & (switch[1:] != switch[:-1])) + 1
            if len(changed):
                (engaged if move.extending else released).append(
                    _at_switch(log, beyond, int(changed[0]), actuator)
                )
    levels, reasons = {}, {}
    for path, rows in (("lock.engage_travel", engaged), ("lock.release_travel", released)):
        if rows:
            levels[path] = _joined(rows)
        else:
            direction = "extension to" if "engage" in path else "retraction from"
            reasons[path] = f"no {direction} the lock with its switch recorded"
    return levels, reasons


def _lock_switch(log: GearLog) -> npt.NDArray[np.bool_] | None:
    """The lock itself where it was recorded, else the switch on its sleeve."""
    role = "locked" if log.has("locked") else "switch_100"
    return np.asarray(log[role] > 0.5) if log.has(role) else None


def _counted(log: GearLog, actuator: Actuator) -> Floats:
    """Nut's travel by the motor: its angle where it was recorded, else the speed's integral."""
    if log.has("motor_position"):
        return log["motor_position"] / per_travel(actuator)
    speed = log["motor_speed"]
    steps = 0.5 * log.period * (speed[1:] + speed[:-1])
    return np.concatenate(([0.0], np.cumsum(steps))) / per_travel(actuator)


def _beyond(log: GearLog, move: Move, actuator: Actuator) -> tuple[Floats, Floats] | None:
    """Nut beyond the stroke [m] around one end of a move, and the deviation of its zero.

    None if the ram does not pass there.
    """
    ram, nut = log["output_position"], _counted(log, actuator)
    stroke = actuator.parameters.value("lever.stroke")
    near, far = _BEFORE
    moving = (log.time > move.begin) & (log.time < move.end)
    inside = moving & (ram < stroke - 5e-4)
    if not inside.any() or float(ram[moving].max()) < stroke - 1e-3:
        return None
    # The instant at which the ram rests at its stop, or leaves it.
    edge = float(log.time[inside][-1 if move.extending else 0])
    toward = edge - log.time if move.extending else log.time - edge
    seated_samples = inside & (toward > near) & (toward < far)
    switch = _lock_switch(log)
    seat = moving & (toward < -near)
    seat &= True if switch is None else ~switch
    if seated_samples.sum() < 20:
        return None
    seated = ram[seat] if seat.sum() > 5 else np.array([stroke])
    base, open_ = float(np.mean(seated)), float(np.std(seated)) / np.sqrt(len(seated))
    # A speed from Hall edges comes late, so that its integral lags with the speed itself.
    speed = log["motor_speed"] / per_travel(actuator)
    design = np.stack([np.ones(len(speed)), speed], axis=1)
    steady = float(np.ptp(speed[seated_samples])) < 0.2 * float(
        np.max(np.abs(speed[seated_samples]))
    )
    if log.has("motor_position") or steady:
        design = design[:, :1]
    shift, *_ = np.linalg.lstsq(design[seated_samples], (ram - nut)[seated_samples], rcond=None)
    noise = float(np.std((ram - nut)[seated_samples] - design[seated_samples] @ shift))
    inverse = noise**2 * np.linalg.inv(design[seated_samples].T @ design[seated_samples])
    std = np.sqrt(np.einsum("ij,jk,ik->i", design, inverse, design) + open_**2)
    return np.asarray(nut + design @ shift - base), np.asarray(std)


def _at_switch(
    log: GearLog, beyond: tuple[Floats, Floats], k: int, actuator: Actuator
) -> tuple[float, float]:
    """Place at which a switch acted, less its response, and what clocks and noise leave open."""
    place, open_ = beyond
    value = actuator.parameters.value
    # The unit counts whole ticks, the first of them when it first sees the change: half a tick less
    # than the delay on the mean, and half of what a sample is apart from a tick more.
    late = value("proximity.delay") + 0.5 * log.period - value("control.period")
    if log.has("locked"):
        late = 0.5 * log.period
    at = float(np.interp(log.time[k] - late, log.time, place))
    speed = abs(float(place[min(k + 1, len(place) - 1)] - place[k - 2])) / (3.0 * log.period)
    clock = float(np.hypot(log.period, value("control.period"))) / np.sqrt(12.0)
    return at, float(np.hypot(speed * clock, open_[k]))


def _joined(rows: Sequence[tuple[float, float]]) -> Level:
    values, deviations = np.array(rows).T
    weight = deviations**-2.0
    middle = float(np.sum(weight * values) / np.sum(weight))
    # Motions further apart than their deviations say something else of these (Birge's ratio).
    apart = float(np.sum(weight * (values - middle) ** 2)) / max(len(values) - 1, 1)
    return Level(abs(middle), max(1.0, apart**0.5) * float(np.sum(weight)) ** -0.5)


def brake_torque(
    tests: Sequence[RigTest], friction: Sequence[float], mass: float, actuator: Actuator
) -> Level | None:
    """Return what the set brake holds, from a rig that moves the ram against it.

    `friction` is the train's own at each test's speed.
    """
    rows = []
    for test, dry in zip(tests, friction, strict=True):
        force = test.direction * (test.level + mass * GRAVITY) - dry
        rows.append((force / per_travel(actuator), max(test.level_std, 1.0) / per_travel(actuator)))
    if not rows:
        return None
    values, deviations = np.array(rows).T
    # What the friction itself is known to.
    own_std = 0.02 * float(np.mean(friction)) / per_travel(actuator)
    spread = float(np.std(values)) if len(values) > 1 else 0.0
    std = float(np.hypot(np.max(deviations), max(own_std, spread)))
    return Level(float(np.mean(values)), std)


def brake_delays(
    logs: Sequence[GearLog], actuator: Actuator
) -> tuple[dict[str, Level], dict[str, str]]:
    """Return the brake's delays from the unit's state to the brake's own switch, if recorded."""
    tick = actuator.parameters.value("control.period")
    delays: dict[str, list[float]] = {"brake.release_delay": [], "brake.engage_delay": []}
    period = tick
    for log in logs:
        if not log.has("brake_released"):
            continue
        period = max(period, log.period)
        changes = np.flatnonzero(np.diff(log["brake_released"] > 0.5)) + 1
        for move in log.moves:
            for path, at in (("brake.release_delay", move.begin), ("brake.engage_delay", move.end)):
                later = [float(log.time[k]) - at for k in changes if log.time[k] >= at]
                if later and later[0] < _DELAY:
                    delays[path].append(later[0])
    # Both ends are recorded at a sample, and the coil counts whole ticks from the first.
    std = float(np.hypot(period / np.sqrt(6.0), tick / np.sqrt(12.0)))
    levels = {
        path: Level(float(np.mean(rows)) + 0.5 * tick, std / np.sqrt(len(rows)))
        for path, rows in delays.items()
        if rows
    }
    why = "no switch of the brake is recorded, and the ram runs on by less than half a millimetre"
    return levels, {path: why for path in delays if path not in levels}
