"""The stage of motions under a control unit's drive: motor, train, and what runs take off them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Bools, Floats
from elevon.calibrate.stages.block_drive import (
    Constants,
    Motor,
    driving,
    motor_constants,
    torque_balance,
)
from elevon.calibrate.stages.context import Balance, Context
from elevon.calibrate.stages.rig import Move, moves_of
from elevon.calibrate.validation import as_recorded, replayed, unit_experiment
from elevon.errors import ElevonError
from elevon.estimate import Determined, Estimate
from elevon.estimate.number import as_values
from elevon.estimate.regression import with_deviations
from elevon.estimate.residual import fit_residual
from elevon.estimate.signals import local_polynomial
from elevon.logs.log import Log
from elevon.progress import Progress, part

#: Roles that this way needs.
NEEDS = ("torque_current", "motor_speed", "output_position")
#: What the set point and the demand stand on.
GIVEN = (
    "control.zero_retraction",
    "control.speed_high",
    "control.speed_low",
    "control.acceleration_limit",
)
BY_CURRENT = ("control.gain_retraction", "control.zero_retraction")
_IDLE = ("control.gain_extension", "control.zero_extension")
_WHY_IDLE = (
    "the leg drives in extension: no current answers the demand, which must be logged itself"
)
_SLOWEST = 100.0  # rad/s, below which the current lags behind the demand
_END = 0.1  # s before the end of a move
_LIMIT = 0.97  # of the link, from which the demand may be limited
_WIDTH = 0.02  # s of the polynomial that gives the current's slope
_FEWEST = 300  # samples
_LATE = 0.3  # s by which a begin may be off
_ZERO = 1.3  # ratio of zeros between which the product is the same but for its deviation
_VOLTS = 0.05  # V, from which a residual weighs less
_GAIN_ROUNDS = 6  # of the share of the time in which the bridge is on


@dataclass(frozen=True)
class _Ramp:
    """A move's samples, what the unit must have demanded, and where its set point changes."""

    log: Log
    used: Bools
    demand: Floats
    begin: float
    slows: float
    open: float

    def set_point(self, actuator: Actuator, begin: float, slows: float) -> Floats:
        """Speed set point as a size [rad/s], for shifts of its begin and of its slowing [s]."""
        value = actuator.parameters.value
        slope, time = value("control.acceleration_limit"), self.log.time
        high, low = value("control.speed_high"), value("control.speed_low")
        rises = np.minimum(high, slope * np.maximum(time - self.begin - begin, 0.0))
        falls = high - slope * np.maximum(time - self.slows - slows, 0.0)
        return np.asarray(np.minimum(rises, np.maximum(falls, low)))


def gains_by_current(logs: Sequence[Log], actuator: Actuator, motor: Motor) -> Determined:
    """Return gain and zero of the speed control in retraction, and why they are not determined.

    Parameters
    ----------
    logs : sequence of Log
        Those that show set point and demand are passed over: they say more.
    actuator : Actuator
        With ramp, levels and motor constants as far as they are determined.
    motor : Motor
        What the third phase draws.
    """
    ramps = [
        ramp
        for log in logs
        if log.has(*NEEDS)
        for move in moves_of(log)
        if not move.extending and (ramp := _ramp(log, move, actuator, motor)) is not None
    ]
    reasons = dict.fromkeys(BY_CURRENT, "no retraction in which the motor drives below the limit")
    levels: dict[str, Estimate] = {}
    if ramps:
        levels, reasons = _fitted(ramps, actuator)
    if any(move.extending for log in logs for move in moves_of(log)):
        reasons = {**reasons, **dict.fromkeys(_IDLE, _WHY_IDLE)}
    return levels, reasons


