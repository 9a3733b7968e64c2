"""What a log determines of the brake: its torque, a force without an arm, or that it was on."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from elevon.arrays import Floats
from elevon.logs.command.note import CommandNote
from elevon.recording import Recording

Known = Literal["torque", "force", "on", "off"]
_MOVING = 0.1  # of the highest speed: slower than that a resistive torque is not at its level
_SMOOTHING = 0.25  # s: the brake's level changes slowly, the cell's noise does not
_RESONATOR = 0.005 / math.sqrt(3.0)  # a ceramic resonator keeps within 0.5 %
_SIGNED = 0.5  # of the mean size: a reaction torque turns with the motion


@dataclass(frozen=True)
class Brake:
    """The brake of one log.

    Attributes
    ----------
    known : str
        ``torque``: level on the motor shaft [N m]; ``force``: level [N], arm unknown; ``on``:
        nothing but that it acted; ``off``.
    time, level : ndarray, shape (m,)
        Seconds from the log's first sample, and the size of the resistive torque or force.
    drift_std : float
        Relative deviation of the load cell's clock.
    turning : float
        1 or -1 where the cell's sign turns with the motion (-1: against it), 0 where it is pulled
        in one direction only: states how the cell's own offset enters `level`.
    """

    known: Known
    time: Floats
    level: Floats
    drift_std: float = 0.0
    turning: float = 0.0

    @classmethod
    def none(cls) -> Brake:
        """No brake."""
        return cls("off", np.zeros(0), np.zeros(0))

    def at(self, time: Floats) -> Floats:
        """Return the level at instants [s], shape (n,)."""
        if not len(self.time):
            return np.zeros(len(time))
        return np.asarray(np.interp(time, self.time, self.level), dtype=np.float64)

    @property
    def unknown(self) -> bool:
        """Whether it acted and its torque is not known."""
        return self.known in ("force", "on")

    @property
    def measured(self) -> bool:
        """Whether a load cell gives the torque itself."""
        return self.known == "torque"


def brake_of(
    recording: Recording,
    note: CommandNote | None,
    time: Floats,
    start: float,
    speed: Floats | None,
) -> Brake:
    """Return what a log determines of its brake.

    Parameters
    ----------
    recording : Recording
        With ``load_cell_torque`` or ``load_cell_force`` where there was a cell.
    note : CommandNote or None
        Says whether the brake was on.
    time, speed : ndarray, shape (n,)
        The drive's clock from zero [s], motor speed [rad/s], if it is known.
    start : float
        Drive time of its first sample [s].
    """
    off = Brake("off", np.array([0.0, float(time[-1]) if len(time) else 0.0]), np.zeros(2))
    if note is not None and note.brake is False:
        return off
    synchronised = (recording.meta.get("import") or {}).get("synchronisation") or {}
    for name, known in (("load_cell_torque", "torque"), ("load_cell_force", "force")):
        if speed is not None and name in recording and synchronised.get("method") != "none":
            channel = recording[name]
            at = np.asarray(channel.time, dtype=np.float64) - start
            level = _level(at, np.asarray(channel.values, dtype=np.float64), time, speed)
            if level is not None:
                kind: Known = "torque" if known == "torque" else "force"
                return Brake(kind, *level[:2], _drift(synchronised), level[2])
    if note is not None and note.brake:
        return Brake("on", off.time, off.level)
    return off


def _drift(synchronised: Mapping[str, Any]) -> float:
    """What the synchronisation left open of the clock's speed; a resonator's, if everything."""
    std = synchronised.get("drift_std")
    return _RESONATOR if std is None else min(float(std), _RESONATOR)


def _level(
    at: Floats, value: Floats, time: Floats, speed: Floats
) -> tuple[Floats, Floats, float] | None:
    """Size of a resistive torque, from samples where the shaft moves; (time, level, turning)."""
    from scipy.ndimage import uniform_filter1d

    moving = np.interp(at, time, speed)
    clear = np.isfinite(value) & (np.abs(moving) > _MOVING * np.abs(speed).max())
    clear &= (at >= time[0]) & (at <= time[-1])
    if clear.sum() < 10:
        return None
    at, value, direction = at[clear], value[clear], np.sign(moving[clear])
    size = float(np.mean(np.abs(value)))
    turning = float(np.mean(value * direction))
    signed = size > 0.0 and abs(turning) > _SIGNED * size and direction.std() > 0.0
    # One sign throughout, however the shaft turns, is a cell that is pulled in one direction only.
    steady = abs(float(value.mean())) > 0.9 * size
    turns = float(np.sign(turning)) if signed and not steady else 0.0
    pull = float(np.sign(value.mean())) or 1.0
    level = value * direction * turns if turns else value * pull
    width = max(1, round(_SMOOTHING / max(float(np.median(np.diff(at))), 1e-6)))
    smooth = _by_stretches(at, np.asarray(level, dtype=np.float64), width, uniform_filter1d)
    return at, np.maximum(smooth, 0.0), turns


def _by_stretches(at: Floats, level: Floats, width: int, smooth: object) -> Floats:
    """Smooth within each stretch of motion: across a reversal there is nothing between."""
    out = level.copy()
    cuts = np.flatnonzero(np.diff(at) > 5.0 * np.median(np.diff(at))) + 1
    for part in np.split(np.arange(len(at)), cuts):
        size = min(width, len(part))
        if size > 1:
            out[part] = smooth(level[part], size, mode="nearest")  # type: ignore[operator]
    return out
