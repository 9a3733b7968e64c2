"""The rotary actuator behind a carrier drive, from edge to edge: another language, another method.

The drive's controllers act at their samples; between them each leg turns where its reference meets
the drawn carrier, and between two edges the windings and the rotor are a smooth differential
equation, integrated by the classical Runge-Kutta method in pieces of at most 31.25 us. Its error
is below 1e-9 of every state. Nothing is shared with the core but the equations. Rigid gear, no dry
friction.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

THIRD = 2.0 * math.pi / 3.0
PIECE = 31.25e-6


@dataclass(frozen=True)
class Numbers:
    """Parameters, SI, symbols of the published equations."""

    resistance: float
    inductance: float
    k: float
    pole_pairs: int
    inertia: float
    viscous: float
    ratio: float
    supply: float
    gain_position: float
    kp: float
    ki: float
    kt: float
    frequency: float
    current_gain: float
    current_integral: float
    dead_time: float = 0.0

    @property
    def sample(self) -> float:
        """Both controllers act at the peaks and the valleys of the carrier."""
        return 0.5 / self.frequency


@dataclass
class Drive:
    """What the drive remembers."""

    torque: float = 0.0
    d: float = 0.0
    q: float = 0.0
    acting: list[float] = field(default_factory=lambda: [0.0] * 3)
    computed: list[float] = field(default_factory=lambda: [0.0] * 3)
    voltage_q: float = 0.0


def sampled(p: Numbers, drive: Drive, y: list[float], command: float) -> None:
    """One sampling: the references computed last act, those of this one are computed."""
    drive.acting = drive.computed
    i, w, theta = y[:3], y[3], y[4]
    error = p.gain_position * (command - theta / p.ratio) - w
    wanted = (p.kp * error + drive.torque) / p.kt
    drive.torque += p.ki * p.sample * error
    angles = [p.pole_pairs * theta - j * THIRD for j in range(3)]
    q = 2 / 3 * sum(i[j] * math.sin(angles[j]) for j in range(3))
    d = -2 / 3 * sum(i[j] * math.cos(angles[j]) for j in range(3))
    coupling = p.pole_pairs * w * p.inductance
    v_d = p.current_gain * -d + drive.d - coupling * q
    v_q = p.current_gain * (wanted - q) + drive.q + coupling * d + p.k * w
    drive.d += p.current_integral * p.sample * -d
    drive.q += p.current_integral * p.sample * (wanted - q)
    drive.voltage_q = v_q
    ahead = 1.5 * p.sample * p.pole_pairs * w
    phases = [v_q * math.sin(a + ahead) - v_d * math.cos(a + ahead) for a in angles]
    shift = 0.5 * (max(phases) + min(phases))
    drive.computed = [2 * (v - shift) / p.supply for v in phases]


def edges(p: Numbers, drive: Drive, falling: bool) -> list[tuple[float, int]]:
    """Instants of the legs' edges after a sampling, from the carrier's straight line."""
    return sorted(
        (p.sample * 0.5 * (1.0 - m if falling else 1.0 + m), j)
        for j, m in enumerate(drive.acting)
        if -1.0 < m < 1.0
    )


def rates(p: Numbers, y: np.ndarray, high: list[bool]) -> np.ndarray:
    """Time derivatives of currents, speed and angle with the legs as they are."""
    theta, w = y[4], y[3]
    k = [p.k * math.sin(p.pole_pairs * theta - j * THIRD) for j in range(3)]
    v = [0.5 * p.supply * (1.0 if x else -1.0) for x in high]
    drop = [v[j] - p.resistance * y[j] - k[j] * w for j in range(3)]
    neutral = sum(drop) / 3.0
    torque = sum(k[j] * y[j] for j in range(3))
    slopes = [(x - neutral) / p.inductance for x in drop]
    return np.array([*slopes, (torque - p.viscous * w) / p.inertia, w])


def moved(p: Numbers, y: np.ndarray, high: list[bool], duration: float) -> np.ndarray:
    """The state after a time without edges."""
    pieces = max(1, math.ceil(duration / PIECE - 1e-9))
    h = duration / pieces
    for _ in range(pieces):
        a = rates(p, y, high)
        b = rates(p, y + 0.5 * h * a, high)
        c = rates(p, y + 0.5 * h * b, high)
        d = rates(p, y + h * c, high)
        y = y + h / 6.0 * (a + 2 * b + 2 * c + d)
    return y


@dataclass(frozen=True)
class Trace:
    """At the samplings: time s, currents A (3 columns), speed rad/s, motor angle rad, v_q V."""

    time: np.ndarray
    currents: np.ndarray
    speed: np.ndarray
    motor: np.ndarray
    voltage_q: np.ndarray


def simulate(
    p: Numbers, command: Callable[[float], float], duration: float, speed: float = 0.0
) -> Trace:
    """Run from zero currents.

    With a dead time the diode of a leg's current holds it, from each edge on, where it was before
    (current into the rail that it leaves) or where it goes; the current's direction is that at the
    edge.
    """
    y, drive, high = np.array([0.0, 0.0, 0.0, speed, 0.0]), Drive(), [False] * 3
    rows = []
    late: list[tuple[float, int, bool]] = []
    for n in range(round(duration / p.sample)):
        begin = n * p.sample
        rows.append([begin, *y])
        sampled(p, drive, list(y), command(begin))
        rows[-1].append(drive.voltage_q)
        falling = n % 2 == 0
        now = begin
        events = [(begin + t, j, falling, True) for t, j in edges(p, drive, falling)]
        queue = sorted(events + [(t, j, up, False) for t, j, up in late])
        late = []
        while queue:
            t, j, up, commanded = queue.pop(0)
            if t >= begin + p.sample:
                late.append((t, j, up))
                continue
            y, now = moved(p, y, high, t - now), t
            # A current out of the leg is held at the lower rail, one into it at the upper one.
            if commanded and p.dead_time > 0.0 and (y[j] > 0.0) == up:
                queue = sorted([*queue, (t + p.dead_time, j, up, False)])
            else:
                high[j] = up
        y = moved(p, y, high, begin + p.sample - now)
    table = np.array(rows)
    return Trace(table[:, 0], table[:, 1:4], table[:, 4], table[:, 5], table[:, 6])