def _ramp(log: Log, move: Move, actuator: Actuator, motor: Motor) -> _Ramp | None:
    value = actuator.parameters.value
    demand, link = _demand(log, actuator, motor)
    inside = (log.time > move.begin) & (log.time < move.end - _END)
    used = inside & (demand < _LIMIT * link)
    used &= np.abs(log["motor_speed"]) > _SLOWEST
    # One stretch: from a limit on the integral is another's.
    over = np.flatnonzero(inside & (demand >= _LIMIT * link))
    if len(over):
        used &= log.time < log.time[over[0]] - _END
    near = np.flatnonzero(inside & (log["output_position"] < value("proximity.position_25")))
    if used.sum() < _FEWEST or not len(near):
        return None
    open_ = log.period + value("control.period") if log.has("state") else _LATE
    return _Ramp(log, used, demand, move.begin, float(log.time[near[0]]), open_)


def _demand(log: Log, actuator: Actuator, motor: Motor) -> tuple[Floats, Floats]:
    """Demanded voltage from current and speed, and the link's, as sizes."""
    stand = dict(log.stand.parameters)
    value = actuator.with_values(stand, source="stand of the log").parameters.value
    speed, current = np.abs(log["motor_speed"]), np.abs(log["torque_current"])
    inductance, drop = value("motor.winding_inductance"), value("inverter.diode_drop")
    resistance = 2.0 * (value("motor.winding_resistance") + value("inverter.on_resistance"))
    commutation = value("low.commutation_factor") * value("motor.pole_pairs") * inductance
    link = (
        log["supply_voltage"]
        if log.has("supply_voltage")
        else np.full(len(speed), value("inverter.supply_voltage"))
    )
    slope = local_polynomial(current, log.period, _WIDTH, slope=True)
    emf = 2.0 * value("motor.emf_constant") * speed
    demand = emf
    for _ in range(_GAIN_ROUNDS):
        duty = np.clip(demand / link, 0.0, 1.0)
        third_mean = 0.0 if motor.third is None else motor.third.means(speed, duty, link)[0]
        pair = current - third_mean
        demand = emf + (resistance + commutation * speed) * pair + (1.0 - duty) * drop
    return np.asarray(demand + 2.0 * inductance * slope), np.asarray(link)


def _fitted(ramps: Sequence[_Ramp], actuator: Actuator) -> Determined:
    zero = actuator.parameters.value(BY_CURRENT[1])
    why = {BY_CURRENT[1]: "without set point or demand only its product with the gain shows"}
    level, other = (_integral(ramps, actuator, zero * scale) for scale in (1.0, _ZERO))
    if level is None or other is None:
        return {}, {
            **why,
            BY_CURRENT[0]: "no integral gain explains the demand that the current says",
        }
    open_ = level.widened(other.value - level.value)
    return {BY_CURRENT[0]: Estimate(open_.value / zero, open_.std / zero, open_.degrees)}, why


def _integral(ramps: Sequence[_Ramp], actuator: Actuator, zero: float) -> Estimate | None:
    """Product of gain and zero, for a zero."""
    tick = actuator.parameters.value("control.period")
    first = actuator.parameters.value(BY_CURRENT[0]) * zero
    scale = np.concatenate([[first], np.full(2 * len(ramps), 0.1)])

    def residual(x: Floats) -> Floats:
        integral, *shifts = x * scale
        parts = []
        for ramp, begin, slows in zip(ramps, shifts[::2], shifts[1::2], strict=True):
            error = ramp.set_point(actuator, begin, slows) - np.abs(ramp.log["motor_speed"])
            h = ramp.log.period
            total = np.cumsum(error) * h - 0.5 * (h - tick) * error
            parts.append((integral * (error / zero + total) - ramp.demand)[ramp.used])
        return np.concatenate(parts)

    reach = np.concatenate([[20.0], *([10.0 * ramp.open, 10.0 * _LATE] for ramp in ramps)])
    start = np.concatenate([[1.0], np.zeros(2 * len(ramps))])
    lowest = np.concatenate([[1e-3], -reach[1:]])
    fit = fit_residual(residual, start, ends=(lowest, reach), loss="soft_l1", soft=_VOLTS)
    x, jacobian = fit.x, fit.jacobian
    # What lies at its bound is known, what no sample feels changes nothing.
    inside = (x > lowest + 1e-6) & (x < reach - 1e-6) & np.any(jacobian, axis=0)
    if not inside[0]:
        return None
    slope, ends = jacobian[:, inside], fit.residual
    strokes = [(r.log.time[r.used], np.ones(int(r.used.sum())), r.log.period) for r in ramps]
    names = tuple(f"x{k}" for k in range(int(inside.sum())))
    fitted = with_deviations(names, x[inside], slope, ends, np.ones(len(ends)), strokes=strokes)
    spread = fitted.std(names[0])
    return Estimate(x[0] * first, spread * first, fitted.degrees) if np.isfinite(spread) else None


