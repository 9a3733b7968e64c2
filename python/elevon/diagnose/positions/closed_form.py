"""Faults that the reduced-order model has no signal for, named by their closed form in a log.

A resolver's error turns with the shaft and stands in the difference of the two positions. A counter
that loses counts still reads whole counts, which one of another scale does not. A contact of the
windings draws current past the motor, so that what the drive measures and what it asks for part,
with the electrical angle. A worn cage rubs once a turn of its own. What is interrupted conducts
nothing, however much is asked for. Each limit is beyond what other faults and healthy units show;
all are ASSUMED.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.answer import Cause, FaultPlace
from elevon.diagnose.positions.features import ENCODER_ERROR, carried, regress
from elevon.diagnose.signs import EVERYTHING, Sign, sign_of
from elevon.logs.log import bridged

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.arrays import Bools
    from elevon.logs.log import Log

RIPPLE = 0.012
"""Amplitude of a resolver's error that is told [rad]: twice what a class of 20 minutes allows."""
CONTACT = 0.1
"""RMS of what turns with the electrical angle between asked and measured current, over the
current's."""
BETWEEN = 0.25
"""The same of what turns twice an electrical turn: unbalanced windings of the candidates leave up
to 0.22 of it in a fast motion, a contact of two phases 0.33 and more."""
PURE = 0.3
"""Of the larger order: below it the other one is not there."""
CAGE = 0.02
"""Amplitude of the friction that turns with the bearing's cage, over the current's RMS."""
TURNS = 1.5
"""Turns of the cage in a log's travel: of less, its friction looks like one that follows the
stroke, or like a slow drift."""
LOST = 0.002
"""Least share of lost counts that is told: twice what a gear's ratio may seem off by."""
FORM = 0.02
"""Deviation of a size that is read by a closed form, over it."""
_FULL = 0.8  # of the current limit: the drive asks for all it has
_LONG = 0.2  # of a log
_NOTHING = 0.02  # of the current asked for: nothing flows
_ALL = 0.9  # of it: it flows as asked
_STANDS = 0.01  # rad of the motor's shaft that a standing one may seem to move by
_CREEP = 2.0  # counts by which the output moves while the shaft seems to stand
_WHOLE = 0.03  # of a count
_SMOOTH = 0.02  # s of the mean that gives the acceleration
_STEPS = 0.05  # deviation over size of what is lost
_OTHER = 0.05  # of a gear ratio: beyond it the log is another actuator's
_RUN_IN = 1.0  # s
_LEAST_TIME = 3.0  # s of log behind it
_DEVIATIONS = 4.0
_LEAST = 400  # samples
_NEEDED = ("output_position", "motor_position", "motor_speed", "torque_current", "current_ref")
_FLOWS = 0.2  # A: below it a current has no direction
_WAYS = 24  # directions that are tried
_PHASES = tuple(f"motor.phase_{p}" for p in "abc")
_WINDINGS = tuple(f"sensor.resolver.{w}" for w in ("sine", "cosine", "excitation"))
_CLOSED = "named by its closed form in the log, which the reduced-order model has not"
#: Beginnings of names of features that each moves.
_OF_ANGLE = (
    "position_", "lost_motion", "speed_", "inertia_current", "current_", "voltage_",
    "control_noise", "target_noise", "reference_noise", "integral_rate",
)  # fmt: skip
_OF_COUNTS = ("position_", "lost_motion", "following_gain", "reference_noise")
_OF_CAGE = ("dry_current", "viscous_current", "current_", "creeping_current", "voltage_")
_OF_CONTACT = (
    *_OF_CAGE, "inertia_current", "brake_current", "speed_gain", "control_noise", "target_noise",
    "integral_rate",
)  # fmt: skip


