"""Static friction: which of two ways a log allows, and what neither of them sees.

A shaft that is held moves off at an instant, and the torque of that instant is the static friction
(`elevon.calibrate.static`). A shaft on bristles creeps from the reversal on, and its friction is
followed through the creep (`elevon.calibrate.static`). How far the shaft deflects while the
torque turns decides.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from elevon.arrays import Bools, Floats
from elevon.calibrate.balance import acceleration_of, delayed, kernel, lagged, motion_of, smoothed
from elevon.estimate.covariance import block_covariance
from elevon.estimate.regression import Regression
from elevon.estimate.residual import fit_residual, robust_weights
from elevon.logs.log import Log

_FEWEST_TURNS = 4  # reversals
_MOST = 48  # reversals that are followed
_FINE = 4  # steps of the bristles a sample
_BEFORE, _AFTER = 0.03, 0.06  # s of clear motion before and after a reversal that count
_MARGIN = 0.03  # s more at both ends, in which the bristles and the filters find their state
_LONGEST = 0.5  # s of a reversal; a longer standstill is no turn of the motion
_CLEAR = 0.02  # of the highest speed: the shaft slides
_SMALL = 0.05  # of the dry friction
#: ASSUMED: rad/s of a Stribeck speed at least; a faster fall is over within a sample, unseen.
_SLOWEST = 0.1
_SCALE = 2.0  # residuals beyond so many of their deviations count less
_EXPONENTS = (1.0, 2.0)


@dataclass(frozen=True)
class StaticFriction:
    """Static friction.

    Attributes
    ----------
    value, std : float
        And its deviation [N m].
    degrees : float
        Degrees of freedom of the deviation.
    unseen : float
        What it may be higher by, whatever the log shows [N m].
    how : str
        How it was read.
    """

    value: float
    std: float
    degrees: float
    unseen: float
    how: str


@dataclass(frozen=True)
class _Windows:
    """Reversals of the logs: rows are events, columns samples (or their parts) of a window."""

    steps: Floats  # (n, m * _FINE): rad a part of a sample
    torque: Floats  # (n, m): N m that the friction has to explain, as late as the current
    brake: Floats  # (n, m): N m of the brake
    direction: Floats  # (n,): of the motion before, 1 or -1
    counts: Bools  # (n, m): samples that count
    period: float
    sigma: float
    lag: float
    late: bool = False  # the current is late by a delay, not by a first-order lag


def presliding_friction(
    logs: Sequence[Log], plant: Regression, constant: float
) -> StaticFriction | None:
    """Fit the bristles to all reversals of the logs.

    What no log settles enters the deviation as the difference it makes: the law of the fall from
    static to dynamic friction, the shape of the current's lag, how the shaft moves between two
    samples, and what rubs only beyond the backlash.

    Parameters
    ----------
    logs
        As `elevon.calibrate.static.static_friction`.
    plant : Regression
        The torque balance.
    constant : float
        Torque constant [N m/A].

    Returns
    -------
    StaticFriction or None
        None with fewer than four reversals.
    """
    windows = _windows(logs, plant, constant)
    if windows is None:
        return None
    dry = constant * plant["dry"]
    fits = [_fit(windows, dry, exponent) for exponent in _EXPONENTS]
    best = min(fits, key=lambda fit: fit.cost)
    others = [fit.static for fit in fits if fit is not best]
    even = windows.steps.reshape(*windows.torque.shape, _FINE).mean(axis=2)
    for other in (
        replace(windows, late=True),
        replace(windows, steps=np.repeat(even, _FINE, axis=1)),
    ):
        others.append(_fit(other, dry, best.exponent, best.x).static)
    # What rubs beyond the backlash rubs in the motion, not yet where the shaft moves off.
    beyond = dry - float(best.x[4])
    variance, degrees = best.variance(windows)
    spread = sum((other - best.static) ** 2 for other in others) + beyond**2
    std = float(np.sqrt(variance + spread))
    how = (
        "peak of the friction that the creep before sliding shows; the shaft deflects as bristles "
        f"of {float(np.exp(best.x[0])):.2g} N m/rad, and how friction falls from there is open"
    )
    return StaticFriction(best.static + beyond, std, degrees, 0.0, how)


def usable_logs(logs: Sequence[Log]) -> list[Log]:
    """Return logs whose angle and brake are known; only those without brake where they suffice."""
    known = [
        log for log in logs if log.has("motor_position") and log.brake.known in {"off", "torque"}
    ]
    free = [log for log in known if log.brake.known == "off"]
    return free if sum(len(reversals(log)) for log in free) >= _FEWEST_TURNS else known


def reversals(log: Log) -> list[tuple[int, int]]:
    """Last sample of sliding before, and first of sliding after, every reversal."""
    speed = motion_of(log).speed
    at = np.flatnonzero(np.abs(speed) > _CLEAR * float(np.abs(speed).max()))
    around, longest = round((_AFTER + _MARGIN) / log.period), round(_LONGEST / log.period)
    return [
        (before, after)
        for before, after in zip(at[:-1].tolist(), at[1:].tolist(), strict=True)
        if speed[before] * speed[after] < 0.0
        and after - before < longest
        and around <= before
        and after < len(speed) - around
        and log.good[before - around : after + around].all()
    ]


def _windows(logs: Sequence[Log], plant: Regression, constant: float) -> _Windows | None:
    """Cut the reversals of all logs into rows of one length."""
    used = usable_logs(logs)
    turns = [reversals(log) for log in used]
    many = -(-sum(map(len, turns)) // _MOST)
    turns = [turn[::many] for turn in turns]
    spans = [after - before for turn in turns for before, after in turn]
    if len(spans) < _FEWEST_TURNS:
        return None
    period = used[0].period
    around = round((_AFTER + _MARGIN) / period)
    length = max(spans) + 2 * around
    sigma = max(kernel(log) for log in used)
    balance = _Known(plant, constant, sigma, length)
    rows = [balance.rows(log, turn) for log, turn in zip(used, turns, strict=True) if turn]
    steps, torque, brake, direction, counts = (
        np.concatenate([row[k] for row in rows]) for k in range(5)
    )
    return _Windows(steps, torque, brake, direction, counts > 0.0, period, sigma, plant["lag"])


@dataclass(frozen=True)
class _Known:
    """What is known of the torque, and the length of a window in samples."""

    plant: Regression
    constant: float
    sigma: float
    length: int

    def friction(self, log: Log) -> tuple[Floats, Floats]:
        """Torque [N m] that inertia and viscosity leave to the friction, and the speed [rad/s]."""
        plant = self.plant
        speed, acceleration = acceleration_of(log, self.sigma)
        shift = plant["offset" if "offset" in plant.names else "constant"]
        known = plant["inertia"] * acceleration + plant["viscous"] * speed
        late = lagged(known[:, None], plant["lag"], log.period)[:, 0]
        return self.constant * (smoothed(log.current, self.sigma) - shift - late), speed

    def rows(
        self, log: Log, turns: list[tuple[int, int]]
    ) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Windows of one log; a short reversal has more of the motion before it, uncounted."""
        from scipy.interpolate import CubicSpline

        torque, speed = self.friction(log)
        last = len(torque) - 1
        brake = np.zeros_like(torque)
        if log.brake.measured:
            brake = np.interp(log.time, log.brake.time, log.brake.level)
        end = np.array([after for _, after in turns]) + round((_AFTER + _MARGIN) / log.period)
        at = end[:, None] + np.arange(-self.length, 0)
        inside = np.clip(at, 0, last)
        part = np.arange(-_FINE * (self.length + 1), -_FINE + 1) / _FINE
        path = CubicSpline(np.arange(last + 1), log.motor)
        steps = np.diff(path(np.clip(end[:, None] + part, 0.0, last)), axis=1)
        begin = np.array([before for before, _ in turns])
        counts = at >= begin[:, None] - round(_BEFORE / log.period)
        counts &= at < end[:, None] - round(_MARGIN / log.period)
        return steps, torque[inside], brake[inside], np.sign(speed[begin]), counts.astype(float)


