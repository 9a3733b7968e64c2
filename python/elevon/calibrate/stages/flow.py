"""One flow for every actuator: stages in their order, each uses what the ones before determined."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.outcome import Calibration
from elevon.calibrate.stages import loops, screw
from elevon.calibrate.stages.context import Context, motor_ratio, run_stages, stages_of
from elevon.calibrate.stages.drive import drive
from elevon.calibrate.stages.heat import heat
from elevon.calibrate.stages.loops import loops_by_current
from elevon.calibrate.stages.rig import (
    GRAVITY,
    KNOTS,
    Move,
    RigTest,
    friction_knots,
    hanging_mass,
    harmonic_knots,
    hats,
    knots,
    moves_of,
    rig_moves,
    rig_tests,
)
from elevon.data import packaged_toml
from elevon.errors import InputError, unknown
from elevon.estimate import Estimate
from elevon.estimate.number import weighted_mean
from elevon.logs.log import Log
from elevon.parameters.records import record_of, records
from elevon.progress import Progress
from elevon.threads import one_blas_thread

_MASS = "screw.moving_mass"


def friction(ctx: Context) -> None:
    """Evaluate the logs in which a rig moved the ram."""
    tests = rig_tests(ctx.logs, ctx.actuator)
    mass = hanging_mass([test for test in tests if test.kind != "brake"])
    why = "too few rig tests in both directions at different levels of friction"
    ctx.add({} if mass is None else {_MASS: mass}, {_MASS: why})
    given = ctx.given_value(_MASS)
    ctx.add(*friction_knots(tests, ctx.actuator, mass or Estimate(given, 0.1 * given)))
    ctx.add(*harmonic_knots(tests, ctx.actuator))
    why = "no slow rig test with the motor connected shows it below the recorder's filter"
    ctx.add(_detent(tests, ctx.ratio), {"motor.detent_torque": why})


def _detent(tests: list[RigTest], ratio: float) -> dict[str, Estimate]:
    """Detent torque at the motor, over all tests that show it."""
    pairs = [
        (test.detent / ratio, test.detent_std / ratio)
        for test in tests
        if test.detent is not None and test.detent_std is not None
    ]
    if not pairs:
        return {}
    sizes, deviations = np.array(pairs).T
    spread = float(np.std(sizes)) / np.sqrt(max(len(sizes) - 1, 1)) if len(sizes) > 1 else 0.0
    std = float(np.hypot(np.mean(deviations) / np.sqrt(len(sizes)), spread))
    size = Estimate(float(np.mean(sizes)), std, max(len(sizes) - 1, 1))
    return {"motor.detent_torque": size}


_BEFORE = (0.02, 1.0)  # s between nut and ram, over which both are held together
_DELAYS = ("brake.release_delay", "brake.engage_delay")
_DELAY = 0.5  # s: a change of the brake later than this is another one's


def travels(ctx: Context) -> None:
    """The nut's travel beyond the stroke at which the lock engages and lets go."""
    engaged: list[tuple[float, float]] = []
    released: list[tuple[float, float]] = []
    for log in ctx.logs:
        switch = _lock_switch(log)
        if switch is None:
            continue
        for move in moves_of(log):
            inside = (log.time >= move.begin) & (log.time <= move.end + 0.1)
            beyond = _beyond(log, move, ctx.actuator)
            if beyond is None:
                continue
            changed = np.flatnonzero(inside[1:] & (switch[1:] != switch[:-1])) + 1
            if len(changed):
                (engaged if move.extending else released).append(
                    _at_switch(log, beyond, int(changed[0]), ctx.actuator)
                )
    for path, rows in (("lock.engage_travel", engaged), ("lock.release_travel", released)):
        direction = "extension to" if "engage" in path else "retraction from"
        why = f"no {direction} the lock with its switch recorded"
        mean, std = weighted_mean(rows) if rows else (0.0, 0.0)
        ctx.add({path: Estimate(abs(mean), std)} if rows else {}, {path: why})


def _lock_switch(log: Log) -> Bools | None:
    """The lock itself where it was recorded, else the switch on its sleeve."""
    role = "locked" if log.has("locked") else "switch_100"
    return np.asarray(log[role] > 0.5) if log.has(role) else None


def _counted(log: Log, actuator: Actuator) -> Floats:
    """Nut's travel by the motor: its angle where it was recorded, else the speed's integral."""
    if log.has("motor_position"):
        return log["motor_position"] / motor_ratio(actuator)
    speed = log["motor_speed"]
    steps = 0.5 * log.period * (speed[1:] + speed[:-1])
    return np.concatenate(([0.0], np.cumsum(steps))) / motor_ratio(actuator)


def _beyond(log: Log, move: Move, actuator: Actuator) -> tuple[Floats, Floats] | None:
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
    speed = log["motor_speed"] / motor_ratio(actuator)
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
    log: Log, beyond: tuple[Floats, Floats], k: int, actuator: Actuator
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