_ROLES = ("motor_speed", "torque_voltage", "torque_current")
_SMOOTH = 2.0  # samples of the Gaussian that leaves the ripple: nothing slower than five samples
_LOCAL = 0.05  # s over which a ripple's energy is averaged; the median over a motion drops ramps
_HALF = 0.5  # of the switching model's energy: nearer to it than to none
_ROUNDING = 1e-12  # of a signal's variance: energy below it is arithmetic


@dataclass(frozen=True)
class Ripple:
    """Energy of a log's ripple over the switching model's, where it is smallest.

    Attributes
    ----------
    share : float or None
        Smallest over motions and channels; None where no run has any.
    role, log : str
        Where.
    """

    share: float | None
    role: str = ""
    log: str = ""

    @property
    def fidelity(self) -> str:
        """``low`` where the logs lack the ripple, else ``high``: a machine commutates."""
        return "low" if self.share is not None and self.share < _HALF else "high"


def ripple_of(logs: Sequence[Log], runs: Sequence[Log]) -> Ripple:
    """Compare the ripple of logs with that of the switching model's runs of them.

    Parameters
    ----------
    logs : sequence of Log
        Of the stand.
    runs : sequence of Log
        The same motions, by the switching model; logs that were not run are passed over.

    Returns
    -------
    Ripple
        The smallest share; its `fidelity` is the one that the logs bear.
    """
    by_name = {log.name: log for log in logs}
    rows = []
    for run in runs:
        log = by_name[run.name]
        for role in _ROLES:
            if not (log.has(role) and run.has(role)):
                continue
            ran = _energy(run, run[role])
            if ran > _ROUNDING * float(np.var(run[role])):
                rows.append((_energy(log, log[role]) / ran, role, log.name))
    return Ripple(*min(rows)) if rows else Ripple(None)


def _energy(log: Log, values: Floats) -> float:
    """Median over the log's motions of a channel's local energy above its smooth part."""
    from scipy.ndimage import gaussian_filter1d

    ripple = values - gaussian_filter1d(values, _SMOOTH)
    local = gaussian_filter1d(ripple**2, _LOCAL / log.period)
    inside = np.zeros(len(values), dtype=bool)
    for move in moves_of(log):
        inside |= (log.time >= move.begin) & (log.time <= move.end)
    return float(np.median(local[inside])) if inside.any() else 0.0


_RATE = 25e3  # Hz at least of a run's channels, before the recorder's filter
_SHARE = 0.1  # of a correction, as its deviation: ASSUMED, the model is not the machine
_MOST = 0.3  # relative: a larger correction says that the run is another motion
_INPUTS = ("command", "load", "load_cell")
_SAMPLED = ("_ref",)


def run_again(
    logs: Sequence[Log],
    actuator: Actuator,
    fidelity: str,
    progress: Progress | None = None,
) -> list[Log]:
    """Return the logs of motions as the model shows them, without noise.

    Parameters
    ----------
    logs : sequence of Log
        Those without motion, or whose recording is not known, are passed over.
    actuator : Actuator
        The model.
    fidelity : str
        Of the runs.
    progress : callable, optional
        As for `elevon.simulate`.

    Returns
    -------
    list of Log
        Empty where a run does not carry out its motions as the log did.
    """
    moving = [log for log in logs if moves_of(log) and log.recording and log.has("command")]
    again = []
    for number, log in enumerate(moving):
        share = part(progress, number / len(moving), (number + 1) / len(moving))
        try:
            inputs = _run_motion(log, actuator, fidelity, share)
        except ElevonError:
            return []
        ways = [[move.extending for move in moves_of(item)] for item in (inputs, log)]
        if ways[0] != ways[1]:
            return []
        again.append(inputs)
    return again