@dataclass(frozen=True)
class _Fit:
    """Bristles fitted.

    `x` holds the logarithm of their stiffness, what static exceeds dry friction by, the logarithm
    of the Stribeck speed, their damping, dry friction near rest, a shift of the torque.
    """

    x: Floats
    exponent: float
    cost: float
    misfit: Floats  # (k,), of the samples that count
    jac: Floats  # (k, 6)

    @property
    def static(self) -> float:
        return float(self.x[4] + self.x[1])

    def variance(self, windows: _Windows) -> tuple[float, float]:
        """Variance of the static friction from the reversals' scores, and degrees of freedom."""
        # A small excess does not show at which speed it is gone.
        active = [k for k in range(6) if k != 2 or self.x[1] > _SMALL * self.x[4]]
        spread = 1.4826 * float(np.median(np.abs(self.misfit))) or 1e-300
        weight, curvature = robust_weights(self.misfit, "soft_l1", _SCALE * spread)
        jac = self.jac[:, active]
        covariance, degrees = block_covariance(
            (jac * curvature[:, None]).T @ jac, jac * (weight * self.misfit)[:, None],
            np.nonzero(windows.counts)[0],
        )  # fmt: skip
        gradient = np.isin(active, (1, 4)).astype(np.float64)
        return float(gradient @ covariance @ gradient), degrees


