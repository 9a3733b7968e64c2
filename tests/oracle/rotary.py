"""The rotary actuator as a hybrid automaton in scipy: another language, another method.

Between two events (a relay switching, the shaft stopping or starting, the backlash closing) the
actuator is a smooth differential equation. It is integrated here by an adaptive Runge-Kutta pair,
and every event is located on the dense output, so nothing is shared with the fixed-step core but
the published equations.

Relay instants are chaotic: an error of one part in 1e9 grows to a whole switching period within
some milliseconds. What two correct programs share is position, speed, means and RMS of currents,
the ripple envelope; never single switchings. Compare those.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.integrate import solve_ivp

THIRD = 2.0 * math.pi / 3.0


@dataclass(frozen=True)
class Numbers:
    """Parameters of the automaton, SI, symbols of the published equations."""

    resistance: float
    inductance: float
    k: float  # peak phase EMF constant, V s/rad (mechanical)
    pole_pairs: int
    electrical_offset: float
    inertia: float
    viscous: float
    friction_static: float  # brake torque included
    friction_dynamic: float
    torque_maximum: float
    ratio: float
    half_backlash: float
    supply: float
    half_band: float
    gain_position: float
    speed_limit: float
    kp: float
    ki: float
    kt: float  # what the controller believes
    current_limit: float  # A, on the quadrature reference
    derivative_time: float = 0.0
    derivative_filter: float = 1000.0
    back_calculation: float = 0.0  # 1/s times (T_sat - T_ref), enters the integral of torque
    conditional: bool = False
    turns: tuple[float, float, float] = (1.0, 1.0, 1.0)


@dataclass
class Mode:
    """Discrete state: legs high, direction of sliding (0 stuck), side of the backlash in contact (0
    free).
    """

    legs: list[bool] = field(default_factory=lambda: [False, False, False])
    slide: int = 0
    contact: int = 0
    output: float = 0.0
    transitions: int = 0


def controller(
    p: Numbers, t: float, y: np.ndarray, output: float, command: Callable[[float], float]
) -> tuple[float, float, float]:
    """Speed error, unsaturated and saturated torque reference."""
    w, xi, x = y[3], y[5], y[6]
    w_ref = min(max(p.gain_position * (command(t) - output), -p.speed_limit), p.speed_limit)
    e = w_ref - w
    t_ref = p.kp * e + xi
    if p.derivative_time > 0:
        t_ref += p.kp * p.derivative_filter * (e - x)
    limit = p.kt * p.current_limit
    return e, t_ref, min(max(t_ref, -limit), limit)


def output_position(p: Numbers, y: np.ndarray, mode: Mode) -> float:
    """Output of the backlash operator."""
    return mode.output if mode.contact == 0 else y[4] / p.ratio - mode.contact * p.half_backlash


def coefficients(p: Numbers, th: float) -> list[float]:
    """EMF coefficients k_j, V s/rad, with the healthy fraction of the turns."""
    a = p.pole_pairs * th + p.electrical_offset
    return [p.turns[j] * p.k * math.sin(a - j * THIRD) for j in range(3)]


def active_torque(p: Numbers, y: np.ndarray) -> float:
    k = coefficients(p, y[4])
    torque = k[0] * y[0] + k[1] * y[1] + k[2] * y[2]
    return min(max(torque, -p.torque_maximum), p.torque_maximum)


def derivative(
    p: Numbers, mode: Mode, command: Callable[[float], float]
) -> Callable[..., list[float]]:
    """Right-hand side in the given discrete state; states i_a, i_b, i_c, w, theta, xi, x."""
    r = [p.turns[j] * p.resistance for j in range(3)]
    ind = [p.turns[j] ** 2 * p.inductance for j in range(3)]
    v = [p.supply / 2 if high else -p.supply / 2 for high in mode.legs]
    inverse = sum(1 / x for x in ind)

    def rhs(t: float, y: np.ndarray) -> list[float]:
        w = y[3]
        e, t_ref, t_sat = controller(p, t, y, output_position(p, y, mode), command)
        k = coefficients(p, y[4])
        drop = [v[j] - r[j] * y[j] - k[j] * w for j in range(3)]
        v_n = sum(drop[j] / ind[j] for j in range(3)) / inverse
        di = [(drop[j] - v_n) / ind[j] for j in range(3)]
        accel = 0.0
        if mode.slide:
            accel = (
                active_torque(p, y) - mode.slide * p.friction_dynamic - p.viscous * w
            ) / p.inertia
        dxi = p.ki * e if not (p.conditional and t_ref != t_sat) else 0.0
        dxi += p.back_calculation * (t_sat - t_ref)
        dx = (e - y[6]) * p.derivative_filter / p.derivative_time if p.derivative_time > 0 else 0.0
        return [*di, accel, w, dxi, dx]

    return rhs


def events(p: Numbers, mode: Mode, command: Callable[[float], float]) -> list[Callable[..., float]]:
    """Functions whose downward zero ends the segment: three relays, friction, backlash."""

    def relay(j: int) -> Callable[[float, np.ndarray], float]:
        sign = 1.0 if mode.legs[j] else -1.0

        def margin(t: float, y: np.ndarray) -> float:
            current = controller(p, t, y, output_position(p, y, mode), command)[2] / p.kt
            shape = math.sin(p.pole_pairs * y[4] + p.electrical_offset - j * THIRD)
            return p.half_band + sign * (current * shape - y[j])

        return margin

    def friction(t: float, y: np.ndarray) -> float:
        if mode.slide == 0:
            return p.friction_static - abs(active_torque(p, y))
        return mode.slide * y[3]

    def backlash(t: float, y: np.ndarray) -> float:
        return p.half_backlash - abs(y[4] / p.ratio - mode.output) if mode.contact == 0 else 1.0

    found = [relay(0), relay(1), relay(2), friction, backlash]
    for f in found:
        f.terminal, f.direction = True, -1  # type: ignore[attr-defined]
    return found


def switch(p: Numbers, mode: Mode, index: int, y: np.ndarray) -> None:
    """Change the discrete state after event ``index``."""
    if index < 3:
        mode.legs[index] = not mode.legs[index]
        mode.transitions += 1
    elif index == 4:
        mode.contact = 1 if y[4] / p.ratio > mode.output else -1
    else:
        torque = active_torque(p, y)
        stuck = mode.slide != 0 and abs(torque) <= p.friction_static
        mode.slide = 0 if stuck else (1 if torque > 0 else -1)
        y[3] = 0.0
        if mode.contact and mode.slide == -mode.contact:
            mode.output = y[4] / p.ratio - mode.contact * p.half_backlash
            mode.contact = 0


@dataclass(frozen=True)
class Trace:
    """Dense samples of one run: time s, currents A (3 columns), speed rad/s, motor and output angle
    rad.
    """

    time: np.ndarray
    currents: np.ndarray
    speed: np.ndarray
    motor: np.ndarray
    output: np.ndarray
    transitions: int


def simulate(
    p: Numbers,
    command: Callable[[float], float],
    duration: float,
    sample: float = 1e-5,
    rtol: float = 1e-8,
) -> Trace:
    """Run from rest, all legs low, backlash centred. Absolute tolerances are 1e-9 of the natural
    scale of each state.
    """
    grid = np.arange(round(duration / sample) + 1) * sample
    states, outputs = np.zeros((grid.size, 7)), np.zeros(grid.size)
    mode, y, t, filled = Mode(), np.zeros(7), 0.0, 0
    while t < duration:
        out = solve_ivp(
            derivative(p, mode, command),
            (t, duration),
            y,
            method="DOP853",
            rtol=rtol,
            atol=1e-9,
            max_step=1e-3,
            first_step=min(2e-5, duration - t),
            events=events(p, mode, command),
            dense_output=True,
        )
        if out.status < 0:
            raise RuntimeError(f"the oracle's integrator gave up at {t} s: {out.message}")
        t, y = float(out.t[-1]), out.y[:, -1].copy()
        stop = int(np.searchsorted(grid, t, side="right"))
        if stop > filled:
            states[filled:stop] = out.sol(grid[filled:stop]).T
            angle = states[filled:stop, 4] / p.ratio
            outputs[filled:stop] = (
                mode.output if mode.contact == 0 else angle - mode.contact * p.half_backlash
            )
            filled = stop
        for index, hits in enumerate(out.t_events):
            if hits.size:
                switch(p, mode, index, y)
    return Trace(grid, states[:, :3], states[:, 3], states[:, 4], outputs, mode.transitions)
