"""Results of the demonstration's steps in a form that can be kept: to JSON and back, to the bit."""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from elevon.calibrate.estimate import Estimate
from elevon.calibrate.validation import SignalError, Validation, ValidationTrace
from elevon.errors import unknown
from elevon.report.checks import Check
from elevon.reproduce.backlash.campaign import RowResult
from elevon.reproduce.backlash.table import BacklashRow

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.calibrate import Calibration
    from elevon.reproduce.backlash import BacklashResult

__all__ = ["Backlashes", "Recovered", "Step", "validation_from_json", "validation_to_json"]


@dataclass(frozen=True)
class Step:
    """A step of the demonstration.

    Attributes
    ----------
    name : str
        What was done.
    seconds : float
        Time it took now.
    reused : str
        What of it was kept from an interrupted run; empty where nothing was.
    """

    name: str
    seconds: float
    reused: str = ""

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON form."""
        return {
            "name": self.name,
            "seconds": self.seconds,
            "resumed": bool(self.reused),
            "kept": self.reused,
        }


@dataclass(frozen=True)
class Backlashes:
    """The recomputed backlash table, without its traces."""

    rows: tuple[RowResult, ...]
    checks: tuple[Check, ...]

    @classmethod
    def of(cls, result: BacklashResult) -> Backlashes:
        """Take the table from the whole result."""
        return cls(tuple(result.rows), tuple(result.checks))

    def to_json(self) -> dict[str, Any]:
        """Return plain types."""
        return {
            "rows": [asdict(row) for row in self.rows],
            "checks": [asdict(check) for check in self.checks],
        }

    @classmethod
    def from_json(cls, data: Any) -> Backlashes:
        """Return the table again."""
        rows = (RowResult(**{**r, "measured": BacklashRow(**r["measured"])}) for r in data["rows"])
        return cls(tuple(rows), tuple(Check(**check) for check in data["checks"]))


@dataclass(frozen=True)
class Recovered:
    """What the calibration found.

    Attributes
    ----------
    actuator : Actuator
        With the calibrated values.
    estimates : tuple of Estimate
        Everything estimated.
    findings : tuple of str
        What the calibration has to say.
    """

    actuator: Actuator
    estimates: tuple[Estimate, ...]
    findings: tuple[str, ...]

    @classmethod
    def of(cls, result: Calibration) -> Recovered:
        """Take it from the whole result."""
        return cls(result.actuator, tuple(result.estimates), tuple(result.findings))

    def __getitem__(self, path: str) -> Estimate:
        for item in self.estimates:
            if item.path == path:
                return item
        raise unknown("estimate", path, [item.path for item in self.estimates])

    def to_json(self, base: Actuator) -> dict[str, Any]:
        """Return plain types; of the actuator what differs from the one calibrated."""
        values = {
            path: entry.value
            for path, entry in self.actuator.parameters.items()
            if entry != base.parameters[path]
        }
        return {
            "values": values,
            "hash": self.actuator.hash,
            "estimates": [asdict(item) for item in self.estimates],
            "findings": list(self.findings),
        }

    @classmethod
    def from_json(cls, data: Any, base: Actuator) -> Recovered:
        """Return it again.

        Raises
        ------
        ValueError
            The values do not give the actuator they were taken from.
        """
        actuator = base.with_values(data["values"], source="calibration")
        if actuator.hash != data["hash"]:
            raise ValueError("the calibrated values are damaged")
        estimates = (Estimate(**_with_tuples(item)) for item in data["estimates"])
        return cls(actuator, tuple(estimates), tuple(data["findings"]))


def _with_tuples(data: Any) -> dict[str, Any]:
    return {key: tuple(v) if isinstance(v, list) else v for key, v in data.items()}


def validation_to_json(result: Validation) -> dict[str, Any]:
    """Return a validation as plain types; arrays as base64 of their bytes."""
    return {
        "actuator": result.actuator,
        "fidelity": result.fidelity,
        "transient": result.transient,
        "errors": [asdict(error) for error in result.errors],
        "commands": dict(result.commands),
        "traces": [
            {
                "log": trace.log,
                "time": _text(trace.time),
                "measured": {name: _text(values) for name, values in trace.measured.items()},
                "simulated": {name: _text(values) for name, values in trace.simulated.items()},
                "used": _text(trace.used.astype(np.float64)),
            }
            for trace in result.traces
        ],
    }


def validation_from_json(data: Any) -> Validation:
    """Return the validation again."""
    traces = (
        ValidationTrace(
            item["log"],
            _array(item["time"]),
            _arrays(item["measured"]),
            _arrays(item["simulated"]),
            _array(item["used"]) != 0.0,
        )
        for item in data["traces"]
    )
    return Validation(
        data["actuator"],
        data["fidelity"],
        data["transient"],
        tuple(SignalError(**error) for error in data["errors"]),
        dict(data["commands"]),
        tuple(traces),
    )


def _text(values: npt.ArrayLike) -> str:
    return base64.b64encode(np.asarray(values, dtype="<f8").tobytes()).decode("ascii")


def _array(text: str) -> npt.NDArray[np.float64]:
    data = base64.b64decode(text, validate=True)
    return np.frombuffer(data, dtype="<f8").astype(np.float64)


def _arrays(texts: Mapping[str, str]) -> dict[str, npt.NDArray[np.float64]]:
    return {name: _array(text) for name, text in texts.items()}