def _fit(windows: _Windows, dry: float, exponent: float, start: Floats | None = None) -> _Fit:
    """Least robust squares from the best point of a grid, or from a start."""
    if start is None:
        start = _coarse(windows, dry, exponent)
    low = np.array([np.log(10.0 * dry), 0.0, np.log(_SLOWEST), 0.0, 0.5 * dry, -0.2 * dry])
    high = np.array([np.log(1e7 * dry), 2.0 * dry, np.log(1e1), 1e2 * dry, 1.5 * dry, 0.2 * dry])

    def residual(x: Floats) -> Floats:
        misfit: Floats = _residual(windows, x[None], exponent)[0][windows.counts]
        return misfit

    spread = 1.4826 * float(np.median(np.abs(residual(start))))
    fit = fit_residual(
        residual, np.clip(start, low + 1e-9, high - 1e-9), ends=(low, high), loss="soft_l1",
        jacobian=lambda x: _slopes(windows, x, exponent, dry), soft=_SCALE * max(spread, 1e-6),
        scale=np.array([0.5, 0.1 * dry, 0.5, 0.5, 0.1 * dry, 0.1 * dry]), most=40,
    )  # fmt: skip
    cost = float(np.sum(np.abs(fit.residual)))
    return _Fit(fit.x, exponent, cost, fit.residual, fit.jacobian)


def _coarse(windows: _Windows, dry: float, exponent: float) -> Floats:
    """Best point of a grid over stiffness and Stribeck speed."""
    grid = np.array(
        [
            [np.log(dry * stiff), 0.2 * dry, np.log(speed), 0.002 * dry * stiff, dry, 0.0]
            for stiff in (1e2, 3e2, 1e3, 3e3, 1e4, 1e5)
            for speed in (0.1, 0.5, 2.0)
        ]
    )
    costs = np.sum(np.abs(_residual(windows, grid, exponent)), axis=(1, 2))
    return np.asarray(grid[int(np.argmin(costs))], dtype=np.float64)


def _slopes(windows: _Windows, x: Floats, exponent: float, dry: float) -> Floats:
    """Derivatives of the residual by central differences, shape (samples, 6)."""
    steps = np.array([1e-3, 1e-3 * dry, 1e-3, 1e-3, 1e-4 * dry, 1e-4 * dry])
    both = np.vstack((x + np.diag(steps), x - np.diag(steps)))
    values = _residual(windows, both, exponent)[:, windows.counts]
    return np.asarray(((values[:6] - values[6:]) / (2.0 * steps[:, None])).T, dtype=np.float64)