def brake(ctx: Context) -> None:
    """What the set brake holds, from a rig that moves the ram against it; its delays."""
    ratio, mass = ctx.ratio, ctx.value("screw.moving_mass")
    rows = []
    for test in rig_tests(ctx.logs, ctx.actuator):
        if test.kind == "brake":
            dry = _friction(ctx, test)
            force = test.direction * (test.level + mass * GRAVITY) - dry
            rows.append((force / ratio, max(test.level_std, 1.0) / ratio, dry / ratio))
    why = "no rig test against the set brake, and a stop is too short for its slope"
    ctx.add({"brake.torque": _holding(rows)} if rows else {}, {"brake.torque": why})
    why = "no switch of the brake is recorded, and the ram runs on by less than half a millimetre"
    ctx.add(_delays(ctx), dict.fromkeys(_DELAYS, why))


def _friction(ctx: Context, test: RigTest) -> float:
    """Return the whole train's friction at a test's speed, without the brake [N]."""
    direction = "extension" if test.direction > 0.0 else "retraction"
    table = [ctx.value(f"friction.ffm_{direction}_{k}") for k in range(1, KNOTS + 1)]
    return float((hats(np.array([test.speed]), knots(ctx.actuator)) @ np.array(table))[0])


def _holding(rows: Sequence[tuple[float, float, float]]) -> Estimate:
    """Torque of the brake, by rows of torque, deviation and the train's own."""
    values, deviations, dry = np.array(rows).T
    # What the friction itself is known to.
    own_std = 0.02 * float(np.mean(dry))
    spread = float(np.std(values)) if len(values) > 1 else 0.0
    return Estimate(
        float(np.mean(values)), float(np.hypot(np.max(deviations), max(own_std, spread)))
    )


def _delays(ctx: Context) -> dict[str, Estimate]:
    """Delays from the unit's state to the brake's own switch, if recorded."""
    tick = ctx.given_value("control.period")
    delays: dict[str, list[float]] = {path: [] for path in _DELAYS}
    period = tick
    for log in ctx.logs:
        if not log.has("brake_released"):
            continue
        period = max(period, log.period)
        changes = np.flatnonzero(np.diff(log["brake_released"] > 0.5)) + 1
        for move in moves_of(log):
            for path, at in zip(_DELAYS, (move.begin, move.end), strict=True):
                later = [float(log.time[k]) - at for k in changes if log.time[k] >= at]
                if later and later[0] < _DELAY:
                    delays[path].append(later[0])
    # Both ends are recorded at a sample, and the coil counts whole ticks from the first.
    std = float(np.hypot(period / np.sqrt(6.0), tick / np.sqrt(12.0)))
    return {
        path: Estimate(float(np.mean(rows)) + 0.5 * tick, std / np.sqrt(len(rows)))
        for path, rows in delays.items()
        if rows
    }


_FIDELITIES = ("auto", "low", "high")
_UNIT = "control.gain_extension"  # an actuator with a control unit of its own has it
_PRELOAD = "screw.efficiency_aiding"  # a preloaded screw has it


STAGES = stages_of("parts", {
    "rig": friction, "speed control": loops.unit_gains, "set points": loops.set_points,
    "drive": drive, "lock": travels, "brake": brake, "motor": screw.motor_constants,
    "load side": screw.load_side, "torque": screw.torque, "position loop": loops.position_loop,
    "speed loop": loops.speed_control, "loops by current": loops_by_current, "heat": heat,
})  # fmt: skip
_KINDS = {_UNIT: "unit", _PRELOAD: "preload"}


@one_blas_thread()
def calibrate_parts(
    logs: Sequence[Log],
    actuator: Actuator,
    *,
    free: Sequence[str] | None = None,
    fidelity: str | None = "auto",
    progress: Progress | None = None,
) -> Calibration:
    """Estimate each number from the signals that show it.

    Parameters
    ----------
    logs : sequence of Log
        Motions under drive, of a friction rig, or long ones with temperatures.
    actuator : Actuator
        Values before; those that are not estimated stay.
    free : sequence of str, optional
        Paths to estimate; default: all that the logs determine.
    fidelity : {"auto", "low", "high"}, optional
        Of the runs of the logs' motions that correct the balances of an actuator with a control
        unit; ``auto``: the switching model where the logs have its ripple, else the reduced-order
        one. None: no runs are made.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Raises
    ------
    InputError
        No log, an unknown fidelity, nothing determined, or a path requested that the logs do not
        determine.
    Interrupted
        `progress` returned False.
    """
    if not logs:
        raise InputError("calibration needs at least one log")
    if fidelity not in {None, *_FIDELITIES}:
        raise unknown("fidelity", str(fidelity), _FIDELITIES, "--fidelity")
    for path in free or ():
        record_of(actuator.wiring, path, "--free")
    context = Context(logs, actuator, fidelity=fidelity, progress=progress)
    _run(context)
    estimates, undetermined = context.answer(free)
    values: dict[str, str | float] = {item.path: item.value for item in estimates}
    fitted = actuator.with_values(values, source="calibration")
    return context.calibration(fitted, estimates, undetermined)


def _run(context: Context) -> None:
    """Run the stages that serve this actuator."""
    known = records(context.actuator.wiring)
    for kind in (_KINDS[path] for path in _KINDS if path in known):
        unseen = packaged_toml("elevon.calibrate.stages", "unseen.toml")[kind]
        context.reasons |= unseen["never"]
        context.given |= {path: tuple(paths) for path, paths in unseen["given"].items()}
    if _UNIT in known:
        context.facts["kinds"] = {
            log.name: "rig" if rig_moves(log) else "motion" if moves_of(log) else "rest"
            for log in context.logs
        }
    run_stages(STAGES, context, 0.05, 0.95)
