"""A log by its roles: its numbers, and what the reduced-order model shows by the same roles."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.diagnose.engine.days import daily, factors_of
from elevon.diagnose.engine.reading import Days, Reading, ReplayUnit, SignalPanel
from elevon.diagnose.engine.table import FeatureTable, FeatureVector, deviations
from elevon.diagnose.positions.plausibility import PLAUSIBLE, plausibility_of
from elevon.diagnose.roles.numbers import (
    Numbers,
    averaged,
    lines,
    noise_deviation,
    numbers_of,
    oversampling,
    smoothed,
)
from elevon.experiment import Experiment, Inputs, Variant, signals_by_role
from elevon.logs.log import Log, bridged, on_clock
from elevon.parameters.records import wirings
from elevon.simulate.prepare import solver_step
from elevon.units import display_unit, to_display

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.logs.log import Log


_SMOOTH = 0.05  # s over which a load is averaged before it becomes straight lines
_ROUGH = 0.01  # of the load's size: what straight lines may miss
_NOISE = 5.0  # deviations of its noise that a load's RMS must reach to be one
_LOADED = 0.15  # of the load's size, RMS; a load that follows the motion differs with the unit
_PUSHED = 0.1  # of the greatest load, of the fastest motion, and share of the time
_KNOTS = 9  # of the model's load over its stroke
_TIED = 1e-3  # of a knot's neighbours, where no sample determines a knot


@dataclass(frozen=True)
class OverStroke:
    """A load that follows the position, as stands load an actuator that actions command.

    Attributes
    ----------
    stroke : float
        m; the knots lie evenly over it.
    forces : tuple of float
        At the knots, positive where they oppose positive motion, N.
    low, high : float
        Positions between which the log shows it, m.
    """

    stroke: float
    forces: tuple[float, ...]
    low: float
    high: float

    def at(self, position: Floats) -> Floats:
        """Return the load at positions, shape (n,)."""
        places = np.linspace(0.0, self.stroke, _KNOTS)
        return np.asarray(np.interp(position, places, self.forces), dtype=np.float64)

    def settings(self, actuator: Actuator) -> dict[str, float]:
        """Return the model's load over its stroke with this one in it, by path."""
        value = actuator.parameters.value
        factor = value("load.factor")
        paths = [f"load.force_{k}" for k in range(_KNOTS)]
        forces = {p: factor * value(p) - f for p, f in zip(paths, self.forces, strict=True)}
        return {"load.factor": 1.0, **forces}


def read_load(
    actuator: Actuator, time: Floats, channels: Mapping[str, Floats]
) -> tuple[tuple[Floats, Floats] | None, OverStroke | None]:
    """Return a log's load over time as straight lines, and over the position where that is known.

    With a load over the position, the one over time is what that leaves. None where the log's
    load is its noise.
    """
    load = channels["load"]
    width = max(1, round(_SMOOTH / float(time[1] - time[0])))
    smooth = smoothed(load, width)
    if float(np.sqrt(np.mean(smooth**2))) < _NOISE * noise_deviation(load) / np.sqrt(width):
        return None, None
    size = float(np.abs(smooth).max())
    known = actuator.parameters
    over = None
    if f"load.force_{_KNOTS - 1}" in known and "output_position" in channels:
        position = channels["output_position"]
        over = _over_stroke(position, load, known.value("lever.stroke"))
        smooth = smoothed(load - over.at(position), width)
    return lines(time, smooth, _ROUGH * size), over


def _over_stroke(position: Floats, load: Floats, stroke: float) -> OverStroke:
    """Least squares of straight lines between the knots."""
    places = np.linspace(0.0, stroke, _KNOTS)
    hats = np.column_stack([np.interp(position, places, row) for row in np.eye(_KNOTS)])
    tied = _TIED * np.diff(np.eye(_KNOTS), axis=0)
    forces = np.linalg.lstsq(
        np.vstack([hats / np.sqrt(len(load)), tied]),
        np.concatenate([load / np.sqrt(len(load)), np.zeros(_KNOTS - 1)]),
        rcond=None,
    )[0]
    ends = np.clip([position.min(), position.max()], 0.0, stroke)
    return OverStroke(stroke, tuple(forces.tolist()), float(ends[0]), float(ends[1]))


