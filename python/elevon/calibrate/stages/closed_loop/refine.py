"""What a search leaves out: friction that grows with the torque, and how late the drive acts.

Both bias gains, inertia and limits where they are missing: a screw's friction eats a share of the
torque at the current's limit, so that a model without it lowers the limit; a drive that reads,
waits and holds acts some milliseconds late, which the model's step stands for.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from elevon.actuator import Actuator
from elevon.calibrate.stages.closed_loop.fit import Searched
from elevon.calibrate.stages.closed_loop.free import free_list
from elevon.calibrate.stages.closed_loop.log import motion
from elevon.calibrate.stages.closed_loop.model import LoopModel
from elevon.calibrate.stages.closed_loop.start import windows
from elevon.calibrate.stages.log import LAWS_WITHOUT_LOAD, LOAD_SHARE, grows_with_torque
from elevon.estimate.free import inner, outer
from elevon.logs.log import Log

_TICKS = (1e-3, 2e-3, 3e-3)  # s, tried beside the actuator file's own step
_PERIODS = 0.25  # of the log, a step at most
_ROUNDS = 6


def refined(
    actuator: Actuator,
    logs: Sequence[Log],
    chosen: Searched,
    *,
    check: Callable[[], bool] = lambda: True,
) -> tuple[Actuator, Searched]:
    """Return the servo and the point from which whole logs are fitted.

    Friction is let grow with the motor's torque (laws that know of no such share), and the model's
    step becomes the one of a few under which windows of the logs are followed best.
    """
    servo = load_share(actuator, logs, chosen.structure)
    free = tuple(free_list(servo, logs, chosen.structure, outer(chosen.free, chosen.x)))
    per_output = LoopModel(servo, logs, chosen.structure, check).per_output
    parts = windows(logs, per_output)
    tried = []
    scales = None
    for step in steps(servo, logs):
        late = servo.with_values({"low.step": step}, source="calibration")
        lanes = LoopModel(late, parts, chosen.structure, check).lanes(free)
        x = inner(free, outer(chosen.free, chosen.x))
        if scales is None:
            lanes.refresh(x)
            scales = lanes.scales
        lanes.scales = scales.copy()
        tried.append((late, lanes.solve(x[None, :], rounds=_ROUNDS)[0]))
    best, point = min(tried, key=lambda item: item[1].cost)
    # The belief stays with the first values of the search.
    first = {item.path: item.start for item in chosen.free}
    free = tuple(replace(item, start=first.get(item.path, item.start)) for item in free)
    return best, replace(chosen, free=free, x=point.x)


def steps(actuator: Actuator, logs: Sequence[Log]) -> list[float]:
    """Return the steps of the model that are tried, the actuator file's own first, s."""
    coarse = actuator.parameters.value("low.step")
    longest = _PERIODS * min(log.period for log in logs)
    if str(actuator.parameters["drive.kind"].value) == "pwm":
        # How late it acts is the current loop's lag, which is fitted: no step stands for it.
        return [max(coarse, min(_TICKS[0], longest))]
    return [coarse, *(tick for tick in _TICKS if coarse < tick <= longest)]


def load_share(actuator: Actuator, logs: Sequence[Log], structure: str) -> Actuator:
    """Return the servo with friction that grows with the torque; a law of bristles stays."""
    if str(actuator.parameters["friction.law"].value) not in LAWS_WITHOUT_LOAD:
        return actuator
    model = LoopModel(actuator, logs, structure)
    top = max(float(np.nanmax(np.abs(motion(log, model.per_output)[0]))) for log in logs)
    if not top > 0.0:
        return actuator
    values = grows_with_torque(top) | {LOAD_SHARE: 0.05}
    return actuator.with_values(values, source="calibration")
