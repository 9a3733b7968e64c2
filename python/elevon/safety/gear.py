"""The landing gear's campaign: failures, when they come, commands, surroundings."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from elevon.safety.rows import Failure, Row, together

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
class GearRow(Row):
    """One run of the landing gear's campaign.

    Attributes
    ----------
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
    moved : tuple of float
        Factors of load and supply: those of a neighbour.
    """

    start: float = HOME
    steps: Steps = ()
    environment: int = 0
    wheels: tuple[tuple[float, float], ...] = ()
    supply: tuple[tuple[float, float], ...] = ()
    moved: tuple[float, float] = (1.0, 1.0)

    @property
    def situation(self) -> str:
        """Start, commands, surroundings in words."""
        steps = ", ".join(f"{action} at {time:g} s" for time, action in self.steps) or "no command"
        supply, factor, temperature = ENVIRONMENTS[self.environment]
        spans = ", ".join(
            f"from {begin:g} s" + (f" to {end:g} s" if end < self.duration else "")
            for begin, end in self.wheels
        )
        shares = ", ".join(f"{share:g} of it at {time:g} s" for time, share in self.supply[1:-1])
        return (
            f"{self.group}: from {1e3 * self.start:g} mm, {steps}; {self.courses}; {supply:g} V"
            f"{f' ({shares})' if shares else ''}, {factor:g} g, {temperature:g} deg C"
            f"{f', weight on wheels {spans}' if spans else ''}"
        )

    @property
    def phase(self) -> str:
        """Phase of flight; what does not arise in every flight has phases of its own."""
        actions = [action for _, action in self.steps]
        if self.wheels:
            return "on wheels"
        if "free_fall" in actions:
            return "free fall"
        first = actions[0] if actions else ""
        known = {
            ("extend", HOME): "extension",
            ("retract", EXTENDED): "retraction",
            ("", HOME): "cruise",
            ("", EXTENDED): "extended",
        }
        return "interrupted" if self.supply else known.get((first, self.start), "interrupted")

    @property
    def begin(self) -> float:
        """First command, in s: what fails before it has failed before the phase."""
        return self.steps[0][0] if self.steps else 0.1

    @property
    def duration(self) -> float:
        """Simulated time in s."""
        return (self.steps[-1][0] if self.steps else LATE) + (AGAIN if self.steps else 3.0)

    def times(self, action: str) -> list[float]:
        """When a command is given, in s."""
        return [time for time, name in self.steps if name == action]

    def data(self) -> dict[str, Any]:
        """Return the row in the form of a scenario file."""
        supply, factor, temperature = ENVIRONMENTS[self.environment]
        load, voltage = self.moved
        data: dict[str, Any] = {
            "duration": self.duration,
            "command": {
                "mode": "gear",
                "steps": [{"time": time, "action": action} for time, action in self.steps],
            },
            "fault": [fault.to_dict() for fault in self.faults],
            "initial": {"nut_position": f"{self.start!r} m"},
            "parameters": {
                "inverter.supply_voltage": supply * voltage,
                "load.factor": factor * load,
                "lubricant.temperature": f"{temperature:g} degC",
            },
        }
        if self.wheels:
            data["load"] = {"weight_on_wheels": {"terms": [_course(self.wheels)]}}
        if self.supply:
            times, shares = zip(*self.supply, strict=True)
            values = [supply * voltage * share for share in shares]
            data["supply"] = {
                "terms": [{"kind": "table", "times": [*times], "values": values, "unit": "V"}]
            }
        return data


def _course(spans: Sequence[tuple[float, float]]) -> dict[str, Any]:
    """Return a table that is one within the spans and nought outside."""
    times, values = [0.0], [1.0 if spans[0][0] <= 0.0 else 0.0]
    for begin, end in spans:
        for time, value in ((begin, 1.0), (end, 0.0)):
            if time > 0.0:
                times += [time, time + 1e-6]
                values += [1.0 - value, value]
    return {"kind": "table", "times": [*times, 1e4], "values": [*values, values[-1]]}


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


REVERSED = tuple(phase for phase in PHASES if phase[2] in {1.5, 2.5})
"""Phases in which a pair is tried in reverse order too: in the middle of each move."""


def population(every: Sequence[Failure], seed: int) -> Iterator[GearRow]:
    """Yield every row of the campaign; the surroundings go round from one to the next.

    Parameters
    ----------
    every : sequence of Failure
        What is tried, alone and in pairs.
    seed : int
        Where the round of the surroundings begins.
    """
    parts = itertools.chain(_healthy(), _singles(every), _cycles(every), _pairs(every))
    for number, row in enumerate(parts):
        # Situations of a failure are a multiple of the surroundings: each failure shifts the round.
        yield replace(row, environment=(number + number // SITUATIONS + seed) % len(ENVIRONMENTS))


def once(every: Sequence[Failure]) -> Iterator[GearRow]:
    """Yield each failure alone, from before the command, once in each phase of every flight."""
    for failure, (start, steps) in itertools.product(every, dict.fromkeys(p[:2] for p in PHASES)):
        if start != MIDDLE:
            yield GearRow("one failure", (failure,), start, steps)


def _healthy() -> Iterator[GearRow]:
    for steps, start in itertools.product(COMMANDS, STARTS):
        yield GearRow("no failure", (), start, steps)
    for transient, (start, action) in itertools.product(TRANSIENTS, _MOVES):
        yield GearRow("supply", (), start, ((0.1, action), (8.0, action)), supply=transient)


SITUATIONS = len(COMMANDS) * len(STARTS) + 3
"""Rows of one failure with one course over time, those on wheels too."""
_MOVES = ((HOME, "extend"), (EXTENDED, "retract"))


def _singles(every: Sequence[Failure]) -> Iterator[GearRow]:
    courses = [("constant", {}), ("step", {"time": LATE})]
    courses += [("intermittent", {"start": 0.05, "period": p, "duty": d}) for p, d in PATTERNS]
    for failure, (kind, parameters) in itertools.product(every, courses):
        faults = (failure.when(kind, **parameters),)
        for steps, start in itertools.product(COMMANDS, STARTS):
            yield GearRow("one failure", faults, start, steps)
        for wheels in (((0.0, 1e3),), ((0.0, 1.0),), ((2.0, 1e3),)):
            yield GearRow("on wheels", faults, EXTENDED, ((2.5, "retract"),), wheels=wheels)


def _cycles(every: Sequence[Failure]) -> Iterator[GearRow]:
    """A power cycle in mid-travel, the failure from the start or from the cut on."""
    for failure, (start, action) in itertools.product(every, _MOVES):
        for kind, parameters in (("constant", {}), ("step", {"time": 2.0})):
            cut = ((0.0, 1.0), (2.0, 1.0), (2.001, 0.0), (3.0, 0.0), (3.001, 1.0), (100.0, 1.0))
            steps = ((0.1, action), (5.0, "stop"), (5.5, action))
            yield GearRow(
                "power cycle", (failure.when(kind, **parameters),), start, steps, supply=cut
            )


def _pairs(every: Sequence[Failure]) -> Iterator[GearRow]:
    """Each pair in every phase, and in the middle of each move in reverse order, too."""
    for first, second in itertools.combinations(every, 2):
        if not together(first, second):
            continue
        for start, steps, time in PHASES:
            faults = (first.when("step", time=0.05), second.when("step", time=time))
            yield GearRow("two failures", faults, start, steps)
        for start, steps, time in REVERSED:
            faults = (first.when("step", time=time), second.when("step", time=0.05))
            yield GearRow("two failures", faults, start, steps)


def drawn(chosen: Sequence[Failure], draw: np.random.Generator) -> GearRow:
    """Return a random situation with several failures, each with its own course."""
    faults = tuple(_drawn(failure, draw) for failure in chosen)
    steps = COMMANDS[int(draw.integers(len(COMMANDS)))]
    start = STARTS[int(draw.integers(len(STARTS)))]
    environment = int(draw.integers(len(ENVIRONMENTS)))
    return GearRow("three failures", faults, start, steps, environment)


def _drawn(failure: Failure, draw: np.random.Generator) -> Failure:
    time = float(draw.uniform(0.0, 8.0))
    if draw.random() < 0.5:
        return failure.when("step", time=time)
    period, duty = PATTERNS[int(draw.integers(len(PATTERNS)))]
    return failure.when("intermittent", start=time, period=period, duty=duty)
