"""A calibration put together from parts, each number from the signals that show it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from elevon.calibrate.estimate import Estimate
from elevon.calibrate.level import Level
from elevon.calibrate.outcome import Outcome, log_facts
from elevon.calibrate.role_log import CalibrationRoleLog
from elevon.errors import InputError, Interrupted
from elevon.parameters.records import record_of

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.progress import Progress

__all__ = ["Parts", "PartsCalibration", "go"]

_WIDE = 0.2  # of a value: a deviation above which it is not determined


@dataclass(frozen=True, kw_only=True)
class PartsCalibration(Outcome):
    """The answer; see `elevon.calibrate.outcome.Outcome` for what every answer has.

    Attributes
    ----------
    logs : tuple of CalibrationRoleLog
        The data.
    facts : mapping of str to object
        What else is known of the fit, plain types.
    """

    logs: tuple[CalibrationRoleLog, ...]
    facts: Mapping[str, Any]

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            **self.head([log_facts(log) for log in self.logs]),
            "undetermined": dict(self.undetermined),
            **self.facts,
            "wall_s": self.wall_s,
        }


class Parts:
    """Levels and reasons as the stages determine them.

    Parameters
    ----------
    actuator : Actuator
        Values before.
    given : mapping of str to tuple of str
        Path to what its value stands on.
    reasons : mapping of str to str
        Of what no log shows.
    """

    def __init__(
        self,
        actuator: Actuator,
        given: Mapping[str, tuple[str, ...]],
        reasons: Mapping[str, str],
    ) -> None:
        self.actuator = actuator
        self.given = given
        self.levels: dict[str, Level] = {}
        self.reasons: dict[str, str] = dict(reasons)

    def add(self, levels: Mapping[str, Level], reasons: Mapping[str, str]) -> None:
        """Take over what a stage determined, and why it did not the rest."""
        self.levels |= levels
        self.reasons |= {path: why for path, why in reasons.items() if path not in self.levels}
        for path in levels:
            self.reasons.pop(path, None)

    def value(self, path: str) -> float:
        """Return what is determined by now, else what is given."""
        item = self.levels.get(path)
        return self.actuator.parameters.value(path) if item is None else item.value

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
                self.reasons[path] = "the logs' noise is larger than its effect"
            elif free is None or path in free:
                estimates.append(self._estimate(path, level))
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

    def _estimate(self, path: str, level: Level) -> Estimate:
        record = record_of(self.actuator.wiring, path)
        low, high = level.interval
        old = self.actuator.parameters.value(path)
        if old >= 0.0:
            low = max(low, 0.0)
        return Estimate(
            path=path,
            value=level.value,
            std=level.std,
            interval=(low, high),
            unit=record.unit,
            register=record.register,
            old=old,
            method="direct",
            given=self.given.get(path, ()),
        )


def go(progress: Progress | None, fraction: float) -> None:
    """Report progress; stop where it says so."""
    if progress is not None and progress(fraction) is False:
        raise Interrupted("calibration stopped")
