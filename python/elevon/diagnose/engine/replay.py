"""Model runs of a log's test: what the healthy unit and each fault would show, and the spread."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, TypedDict

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.candidates import CandidateFault, of_a_magnet
from elevon.diagnose.positions.features import SIZES, FeatureVector, features_of
from elevon.experiment import Experiment, Inputs, Variant

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

_SIGNALS: Mapping[str, str] = {
    "output_position": "encoder_position", "motor_position": "motor_position",
    "speed_ref": "speed_ref", "motor_speed": "motor_speed", "current_ref": "current_ref",
    "torque_current": "current_q_meas", "torque_voltage": "voltage_q_ref",
}  # fmt: skip
_RATE = 400.0  # Hz of the model's signals
_DRAWS = 40
_POINTS = 6  # severities of each candidate

#: Deviation of what changes from run to run of a healthy unit. ASSUMED, all: 15 K of winding and
#: 10 K of magnets (-0.1 %/K), friction that depends on temperature and running-in, sensors of
#: ordinary class, a supply within its regulation.
SPREAD: Mapping[str, tuple[float, str]] = {
    "motor.winding_temperature": (15.0, "add"),
    "motor.emf_constant": (0.01, "scale"),
    "friction.dynamic": (0.05, "scale"),
    "friction.viscous": (0.10, "scale"),
    "inverter.supply_voltage": (0.02, "scale"),
    "gain@sensor.current_a": (0.005, "fault"),
    "gain@sensor.current_b": (0.005, "fault"),
    "gain@sensor.current_c": (0.005, "fault"),
    "load.brake": (0.02, "brake"),
}


class Replay:
    """Features of the model in one test.

    Attributes
    ----------
    healthy : FeatureVector
        Of the actuator file as it is.
    severities : mapping of str to ndarray, shape (m,)
        Key of the candidate to the severities that were run.
    shifts : mapping of str to ndarray, shape (m, k)
        What they do to the features; of sizes (`SIZES`) the part at a right angle.
    draws : ndarray, shape (d, k)
        Features of healthy units as they differ from run to run.
    uncertainties : mapping of str to ndarray, shape (m, k)
        What severities do to features that depends on an angle no log shows, by key: its deviation.
    """

    def __init__(
        self,
        healthy: FeatureVector,
        severities: Mapping[str, Floats],
        shifts: Mapping[str, Floats],
        draws: Floats,
        uncertainties: Mapping[str, Floats] | None = None,
    ) -> None:
        self.healthy = healthy
        self.severities = severities
        self.shifts = shifts
        self.draws = draws
        self.uncertainties = {} if uncertainties is None else uncertainties

    def shift(self, key: str, severity: Floats) -> Floats:
        """Return what severities of shape (m,) do to the features, shape (m, k)."""
        return _read(self.severities[key], self.shifts[key], severity)

    def uncertainty(self, key: str, severity: float) -> Floats:
        """Return the deviation that a severity gives the features, shape (k,)."""
        if key not in self.uncertainties:
            return np.zeros(len(self.healthy.names))
        table = _read(self.severities[key], self.uncertainties[key], np.array([severity]))
        return np.asarray(table[0], dtype=np.float64)


def _read(at: Floats, table: Floats, severity: Floats) -> Floats:
    columns = [np.interp(severity, at, column) for column in table.T]
    return np.asarray(np.column_stack(columns), dtype=np.float64)


def logged_features(log: Log, actuator: Actuator) -> FeatureVector:
    """Return the features of a log."""
    return features_of(log.without("command"), **_constants(actuator))


def replay(
    item: Log,
    actuator: Actuator,
    candidates: Sequence[CandidateFault],
    baselines: Sequence[Log] = (),
) -> Replay:
    """Run the test on the model: healthy, each candidate at several severities, and the spread.

    The healthy run is always the log's own. Shifts and spread are those of the first baseline that
    is of the same test by its note, run once for all logs that stand against it; without one they
    are the log's own. So they depend on what the caller gives, not on earlier calls.

    Parameters
    ----------
    item : Log
        Prepared.
    actuator : Actuator
        The healthy unit.
    candidates : sequence of CandidateFault
        Faults.
    baselines : sequence of Log
        Prepared; whose runs may serve.
    """
    alike = next((b for b in baselines if candidates and _same_runs(item, b)), item)
    made = _remembered(alike, actuator, candidates)
    return made if alike is item else _about(made, modelled(item, actuator))


def modelled(item: Log, actuator: Actuator) -> FeatureVector:
    """Return the features of the healthy model in a log's test."""
    return _remembered(item, actuator, ()).healthy


