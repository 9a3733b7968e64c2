"""A log's signals beside those of the model in the same test."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.engine.candidates import of_a_magnet
from elevon.diagnose.engine.replay import ReplayUnit, runs
from elevon.diagnose.pictures import SignalPanel, Traces, named_faults
from elevon.diagnose.positions.log import prepared

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.answer import Diagnosis
    from elevon.logs.log import Log


def traces_of(logs: Sequence[Log], actuator: Actuator, result: Diagnosis) -> list[Traces]:
    """Return each log's signals beside the healthy model's and those with what is named.

    Parameters
    ----------
    logs : sequence of Log
        Those that were diagnosed.
    actuator : Actuator
        The healthy unit.
    result : Diagnosis
        The answer.
    """
    texts = tuple(f"{key}={value!r}" for key, value in named_faults(result).items())
    actuator = of_a_magnet(actuator)
    units = [ReplayUnit()] + ([ReplayUnit({}, texts)] if texts else [])
    return [_traces(prepared(log, actuator), actuator, units) for log in logs]


def _traces(item: Log, actuator: Actuator, units: Sequence[ReplayUnit]) -> Traces:
    sources = [item, *runs(item, actuator, units)]
    ratio = actuator.parameters.value("gear.ratio")
    good = sources[0].good
    panels = []
    for name, unit, read in (
        ("Difference of the two positions", "deg", lambda s: _gap(s, ratio)),
        ("Torque current", "A", lambda s: s.current),
        ("Motor speed", "rad/s", lambda s: s.speed),
    ):
        lines = [np.asarray(read(signals))[good] for signals in sources]
        panels.append(
            SignalPanel(name, unit, lines[0], lines[1], lines[2] if len(lines) > 2 else None)
        )
    return Traces(item.name, item.time[good], panels)


def _gap(signals: Log, ratio: float) -> Floats:
    """Motor less output [deg] about the middle of its ends: where the zeros are does not matter."""
    gap = np.degrees(signals.motor / ratio - signals.output)
    low, high = np.percentile(gap[signals.good], [1.0, 99.0])
    return np.asarray(gap - 0.5 * (low + high))
