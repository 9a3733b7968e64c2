"""The derivative branch of the speed controller against its continuous form, at any tick.

A locked shaft makes the speed error equal to the command; without integral action the torque
reference is K_p e + D. For a ramp of slope m, K_p T_d s/(T_d/N s + 1) ends at K_p T_d m; for a
step of height h it begins near K_p N h where the tick is short, and at K_p h T_d/T_s where the tick
is long against T_d/N: the difference of two samples.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

import elevon
from elevon.errors import FindingWarning, InputError
from tests.physics.rig import (
    FREE_SHAFT,
    HYSTERESIS,
    INERTIA,
    LOCKED,
    MOTOR,
    PWM,
    actuator,
    constant,
    make_scenario,
    run,
    term,
)

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


class Unchecked(elevon.Actuator):
    """An actuator whose findings do not stop it."""

    def findings(self, fidelity: str = "high") -> list:
        """Nothing is found."""
        return []


def loop(drive: dict, ratio: float, **extra: object) -> dict:
    """A speed loop at K_p T_d / J = `ratio`."""
    gains = {"control.speed_gain": ratio * INERTIA / TD, "control.derivative_time": TD}
    limits = {"control.current_limit": 13.3, "control.derivative_filter": 1000.0}
    return MOTOR | drive | gains | limits | extra


def scatter(values: dict, fidelity: str = "high") -> float:
    """Standard deviation of the torque reference under 1 N m of brake, the check set aside."""
    free = elevon.Actuator.load("torino-rotary")
    free = Unchecked(**{name: getattr(free, name) for name in free.__dataclass_fields__})
    brake = {"load": {"brake": {"terms": [constant(1.0)]}}}
    rec = elevon.simulate(
        free.with_values(values),
        make_scenario(duration=0.1, mode="speed", command=[constant(30.0)], extra=brake),
        record=f"torque_ref@{20 if fidelity == 'high' else 2} kHz",
        fidelity=fidelity,
    )
    torque = rec["torque_ref"]
    return float(np.std(torque.values[torque.time > 0.06]))


def limit(values: dict) -> float:
    """K_p T_d / J that the check states."""
    (found,) = actuator(values).findings()
    assert (found["path"], found["severity"]) == ("control.speed_gain", "error")
    return float(found["limit"]) * TD / INERTIA


@pytest.mark.parametrize("extra", [{}, {"control.sample_time": 500e-6}])
def test_a_carrier_drive_is_refused_where_it_becomes_unstable_and_warned_before(
    extra: dict,
) -> None:
    """Measured scatter on either side of the stated limit; all cases: benchmarks/derivative.py."""
    most = limit(loop(PWM, 20.0, **extra))
    assert scatter(loop(PWM, 0.85 * most, **extra)) < 0.5
    assert scatter(loop(PWM, 1.15 * most, **extra)) > 2.0
    scenario = make_scenario(duration=1e-3, mode="speed", command=[constant(30.0)])
    with pytest.raises(InputError, match="current loop bears"):
        elevon.simulate(actuator(loop(PWM, 1.05 * most, **extra)), scenario)
    with pytest.warns(FindingWarning, match="becomes unstable at"):
        elevon.simulate(actuator(loop(PWM, 0.9 * most, **extra)), scenario)
    assert actuator(loop(PWM, 0.75 * most, **extra)).findings() == []


def test_the_limit_of_a_carrier_drive_is_that_of_its_current_loop_at_a_higher_gain() -> None:
    """(1 + rho) K T_s / L = 1 where the duties act one sample late."""
    bare = PWM["pwm.proportional_gain"] / 30.5e-3 * PWM["pwm.sample_time"]
    assert 1 + limit(loop(PWM, 20.0)) == pytest.approx(1 / bare, rel=0.03)


def test_relays_looked_at_every_step_bear_any_derivative_a_tick_does_not() -> None:
    """Steady at K_p T_d of five inertias, with and without backlash; with a tick 1 is the limit."""
    elastic = {"backlash.model": "elastic", "backlash.damping": 20.0, "load.inertia": 0.5}
    for extra in ({}, {"backlash.stiffness": 1e4, **elastic}):
        assert actuator(loop(HYSTERESIS, 5.0, **extra)).findings() == []
        assert scatter(loop(HYSTERESIS, 5.0, **extra)) < 0.6
    ticking = {"control.sample_time": 2e-3}
    assert limit(loop(HYSTERESIS, 3.0, **ticking)) == pytest.approx(1.0, rel=1e-6)
    assert scatter(loop(HYSTERESIS, 0.7, **ticking)) < 0.3
    assert scatter(loop(HYSTERESIS, 1.5, **ticking)) > 2.0


# What the reduced-order model does not carry of the switching one's settings is beside the point
# here.
@pytest.mark.filterwarnings("ignore::elevon.errors.NotActingWarning")
@pytest.mark.parametrize("drive", [HYSTERESIS, PWM])
def test_the_low_model_bears_any_derivative_and_says_where_the_high_one_does_not(
    drive: dict,
) -> None:
    values = loop(drive, 20.0, **({"control.sample_time": 2e-3} if drive is HYSTERESIS else {}))
    assert scatter(values, "low") < 0.1
    (found,) = actuator(values).findings("low")
    assert found["severity"] == "warning"


def test_a_current_loop_that_oscillates_by_itself_is_refused() -> None:
    """K T_s / L = 1 with the duties one sample late, 2 with none."""
    for delay, most in ((1.0, 1.0), (0.0, 2.0)):
        for share, refused in ((0.98, False), (1.02, True)):
            gain = share * most * 30.5e-3 / PWM["pwm.sample_time"]
            values = {"pwm.proportional_gain": gain, "pwm.computation_delay": delay}
            found = [f["path"] for f in actuator(MOTOR | PWM | values).findings()]
            assert ("pwm.proportional_gain" in found) == refused, (delay, share)
