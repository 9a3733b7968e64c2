"""What every calibration answers with: actuators, logs, estimates, and their first JSON fields."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from elevon.calibrate.estimate import Estimate
from elevon.errors import unknown

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["Outcome", "log_facts"]


class _Log(Protocol):
    """What an outcome asks of a log."""

    @property
    def name(self) -> str: ...

    @property
    def time(self) -> npt.NDArray[np.float64]: ...

    @property
    def period(self) -> float: ...


@dataclass(frozen=True, kw_only=True)
class Outcome:
    """The answer of any calibration.

    Attributes
    ----------
    actuator, before : Actuator
        With the calibrated values, and as given.
    logs : sequence of logs
        The data.
    estimates : tuple of Estimate
        What the logs determine.
    undetermined : mapping of str to str
        What they do not, and why, where that is listed by parameter.
    wall_s : float
        Time it took.
    """

    actuator: Actuator
    before: Actuator
    logs: Sequence[_Log]
    estimates: tuple[Estimate, ...]
    undetermined: Mapping[str, str] = field(default_factory=dict)
    wall_s: float = field(compare=False)

    def __getitem__(self, path: str) -> Estimate:
        for item in self.estimates:
            if item.path == path:
                return item
        raise unknown("estimate", path, [item.path for item in self.estimates])

    def _repr_html_(self) -> str:
        from elevon.calibrate.notebook_card import calibration_card

        names = [log.name for log in self.logs]
        return calibration_card(self.before, names, self.estimates, self.undetermined)

    def head(self, logs: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
        """Return the first fields of the JSON form, with what is to be reported of each log."""
        return {
            "status": "ok",
            "actuator": self.before.name,
            "logs": list(logs),
            "parameters": {item.path: item.to_dict() for item in self.estimates},
        }


def log_facts(log: _Log) -> dict[str, Any]:
    """Return a log's name, samples and rate, plain types."""
    return {"name": log.name, "samples": len(log.time), "rate_hz": 1.0 / log.period}
