"""What a campaign is made of: rows of an actuator, its hazards, what is displayed, its limits."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from elevon.actuator import Actuator
from elevon.errors import InputError
from elevon.safety import gear, gear_hazards, servo
from elevon.safety.hazards import Hazard, Message, Watched
from elevon.safety.rates import DriveMonitor, FailureRate, read_rates
from elevon.safety.rows import Failure, Row, Tried, failures

NEIGHBOUR = 0.1
"""By how much load, supply and friction of a neighbour differ, over the row's own."""


@dataclass(frozen=True)
class Study:
    """The campaign of one actuator.

    Attributes
    ----------
    actuator : Actuator
        What is run.
    failures : dict
        By fidelity: what is tried, alone and in pairs.
    rates : dict
        Rate of each failure by its name.
    hazards : tuple of Hazard
        What no run may show.
    record : str
        What is kept of a run.
    limits : mapping
        The unit's own limits, for distances and hazards.
    """

    actuator: Actuator
    failures: Mapping[str, tuple[Failure, ...]]
    rates: Mapping[str, FailureRate]
    hazards: tuple[Hazard, ...]
    record: str
    limits: Mapping[str, float]

    @property
    def gear(self) -> bool:
        """Whether it has a control unit with states."""
        return self.actuator.wiring == "landing_gear"

    @property
    def names(self) -> list[str]:
        """Names of all failures, those that the switching model alone has at the end."""
        return list(
            dict.fromkeys(f.name for group in ("low", "high") for f in self.failures[group])
        )

    def rows(self, seed: int) -> Iterator[Row]:
        """Yield the rows of low fidelity: no failure, each failure, each pair."""
        if self.gear:
            return gear.population(self.failures["low"], seed)
        return servo.population(self.failures["low"], seed, servo.template(self.actuator))

    def switching_rows(self) -> Iterator[Row]:
        """Yield a row in each phase for each failure that the switching model alone has."""
        carried = {failure.name for failure in self.failures["low"]}
        alone = [failure for failure in self.failures["high"] if failure.name not in carried]
        if self.gear:
            return gear.once(alone)
        return servo.once(alone, servo.template(self.actuator))

    def drawn(self, chosen: Sequence[Failure], draw: np.random.Generator) -> Row:
        """Return a random situation with the failures chosen."""
        if self.gear:
            return gear.drawn(chosen, draw)
        return servo.drawn(chosen, draw, servo.template(self.actuator))

    def displayed(self, run: Watched, monitors: Sequence[DriveMonitor]) -> list[Message]:
        """Return what is displayed, what the drive's monitors find with it."""
        messages = gear_hazards.displayed(run) if self.gear else servo.displayed(run)
        messages += [
            Message(time, f"monitor: {item.name}")
            for item in monitors
            if (time := _monitored(run, item)) is not None
        ]
        return sorted(messages, key=lambda line: line.time)

    def end(self, run: Watched) -> str:
        """Return the state in which a run ends."""
        if self.gear:
            return gear_hazards.end(run)
        return "tripped" if run["tripped"][-1] > 0.5 else "runs"

    def distance(self, run: Watched) -> tuple[float, str]:
        """Return the least distance from a limit that could change a run, and of what quantity."""
        every = gear_hazards.distances(run) if self.gear else servo.distances(run)
        return min((distance, name) for name, distance in every)

    def neighbours(self, row: Row) -> list[tuple[Actuator, Row]]:
        """Return the row with load, supply and friction moved both ways by `NEIGHBOUR`."""
        near: list[tuple[Actuator, Row]] = []
        for factor in (1.0 - NEIGHBOUR, 1.0 + NEIGHBOUR):
            near.append((self._rubbing(factor), row))
            for moved in ((factor, 1.0), (1.0, factor)):
                near.append((self.actuator, replace(row, moved=moved)))  # type: ignore[call-arg]
        return near

    def _rubbing(self, factor: float) -> Actuator:
        """The actuator with its friction moved."""
        paths = [path for path in self.actuator.parameters if _is_friction(path)]
        values = {path: self.actuator.parameters.value(path) * factor for path in paths}
        return self.actuator.with_values(values)


def _is_friction(path: str) -> bool:
    table = path.startswith(("friction.ff_", "friction.ffm_"))
    return table or path in {"friction.static", "friction.dynamic", "friction.viscous"}


def _monitored(run: Watched, monitor: DriveMonitor) -> float | None:
    """When a monitor finds its signal above its limit for its time; None: never."""
    signal = run[monitor.signal]
    if monitor.minus:
        signal = signal - monitor.scale * run[monitor.minus]
    above = np.abs(signal) > monitor.limit
    edges = np.flatnonzero(np.diff(np.concatenate(([0], above.astype(int), [0]))))
    for first, last in zip(edges[::2], edges[1::2], strict=True):
        if run.time[last - 1] - run.time[first] >= monitor.time:
            return float(run.time[first]) + monitor.time
    return None


def study_of(
    actuator: Actuator,
    hazards: Sequence[Hazard] | None,
    rates: Path | None,
    monitors: Sequence[DriveMonitor],
) -> Study:
    """Return the campaign of an actuator.

    Parameters
    ----------
    actuator : Actuator
        A landing gear's, or a servo's.
    hazards : sequence of Hazard, optional
        In place of the wiring's own.
    rates : path, optional
        File of rates.
    monitors : sequence of DriveMonitor
        Their signals must be recorded.

    Raises
    ------
    InputError
        No rate for a failure, a monitor of an unknown signal, two hazards of one name.
    """
    is_gear = actuator.wiring == "landing_gear"
    module = gear_hazards if is_gear else servo
    names = _names(_every(actuator, {}))
    about = read_rates(actuator.wiring, names, rates)
    stated = {
        name.partition("=")[0]: Tried(item.severity, item.attributes)
        for name, item in about.items()
    }
    every = _every(actuator, stated)
    names = _names(every)
    rates_by_name = read_rates(actuator.wiring, names, rates)
    missing = [name for name in names if name not in rates_by_name]
    if missing:
        raise InputError(
            f"no rate for {', '.join(missing)}: give the part whose failure it is with --rates"
        )
    chosen = tuple(module.HAZARDS if hazards is None else hazards)
    if len({item.name for item in chosen}) < len(chosen):
        raise InputError("two hazards have one name")
    if not is_gear:
        servo.template(actuator)
    record = _with_signals(module.RECORD, actuator, monitors)
    return Study(actuator, every, rates_by_name, chosen, record, module.limits(actuator))


def _every(actuator: Actuator, stated: Mapping[str, Tried]) -> dict[str, tuple[Failure, ...]]:
    return {fidelity: failures(actuator, fidelity, stated) for fidelity in ("low", "high")}


def _names(every: Mapping[str, Sequence[Failure]]) -> list[str]:
    return list(dict.fromkeys(item.name for group in every.values() for item in group))


def _with_signals(record: str, actuator: Actuator, monitors: Sequence[DriveMonitor]) -> str:
    """Return what is recorded, the signals of the monitors too."""
    from elevon import _core
    from elevon.errors import unknown

    names, _, rate = record.partition("@")
    signals = names.split(",")
    known = [item["name"] for item in _core.signals(actuator.wiring, "low")]
    for monitor in monitors:
        for name in filter(None, (monitor.signal, monitor.minus)):
            if name not in known:
                raise unknown("signal", name, known, f"monitor {monitor.name!r}")
            signals += [name] * (name not in signals)
    return f"{','.join(signals)}@{rate}"