@dataclass
class DriveLog:
    """A drive's log with what its signs are read by.

    Attributes
    ----------
    log : Log
        Its gaps bridged.
    actuator : Actuator
        The healthy unit.
    present : ndarray, shape (n,)
        Samples that are no bridge.
    """

    log: Log
    actuator: Actuator
    present: Bools

    @classmethod
    def of(cls, log: Log, actuator: Actuator) -> DriveLog | None:
        """Return a log's; None where channels are missing, or too few samples have all of them."""
        if not log.has(*_NEEDED):
            return None
        roles = [role for role in (*_NEEDED, "direct_current") if log.has(role)]
        whole = np.isfinite(np.column_stack([log[role] for role in roles])).all(axis=1)
        present = np.asarray(log.good & whole)
        left = present & (log.time >= _RUN_IN)
        if left.sum() < _LEAST or float(left.mean()) * log.duration < _LEAST_TIME:
            return None
        channels = {role: bridged(log.time, log[role]) for role in roles}
        return cls(log.with_channels(**channels), actuator, present)

    def value(self, path: str) -> float:
        """Return a parameter of the healthy unit."""
        return self.actuator.parameters.value(path)

    @property
    def use(self) -> Bools:
        """Samples that are there, behind the run-in."""
        return np.asarray(self.present & (self.log.time >= _RUN_IN))

    @property
    def count(self) -> float:
        """Output travel of one count [rad]."""
        paths = ("pulses", "edges", "wheel_ratio")
        return 2.0 * math.pi / math.prod(self.value(f"sensor.encoder.{name}") for name in paths)

    def moved(self, role: str) -> float:
        """Return the travel of a position [rad]."""
        return float(np.ptp(self.log[role][self.present]))

    @cached_property
    def moving(self) -> Bools:
        """Samples of motion, the output carried along."""
        log, use = self.log, self.use
        speed = np.abs(log["motor_speed"])
        moving = use & (speed > 0.1 * float(speed[use].max()))
        driver = log["motor_position"] / self.value("gear.ratio")
        gap = driver - log["output_position"]
        past = moving & carried(driver, float(np.ptp(gap[moving]))) if moving.any() else moving
        return past if past.sum() >= _LEAST else moving


def drive_signs(logs: Sequence[Log], baselines: Sequence[Log], actuator: Actuator) -> list[Sign]:
    """Return the sign of one of these faults that most logs show by its closed form, if any.

    Parameters
    ----------
    logs, baselines : sequence of Log
        Of the unit; of a healthy one.
    actuator : Actuator
        The healthy unit.
    """
    healthy = [item for log in baselines if (item := DriveLog.of(log, actuator)) is not None]
    items = [item for log in logs if (item := DriveLog.of(log, actuator)) is not None]
    signs = [sign for item in items if (sign := drive_sign(item, healthy)) is not None]
    if 2 * len(signs) <= len(logs) or len({sign.cause.kind for sign in signs}) > 1:
        return []
    return signs[:1]


def drive_sign(item: DriveLog, healthy: Sequence[DriveLog]) -> Sign | None:
    """Return what a log shows by its closed form; None: nothing of the kind."""
    full = np.abs(item.log["current_ref"]) > _FULL * item.value("control.current_limit")
    if (item.use & full).sum() > _LONG * item.use.sum():
        return _at_the_limit(item, item.use & full)
    if item.moving.sum() < _LEAST or item.moved("motor_position") < 4.0 * math.pi:
        return None
    return (
        _contact(item) or _resolver(item, healthy) or _lost_counts(item, healthy)
        or _cage(item)
    )  # fmt: skip


def _at_the_limit(item: DriveLog, full: Bools) -> Sign | None:
    """All is asked for: either nothing flows, or all of it does and the shaft seems to stand."""
    log = item.log
    size = float(np.mean(np.abs(log["torque_current"][full])))
    wanted = float(np.mean(np.abs(log["current_ref"][full])))
    if size < _NOTHING * wanted:
        return _nearly_nothing(_interrupted(item), size / wanted, _NOTHING)
    shaft = log["motor_position"][item.present]  # one channel alone tells a half of the turn
    off = float(np.ptp(shaft - np.pi * np.round((shaft - np.median(shaft)) / np.pi)))
    if size < _ALL * wanted or off > _STANDS:
        return None
    stands = (off / math.pi, _STANDS / math.pi)
    resolver = [("resolver_open", winding) for winding in _WINDINGS]
    resolver.append(("stuck", "sensor.resolver"))
    if item.moved("output_position") > _CREEP * item.count:
        return _nearly_nothing(_cause(*resolver[0], resolver[1:]), *stands)
    jam = _cause("jam", "transmission", resolver, unit="N m", there=False)
    return _nearly_nothing(jam, *stands)


def _nearly_nothing(cause: Cause, share: float, limit: float) -> Sign:
    """Return the sign of what is as good as gone: how small a share is left, in its logarithm."""
    gone, needed = (-math.log(max(x, 1e-6)) for x in (share, limit))
    return sign_of(cause, gone, needed, moves=EVERYTHING, text=_CLOSED)


def _interrupted(item: DriveLog) -> Cause:
    """Which circuit is open: of one phase, its current is missing while the others flow."""
    phases = [("open_phase", phase) for phase in _PHASES]
    switches = [("open_switch", f"inverter.{p}_{side}") for p in "abc" for side in ("high", "low")]
    supply = ("connector_open", "supply")
    if not item.log.has("direct_current"):
        return _cause(*supply, [*phases, *switches])
    shares = _phase_shares(item)
    if shares is None:
        return _cause(*supply, [*phases, *switches])
    missing, one_way = shares
    if missing < PURE:
        return _cause(*phases[0], phases[1:])
    return _cause(*switches[0], switches[1:]) if one_way < PURE else _cause(*supply)


