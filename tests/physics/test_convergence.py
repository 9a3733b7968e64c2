"""Rotor on a spring against cos(w0 t): order and energy of both solver methods."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from tests.physics.rig import FREE_SHAFT, INERTIA, RATIO, run

W0 = 50.0
SPRING = FREE_SHAFT | {"load.stiffness": INERTIA * W0**2 * RATIO**2}
DURATION = 0.05  # under half a period: at a reversal the friction rule stops the rotor for a step


def swing(method: str, step: float) -> tuple[float, float]:
    """RMS position error over the amplitude, and the growth of the energy."""
    rec = run(
        SPRING | {"solver.method": method, "solver.step": step},
        duration=DURATION,
        mode="speed",
        command=[],
        record="motor_position,motor_speed@1 kHz",
        scenario={"initial": {"motor_position": 1.0, "output_position": 1.0 / RATIO}},
    )
    time = rec["motor_position"].time
    angle, speed = rec["motor_position"].values, rec["motor_speed"].values
    error = float(np.sqrt(np.mean((angle - np.cos(W0 * time)) ** 2)))
    energy = angle**2 + (speed / W0) ** 2
    return error, float(energy[-1] / energy[0] - 1.0)


@pytest.mark.parametrize("method", ["explicit", "semi_implicit"])
def test_first_order(method: str) -> None:
    errors = [swing(method, step)[0] for step in (1e-4, 5e-5, 2.5e-5)]
    for coarse, fine in itertools.pairwise(errors):
        assert coarse / fine == pytest.approx(2.0, rel=0.1)


def test_explicit_gains_energy_and_semi_implicit_keeps_it() -> None:
    """Explicit Euler: (1 + w0^2 dt^2)^n, growth exp(w0^2 dt t) - 1; semi-implicit: none in the
    mean, at most w0 dt within a cycle.
    """
    step = 1e-4
    _, explicit = swing("explicit", step)
    assert explicit == pytest.approx(math.expm1(W0**2 * step * DURATION), rel=0.01)
    _, semi = swing("semi_implicit", step)
    assert abs(semi) < W0 * step
