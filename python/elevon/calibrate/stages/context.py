"""What the stages of a calibration share: logs, the actuator before, what is determined so far."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, field
from functools import cached_property
from typing import Any, Generic, TypeVar

from elevon.actuator import Actuator
from elevon.calibrate.named import named
from elevon.calibrate.stages.log import motor_ratio
from elevon.data import packaged_toml
from elevon.errors import InputError, Interrupted
from elevon.estimate import Estimate
from elevon.logs.log import Log
from elevon.parameters.records import record_of, records
from elevon.progress import Progress, part

C = TypeVar("C", bound="Context")
_WIDE = 0.2  # of a value: a deviation above which it is not determined
_NOISE = "the logs' noise is larger than its effect"
_IMPOSSIBLE = "the value that the logs say is none that the model can have"


@dataclass(eq=False)
class Context:
    """What a calibration knows as its stages go on.

    Parameters
    ----------
    logs : sequence of Log
        The data.
    actuator : Actuator
        Values before.
    fidelity : str or None
        Of runs that correct what balances misread: ``auto``, ``low``, ``high``, or none.
    progress : callable, optional
        Told the done fraction; returns False to stop.

    Attributes
    ----------
    levels : dict of str to Estimate
        What is determined, by path.
    reasons : dict of str to str
        Why others are not.
    given : dict of str to tuple of str
        What a value stands on.
    facts : dict of str to object
        What else is known, plain types.
    """

    logs: Sequence[Log]
    actuator: Actuator
    _: KW_ONLY
    fidelity: str | None = "auto"
    progress: Progress | None = None
    levels: dict[str, Estimate] = field(default_factory=dict, init=False)
    reasons: dict[str, str] = field(default_factory=dict, init=False)
    given: dict[str, tuple[str, ...]] = field(default_factory=dict, init=False)
    facts: dict[str, Any] = field(default_factory=dict, init=False)

    def go(self, fraction: float) -> None:
        """Report progress; stop where it says so."""
        if self.progress is not None and self.progress(fraction) is False:
            raise Interrupted("calibration stopped")

    def add(self, levels: Mapping[str, Estimate], reasons: Mapping[str, str] | None = None) -> None:
        """Take over what a stage determined, and why it did not the rest.

        What the model cannot hold (a resistance below zero) is noise, and says so.
        """
        possible = {path: item for path, item in levels.items() if self._holds(path, item)}
        self.levels |= possible
        self.reasons |= dict.fromkeys(levels.keys() - possible.keys(), _IMPOSSIBLE)
        self.reasons |= {p: why for p, why in (reasons or {}).items() if p not in self.levels}
        for path in possible:
            self.reasons.pop(path, None)

    def _holds(self, path: str, item: Estimate) -> bool:
        record = record_of(self.actuator.wiring, path)
        low = item.value > record.minimum if record.minimum_open else item.value >= record.minimum
        high = item.value < record.maximum if record.maximum_open else item.value <= record.maximum
        return low and high

    def stands_on(self, paths: Sequence[str], given: tuple[str, ...]) -> None:
        """Note what values of some paths stand on, beside what they do already."""
        for path in paths:
            self.given[path] = (*self.given.get(path, ()), *given)

    def given_value(self, path: str) -> float:
        """Return the value before."""
        return self.actuator.parameters.value(path)

    def value(self, path: str) -> float:
        """Return what is determined by now, else what is given."""
        item = self.levels.get(path)
        return self.given_value(path) if item is None else item.value

    @property
    def progress_of_runs(self) -> Progress | None:
        """Of model runs in the middle of a stage."""
        return part(self.progress, 0.5, 0.9)

    @cached_property
    def ratio(self) -> float:
        """Motor angle over a servo's travel, rad/m."""
        return motor_ratio(self.actuator)

    def settled(self) -> Actuator:
        """Return the actuator as the stages so far have it, for what is only read from it."""
        values: dict[str, str | float] = {p: item.value for p, item in self.levels.items()}
        return self.actuator.with_values(values, source="calibration")

    def answer(self, free: Sequence[str] | None) -> tuple[list[Estimate], dict[str, str]]:
        """Return the estimates, those requested only, and the rest with its reasons.

        Raises
        ------
        InputError
            Nothing is determined, or not what was requested.
        """
        estimates = []
        for path, level in self.levels.items():
            if not level.std < _WIDE * abs(level.value):
                self.reasons[path] = _NOISE
            elif free is None or path in free:
                given = self.given.get(path, ())
                estimates.append(named(level, path, self.actuator, given=given))
        present = {item.path for item in estimates}
        for path in free or ():
            if path not in present:
                why = self.reasons.get(path, "nothing in the logs speaks of it")
                raise InputError(f"--free {path}: {why}")
        if not estimates:
            text = "; ".join(list(dict.fromkeys(self.reasons.values()))[:3])
            raise InputError(f"the logs determine no parameter: {text}")
        order = {path: k for k, path in enumerate(self.actuator.parameters)}
        estimates.sort(key=lambda item: order[item.path])
        missing = {p: self.reasons[p] for p in sorted(self.reasons, key=lambda p: order[p])}
        return estimates, {} if free is not None else missing


@dataclass(frozen=True)
class Stage(Generic[C]):
    """A part of a calibration; it says itself why the logs do not show what it gives.

    Attributes
    ----------
    name : str
        Of the stage.
    of : str
        A parameter that an actuator has which the stage can serve.
    needs : str
        Roles and excitation that it needs, in words.
    gives : str
        What it determines, in words.
    run : callable
        Reads the context and adds to it.
    """

    name: str
    of: str
    needs: str
    gives: str
    run: Callable[[C], None]


def stages_of(flow: str, runs: Mapping[str, Callable[[C], None]]) -> tuple[Stage[C], ...]:
    """Return the stages of a flow; what each needs and gives stands in ``stages.toml``."""
    rows = packaged_toml("elevon.calibrate.stages", "stages.toml")[flow]
    return tuple(Stage(name, run=run, **rows[name]) for name, run in runs.items())


def run_stages(stages: Sequence[Stage[C]], context: C, first: float, last: float) -> None:
    """Run the stages that serve an actuator, between two fractions of the work."""
    known = records(context.actuator.wiring)
    serving = [stage for stage in stages if stage.of in known]
    for number, stage in enumerate(serving):
        context.go(first + (last - first) * number / len(serving))
        stage.run(context)