def _phase_shares(item: DriveLog) -> tuple[float, float] | None:
    """Return how much less current flows in one direction of the windings than across it.

    And how much less one way than the other, of the direction in which that is least; None where
    hardly any flows. A phase that is open leaves a line, a switch a half of the plane.
    """
    log = item.log
    direct, torque = log["direct_current"], log["torque_current"]
    flows = item.present & (np.hypot(direct, torque) > _FLOWS)
    if flows.sum() < _LEAST // 4:
        return None
    turn = item.value("motor.pole_pairs") * log["motor_position"][flows]
    vector = (direct + 1j * torque)[flows] * np.exp(1j * turn)
    ways = np.exp(-1j * np.pi * np.arange(2 * _WAYS) / _WAYS)
    along = np.real(ways[:, None] * vector)
    sizes = np.sqrt(np.mean(along**2, axis=1))
    forward = np.sqrt(np.mean(np.maximum(along, 0.0) ** 2, axis=1))
    back = np.maximum(np.roll(forward, _WAYS), 1e-12)
    return float(sizes.min() / sizes.max()), float(np.min(forward / back))


def _contact(item: DriveLog) -> Sign | None:
    """A contact of two phases, or of one to ground: current that the motor does not take.

    Between two phases it has the motor's voltage, so it turns twice an electrical turn; to ground
    the link's middle stands against the phase, so it turns once.
    """
    log, moving = item.log, item.moving
    part = (log["current_ref"] - log["torque_current"])[moving]
    speed = log["motor_speed"][moving]
    turn = item.value("motor.pole_pairs") * log["motor_position"][moving]
    shape = speed / float(np.abs(speed).max())
    trend = [np.sign(speed), shape, np.ones_like(shape)]
    waves = [f(k * turn) for k in (1, 2) for f in (np.cos, np.sin)]
    columns = [
        *trend,
        *(wave * weight for wave in waves for weight in (np.ones_like(shape), shape)),
    ]
    weights, _ = regress(columns, part)
    once, twice = (
        float(np.sqrt(np.mean(sum(weights[k] * columns[k] for k in range(at, at + 4)) ** 2)))
        for at in (3, 7)
    )
    size = float(np.sqrt(np.mean(log["torque_current"][moving] ** 2)))
    over = max(once / CONTACT, twice / BETWEEN) / size  # limits
    if over < 1.0:
        return None
    places = [("ground_short", phase) for phase in _PHASES]
    if once < PURE * twice:
        places = [("phase_short", f"motor.phases_{pair}") for pair in ("ab", "bc", "ca")]
    cause = _cause(*places[0], places[1:], unit="S", there=False)
    return sign_of(cause, over, 1.0, moves=_OF_CONTACT, text=_CLOSED)


def _gap(item: DriveLog) -> tuple[Floats, Floats]:
    """Return weights and deviations of what the difference of the positions has, at the shaft.

    Direction, output, one, cosine and sine of the shaft's angle and of twice it.
    """
    log, moving = item.log, item.moving
    shaft, output = log["motor_position"][moving], log["output_position"][moving]
    gap = shaft - item.value("gear.ratio") * output
    columns = [np.sign(log["motor_speed"][moving]), output, np.ones_like(output)]
    columns += [f(k * shaft) for k in (1, 2) for f in (np.cos, np.sin)]
    weights, covariance = regress(columns, gap)
    return weights, np.sqrt(np.maximum(np.diag(covariance), 0.0))


def _resolver(item: DriveLog, healthy: Sequence[DriveLog]) -> Sign | None:
    """An error of the resolver once or twice a turn: an offset, or unlike channels."""
    weights, deviations = _gap(item)
    others = [_gap(other)[0] for other in healthy if other.moving.sum() >= _LEAST]
    size = {}
    for order, at in ((1, 3), (2, 5)):
        usual = max((float(np.hypot(*w[at : at + 2])) for w in others), default=0.0)
        error = float(np.hypot(*deviations[at : at + 2]))
        size[order] = (float(np.hypot(*weights[at : at + 2])) - usual, error)
    order = max(size, key=lambda key: size[key][0])
    amplitude, error = size[order]
    if amplitude < max(RIPPLE, _DEVIATIONS * error):
        return None
    ends = _ends(amplitude, error)
    if order == 1:
        cause = _sized([("channel_offset", winding) for winding in _WINDINGS[:2]], ends)
    else:
        shorts = [("resolver_short", winding) for winding in _WINDINGS[:2]]
        shorts += [(kind, "sensor.resolver") for kind in ("mismatch", "quadrature")]
        cause = _sized(shorts, [2.0 * x / (1.0 + x) for x in ends])
    return sign_of(cause, amplitude, RIPPLE, moves=_OF_ANGLE, text=_CLOSED, error=error)