def _run_motion(log: Log, actuator: Actuator, fidelity: str, progress: Progress | None) -> Log:
    experiment = unit_experiment(log, actuator, fidelity, period=1.0 / _RATE)
    run = replayed(experiment, progress)
    channels = {role: log[role] for role in log.channels if role in _INPUTS}
    for role in (role for role in log.channels if role in experiment.shows):
        channels[role] = as_recorded(log, run, role, stepped=role.endswith(_SAMPLED))
    return replace(log, channels=channels)


def with_noise(again: Sequence[Log], logs: Sequence[Log], seed: int) -> list[Log]:
    """Return runs with as much noise as the logs have: what is new in each sample."""
    rng = np.random.default_rng([seed, len(again)])
    by_name = {log.name: log for log in logs}
    result = []
    for run in again:
        noise = {role: by_name[run.name][role] - values for role, values in run.channels.items()}
        # Third differences of both, outliers (edges) aside.
        sizes = {role: float(np.median(np.abs(np.diff(d, 3)))) for role, d in noise.items()}
        scale = 1.4826 / np.sqrt(20.0)
        result.append(
            replace(
                run,
                channels={
                    role: values + scale * sizes[role] * rng.standard_normal(len(values))
                    for role, values in run.channels.items()
                },
            )
        )
    return result


def corrected(
    levels: Mapping[str, Estimate], readings: Sequence[Mapping[str, Estimate]], ran: Actuator
) -> dict[str, Estimate]:
    """Return levels less what the same balances misread in runs whose numbers are known.

    Parameters
    ----------
    levels : mapping of str to Estimate
        Read in the logs.
    readings : sequence of mapping of str to Estimate
        Read in the runs, one for each draw of their noise.
    ran : Actuator
        What was run.
    """
    result = {}
    for path, level in levels.items():
        true = ran.parameters.value(path)
        read = float(np.mean([item[path].value if path in item else np.nan for item in readings]))
        if not abs(read - true) < _MOST * true:
            result[path] = level
            continue
        scale = true / read
        std = float(np.hypot(scale * level.std, _SHARE * (scale - 1.0) * level.value))
        result[path] = Estimate(scale * level.value, std, level.degrees)
    return result


_ROUNDS = 3  # of runs that correct the balances, at most
_NOISES = 4  # draws of a run's noise, over which its readings are averaged
_SETTLED = 0.25  # deviations: a change from which no further round is made


@dataclass(frozen=True)
class _Reading:
    """Numbers, why others are not among them, and the balances themselves."""

    levels: dict[str, Estimate]
    reasons: dict[str, str]
    motor: Motor
    balance: Balance


@dataclass(frozen=True)
class _Reader:
    """The balances of logs, of a stand or of the model run again, with what they take as it is.

    Attributes
    ----------
    actuator, settled : Actuator
        First values, and with what the stages before have determined.
    friction : mapping of str to float
        Knots that a rig has determined.
    inertia : tuple of ndarray
        Places of the ram [m] and what turns and swings beside the motor's own inertia [kg m2].
    gains : bool
        Whether the unit's gains are read from the current as well.
    """

    actuator: Actuator
    settled: Actuator
    friction: Mapping[str, float]
    inertia: tuple[Floats, Floats]
    gains: bool

    def __call__(self, logs: Sequence[Log]) -> _Reading:
        """Return what the logs show."""
        parts = driving(logs, self.actuator)
        motor = motor_constants(parts, self.actuator)
        balance = torque_balance(parts, Constants(self.settled, motor, self.friction, self.inertia))
        levels, reasons = {**motor.levels, **balance.levels}, {**motor.reasons, **balance.reasons}
        if self.gains:
            values: dict[str, str | float] = {**as_values(motor.levels)}
            ready = self.settled.with_values(values, source="calibration")
            gains, missing = gains_by_current(logs, ready, motor)
            levels, reasons = levels | gains, reasons | missing
        return _Reading(levels, reasons, motor, balance)