def _residual(windows: _Windows, x: Floats, exponent: float) -> Floats:
    """Torque less friction of parameters (k, 6): (k, n, m), zero where nothing counts."""
    friction = _bristles(windows, x, exponent)
    late = delayed if windows.late else lagged
    flat = smoothed(friction.reshape(len(friction), -1), windows.sigma)
    friction = np.moveaxis(late(flat, windows.lag, windows.period).reshape(friction.shape), 0, 2)
    return np.where(windows.counts, windows.torque - friction - x[:, 5, None, None], 0.0)


def _bristles(windows: _Windows, x: Floats, exponent: float) -> Floats:
    """Friction at the samples (m, k, n): the deflection is exact over each part of a sample."""
    stiffness, stribeck = np.exp(x[:, 0, None]), np.exp(x[:, 2, None])
    excess, damping, dry = (x[:, j, None] for j in (1, 3, 4))
    part = windows.period / _FINE
    steps = np.ascontiguousarray(windows.steps.T)[:, None, :]
    size = np.abs(steps)
    brake = np.repeat(windows.brake.T, _FINE, axis=0)[:, None, :]
    level = dry + excess * np.exp(-((size / part / stribeck) ** exponent)) + brake
    end = np.sign(steps) * level / stiffness
    left = np.exp(-stiffness * size / level)
    z = np.empty((len(steps) + 1, *level.shape[1:]))
    z[0] = windows.direction * (dry + windows.brake[:, 0]) / stiffness
    for k in range(len(steps)):
        z[k + 1] = end[k] + (z[k] - end[k]) * left[k]
    rate = (z[_FINE::_FINE] - z[_FINE - 1 :: _FINE][: len(z[_FINE::_FINE])]) / part
    return np.asarray(stiffness * z[_FINE::_FINE] + damping * rate)


_FEWEST_BREAKAWAYS = 4  # breakaways
_MEDIAN = 1.2533  # deviation of a median over that of a mean
_STUCK_SHAFT = 0.02  # s that the shaft stands still at least
_CLIMB = 0.04  # s of the climb before the instant that are used, at most
_TAIL = 5  # samples of the set point that are as good as straight
_NOISY_TAIL = 0.02  # s of a measured current that are as good as straight: its noise averages out
_MOTION = 5.0  # deviations of the angle's noise that are motion
_FINEST = 1e-6  # rad: motion smaller than this is none
_AWAY = 0.05  # s after the instant in which the motion must have become clear
_CLEAR_BREAKAWAY = 0.02  # of the highest speed


@dataclass(frozen=True)
class Breakaways:
    """Breakaways of all logs, one entry each.

    Attributes
    ----------
    current : ndarray, shape (n,)
        Current that made the torque of the instant, as its sensor would show it without lag [A].
    brake : ndarray, shape (n,)
        Torque of the brake [N m].
    direction : ndarray, shape (n,)
        Of the motion that follows, 1 or -1.
    slope : ndarray, shape (n,)
        Climb of the current towards that motion [A/s].
    behind : float
        Deviation of how far the measured current stays behind its set point: alike for all [A].
    """

    current: Floats
    brake: Floats
    direction: Floats
    slope: Floats
    behind: float


def breakaway_torque(
    logs: Sequence[Log],
    *,
    constant: float,
    offset: float,
    lag: float,
    slow: float,
) -> StaticFriction | None:
    """Return the static friction of all breakaways.

    Parameters
    ----------
    logs
        As `breakaways`.
    constant : float
        Torque constant [N m/A].
    offset, lag : float
        Of the measured current [A, s].
    slow : float
        Speed [rad/s] below which the shaft counts as at rest.

    Returns
    -------
    StaticFriction or None
        Median; its deviation from the scatter, from the climb within one sample, in which the
        instant may be misplaced alike every time, and from the set point's own shift. None with
        fewer than four breakaways.
    """
    every = breakaways(logs, lag, slow)
    count = len(every.current)
    if count < _FEWEST_BREAKAWAYS:
        return None
    torque = constant * every.direction * (every.current - offset) - every.brake
    middle = float(np.median(torque))
    scatter = 1.4826 * float(np.median(np.abs(torque - middle)))
    period = max(log.period for log in logs)
    climb = constant * float(np.median(every.slope)) * period / np.sqrt(3.0)
    noise_part = _MEDIAN * scatter / np.sqrt(count)
    std = float(np.sqrt(noise_part**2 + climb**2 + (constant * every.behind) ** 2))
    how = "torque at which the shaft breaks away; ripple that the log does not show lowers it"
    return StaticFriction(middle, std, count - 1.0, _RIPPLE * middle, how)