def _about(made: Replay, healthy: FeatureVector) -> Replay:
    """Return the runs of another log of the test about a log's own healthy run."""
    names = tuple(n for n in made.healthy.names if n in healthy.names)
    at = [made.healthy.names.index(n) for n in names]
    healthy = healthy.only(names)
    return Replay(
        healthy,
        made.severities,
        {key: table[:, at] for key, table in made.shifts.items()},
        made.draws[:, at] + healthy.values - made.healthy.values[at],
        {key: table[:, at] for key, table in made.uncertainties.items()},
    )


_REMEMBERED = 32  # logs
_RECENT: dict[Any, Replay] = {}  # by all that the runs depend on; the latest is the last


def _remembered(item: Log, actuator: Actuator, candidates: Sequence[CandidateFault]) -> Replay:
    actuator = of_a_magnet(actuator)
    key = (actuator.hash, tuple(candidates), _digest(item))
    made = _RECENT.pop(key, None) or _replayed(item, actuator, candidates)
    _RECENT[key] = made
    while len(_RECENT) > _REMEMBERED:
        _RECENT.pop(next(iter(_RECENT)))
    return made


def _digest(log: Log) -> bytes:
    """Of all in a log that its model runs depend on."""
    braked, current = log.brake.measured, log.has("torque_current")
    state = (braked, log.duration, log.output[0], log.speed[0], log.has("torque_voltage"), current)
    out = hashlib.sha256(f"{state!r}".encode())
    brake = (log.brake.time, log.brake.level) if braked else ()
    for array in (log.time, log["command"], log.good, *brake):
        out.update(f"{array.shape}".encode() + np.ascontiguousarray(array).tobytes())
    return out.digest()


def _same_runs(a: Log, b: Log) -> bool:
    """Whether faults do the same in two logs: one test by the notes, as much of it measured."""
    if a.note is None or b.note is None or a.note.waveform is None:
        return False
    shows = ("torque_current", "torque_voltage")
    alike = [[log.brake.measured, *map(log.has, shows)] for log in (a, b)]
    noted = (a.note.parameters, b.note.parameters)
    if a.note.waveform != b.note.waveform or noted[0].keys() != noted[1].keys():
        return False
    pairs = [(a.duration, b.duration, 0.02), (a.period, b.period, 0.01)]
    pairs += [(float(a.good.mean()), float(b.good.mean()), 0.05)]
    pairs += [(noted[0][n], noted[1][n], 0.005) for n in noted[0]]
    if a.brake.measured and b.brake.measured:
        pairs.append((float(np.mean(a.brake.level)), float(np.mean(b.brake.level)), 0.1))
    near = all(abs(x - y) <= e * max(abs(x), abs(y)) for x, y, e in pairs)
    return near and alike[0] == alike[1]


def _replayed(item: Log, actuator: Actuator, candidates: Sequence[CandidateFault]) -> Replay:
    severities = {c.key: _severities(c) for c in candidates}
    units = [ReplayUnit()]
    for c in candidates:
        units += [ReplayUnit({}, (c.text(float(s)),)) for s in severities[c.key] if s != 0.0]
    if candidates:
        units += [_drawn(actuator, np.random.default_rng([15, k])) for k in range(_DRAWS)]
    constants = _constants(actuator)
    features = [
        features_of(run, **constants, deviations=False) for run in runs(item, actuator, units)
    ]
    names = tuple(n for n in features[0].names if all(n in s.names for s in features))
    rows = np.array([s.only(names).values for s in features])
    shifts, uncertainties, at = {}, {}, 1
    for c in candidates:
        zero = severities[c.key] == 0.0
        table = np.zeros((len(zero), len(names)))
        count = int((~zero).sum())
        table[~zero] = _moved_by(rows[at : at + count], rows[0], names)
        shifts[c.key] = table * [
            n not in c.fixed_features and (not c.known_features or n in c.known_features)
            for n in names
        ]
        if c.known_features:
            uncertainties[c.key] = np.abs(table * [n not in c.known_features for n in names])
        at += count
    return Replay(features[0].only(names), severities, shifts, rows[at:], uncertainties)