def drive(ctx: Context) -> None:
    """Evaluate motor and train from motions; runs of the same motions correct them."""
    known = {p: v for p, v in as_values(ctx.levels).items() if p.startswith("friction.ffm_")}
    settled = ctx.settled()
    by_current = BY_CURRENT[0] not in ctx.levels
    inertia = _beside_motor(ctx.logs, settled)
    reader = _Reader(ctx.actuator, settled, known, inertia, by_current)
    first = reader(ctx.logs)
    ctx.add(first.levels, first.reasons)
    if by_current and BY_CURRENT[0] in first.levels:
        constants = () if "motor.emf_constant" in first.levels else ("motor.emf_constant",)
        ctx.stands_on(BY_CURRENT, (*GIVEN, *constants))
    residual = first.balance.residual
    ctx.facts |= {
        "motions_run_again": 0,
        "fidelity": None,
        "ripple_share": None,
        "torque_per_ampere": first.motor.torque,
        "balance_residual_n": None if np.isnan(residual) else residual,
    }
    if ctx.fidelity is not None:
        _correct(ctx, reader, first, ctx.fidelity)


def _correct(ctx: Context, reader: _Reader, first: _Reading, fidelity: str) -> None:
    """Take off what the balances misread in runs of the same motions."""
    again = _chosen(ctx, fidelity)
    for _ in range(_ROUNDS):
        if not again:
            return
        ran, before = ctx.settled(), as_values(ctx.levels)
        noisy = [with_noise(again, ctx.logs, seed) for seed in range(_NOISES)]
        ctx.add(corrected(first.levels, [reader(logs).levels for logs in noisy], ran))
        moved = [
            abs(ctx.levels[p].value - before[p]) / ctx.levels[p].std
            for p in first.levels.keys() & before.keys()
        ]
        if max(moved, default=0.0) < _SETTLED:
            return
        again = _run(ctx, str(ctx.facts["fidelity"]))


def _chosen(ctx: Context, fidelity: str) -> list[Log]:
    """Return the first runs, at the fidelity that the logs bear where none is given."""
    if fidelity != "auto":
        return _run(ctx, fidelity)
    again = _run(ctx, "high")
    if not again:
        return again
    ripple = ripple_of(ctx.logs, again)
    ctx.facts["ripple_share"] = ripple.share
    return again if ripple.fidelity == "high" else _run(ctx, ripple.fidelity)


def _run(ctx: Context, fidelity: str) -> list[Log]:
    again = run_again(ctx.logs, ctx.settled(), fidelity, ctx.progress_of_runs)
    ctx.facts |= {
        "fidelity": fidelity, "motions_run_again": ctx.facts["motions_run_again"] + len(again),
    }  # fmt: skip
    return again


def _beside_motor(logs: Sequence[Log], actuator: Actuator) -> tuple[Floats, Floats]:
    """Return places of the ram and what turns and swings beside the motor's own inertia there.

    The core says it: a run in which a rig moves the ram through its stroke.
    """
    from elevon.scenario import Scenario
    from elevon.simulate import simulate

    stands = (log.stand.parameters for log in logs if moves_of(log))
    model = actuator.with_values(
        next((dict(item) for item in stands if item), {}), source="stand of the log"
    )
    stroke = model.parameters.value("lever.stroke")
    seconds = 0.5
    speed = {"kind": "constant", "value": 0.95 * stroke / seconds}
    scenario = Scenario.from_dict(
        {
            "duration": seconds,
            "command": {"mode": "gear"},
            "load": {"rig_speed": {"terms": [speed]}},
            "initial": {"nut_position": 0.01 * stroke},
        }
    )
    run = simulate(
        model, scenario, fidelity="low", record="output_position,equivalent_inertia@200 Hz"
    )
    total = np.asarray(run["equivalent_inertia"].values, dtype=np.float64)
    places = np.asarray(run["output_position"].values, dtype=np.float64)
    return places, total - model.parameters.value("motor.inertia")
