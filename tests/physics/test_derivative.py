"""The derivative branch of the speed controller against its continuous form, at any tick.

A locked shaft makes the speed error equal to the command; without integral action the torque
reference is K_p e + D. For a ramp of slope m, K_p T_d s/(T_d/N s + 1) ends at K_p T_d m; for a
step of height h it begins near K_p N h where the tick is short, and at K_p h T_d/T_s where the tick
is long against T_d/N: the difference of two samples.
"""

from __future__ import annotations

import math

import pytest

from tests.physics.rig import FREE_SHAFT, HYSTERESIS, LOCKED, run, term

KP, TD, SLOPE = 0.2, 0.01, 3.0
STUCK = (
    FREE_SHAFT
    | HYSTERESIS
    | LOCKED
    | {"control.speed_gain": KP, "control.integral_time": 0.0, "control.derivative_time": TD}
    | {"control.current_limit": 1e4}
)


@pytest.mark.parametrize("filter_", [5.0, 1000.0])
@pytest.mark.parametrize("tick", ["0 us", "125 us", "1 ms"])
def test_a_ramp_gives_gain_times_slope_at_any_tick(filter_: float, tick: str) -> None:
    settings = {**STUCK, "control.derivative_filter": filter_, "control.sample_time": tick}
    command = [term("ramp", initial=0.0, slope=SLOPE, start=0.0, end=1.0)]
    rec = run(settings, duration=0.05, mode="speed", record="torque_ref@1 kHz", command=command)
    time, torque = rec["torque_ref"].time[-1], rec["torque_ref"].values[-1]
    settled = KP * TD * SLOPE * -math.expm1(-time * filter_ / TD)
    late = KP * SLOPE * 1e-3  # one tick of the ramp itself
    assert torque - KP * SLOPE * time == pytest.approx(settled, abs=late)
    if tick == "0 us":
        assert torque - KP * SLOPE * time == pytest.approx(settled, rel=1e-3)


@pytest.mark.parametrize(("tick", "gain"), [("0 us", None), ("1 ms", TD / 1e-3)])
def test_a_step_is_limited_by_filter_and_tick(tick: str, gain: float | None) -> None:
    n, height = 1000.0, 0.5
    settings = {**STUCK, "control.derivative_filter": n, "control.sample_time": tick}
    command = [term("step", initial=0.0, final=height, time=0.01)]
    rec = run(settings, duration=0.02, mode="speed", record="torque_ref@1 MHz", command=command)
    top = float(rec["torque_ref"].values.max()) / (KP * height) - 1.0
    share = -math.expm1(-n * 1e-6 / TD)
    expected = TD / 1e-6 * share if gain is None else gain
    assert top == pytest.approx(expected, rel=1e-6)
