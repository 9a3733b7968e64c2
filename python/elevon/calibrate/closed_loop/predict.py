"""A calibrated servo on logs that it has not seen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from elevon.arrays import Floats
from elevon.calibrate.closed_loop.log import LoopLog
from elevon.errors import InputError

if TYPE_CHECKING:
    from elevon.actuator import Actuator

__all__ = ["Agreement", "errors_of", "predict"]


@dataclass(frozen=True)
class Agreement:
    """RMS error of one channel of one log: SI, and shares of the signal's range and RMS."""

    log: str
    channel: str
    rms: float
    of_range: float
    of_rms: float

    def to_dict(self) -> dict[str, Any]:
        """Return plain types, percent as elsewhere."""
        return {
            "log": self.log,
            "signal": self.channel,
            "rms": self.rms,
            "rms_percent_of_range": 100.0 * self.of_range,
            "rms_percent_of_rms": 100.0 * self.of_rms,
        }


def errors_of(log: LoopLog, logger: Mapping[str, Floats]) -> list[Agreement]:
    """Return the error of each channel over the samples that count."""
    rows = []
    for name, values in logger.items():
        mask = log.used & np.isfinite(log.signals[name])
        data = log.signals[name][mask]
        rms = float(np.sqrt(np.mean((values[mask] - data) ** 2)))
        size, span = float(np.sqrt(np.mean(data**2))), float(np.ptp(data))
        rows.append(
            Agreement(
                log.name, name, rms, rms / span if span else np.inf, rms / size if size else np.inf
            )
        )
    return rows


def predict(
    logs: Sequence[LoopLog], actuator: Actuator, logger: Mapping[str, float] | None = None
) -> tuple[list[Agreement], list[dict[str, Floats]]]:
    """Run a servo on the demands of logs and compare.

    Parameters
    ----------
    logs : sequence of LoopLog
        Held-out data.
    actuator : Actuator
        Calibrated; its own `control.structure` holds.
    logger : mapping of str to float, optional
        Delays and offsets of the logger, `LoopCalibration.logger`.

    Returns
    -------
    list of Agreement, list of dict
        Errors by log and channel, and each log's channels as predicted.

    Raises
    ------
    InputError
        A run leaves the finite numbers.
    """
    from elevon.calibrate.closed_loop.free import STICK
    from elevon.calibrate.closed_loop.model import LoopModel

    structure = str(actuator.parameters["control.structure"].value)
    model = LoopModel(actuator, logs, structure)
    model.keep_gains(actuator)
    values = {path: value for path, value in (logger or {}).items() if path != STICK}
    errors, traces = [], []
    for log, run in zip(logs, model.simulate([values])[0], strict=True):
        if run is None:
            raise InputError(f"{log.name}: the model's run leaves the finite numbers")
        errors += errors_of(log, run)
        traces.append(run)
    return errors, traces