@dataclass(frozen=True)
class _Event:
    """One breakaway: its instant, and set point and measured current while the shaft stuck."""

    when: float
    direction: float
    brake: float
    time: Floats
    target: Floats
    current: Floats
    tail: int

    def climbs(self) -> bool:
        """Whether the set point climbs towards the motion, over the standstill that is used."""
        slope = np.polyfit(self.time - self.when, self.target, 1)[0]
        return bool(slope * self.direction > 0.0)

    def line(self) -> tuple[float, float]:
        """Slope and level at the instant of the set point's last stretch."""
        last = slice(-self.tail, None)
        slope, level = np.polyfit(self.time[last] - self.when, self.target[last], 1)
        return float(slope), float(level)


def breakaways(logs: Sequence[Log], lag: float, slow: float) -> Breakaways:
    """Find every breakaway whose torque is known.

    The set point of the current gives the shape of the climb, free of noise; how far the measured
    current stays behind is one number for all climbs, its offset another.

    Parameters
    ----------
    logs : sequence of Log
        With the motor's angle; those whose brake acted unmeasured are passed over.
    lag : float
        Of the measured current behind the torque [s].
    slow : float
        Speed [rad/s] below which the shaft counts as at rest.
    """
    events = [
        event
        for log in logs
        if log.has("motor_position") and log.brake.known in {"off", "torque"}
        for event in _events(log, log.motor, slow)
    ]
    lines = np.array([event.line() for event in events], dtype=np.float64).reshape(-1, 2)
    direction = np.array([event.direction for event in events], dtype=np.float64)
    climbing = np.array([event.climbs() for event in events], dtype=np.bool_)
    events = [event for event, up in zip(events, climbing, strict=True) if up]
    lines, direction = lines[climbing], direction[climbing]
    gap, offset, behind = _behind(events)
    current = lines[:, 1] - offset - gap * direction + lag * lines[:, 0]
    brake = np.array([event.brake for event in events], dtype=np.float64)
    return Breakaways(current, brake, direction, lines[:, 0] * direction, behind)


def _behind(events: Sequence[_Event]) -> tuple[float, float, float]:
    """How far the current stays behind its set point in a climb, its offset, a deviation [A]."""
    if not events:
        return 0.0, 0.0, 0.0
    deficit = np.concatenate([e.target - e.current for e in events])
    direction = np.concatenate([np.full(len(e.time), e.direction) for e in events])
    columns = np.column_stack((direction, np.ones_like(direction)))
    (gap, offset), *_ = np.linalg.lstsq(columns, deficit, rcond=None)
    # One climb is one observation.
    means = [float(np.mean(e.target - e.current)) - gap * e.direction - offset for e in events]
    return float(gap), float(offset), float(np.std(means) / np.sqrt(len(means)))


def _events(log: Log, motor: Floats, slow: float) -> list[_Event]:
    least, most = round(_STUCK_SHAFT / log.period), round(_CLIMB / log.period)
    noisy = not log.has("current_ref")
    tail = max(_TAIL, round(_NOISY_TAIL / log.period)) if noisy else _TAIL
    events = []
    for begin, end in stuck_stretches(motor, least, slow * log.period):
        instant = _instant(log, motor, end)
        part = slice(max(begin + 1, end - most), end + 1)
        if instant is None or not log.good[part].all():
            continue
        brake = np.interp(instant[0], log.brake.time, log.brake.level)
        events.append(
            _Event(
                *instant,
                float(brake) if log.brake.measured else 0.0,
                log.time[part],
                log.current_target[part],
                log.current[part],
                tail,
            )
        )
    return events


