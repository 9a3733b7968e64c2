"""Which estimates the actuator file accepts, and which must be refused or explained."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from elevon.actuator import Actuator
from elevon.calibrate.candidates import within_inertia
from elevon.calibrate.dynamic import Dynamic
from elevon.calibrate.plant import Torque
from elevon.errors import InputError
from elevon.estimate import Estimate
from elevon.parameters.records import record_of
from elevon.parameters.relations import static_following

#: Offsets of sensors, which no parameter holds: they go with the actuator file's promises on logs.
_OFFSETS = {
    "sensor.speed_offset": "motor_speed",
    "sensor.current_offset": "current_q_meas",
}
_BOUND = "the fit of the model runs ends at its bound: they do not say where it lies"
_LOOSEST = 0.25  # of the value, or of the one before: a larger deviation determines nothing


def accept(
    estimates: Sequence[Estimate], free: Sequence[str] | None, actuator: Actuator
) -> list[Estimate]:
    """Keep what was requested, what no actuator file holds, and only what it can hold."""
    accepted = []
    for item in estimates:
        if item.in_set and free is not None and item.path not in free:
            continue
        if item.in_set:
            record = record_of(actuator.wiring, item.path)
            low = item.value < record.minimum or (
                record.minimum_open and item.value == record.minimum
            )
            if low or item.value > record.maximum or not np.isfinite(item.std):
                continue
            # What is loose may still tell the value before wrong.
            scale = max(abs(item.value), abs(item.old or 0.0))
            if record.minimum >= 0.0 and item.std > _LOOSEST * scale:
                continue
        accepted.append(item)
    return accepted


def missing(free: Sequence[str] | None, estimates: Sequence[Estimate], torque: Torque) -> None:
    """Raise `InputError` for a path that was requested and is not estimated."""
    known = {item.path for item in estimates}
    for path in free or ():
        if path in known:
            continue
        if path == "motor.emf_constant" and not torque.measured:
            raise InputError(
                "--free motor.emf_constant: without a load cell the logs determine only the ratio "
                "of inertia and friction to the torque constant; add --loadcell, or leave it out"
            )
        raise InputError(
            f"--free {path}: nothing in the logs excites it enough; leave it out or add a log "
            "that does"
        )


def undetermined(
    every: Sequence[Estimate],
    accepted: Sequence[Estimate],
    free: Sequence[str] | None,
    dynamic: Dynamic | None,
) -> dict[str, str]:
    """Return path to why a number stays as given: too loose, outside the model, or not seen."""
    known = {item.path for item in accepted}
    missing = {
        item.path: f"{item.value:.4g} +- {item.std:.2g} {item.unit} is not determined by the "
        "signals, or not possible in the model"
        for item in every
        if item.in_set and item not in accepted and (free is None or item.path in free)
    }
    if dynamic is not None:
        missing |= dict.fromkeys(dynamic.at_bound, _BOUND)
        missing |= dynamic.ranking.dropped
    return {path: why for path, why in missing.items() if path not in known}


def with_values(
    actuator: Actuator,
    estimates: Sequence[Estimate],
    followed: Mapping[str, float],
    torque: Torque,
    dynamic: Dynamic | None,
) -> Actuator:
    """Return the actuator with what was estimated, and what has to follow from it."""
    values: dict[str, str | float] = dict(followed)
    values |= {item.path: item.value for item in estimates if item.in_set}
    if torque.measured and torque.tied and "motor.emf_constant" in values:
        values["control.torque_constant"] = torque.believed
    if dynamic is not None and dynamic.drive != actuator.parameters["drive.kind"].value:
        values["drive.kind"] = dynamic.drive
    if "friction.dynamic" in values and "friction.static" not in values:
        friction = float(values["friction.dynamic"])
        values["friction.static"] = static_following(actuator.parameters, friction)
    values |= within_inertia(actuator, values)
    offsets = {
        signal: item.value
        for item in estimates
        for path, signal in _OFFSETS.items()
        if item.path == path
    }
    fitted = actuator.with_values(values, source="calibration")
    return replace(fitted, validation={**(actuator.validation or {}), "offsets": offsets})


def shortened(actuator: Actuator, estimates: Sequence[Estimate]) -> list[str]:
    """Say so where the actuator file cannot hold the derivative time as estimated."""
    values: dict[str, str | float] = {item.path: item.value for item in estimates if item.in_set}
    if "control.derivative_time" not in within_inertia(actuator, values):
        return []
    return [
        "control.derivative_time is shortened in the file: as estimated, speed gain times it "
        "exceeds the inertia, which this controller without its filter cannot hold"
    ]
