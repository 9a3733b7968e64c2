"""The situations of the safety campaign: failures, when they come, commands, surroundings."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from functools import cache
from typing import Any

from elevon.scenario import Scenario

Steps = tuple[tuple[float, str], ...]

STARTS = (0.75e-3, 5e-3, 30e-3, 60e-3, 80e-3, 130e-3, 190e-3, 200e-3, 230e-3, 260e-3, 265.5e-3,
          267e-3)  # fmt: skip
"""Nut positions at power-up [m]: the ends, both sides of each switch, between them."""
EXTENDED, MIDDLE, HOME = 267e-3, 130e-3, 0.75e-3
PATTERNS = ((0.4, 0.03), (0.1, 0.5), (1.0, 0.5), (3.0, 0.1))
"""Intermittent faults: period [s] and the share of it that is faulty."""
ENVIRONMENTS = tuple(
    itertools.chain.from_iterable(
        ((supply, factor, (-40.0, 20.0, 70.0)[(i + j) % 3])
         for j, factor in enumerate((1.0, 1.5, 3.5)))
        for i, supply in enumerate((28.0, 20.5, 32.2))
    )
)  # fmt: skip
"""Supply [V], load factor and lubricant temperature [deg C]: every pair of values occurs."""
LATE = 2.5
"""A late failure comes this long after power-up [s]."""
AGAIN = 14.0
"""Simulated time after the last command [s]: a move and its retries."""


@dataclass(frozen=True)
class Failure:
    """One failure: a fault of the catalogue at its place, and when it is there.

    Attributes
    ----------
    kind, place : str
        As in the catalogue.
    severity : float
        In the kind's unit.
    profile : tuple
        Kind of the profile and its parameters, as pairs.
    attributes : tuple
        Names of the kind's attributes without a default, and their values.
    """

    kind: str
    place: str
    severity: float
    profile: tuple[tuple[str, Any], ...] = (("kind", "constant"),)
    attributes: tuple[tuple[str, float], ...] = ()

    @property
    def name(self) -> str:
        """Kind and place."""
        return f"{self.kind}@{self.place}"

    def when(self, kind: str, **parameters: float) -> Failure:
        """Return the failure with another course over time."""
        profile = (("kind", kind), *sorted(parameters.items()))
        return Failure(self.kind, self.place, self.severity, profile, self.attributes)

    def to_dict(self) -> dict[str, object]:
        """Return the fault as a scenario has it."""
        return {
            "kind": self.kind,
            "place": self.place,
            "severity": self.severity,
            "profile": dict(self.profile),
            **dict(self.attributes),
        }


@dataclass(frozen=True)
class Row:
    """One run of the campaign.

    Attributes
    ----------
    group : str
        Which part of the campaign it belongs to.
    faults : tuple of Failure
        None: the surroundings alone.
    start : float
        Nut position at power-up, in m.
    steps : tuple
        Times in s and commands.
    environment : int
        Index into `ENVIRONMENTS`.
    wheels : tuple
        From when to when there is weight on wheels, in s.
    supply : tuple
        Times in s and shares of the supply voltage; empty: constant.
    """

    group: str
    faults: tuple[Failure, ...]
    start: float
    steps: Steps
    environment: int = 0
    wheels: tuple[tuple[float, float], ...] = ()
    supply: tuple[tuple[float, float], ...] = field(default=())

    @property
    def combination(self) -> str:
        """The failures by name."""
        return " + ".join(sorted(fault.name for fault in self.faults)) or "none"

    @property
    def situation(self) -> str:
        """Start, commands, surroundings in words."""
        steps = ", ".join(f"{action} at {time:g} s" for time, action in self.steps) or "no command"
        supply, factor, temperature = ENVIRONMENTS[self.environment]
        courses = "; ".join(
            " ".join(f"{key} {value:g}" if key != "kind" else str(value)
                     for key, value in fault.profile)
            for fault in self.faults
        )  # fmt: skip
        spans = ", ".join(
            f"from {begin:g} s" + (f" to {end:g} s" if end < self.duration else "")
            for begin, end in self.wheels
        )
        shares = ", ".join(f"{share:g} of it at {time:g} s" for time, share in self.supply[1:-1])
        return (
            f"{self.group}: from {1e3 * self.start:g} mm, {steps}; {courses}; {supply:g} V"
            f"{f' ({shares})' if shares else ''}, {factor:g} g, {temperature:g} deg C"
            f"{f', weight on wheels {spans}' if spans else ''}"
        )

    @property
    def duration(self) -> float:
        """Simulated time in s."""
        return (self.steps[-1][0] if self.steps else LATE) + (AGAIN if self.steps else 3.0)

    def times(self, action: str) -> list[float]:
        """When a command is given, in s."""
        return [time for time, name in self.steps if name == action]

    def scenario(self) -> Scenario:
        """Return the row as a scenario."""
        supply, factor, temperature = ENVIRONMENTS[self.environment]
        data: dict[str, Any] = {
            "duration": self.duration,
            "command": {
                "mode": "gear",
                "steps": [{"time": time, "action": action} for time, action in self.steps],
            },
            "fault": [fault.to_dict() for fault in self.faults],
            "initial": {"nut_position": self.start},
            "parameters": {
                "inverter.supply_voltage": supply,
                "load.factor": factor,
                "lubricant.temperature": f"{temperature:g} degC",
            },
        }
        if self.wheels:
            data["load"] = {"weight_on_wheels": {"terms": [_course(self.wheels)]}}
        if self.supply:
            times, shares = zip(*self.supply, strict=True)
            values = [supply * share for share in shares]
            data["supply"] = {"terms": [{"kind": "table", "times": times, "values": values}]}
        return Scenario.from_dict(data)


def _course(spans: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """Return a table that is one within the spans and nought outside."""
    times, values = [0.0], [1.0 if spans[0][0] <= 0.0 else 0.0]
    for begin, end in spans:
        for time, value in ((begin, 1.0), (end, 0.0)):
            if time > 0.0:
                times += [time, time + 1e-6]
                values += [1.0 - value, value]
    return {"kind": "table", "times": [*times, 1e4], "values": [*values, values[-1]]}


@cache
def failures(wiring: str, fidelity: str) -> tuple[Failure, ...]:
    """Return every fault of the catalogue at every place, with both signs where it has them."""
    from elevon.faults.catalogue import catalogue

    return tuple(
        Failure(
            record.kind, place, severity,
            attributes=tuple((item["name"], 0.0) for item in record.attributes
                             if item["default"] is None),
        )
        for record in catalogue(wiring)
        if fidelity in record.fidelities
        for place in record.places
        for severity in record.tried
    )  # fmt: skip


COMMANDS: tuple[Steps, ...] = (
    (),
    ((0.1, "extend"),),
    ((0.1, "retract"),),
    ((0.3, "free_fall"),),
    ((2.0, "free_fall"),),
    ((0.1, "extend"), (3.0, "retract")),
    ((0.1, "retract"), (3.0, "extend")),
    ((0.1, "extend"), (1.0, "extend"), (4.0, "stop"), (5.0, "extend")),
)
"""None, each command, before and after the confirmation of power-up, reversed, repeated."""

PHASES: tuple[tuple[float, Steps, float], ...] = (
    (HOME, ((0.1, "extend"),), 0.05),
    (HOME, ((0.1, "extend"),), 2.5),
    (HOME, ((0.1, "extend"),), 5.5),
    (EXTENDED, ((0.1, "retract"),), 0.05),
    (EXTENDED, ((0.1, "retract"),), 2.5),
    (EXTENDED, ((0.1, "retract"),), 5.5),
    (HOME, (), 2.0),
    (MIDDLE, (), 0.5),
    (EXTENDED, (), 2.0),
    (HOME, ((0.1, "free_fall"),), 0.05),
    (HOME, ((0.1, "free_fall"),), 1.5),
    (HOME, ((0.1, "free_fall"),), 3.2),
)
"""Start, commands, and when the second failure comes: the phases of `pisa-failures`."""

TRANSIENTS: tuple[tuple[tuple[float, float], ...], ...] = tuple(
    ((0.0, 1.0), (3.0, 1.0), (3.001, share), (3.0 + length, share), (3.001 + length, 1.0),
     (100.0, 1.0))
    for share, length in ((0.0, 0.05), (0.0, 0.2), (0.0, 1.0), (0.36, 1.0), (0.43, 5.0),
                          (1.65, 0.1), (2.0, 0.05))
)  # fmt: skip
"""Interruptions, dips and surges of the kinds of DO-160 section 16 (lengths and depths ASSUMED)."""


def population(wiring: str, fidelity: str, seed: int) -> Iterator[Row]:
    """Yield every row of the campaign; the surroundings go round from one to the next.

    Parameters
    ----------
    wiring, fidelity : str
        Whose catalogue.
    seed : int
        Where the round of the surroundings begins, and which third of the random triples is drawn.
    """
    every = failures(wiring, fidelity)
    parts = itertools.chain(_healthy(), _singles(every), _cycles(every), _pairs(every))
    for number, row in enumerate(parts):
        yield _placed(row, (number + seed) % len(ENVIRONMENTS))


def _placed(row: Row, environment: int) -> Row:
    return Row(row.group, row.faults, row.start, row.steps, environment, row.wheels, row.supply)


def _healthy() -> Iterator[Row]:
    for steps, start in itertools.product(COMMANDS, STARTS):
        yield Row("no failure", (), start, steps)
    for transient, (start, action) in itertools.product(TRANSIENTS, _MOVES):
        yield Row("supply", (), start, ((0.1, action), (8.0, action)), supply=transient)


_MOVES = ((HOME, "extend"), (EXTENDED, "retract"))


def _singles(every: Sequence[Failure]) -> Iterator[Row]:
    courses = [("constant", {}), ("step", {"time": LATE})]
    courses += [("intermittent", {"start": 0.05, "period": p, "duty": d}) for p, d in PATTERNS]
    for failure, (kind, parameters) in itertools.product(every, courses):
        faults = (failure.when(kind, **parameters),)
        for steps, start in itertools.product(COMMANDS, STARTS):
            yield Row("one failure", faults, start, steps)
        for wheels in (((0.0, 1e3),), ((0.0, 1.0),), ((2.0, 1e3),)):
            yield Row("on wheels", faults, EXTENDED, ((2.5, "retract"),), wheels=wheels)


def _cycles(every: Sequence[Failure]) -> Iterator[Row]:
    """A power cycle in mid-travel, the failure from the start or from the cut on."""
    for failure, (start, action) in itertools.product(every, _MOVES):
        for kind, parameters in (("constant", {}), ("step", {"time": 2.0})):
            cut = ((0.0, 1.0), (2.0, 1.0), (2.001, 0.0), (3.0, 0.0), (3.001, 1.0), (100.0, 1.0))
            steps = ((0.1, action), (5.0, "stop"), (5.5, action))
            yield Row("power cycle", (failure.when(kind, **parameters),), start, steps, supply=cut)


def _together(*chosen: Failure) -> bool:
    """Whether one place can have all of them: a phase is open or shorted, a switch on or off."""
    from elevon.errors import InputError
    from elevon.faults import Fault, check_together

    if len({failure.place for failure in chosen}) == len(chosen):
        return True
    try:
        check_together([Fault(failure.kind, failure.place, failure.severity) for failure in chosen])
    except InputError:
        return False
    return True


def _pairs(every: Sequence[Failure]) -> Iterator[Row]:
    for first, second in itertools.combinations(every, 2):
        if not _together(first, second):
            continue
        for start, steps, time in PHASES:
            faults = (first.when("step", time=0.05), second.when("step", time=time))
            yield Row("two failures", faults, start, steps)


def triples(wiring: str, fidelity: str, seed: int, number: int) -> Iterator[Row]:
    """Yield random situations with three failures, each with its own course.

    Parameters
    ----------
    wiring, fidelity : str
        Whose catalogue.
    seed : int
        Of the draw.
    number : int
        How many.
    """
    import numpy as np

    draw = np.random.default_rng(seed)
    every = failures(wiring, fidelity)
    for _ in range(number):
        chosen = [every[index] for index in draw.choice(len(every), 3, replace=False)]
        while not _together(*chosen):
            chosen = [every[index] for index in draw.choice(len(every), 3, replace=False)]
        faults = tuple(_drawn(failure, draw) for failure in chosen)
        steps = COMMANDS[int(draw.integers(len(COMMANDS)))]
        start = STARTS[int(draw.integers(len(STARTS)))]
        yield Row("three failures", faults, start, steps, int(draw.integers(len(ENVIRONMENTS))))


def _drawn(failure: Failure, draw: Any) -> Failure:
    time = float(draw.uniform(0.0, 8.0))
    if draw.random() < 0.5:
        return failure.when("step", time=time)
    period, duty = PATTERNS[int(draw.integers(len(PATTERNS)))]
    return failure.when("intermittent", start=time, period=period, duty=duty)