def _lost_counts(item: DriveLog, healthy: Sequence[DriveLog]) -> Sign | None:
    """An output position that is too short, in whole counts: of another scale they are others."""
    off = (item.log["output_position"][item.use] - item.log["output_position"][0]) / item.count
    if float(np.mean(np.abs(off - np.round(off)) < _WHOLE)) < 1.0 - _WHOLE:
        return None
    weights, deviations = _gap(item)
    ratio = item.value("gear.ratio")
    usual = [float(_gap(other)[0][1]) for other in healthy if other.moving.sum() >= _LEAST]
    more = (float(weights[1]) - (float(np.mean(usual)) if usual else 0.0)) / ratio
    noise = float(deviations[1]) / ratio
    # An error once a turn of the encoder's wheel is a slope over a part of it, anew each day.
    turns = item.value("sensor.encoder.wheel_ratio")
    error = math.hypot(noise, ENCODER_ERROR * turns / math.sqrt(3.0))
    if not max(LOST, _DEVIATIONS * error) < more < _OTHER:
        return None
    ends = _ends(more, error)
    kinds = [("missing_counts", "sensor.encoder"), ("gain", "sensor.resolver")]
    if noise > _STEPS * more:  # what is lost in one place leaves steps, no straight line
        kinds = [("dark_sectors", "sensor.encoder"), kinds[0]]
    cause = _sized(kinds, [x / (1.0 + x) for x in ends])
    return sign_of(cause, more, LOST, moves=_OF_COUNTS, text=_CLOSED, error=error)


def _cage(item: DriveLog) -> Sign | None:
    """Friction once a turn of the cage of the motor's bearing, at the order of its geometry."""
    log, moving = item.log, item.moving
    value = item.value
    gamma = value("bearing.ball_diameter") / value("bearing.pitch_diameter")
    order = 0.5 * (1.0 - gamma * math.cos(value("bearing.contact_angle")))
    current, speed = log["torque_current"], log["motor_speed"]
    half = max(1, round(_SMOOTH / log.period))
    rate = np.gradient(np.convolve(speed, np.ones(half) / half, "same"), log.time)
    way = np.sign(speed)
    turn = order * log["motor_position"]
    if float(np.ptp(turn[moving])) < 2.0 * np.pi * TURNS:
        return None
    columns = [way * np.cos(turn), way * np.sin(turn), way, way * log.time, speed, rate,
               np.ones_like(speed)]  # fmt: skip
    weights, covariance = regress([column[moving] for column in columns], current[moving])
    size, error = float(np.hypot(*weights[:2])), float(np.sqrt(np.trace(covariance[:2, :2])))
    limit = CAGE * float(np.sqrt(np.mean(current[moving] ** 2)))
    if size < max(limit, _DEVIATIONS * error):
        return None
    factor = 2.0 * value("control.torque_constant")  # between nothing and all of the drag
    drag, low, high = (factor * end for end in _ends(size, error))
    cause = Cause("bearing", "bearing.cage", "N m", 0.0, drag, (low, high))
    return sign_of(cause, size, limit, moves=_OF_CAGE, text=_CLOSED, error=error)


def _ends(size: float, error: float) -> tuple[float, float, float]:
    """Return a size and its interval of 90 %, with what the form itself is off by."""
    wide = 1.645 * math.hypot(error, FORM * size)
    return size, max(size - wide, 0.0), size + wide


def _sized(faults: Sequence[tuple[str, str]], ends: Sequence[float]) -> Cause:
    """Return a cause and those that look alike, its size as a share and interval read off a log."""
    size, low, high = ends
    places = tuple(FaultPlace(*other) for other in faults[1:])
    return Cause(*faults[0], "1", 0.0, size, (low, high), places)


def _cause(
    kind: str,
    place: str,
    others: Sequence[tuple[str, str]] = (),
    *,
    unit: str = "1",
    there: bool = True,
) -> Cause:
    """Return a cause that is there or not, or whose size no log tells."""
    size = 1.0 if there else math.nan
    places = tuple(FaultPlace(*other) for other in others)
    return Cause(kind, place, unit, 0.0, size, (size, size), places)
