"""Friction from a rig that moves the ram: means over speed, harmonics of the pitch, detent.

At a constant speed the load cell shows ``d F(v) - m g`` (d: direction), and what repeats over the
pitch. Free fall (the stages apart) shows the screw side, modified free fall (the motor turns, its
brake open) the whole train, and a set brake what it holds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from elevon.actuator import Actuator
from elevon.arrays import Floats
from elevon.calibrate.stages.log import motor_ratio
from elevon.calibrate.stages.moves import connected, rig_moves
from elevon.estimate.covariance import block_covariance
from elevon.estimate.regression import huber
from elevon.logs.log import Log

HARMONICS = 5
_SETTLED = 0.3  # s left out: the rig's start
_BAND = 0.25  # of the log's rate: a detent above it is damped by the recorder's filter
_BLOCKS = 12
_TRIES = 41  # frequencies of the detent that are tried, within what the speed leaves open


@dataclass(frozen=True)
class RigTest:
    """One run of the rig.

    Attributes
    ----------
    log : str
        Name.
    kind : str
        ``ff``, ``ffm`` or ``brake``.
    speed : float
        Of the ram, signed [m/s].
    level, level_std : float
        Mean force of the cell and its deviation [N].
    harmonics, harmonics_std : ndarray, shape (HARMONICS,)
        Amplitudes over the pitch, positive with the resistance [N].
    detent, detent_std : float or None
        Amplitude of the detent at the ram [N], where the log's rate shows it.
    """

    log: str
    kind: str
    speed: float
    level: float
    level_std: float
    harmonics: Floats
    harmonics_std: Floats
    detent: float | None
    detent_std: float | None

    @property
    def direction(self) -> float:
        """1 extending, -1 retracting."""
        return float(np.sign(self.speed))


def rig_tests(logs: Sequence[Log], actuator: Actuator) -> list[RigTest]:
    """Evaluate the logs in which a rig moved the ram; others are passed over."""
    return [_test(log, actuator) for log in logs if rig_moves(log)]


def _kind(log: Log, per_travel: float) -> str:
    if not connected(log, per_travel):
        return "ff"
    powered = str(log.stand.parameters.get("brake.powered") or "always")
    return "ffm" if powered == "always" else "brake"


def _test(log: Log, actuator: Actuator) -> RigTest:
    per_travel = motor_ratio(actuator)
    pitch = 2.0 * np.pi * actuator.parameters.value("screw.lead")
    kind = _kind(log, per_travel)
    used = log.time >= _SETTLED
    time, force = log.time[used], log["load_cell"][used]
    # The rig's speed is constant: a straight line is quieter than the position itself.
    slope, offset = np.polyfit(time, log["output_position"][used], 1)
    direction = float(np.sign(slope))
    turn = 2.0 * np.pi * (slope * time + offset) / pitch
    columns = [np.ones_like(time)]
    columns += [direction * np.cos(n * turn) for n in range(1, HARMONICS + 1)]
    frequency = actuator.parameters.value("motor.detent_periods") * abs(slope) * per_travel
    visible = kind != "ff" and 0.0 < frequency / (2.0 * np.pi) < _BAND / log.period
    if visible:
        tone = _tone(time, force, np.stack(columns, axis=1), frequency)
        columns += [np.cos(tone * time), np.sin(tone * time)]
    design = np.stack(columns, axis=1)
    value, residual, _ = huber(design, force)
    blocks = np.arange(len(force)) * _BLOCKS // len(force)
    covariance, _ = block_covariance(
        design.T @ design, design * residual[:, None], blocks, counted=1
    )
    std = np.sqrt(np.diag(covariance))
    size = (float(np.hypot(*value[-2:])), float(np.mean(std[-2:]))) if visible else (None, None)
    part = slice(1, HARMONICS + 1)
    return RigTest(
        log.name, kind, float(slope), float(value[0]), float(std[0]), value[part], std[part], *size
    )


def _tone(time: Floats, force: Floats, design: Floats, frequency: float) -> float:
    """Frequency of the detent: what the line through the position leaves open decides the phase."""
    residual = force - design @ np.linalg.lstsq(design, force, rcond=None)[0]
    width = 2.0 * np.pi / float(np.ptp(time))
    tries = frequency + np.linspace(-width, width, _TRIES)
    power = [abs(np.exp(-1j * w * time) @ residual) for w in tries]
    best = int(np.argmax(power))
    if not 0 < best < _TRIES - 1:
        return float(tries[best])
    a, b, c = power[best - 1 : best + 2]
    return float(tries[best] + 0.5 * (a - c) / (a - 2.0 * b + c) * (tries[1] - tries[0]))