def stuck_stretches(motor: Floats, least: int, small: float) -> list[tuple[int, int]]:
    """First and last sample of every stretch that moves less a sample than is small [rad]."""
    moved = np.abs(np.diff(motor))
    jumps = np.abs(np.diff(motor, 3))
    noise = 1.4826 * float(np.median(jumps[jumps > 0.0])) / np.sqrt(20.0) if jumps.any() else 0.0
    # The noise of a smooth motion's third differences is far below its first ones.
    standing = np.concatenate(([False], moved <= max(_MOTION * noise, _FINEST, small), [False]))
    edges = np.flatnonzero(np.diff(standing.astype(np.int8)))
    pairs = zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)
    return [(begin, end) for begin, end in pairs if end - begin >= least and end < len(motor) - 3]


def _instant(log: Log, motor: Floats, end: int) -> tuple[float, float] | None:
    """Instant and direction of the motion after sample `end`; None where it does not go on.

    Off a standstill the angle grows with the square of time: the roots of two samples point back
    at the instant.
    """
    ahead = motor[end + 1 : end + 1 + max(3, round(_AWAY / log.period))] - motor[end]
    direction = float(np.sign(ahead[-1]))
    top = float(np.abs(log.speed).max())
    if direction == 0.0 or abs(ahead[-1] - ahead[-2]) < _CLEAR_BREAKAWAY * top * log.period:
        return None
    first, second = direction * float(ahead[0]), direction * float(ahead[1])
    if not 0.0 < first < second:
        return None
    back = np.sqrt(first) / (np.sqrt(second) - np.sqrt(first))
    return float(log.time[end + 1]) - min(max(float(back), 0.0), 1.0) * log.period, direction


_FEWEST = 4  # reversals with a standstill
_STUCK = 0.02  # s of a standstill at least
_SLOW = 0.1  # of the dry friction: what it gives the shaft in a sample is a speed near rest
_LONG = (
    3.0  # of the motion in one sample near rest: a longer give is followed, a shorter one is none
)
#: ASSUMED: torque ripple of a switched drive, of the static friction. A shaft breaks away on the
#: ripple's top; a current that is filtered, or sampled in step with the drive, shows its middle. A
#: PWM of 10 kHz in the model: 5 %.
_RIPPLE = 0.06


def static_friction(
    logs: Sequence[Log], plant: Regression, constant: float
) -> StaticFriction | None:
    """Estimate static friction by the way that the logs allow.

    Parameters
    ----------
    logs : sequence of Log
        With the motor's angle; those whose brake acted unmeasured are passed over.
    plant : Regression
        The torque balance.
    constant : float
        Torque constant [N m/A].

    Returns
    -------
    StaticFriction or None
        None with fewer than four reversals, or breakaways.
    """
    slow = _SLOW * plant["dry"] / plant["inertia"] * max(log.period for log in logs)
    if not slow > 0.0:
        return None
    if _gives(logs, plant, slow):
        return presliding_friction(logs, plant, constant)
    offset = plant["offset" if "offset" in plant.names else "constant"]
    return breakaway_torque(logs, constant=constant, offset=offset, lag=plant["lag"], slow=slow)


def _gives(logs: Sequence[Log], plant: Regression, slow: float) -> bool:
    """Return whether the shaft deflects further than rounding while its torque turns.

    Reversals without a standstill say nothing in either direction; where there are no others the
    deflection is followed.
    """
    lengths = []
    for log in usable_logs(logs):
        current = motion_of(log).current
        small = slow * log.period
        stuck = stuck_stretches(log.motor, max(2, round(_STUCK / log.period)), small)
        for before, after in reversals(log):
            for a, b in ((a, b) for a, b in stuck if before <= a and b <= after):
                turn = abs(float(current[b] - current[a])) / (2.0 * plant["dry"])
                if turn > 0.2:
                    lengths.append(abs(float(log.motor[b] - log.motor[a])) / (turn * small))
    return len(lengths) < _FEWEST or float(np.median(lengths)) > _LONG
