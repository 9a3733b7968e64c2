"""A log's signals by role beside those of the model in the same test."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from elevon.arrays import Floats
from elevon.diagnose.pictures import SignalPanel, Traces, named_faults
from elevon.diagnose.roles.channels import RoleUnit, channels_by
from elevon.diagnose.roles.log import role_log
from elevon.diagnose.roles.role_test import RoleTest
from elevon.units import to_display

if TYPE_CHECKING:
    from elevon.actuator import Actuator
    from elevon.diagnose.engine.answer import Diagnosis
    from elevon.logs.log import Log

#: Roles that are drawn, the first three of a log; lengths in mm.
_DRAWN = (
    "output_position", "torque_current", "motor_speed", "supply_current", "torque_voltage", "state",
)  # fmt: skip
_MOST = 3


def traces_by_roles(logs: Sequence[Log], actuator: Actuator, result: Diagnosis) -> list[Traces]:
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
    units = [RoleUnit({})] + ([RoleUnit({}, texts)] if texts else [])
    items = [role_log(log, actuator) for log in logs]
    return [_traces(item, actuator, units) for item in items]


def _traces(item: RoleTest, actuator: Actuator, units: Sequence[RoleUnit]) -> Traces:
    sources: list[Mapping[str, Floats]] = [item.seen, *channels_by(item, actuator, units)]
    roles = [role for role in _DRAWN if all(role in channels for channels in sources)]
    panels = []
    for role in roles[:_MOST]:
        unit = "mm" if item.log.units[role] == "m" else item.log.units[role]
        lines = [np.asarray(to_display(channels[role], unit)) for channels in sources]
        name = role.replace("_", " ").capitalize()
        panels.append(
            SignalPanel(name, unit, lines[0], lines[1], lines[2] if len(lines) > 2 else None)
        )
    return Traces(item.name, item.log.time, panels)