def _moved_by(rows: Floats, healthy: Floats, names: Sequence[str]) -> Floats:
    """Differences from the healthy run; of sizes, what must be added at a right angle."""
    out = rows - healthy
    for k, name in enumerate(names):
        if name in SIZES:
            power = np.maximum(rows[:, k] ** 2 - healthy[k] ** 2, 0.0)
            out[:, k] = np.sqrt(power)
    return out


class _Constants(TypedDict):
    """Of the actuator, for the regressions."""

    ratio: float
    pole_pairs: float
    emf: float


def _constants(actuator: Actuator) -> _Constants:
    value = actuator.parameters.value
    return {
        "ratio": value("gear.ratio"),
        "pole_pairs": value("motor.pole_pairs"),
        "emf": value("motor.emf_constant"),
    }


def _severities(candidate: CandidateFault) -> Floats:
    """Zero, and severities that grow by squares from it to each end of the range."""
    steps = np.linspace(0.0, 1.0, _POINTS) ** 2
    low = candidate.low * steps[:0:-1] if candidate.low < 0.0 else np.zeros(0)
    return np.concatenate((low, candidate.high * steps))


@dataclass(frozen=True)
class ReplayUnit:
    """A unit of the replay: values, faults, brake over the logged one, where its motor starts."""

    values: Mapping[str, float] = field(default_factory=dict)
    faults: tuple[str, ...] = ()
    brake: float = 1.0
    turn: float = 0.0


def runs(log: Log, actuator: Actuator, units: Sequence[ReplayUnit]) -> Iterator[Log]:
    """Run all units through the log's test; what each would have shown in its place."""
    output, motor = (
        float(log.output[0]),
        float(log.output[0]) * actuator.parameters.value("gear.ratio"),
    )
    brake = log.brake
    inputs = Inputs(
        duration=log.duration,
        mode="position",
        command=(log.time, log["command"]),
        loads={"brake": (brake.time, brake.level)} if brake.measured else {},
        initial={
            "motor_position": motor, "motor_speed": float(log.speed[0]), "output_position": output,
        },
    )  # fmt: skip
    experiment = Experiment(log, actuator, inputs, _shows(log), rate=f"{_RATE:g} Hz")
    variants = [
        Variant(
            unit.values,
            unit.faults,
            {"brake": (brake.time, unit.brake * brake.level)} if brake.measured else {},
            {"motor_position": motor + unit.turn},
        )
        for unit in units
    ]
    for run in experiment.run(variants):
        yield run.seen(log).with_channels(command=log["command"])


def _shows(log: Log) -> dict[str, str]:
    """What a log shows, and its current's set point: role to the model's signal."""
    return {role: name for role, name in _SIGNALS.items() if log.has(role) or role == "current_ref"}


def _drawn(actuator: Actuator, rng: np.random.Generator) -> ReplayUnit:
    """Return a healthy unit of another day; `turn` moves its motor: no log tells the zero."""
    values: dict[str, float] = {}
    faults, brake = [], 1.0
    for path, (spread, way) in SPREAD.items():
        step = spread * float(rng.standard_normal())
        if way == "fault":
            faults.append(f"{path}={step!r}")
        elif way == "brake":
            brake += step
        else:
            old = actuator.parameters.value(path)
            values[path] = old + step if way == "add" else old * max(1.0 + step, 0.05)
            if path == "friction.dynamic":
                static = actuator.parameters.value("friction.static")
                values["friction.static"] = static * max(1.0 + step, 0.05)
    value = actuator.parameters.value
    # Within the backlash: further off the output would not be where the motor holds it.
    most = min(
        0.45 * value("backlash.total") * value("gear.ratio"), math.pi / value("motor.pole_pairs")
    )
    turn = float(rng.uniform(-most, most))
    return ReplayUnit(values, tuple(faults), brake, turn)