def load_alike(
    a: tuple[tuple[Floats, Floats] | None, OverStroke | None],
    b: tuple[tuple[Floats, Floats] | None, OverStroke | None],
    grid: Floats,
) -> bool:
    """Whether two tests were loaded alike, at the positions or the instants that both show."""
    (first, over_first), (second, over_second) = a, b
    if over_first is not None and over_second is not None:
        low = max(over_first.low, over_second.low)
        high = max(low, min(over_first.high, over_second.high))
        places = np.linspace(low, high, len(grid))
        pushes = [over_first.at(places), over_second.at(places)]
    elif (over_first is None) != (over_second is None):
        return False
    else:
        none = (np.zeros(1), np.zeros(1))
        pushes = [np.interp(grid, *(none if x is None else x)) for x in (first, second)]
    largest = max(float(np.abs(push).max()) for push in pushes)
    off = float(np.sqrt(np.mean((pushes[0] - pushes[1]) ** 2)))
    return off <= _LOADED * largest


def drives_output(log: Log, deflection: Floats | None) -> bool:
    """Whether a load drives the output of an elastic backlash over a tenth of the motion."""
    if deflection is None:
        return False
    speed = np.gradient(log["command"], log.time)
    pushed = deflection * np.sign(speed) < -_PUSHED * np.abs(deflection).max()
    moving = np.abs(speed) > _PUSHED * np.abs(speed).max()
    return bool(np.mean(pushed[moving]) > _PUSHED)


