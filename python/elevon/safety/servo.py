"""The servos' campaign: situations, hazards, what their drives display, distances to limits."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, cast

import numpy as np
import numpy.typing as npt

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.errors import InputError
from elevon.safety.hazards import Hazard, Message, Watched, lasting
from elevon.safety.rows import Failure, Row, together
from elevon.units import parse_quantity

RECORD = (
    "command,output_position,output_speed,motor_speed,encoder_position,resolver_position,"
    "current_q,current_q_meas,supply_voltage,resolver_signal,thermal_warning,tripped@400 Hz"
)
COURSES = ("hold", "move", "track")
"""Phases of a flight: a surface held under load, moved to another place, moved all the time."""
ENVIRONMENTS = ((0.0, 1.0), (0.1, 1.0), (-0.1, 0.9))
"""Load over the largest one, and supply over the nominal one."""
BEGIN, LENGTH = 0.5, 4.0
"""When load and command come, and the simulated time [s]."""
LATE = 1.5
"""A late failure comes then, in s: while the output moves."""
PATTERNS = ((0.4, 0.1), (0.1, 0.5))
"""Intermittent faults: period [s] and the share of it that is faulty."""

# Limits of the hazards, over the amplitude of the actuator's own scenario; all ASSUMED: a tenth of
# it is what a control loop above the actuator would call a motion, the others are its fractions.
UNCOMMANDED = 0.1
LOST = 0.3
REPORTED = 0.1
AMPLITUDE, FREQUENCY = 0.02, 3.0
"""Oscillation: half of the way between its ends, and its least frequency [Hz]."""
RUNAWAY = 0.5
"""Beyond the range of the command by this."""
STUCK_SPEED, STUCK_CURRENT, STUCK_TIME = 0.02, 0.5, 0.5
"""A jam: motor speed below this share of its limit, current above this share, for longer [s]."""
LASTING = 0.1
"""A deviation that lasts no longer is a transient [s]."""


@dataclass(frozen=True)
class ServoRow(Row):
    """One run of a servo's campaign.

    Attributes
    ----------
    course : str
        One of `COURSES`.
    environment : int
        Index into `ENVIRONMENTS`.
    amplitude, load, supply : float
        The actuator's own: of its scenario, the largest load that it bears, its supply [V].
    linear : bool
        Whether the output travels (m, N) or turns (rad, N m).
    moved : tuple of float
        Factors of load and supply: those of a neighbour.
    """

    course: str = "hold"
    environment: int = 0
    amplitude: float = 0.0
    load: float = 0.0
    supply: float = 0.0
    linear: bool = False
    moved: tuple[float, float] = (1.0, 1.0)

    @property
    def situation(self) -> str:
        """Course, load, supply in words."""
        load, supply = ENVIRONMENTS[self.environment]
        return (
            f"{self.group}: {self.course}; {self.courses}; load {100 * load:g} % of the largest, "
            f"{self.supply * supply:g} V"
        )

    @property
    def phase(self) -> str:
        """The course."""
        return self.course

    @property
    def begin(self) -> float:
        """When load and command come, in s."""
        return BEGIN

    def data(self) -> dict[str, Any]:
        """Return the row in the form of a scenario file."""
        load, supply = ENVIRONMENTS[self.environment]
        unit = "m" if self.linear else "rad"
        at = {"start": f"{BEGIN!r} s"}
        size = f"{self.amplitude!r} {unit}"
        terms: list[dict[str, Any]] = []
        if self.course == "move":
            rate = f"{self.amplitude!r} {unit}/s"
            terms = [{"kind": "ramp", "slope": rate, "end": f"{BEGIN + 1.0!r} s", **at}]
        elif self.course == "track":
            terms = [{"kind": "sine", "amplitude": size, "frequency": "0.3 Hz", **at}]
        data: dict[str, Any] = {
            "duration": LENGTH,
            "command": {"mode": "position", "terms": terms},
            "fault": [fault.to_dict() for fault in self.faults],
            "parameters": {"inverter.supply_voltage": self.supply * supply * self.moved[1]},
        }
        if load:
            force = f"{load * self.load * self.moved[0]!r} {'N' if self.linear else 'N m'}"
            step = {"kind": "step", "final": force, "time": f"{BEGIN!r} s"}
            data["load"] = {"output": {"terms": [step]}}
        return data


def template(actuator: Actuator) -> ServoRow:
    """Return a row with what the rows of an actuator share.

    Raises
    ------
    InputError
        The actuator's own scenario has no sine whose amplitude the limits are fractions of.
    """
    terms = (actuator.default_scenario or {}).get("command", {}).get("terms", [])
    sines = [term for term in terms if term.get("kind") == "sine"]
    if not sines:
        raise InputError(
            f"{actuator.name}: its own scenario commands no sine, of whose amplitude the limits of "
            "the hazards are fractions"
        )
    linear = actuator.wiring == "ballscrew"
    value = actuator.parameters.value
    torque = value("control.current_limit") * value("control.torque_constant")
    way = value("screw.lead") / (2.0 * np.pi) if linear else 1.0 / value("gear.ratio")
    return ServoRow(
        "no failure", (),
        amplitude=parse_quantity(sines[0]["amplitude"], "m" if linear else "rad"),
        load=float(torque / way), supply=value("inverter.supply_voltage"), linear=linear,
    )  # fmt: skip


def population(every: Sequence[Failure], seed: int, row: ServoRow) -> Iterator[ServoRow]:
    """Yield every row of the campaign.

    Parameters
    ----------
    every : sequence of Failure
        What is tried, alone and in pairs.
    seed : int
        Where the round of the surroundings begins.
    row : ServoRow
        What all rows share.
    """
    for course, number in itertools.product(COURSES, range(len(ENVIRONMENTS))):
        yield replace(row, course=course, environment=number)
    courses = [("constant", {}), ("step", {"time": LATE})]
    courses += [("intermittent", {"start": 0.1, "period": p, "duty": d}) for p, d in PATTERNS]
    for failure, (kind, given) in itertools.product(every, courses):
        for course, number in itertools.product(COURSES, range(len(ENVIRONMENTS))):
            yield replace(row, group="one failure", faults=(failure.when(kind, **given),),
                          course=course, environment=number)  # fmt: skip
    for number, (first, second) in enumerate(itertools.combinations(every, 2)):
        if not together(first, second):
            continue
        for place, course in enumerate(COURSES):
            for times in ((0.1, 0.1), (0.1, LATE), (LATE, 0.1)):
                faults = (first.when("step", time=times[0]), second.when("step", time=times[1]))
                surroundings = (seed + number + place) % len(ENVIRONMENTS)
                yield replace(row, group="two failures", faults=faults, course=course,
                              environment=surroundings)  # fmt: skip


def once(every: Sequence[Failure], row: ServoRow) -> Iterator[ServoRow]:
    """Yield each failure alone, from before the command, once in each course."""
    for failure, course in itertools.product(every, COURSES):
        yield replace(row, group="one failure", faults=(failure,), course=course)


def drawn(chosen: Sequence[Failure], draw: np.random.Generator, row: ServoRow) -> ServoRow:
    """Return a random situation with several failures, each with its own course."""
    faults = tuple(fault.when("step", time=float(draw.uniform(0.0, LENGTH))) for fault in chosen)
    return replace(row, group="three failures", faults=faults,
                   course=COURSES[int(draw.integers(len(COURSES)))],
                   environment=int(draw.integers(len(ENVIRONMENTS))))  # fmt: skip


def _row(run: Watched) -> ServoRow:
    return cast("ServoRow", run.row)


def _after(run: Watched) -> npt.NDArray[np.bool_]:
    """Instants at which load and command have come and their transient has passed."""
    return np.asarray(run.time > BEGIN + 0.3)


def _uncommanded(run: Watched) -> float | None:
    """A held surface leaves its place."""
    if _row(run).course != "hold":
        return None
    away = np.abs(run["output_position"] - run["command"]) > UNCOMMANDED * _row(run).amplitude
    return lasting(run, away, LASTING)


def _lost(run: Watched) -> float | None:
    """A commanded motion does not come."""
    if _row(run).course == "hold":
        return None
    behind = np.abs(run["output_position"] - run["command"]) > LOST * _row(run).amplitude
    return lasting(run, behind & _after(run), LASTING)


def _jam(run: Watched) -> float | None:
    """The motor stands and presses while the output is away from its command."""
    amplitude = _row(run).amplitude
    standing = np.abs(run["motor_speed"]) < STUCK_SPEED * run.limits["speed"]
    pressing = np.abs(run["current_q"]) > STUCK_CURRENT * run.limits["current"]
    away = np.abs(run["output_position"] - run["command"]) > UNCOMMANDED * amplitude
    return lasting(run, standing & pressing & away & _after(run), STUCK_TIME)


def _oscillation(run: Watched) -> float | None:
    """Swings beyond amplitude and frequency about a course that is slow."""
    deviation = run["output_position"] - run["command"]
    step = float(run.time[1] - run.time[0])
    width = max(1, round(1.0 / (FREQUENCY * step)))
    slow = np.convolve(deviation, np.ones(width) / width, mode="same")
    swing = np.where(_after(run) & (run.time < run.time[-1] - 1.0 / FREQUENCY), deviation - slow, 0)
    large = np.abs(swing) > AMPLITUDE * _row(run).amplitude
    signs = np.where(large, np.sign(swing), 0.0)
    turns = np.flatnonzero(signs)
    changes = turns[1:][np.diff(signs[turns]) != 0.0]
    for first, last in zip(changes, changes[5:], strict=False):  # five half periods in a row
        if run.time[last] - run.time[first] < 2.5 / FREQUENCY:
            return float(run.time[first])
    return None


def _runaway(run: Watched) -> float | None:
    """The output leaves the range of the command, in motion."""
    low, high = float(run["command"].min()), float(run["command"].max())
    beyond = np.fmax(run["output_position"] - high, low - run["output_position"])
    moving = np.abs(run["output_speed"]) > 0.1 * _row(run).amplitude
    return lasting(run, (beyond > RUNAWAY * _row(run).amplitude) & moving, 0.0)


def _misreported(run: Watched) -> float | None:
    """The drive reports another place than that where the output is."""
    wrong = np.abs(run["encoder_position"] - run["output_position"])
    return lasting(run, wrong > REPORTED * _row(run).amplitude, LASTING)


HAZARDS = (
    Hazard("uncommanded motion", "a held output leaves its place", _uncommanded, "hazardous"),
    Hazard("loss of motion", "the output does not follow a commanded motion", _lost, "major"),
    Hazard("jam", "the motor presses and stands, the output is away from its command", _jam,
           "hazardous"),
    Hazard("oscillation", "the output swings beyond amplitude and frequency", _oscillation,
           "hazardous"),
    Hazard("runaway", "the output leaves the range of the command", _runaway, "catastrophic"),
    Hazard("wrong position reported", "the position reported is not that of the output",
           _misreported, "major"),
)  # fmt: skip
"""Every hazard; the classes are ASSUMED: one surface of several on an axis, without redundancy."""


def limits(actuator: Actuator) -> dict[str, float]:
    """Return the drive's limits that hazards and distances are held against."""
    value = actuator.parameters.value
    return {
        "speed": value("control.speed_limit"),
        "current": value("control.current_limit"),
        "trip": value("inverter.trip_current"),
        "supply": value("inverter.supply_voltage"),
    }


def displayed(run: Watched) -> list[Message]:
    """Return what the drive says of itself."""
    lines = []
    for signal, text in (("tripped", "drive tripped"), ("thermal_warning", "winding hot")):
        begin = np.flatnonzero(run[signal] > 0.5)
        if begin.size:
            lines.append(Message(float(run.time[begin[0]]), text))
    return lines


def distances(run: Watched) -> Iterator[tuple[str, float]]:
    """Yield how far a run stays from each limit that could change it, over the limit."""
    amplitude = _row(run).amplitude
    size: Floats = np.abs(run["output_position"] - run["command"])[_after(run)]
    allowed = {"hold": UNCOMMANDED, "move": LOST, "track": LOST}[_row(run).course]
    yield "position", abs(float(size.max(initial=0.0)) / (allowed * amplitude) - 1.0)
    current = float(np.abs(run["current_q"]).max())
    yield "current", abs(current / run.limits["current"] - 1.0)
    if run.limits["trip"] > 0.0:
        yield "current", abs(current / run.limits["trip"] - 1.0)
    slowest = float(np.quantile(np.abs(run["motor_speed"][_after(run)]), 0.95))
    yield "force", abs(slowest / (STUCK_SPEED * run.limits["speed"]) - 1.0)
