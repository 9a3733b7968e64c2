"""A servo's log with both positions: its features, and what the model shows in its place."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.candidates import of_a_magnet
from elevon.diagnose.engine.days import DAILY, moved_value
from elevon.diagnose.engine.reading import Days, Reading, ReplayUnit, SignalPanel
from elevon.diagnose.engine.table import FeatureTable, FeatureVector
from elevon.diagnose.positions.features import ENCODER_ERROR, FEATURES, features_of
from elevon.diagnose.positions.log import LONGEST, RUN_IN, prepared
from elevon.diagnose.positions.plausibility import PLAUSIBLE, plausibility_of
from elevon.experiment import Experiment, Inputs, Variant
from elevon.logs.command.curve import command_curve
from elevon.simulate.prepare import solver_step
from elevon.units import to_display

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log

_SIGNALS: Mapping[str, str] = {
    "output_position": "encoder_position", "motor_position": "motor_position",
    "speed_ref": "speed_ref", "motor_speed": "motor_speed", "current_ref": "current_ref",
    "torque_current": "current_q_meas", "torque_voltage": "voltage_q_ref",
}  # fmt: skip
_RATE = 400.0  # Hz of the model's signals, at least
_DRAWS = 40
_SAME = 0.2  # relative difference of two logs' motion up to which they are one test
_NOTED = 0.02  # of two noted parameters

#: What of `DAILY` varies here, and sensors of ordinary class: gains of current sensors as faults,
#: the brake's torque. The drive's supply is regulated to 2 %. ASSUMED.
SPREAD: Mapping[str, tuple[float, str]] = {
    **{
        path: DAILY[path]
        for path in ("motor.winding_temperature", "motor.emf_constant", "friction.dynamic",
                     "friction.viscous")
    },
    "inverter.supply_voltage": (0.02, "scale"),
    "gain@sensor.current_a": (0.005, "fault"),
    "gain@sensor.current_b": (0.005, "fault"),
    "gain@sensor.current_c": (0.005, "fault"),
    "load.brake": (0.02, "brake"),
}  # fmt: skip
#: With a brake of unknown torque the model gives nothing of friction: many times the unit's own.
BRAKE_UNKNOWN: FeatureTable = {
    **FEATURES,
    **{
        name: replace(FEATURES[name], mismatch=(10.0, 0.0), pooled=0.0)
        for name in ("dry_current", "viscous_current")
    },
}
#: Features that only a measured torque current gives.
_OF_THE_CURRENT = frozenset(
    ["dry_current", "viscous_current", "inertia_current", "brake_current", "current_order_1",
     "current_order_2", "current_shaft", "current_sideband", "voltage_per_current"]
)  # fmt: skip
#: What a log may lack, and what that costs.
_LOST = {
    "torque_current": "no measured torque current (r78): friction, current ripple and faults of "
    "the drive's current loop and of current sensors are not seen",
    "torque_voltage": "no voltage (r1733): shorts, eccentricity and lost flux are judged by the "
    "current's ripple alone",
}


def logged_features(log: Log, actuator: Actuator, *, deviations: bool = True) -> FeatureVector:
    """Return the features of a log."""
    value = actuator.parameters.value
    return features_of(
        log, ratio=value("gear.ratio"), pole_pairs=value("motor.pole_pairs"),
        emf=value("motor.emf_constant"), deviations=deviations,
    )  # fmt: skip


class PositionReading(Reading):
    """A log of a turning servo, by regressions of its positions, current and voltage.

    Parameters
    ----------
    log : Log
        As `elevon.diagnose.positions.log.prepared` takes it.
    actuator : Actuator
        The healthy unit.
    """

    # Nearly Gaussian: the least deviations are generous, so most numbers stand closer than stated;
    # with few degrees that counts as a day of small spread, and what does vary as a fault.
    DEGREES = 200.0
    SEVERITIES = (5, 2)

    def __init__(self, log: Log, actuator: Actuator) -> None:
        self._whole = log.duration  # s
        self.log = prepared(log, actuator)
        self.actuator = of_a_magnet(actuator)

    @cached_property
    def features(self) -> FeatureVector:
        """What the log shows."""
        return logged_features(self.log.without("command"), self.actuator)

    @cached_property
    def plausible(self) -> FeatureVector:
        """What the log shows beside that and no candidate moves."""
        return plausibility_of(self.log, self.actuator)

    def plausible_of(self, units: Sequence[ReplayUnit]) -> list[FeatureVector]:
        """Return the same of units that run the test."""
        return [plausibility_of(run, self.actuator) for run in self._runs(units)]

    @property
    def plausible_table(self) -> FeatureTable:
        """Records of that."""
        return PLAUSIBLE

    @cached_property
    def _moved_by_encoder(self) -> tuple[list[FeatureVector], list[FeatureVector]]:
        turn = self.actuator.parameters.value("sensor.encoder.wheel_ratio") * self.log.output
        features: list[FeatureVector] = []
        plausible: list[FeatureVector] = []
        bare = self.log.without("command")
        for wave in (np.cos(turn), np.sin(turn)):
            error = ENCODER_ERROR / math.sqrt(6.0) * wave  # of a size up to that, and any phase
            other = bare.with_channels(output_position=bare.output + error)
            features.append(_less(logged_features(other, self.actuator, deviations=False),
                                  self.features))  # fmt: skip
            plausible.append(_less(plausibility_of(other, self.actuator), self.plausible))
        return features, plausible

    def periodic(self) -> tuple[list[FeatureVector], list[FeatureVector]]:
        """Return what the encoder's error once a turn of its wheel moves, its phase being free.

        The wheel stands somewhere else each time the drive is switched on.
        """
        return self._moved_by_encoder

    @property
    def table(self) -> FeatureTable:
        """Its features' records."""
        return BRAKE_UNKNOWN if self.log.brake.unknown else FEATURES

    def lookalike_moves(self, key: str, severity: float) -> dict[str, float]:
        """Return what an error once an output turn adds to the slope of a sensor's gain."""
        sign = {"gain@sensor.encoder": 1.0, "gain@sensor.resolver": -1.0}.get(key)
        if sign is None:
            return {}
        ratio = self.actuator.parameters.value("gear.ratio")
        stroke = float(np.ptp(self.log.output[self.log.good]))
        return {"position_cubic": sign * ratio * severity * stroke**3 / 6.0}

    def digest(self) -> bytes:
        """Of all in the log that its model runs depend on."""
        log = self.log
        braked, shows = log.brake.measured, [log.has(r) for r in _LOST]
        state = (braked, log.brake.unknown, log.duration, log.output[0], log.speed[0], *shows)
        out = hashlib.sha256(f"{state!r}".encode())
        brake = (log.brake.time, log.brake.level) if braked else ()
        for array in (log.time, log["command"], log.good, *brake):
            out.update(f"{array.shape}".encode() + np.ascontiguousarray(array).tobytes())
        return out.digest()

    def outcomes(self, units: Sequence[ReplayUnit]) -> Iterator[FeatureVector]:
        """Run units through the test; what each would have shown in the log's place."""
        for run in self._runs(units):
            yield logged_features(run, self.actuator, deviations=False)

    def _runs(self, units: Sequence[ReplayUnit]) -> Iterator[Log]:
        log, brake, output = self.log, self.log.brake, float(self.log.output[0])
        inputs = Inputs(
            duration=log.duration,
            mode="position",
            command=command_curve(log).points,
            loads={"brake": (brake.time, brake.level)} if brake.measured else {},
            initial={
                "motor_position": output * self.actuator.parameters.value("gear.ratio"),
                "motor_speed": float(log.speed[0]), "output_position": output,
            },
        )  # fmt: skip
        shows = {r: name for r, name in _SIGNALS.items() if log.has(r) or r == "current_ref"}
        experiment = Experiment(log, self.actuator, inputs, shows, rate=f"{self._rate:.12g} Hz")
        for run in experiment.run([unit.variant for unit in units]):
            yield run.seen(log).with_channels(command=log["command"])

    @property
    def _rate(self) -> float:
        """Of the model's signals [Hz]: the log's, where that is faster.

        Signals between whose samples the log has samples would be drawn straight there, and the
        small difference of command and position is off by what they bend.
        """
        step = solver_step(self.actuator, "low")
        each = int(self.log.period / step * (1.0 + 1e-6))
        return max(_RATE, 1.0 / (max(each, 1) * step))

    def days(self) -> Days:
        """Return healthy units of other days."""
        return Days([self._day(np.random.default_rng([15, k])) for k in range(_DRAWS)])

    def _day(self, rng: np.random.Generator) -> ReplayUnit:
        """A healthy unit of another day, its motor turned: no log tells the zero."""
        value = self.actuator.parameters.value
        values: dict[str, float] = {}
        faults, loads = [], {}
        for path, (spread, way) in SPREAD.items():
            step = spread * float(rng.standard_normal())
            if way == "fault":
                faults.append(f"{path}={step!r}")
            elif way == "brake":
                brake = self.log.brake
                if brake.measured:
                    loads = {"brake": (brake.time, (1.0 + step) * brake.level)}
            else:
                values[path] = moved_value(value(path), step, way)
                if path == "friction.dynamic":
                    values["friction.static"] = moved_value(value("friction.static"), step, way)
        # Within the backlash: further off the output would not be where the motor holds it.
        ratio = value("gear.ratio")
        most = min(0.45 * value("backlash.total") * ratio, math.pi / value("motor.pole_pairs"))
        start = float(self.log.output[0]) * ratio + float(rng.uniform(-most, most))
        return ReplayUnit(Variant(values, tuple(faults), loads, {"motor_position": start}))

    def drawn(self, units: Sequence[ReplayUnit]) -> list[SignalPanel]:
        """Return the log's signals that a page draws, each beside those of units."""
        sources = [self.log, *self._runs(units)]
        ratio, good = self.actuator.parameters.value("gear.ratio"), self.log.good
        return [
            SignalPanel(
                "Difference of the two positions", "deg", *(_gap(s, ratio) for s in sources)
            ),
            SignalPanel("Torque current", "A", *(s.current[good] for s in sources)),
            SignalPanel(
                "Motor speed",
                "rpm",
                *(np.asarray(to_display(s.speed[good], "rpm")) for s in sources),
            ),
        ]

    def same(self, other: Reading) -> bool:
        """Whether a baseline is of the same test: by the notes, else brake, motion and speed."""
        a, b = self.log, other.log
        if a.brake.measured != b.brake.measured or a.brake.unknown != b.brake.unknown:
            return False
        notes = (a.note, b.note)
        if all(note is not None and note.waveform for note in notes):
            first, second = (note.parameters for note in notes if note is not None)
            names = first.keys() & second.keys()
            alike = notes[0].waveform == notes[1].waveform  # type: ignore[union-attr]
            return alike and all(_near(first[n], second[n], _NOTED) for n in names)
        sizes = [(float(np.std(x.output)), float(np.sqrt(np.mean(x.speed**2)))) for x in (a, b)]
        return all(_near(x, y, _SAME) for x, y in zip(*sizes, strict=True))

    def serves(self, other: Reading) -> bool:
        """Whether faults do the same in both: one test by the notes, as much of it measured."""
        a, b = self.log, other.log
        if a.note is None or b.note is None or a.note.waveform is None:
            return False
        alike = [[log.brake.measured, *map(log.has, _LOST)] for log in (a, b)]
        noted = (a.note.parameters, b.note.parameters)
        if a.note.waveform != b.note.waveform or noted[0].keys() != noted[1].keys():
            return False
        pairs = [(a.duration, b.duration, 0.02), (a.period, b.period, 0.01)]
        pairs += [(float(a.good.mean()), float(b.good.mean()), 0.05)]
        pairs += [(noted[0][n], noted[1][n], 0.005) for n in noted[0]]
        if a.brake.measured and b.brake.measured:
            pairs.append((float(np.mean(a.brake.level)), float(np.mean(b.brake.level)), 0.1))
        return all(_near(x, y, e) for x, y, e in pairs) and alike[0] == alike[1]

    def usable(self, names: Sequence[str], same: Sequence[Reading]) -> list[str]:
        """Return the features that count with these baselines."""
        if all(item.log.has("torque_current") for item in (self, *same)):
            return list(names)
        # A set point has the derivative's spikes, which the motor's current never follows.
        return [n for n in names if n not in _OF_THE_CURRENT]

    def pools(self, other: Reading) -> bool:
        """Whether a baseline of another test says something of friction."""
        return other.log.has("torque_current") and not other.log.brake.unknown

    def notes(self, same: Sequence[Reading]) -> list[str]:
        """Return what the log lacks and what it costs."""
        log = self.log
        out = []
        if not same:
            out.append(
                "no baseline of this test: how far a healthy unit deviates from the model is "
                "assumed, small faults are not seen"
            )
        if self._whole > LONGEST:
            out.append(f"read for {LONGEST:g} s from where it begins to move")
        out += [text for role, text in _LOST.items() if not log.has(role)]
        if log.brake.unknown:
            out.append(
                "the brake acted and its torque is not known (no load-cell file, or no arm): "
                "friction is held against baselines of this test only"
            )
        if log.gain is None:
            out.append("no waveform explains the command: drift of the position gain is not seen")
        missing = 1.0 - float(np.mean(log.good[log.time >= RUN_IN]))
        if missing > 0.01:
            out.append(f"{100 * missing:.0f} % of the samples are missing; left out")
        if self.features.floats:
            out.append(
                "the output is not carried through its backlash by friction but flies in it on its "
                "own; the backlash is read from the width of the two positions' difference"
            )
        return [f"{log.name}: {text}" for text in out]


def _less(one: FeatureVector, other: FeatureVector) -> FeatureVector:
    """Return the difference of the features that both have."""
    names = tuple(name for name in one.names if name in other.names)
    off = one.only(names).values - other.only(names).values
    return FeatureVector(names, off, np.zeros(len(names)))


def _near(a: float, b: float, share: float) -> bool:
    return abs(a - b) <= share * max(abs(a), abs(b))


def _gap(signals: Log, ratio: float) -> Floats:
    """Motor less output [deg] about the middle of its ends: where the zeros are does not matter."""
    gap = np.degrees(signals.motor / ratio - signals.output)[signals.good]
    low, high = np.percentile(gap, [1.0, 99.0])
    return np.asarray(gap - 0.5 * (low + high))