#: What is put in, not measured.
INPUTS = frozenset(["command", "load"])
BEFORE = 0.1  # s before the onset that are read
_ALIKE = 0.05  # of the command's range, RMS, up to which two commands are the same
_SERVES = 0.005  # likewise, up to which faults do the same in both
_SOONER = 1.3  # times the length of a log's baseline that the log may have
_ELASTIC = 1.0  # backlash.model: an elastic contact
_SET_POINT = "_ref"  # end of roles that a drive knows as numbers: nothing filters them
_DRAWS = 28
#: Deviations of the days that are run over those stated: what sets in on a rare day is seen, and
#: counts in full; what is linear counts as stated.
_WIDE = 2.0
_LATE = 0.1  # deviation, in samples, of where a log is seen to begin. ASSUMED: straight onsets
#: Roles that are drawn, the first three of a log.
_DRAWN = (
    "output_position", "torque_current", "motor_speed", "supply_current", "torque_voltage", "state",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class RoleReading(Reading):
    """The test of a log, counted from its onset, and what the log shows.

    Attributes
    ----------
    log : Log
        On an even clock whose zero is the onset; it begins `BEFORE` it.
    actuator : Actuator
        The healthy unit, with what the log's stand set.
    rate, seconds : float
        Hz; s after the onset.
    command : (ndarray, ndarray)
        Instants and values of straight lines; of actions, instants and numbers.
    actions : tuple of str
        That command the actuator; none where a position is commanded.
    load : (ndarray, ndarray) or None
        Instants and force or torque on the output, positive where it opposes positive motion; with
        a load over the stroke what that leaves.
    stroke : OverStroke or None
        Load over the position, for a model that has one.
    own_load : bool
        Whether the model loads itself: the log's load is then an output, not an input.
    initial : mapping of str to float or str
        Signal to where it starts.
    settings : mapping of str to float or str
        Parameters that the stand set.
    note : str
        Stand and step that the log names, if any.
    findings : tuple of str
        What the caller should know.
    like : RoleReading or None
        The baseline that decides whether the output deflects.
    """

    # Nearly Gaussian. The least deviations are generous, so most numbers stand closer than stated;
    # with few degrees that would count as a day of small spread, and what does vary as a fault.
    DEGREES = 200.0
    SEVERITIES = (4, 3)
    SETS_IN = True
    ALIKE = 2.0
    # What the reduced-order model lacks moves many numbers together, which no prior of each states.
    PRIOR = False

    log: Log
    actuator: Actuator
    rate: float
    seconds: float
    command: tuple[Floats, Floats]
    actions: tuple[str, ...]
    load: tuple[Floats, Floats] | None
    stroke: OverStroke | None
    own_load: bool
    initial: Mapping[str, float | str]
    settings: Mapping[str, float | str]
    note: str = ""
    findings: tuple[str, ...] = ()
    like: RoleReading | None = None

    @cached_property
    def seen(self) -> Mapping[str, Floats]:
        """What the log shows, not what was put in: role to values, shape (n,)."""
        own_load = {"load"} if self.own_load else set()
        return {r: v for r, v in self.log.channels.items() if r not in INPUTS - own_load}

    @cached_property
    def _read(self) -> tuple[FeatureVector, FeatureTable]:
        numbers = self._numbers(self.seen, noisy=True)
        values = np.array(list(numbers.values.values()))
        std = np.array([numbers.noise[name] for name in numbers.values])
        return FeatureVector(tuple(numbers.values), values, std), numbers.table()

    @property
    def features(self) -> FeatureVector:
        """What the log shows."""
        return self._read[0]

    @property
    def table(self) -> FeatureTable:
        """Its features' records."""
        return self._read[1]

    @cached_property
    def plausible(self) -> FeatureVector:
        """What the log shows beside that and no candidate moves."""
        return plausibility_of(self.log, self.actuator)

    @property
    def plausible_table(self) -> FeatureTable:
        """Records of that."""
        return PLAUSIBLE

    def plausible_of(self, units: Sequence[ReplayUnit]) -> list[FeatureVector]:
        """Return the same of units that run the test."""
        runs = self._channels(units)
        return [plausibility_of(self.log.with_channels(**r), self.actuator) for r in runs]

    def _numbers(self, channels: Mapping[str, Floats], *, noisy: bool = False) -> Numbers:
        known, log = self.actuator.parameters, self.log
        pairs = known.value("motor.pole_pairs") if "motor.pole_pairs" in known else None
        return numbers_of(channels, log["command"], log.time, log.units, pairs, noisy=noisy)

    def digest(self) -> bytes:
        """Of all in the log that its model runs depend on."""
        state = (self.seconds, self.rate, sorted(self.seen), self.stroke, self.own_load,
                 sorted(self.initial.items()), sorted(self.settings.items()),
                 self._compliant)  # fmt: skip
        out = hashlib.sha256(f"{state!r}".encode())
        # The table's least sizes are those of the log's channels.
        tables = (
            self.log.time,
            self.log["command"],
            self.log.good,
            *self.command,
            *(self.load or ()),
        )
        for array in (*tables, *(self.seen[role] for role in sorted(self.seen))):
            out.update(f"{array.shape}".encode() + np.ascontiguousarray(array).tobytes())
        return out.digest()

    def outcomes(self, units: Sequence[ReplayUnit]) -> Iterator[FeatureVector]:
        """Run units through the test; what each would have shown in the log's place."""
        for channels in self._channels(units):
            values = self._numbers(channels).values
            array = np.array(list(values.values()))
            yield FeatureVector(tuple(values), array, np.zeros(len(array)))

    def _channels(self, units: Sequence[ReplayUnit]) -> Iterator[dict[str, Floats]]:
        """What each unit shows by the log's roles, on its instants."""
        known = signals_by_role(self.actuator.wiring, "low")
        signals = {role: known[role] for role in self.seen if role in known}
        step = solver_step(self.actuator, "low")
        over = oversampling(self.rate, step)
        # In whole steps: a log's rate need be none, and what it shows is read at its own instants.
        each = max(round(1.0 / (over * self.rate * step)), 1) * step
        experiment = Experiment(
            self.log, self.actuator, self._inputs(), signals, rate=f"{1.0 / each:.12g} Hz"
        )
        deflection = self.deflection
        runs = experiment.run([unit.variant for unit in units])
        for unit, run in zip(units, runs, strict=True):
            phase = 0.0 if self.actions else unit.variant.later
            shows = self._as_logged(run.log, unit.late / self.rate + phase)
            compliant = self._compliant if unit.compliant is None else unit.compliant
            if deflection is not None and compliant and "output_position" in shows:
                shows["output_position"] = shows["output_position"] - deflection
            yield shows

    def _inputs(self) -> Inputs:
        times, values = self.command
        steps = tuple(
            (max(float(t) + BEFORE, 0.0), self.actions[int(n) % len(self.actions)])
            for t, n in zip(times, values, strict=True)
            if self.actions and t < self.seconds
        )
        return Inputs(
            self.seconds + BEFORE + 2.0 / self.rate,
            wirings()[self.actuator.wiring]["modes"][0],
            None if self.actions else (times + BEFORE, values),
            steps,
            {} if self.load is None else {"output": (self.load[0] + BEFORE, self.load[1])},
            dict(self.initial),
        )

    def _as_logged(self, run: Log, late: float) -> dict[str, Floats]:
        """A run by role, on the log's instants; one that ended early shows its end on."""
        clock, at = run.time, self.log.time + BEFORE + late
        over = round(1.0 / (self.rate * (clock[1] - clock[0]))) if len(clock) > 1 else 1
        out = {}
        for role in run:
            values = np.nan_to_num(run[role])
            if len(clock) == 0:
                out[role] = np.zeros(len(at))
                continue
            state = self.log.units[role] == "1"
            filtered = values if state or role.endswith(_SET_POINT) else averaged(values, over)
            out[role] = on_clock(clock, filtered, at, self.log.units[role])
            if not self.log.good.all():  # where the log has nothing the run shows nothing
                seen = np.where(self.log.good, out[role], np.nan)
                out[role] = bridged(self.log.time, seen, self.log.units[role])
        return out

    def days(self) -> Days:
        """Return healthy units of other days, in deviations of factors, onset and clock's phase.

        The factors are drawn `_WIDE` times as far as they are; the phase is even over a sample. An
        action is seen at a sample, so it has no other lateness.
        """
        rng = np.random.default_rng(15)
        factors = factors_of(self.actuator)
        wide = _WIDE * rng.standard_normal((_DRAWS, len(factors)))
        phase = np.sqrt(12.0) * (rng.random(_DRAWS) - 0.5)
        steps = np.column_stack([wide, rng.standard_normal(_DRAWS), phase])
        late = 0.0 if self.actions else _LATE
        units = [
            ReplayUnit(
                Variant(
                    daily(self.actuator, dict(zip(factors, row, strict=False))),
                    later=row[-1] / np.sqrt(12.0) / self.rate,
                    number=k + 1,
                ),
                late=late * row[-2],
            )
            for k, row in enumerate(steps.tolist())
        ]
        return Days(units, steps)

    @cached_property
    def deflection(self) -> Floats | None:
        """How far the output stands back under the log's load, shape (n,): force by stiffness.

        The reduced-order model's backlash is rigid. None without a load, or where the unit's
        contact is rigid.
        """
        known = self.actuator.parameters
        elastic = "backlash.model" in known and known.value("backlash.model") == _ELASTIC
        if self.load is None or not elastic:
            return None
        load = np.interp(self.log.time, *self.load)
        return np.asarray(load / known.value("backlash.stiffness"), dtype=np.float64)

    @cached_property
    def _compliant(self) -> bool:
        """Whether the log is nearer to a compliant model: what faults do depends on it."""
        if self.like is not None:
            return self.like._compliant
        if self.deflection is None:
            return True
        units = [ReplayUnit(compliant=True), ReplayUnit(compliant=False)]
        soft, rigid = self.outcomes(units)
        names = [n for n in soft.names if n in self.table and n in rigid.names]
        logged = self.features.only(names).values
        least = deviations([self.table[n] for n in names], logged, "repeats")
        far = [float(np.sum(((logged - x.only(names).values) / least) ** 2)) for x in (soft, rigid)]
        return far[0] <= far[1]

    def doubts(self) -> list[ReplayUnit]:
        """The stated stiffness is seldom measured: its compliance is uncertain by its own size."""
        return [] if self.deflection is None else [ReplayUnit(compliant=not self._compliant)]

    def drawn(self, units: Sequence[ReplayUnit]) -> list[SignalPanel]:
        """Return the log's signals that a page draws, each beside those of units."""
        sources: list[Mapping[str, Floats]] = [self.seen, *self._channels(units)]
        out = []
        for role in [r for r in _DRAWN if all(r in channels for channels in sources)][:3]:
            unit = display_unit(self.log.units[role])
            lines = [np.asarray(to_display(channels[role], unit)) for channels in sources]
            out.append(SignalPanel(role.replace("_", " ").capitalize(), unit, *lines))
        return out

    def same(self, other: Reading) -> bool:
        """Whether a baseline was commanded the same, and loaded alike.

        It may go on for longer, as it is read as far as the first, and end a little sooner: a bench
        that is started by hand cuts a short log's end off. Of two logs that name their step the
        load needs be no nearer: it may follow from a motion that a fault has changed.
        """
        if not isinstance(other, RoleReading):
            return False
        seconds = min(self.seconds, other.seconds)
        if self.seconds > _SOONER * seconds:
            return False
        grid = np.linspace(0.0, seconds, 200)
        if self._apart(other, grid, 1.0 / min(self.rate, other.rate)) > _ALIKE:
            return False
        if self.note and self.note == other.note and self.settings == other.settings:
            return True
        return load_alike((self.load, self.stroke), (other.load, other.stroke), grid)

    def serves(self, other: Reading) -> bool:
        """Whether faults do the same in both: set and commanded the same, as much of it seen."""
        if not isinstance(other, RoleReading) or self.settings != other.settings:
            return False
        seen = self.seen.keys() == other.seen.keys() and len(self.log.time) == len(other.log.time)
        return seen and self._apart(other, np.linspace(0.0, self.seconds, 200)) <= _SERVES

    def repeats(self, other: Reading) -> bool:
        """Whether the two differ by less than the clocks' phases, which the days have, explain."""
        return self.serves(other)

    def _apart(self, other: RoleReading, grid: Floats, jitter: float = 0.0) -> float:
        """RMS of the difference of two commands from where each began, over the range.

        With a jitter [s] the other's command may come by so much sooner or later at each instant:
        an edge falls on one sample or the next.
        """
        size = max(float(np.ptp(self.command[1])), 1e-12)
        this = np.interp(grid, *self.command) - self.command[1][0]
        shifts = (-jitter, 0.0, jitter) if jitter else (0.0,)
        near = [np.interp(grid + s, *other.command) - other.command[1][0] for s in shifts]
        off = this - np.clip(this, np.min(near, axis=0), np.max(near, axis=0))
        return float(np.sqrt(np.mean(off**2))) / size

    def within(self, seconds: float, like: RoleReading | None = None) -> RoleReading:
        """Return the test up to some seconds after its onset; the same one when asked again."""
        if seconds >= self.seconds and like is None:
            return self
        if (seconds, like) not in self._parts:
            log = self.log.part(self.log.time < seconds * (1.0 + 1e-9), 0.0, seconds)
            part = replace(self, log=log, seconds=min(seconds, self.seconds), like=like)
            self._parts[seconds, like] = part
        return self._parts[seconds, like]

    @cached_property
    def _parts(self) -> dict[tuple[float, RoleReading | None], RoleReading]:
        """What was read of it so far: many logs stand against one baseline."""
        return {}

    def matched(self, same: Sequence[Reading]) -> tuple[Reading, list[Reading]]:
        """Return the log and its baselines, each read as far as the shortest of them goes."""
        others = [b for b in same if isinstance(b, RoleReading)]
        seconds = min(x.seconds for x in (self, *others))
        if not others:
            return self, []
        first = others[0].within(seconds)
        later = [b.within(seconds, first) for b in others[1:]]
        return self.within(seconds, first), [first, *later]

    def notes(self, same: Sequence[Reading]) -> list[str]:
        """Return what the log lacks and what it costs."""
        out = list(self.findings)
        if drives_output(self.log, self.deflection):
            out.append(
                f"{self.name}: the load drives the output part of the time and holds it at one end "
                "of its backlash, where the reduced-order model has it carried by friction: "
                "backlash may be named as something else, and its limit does not hold"
            )
        if not same:
            out.append(
                f"{self.name}: no baseline of this test, commanded and loaded alike and about as "
                "long at least: how far a healthy unit deviates from the model is assumed, small "
                "faults are not seen"
            )
        return out
