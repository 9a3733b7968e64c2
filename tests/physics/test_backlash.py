"""The backlash operator against its describing function, the elastic dead zone against statics."""

from __future__ import annotations

import math

import numpy as np
import pytest

import elevon
from elevon.units import parse_quantity
from tests.physics.rig import FREE_SHAFT, INERTIA, constant, run, term, values


def describing_function(amplitude: float, half: float) -> complex:
    """Fundamental of the backlash operator's output over its sine input of `amplitude`, half gap
    `half`.
    """
    s = 1 - 2 * half / amplitude
    real = 0.5 + (math.asin(s) + s * math.sqrt(1 - s * s)) / math.pi
    return complex(real, -4 / math.pi * (half / amplitude) * (1 - half / amplitude))


def fundamental(time: np.ndarray, signal: np.ndarray, frequency: float) -> complex:
    """Complex amplitude at `frequency` over a whole number of periods."""
    return complex(2 * np.mean(signal * np.exp(-2j * math.pi * frequency * time)))


@pytest.mark.parametrize("ratio", [0.05, 0.3, 0.7])
def test_backlash_operator_has_its_describing_function(ratio: float) -> None:
    """A pure sine of the motor (a free inertia under a cosine torque) through the backlash, one
    settled period.

    The limit, 1e-4 of the motor's amplitude, is the quadrature's: 1000 samples a period of a curve
    with kinks.
    """
    frequency, amplitude = 2.0, 0.05
    omega = 2 * math.pi * frequency
    torque = amplitude * 124 * INERTIA * omega**2
    settings = FREE_SHAFT | {"backlash.total": 2 * ratio * amplitude}
    rec = run(
        settings,
        duration=1.5,
        record="motor_position,output_position@2 kHz",
        scenario={
            "load": {
                "shaft": {
                    "terms": [term("sine", amplitude=torque, frequency=frequency, phase="90 deg")]
                }
            }
        },
    )
    time = rec["motor_position"].time
    motor, output = values(rec, "motor_position", "output_position")
    last = time > 1.0 - 1e-9
    last &= time < 1.5 - 1e-9
    x = fundamental(time[last], motor[last] / 124, frequency)
    y = fundamental(time[last], output[last], frequency)
    assert abs(x) == pytest.approx(amplitude, rel=1e-3)
    assert abs(y / x - describing_function(abs(x), ratio * amplitude)) < 1e-4


def test_backlash_total_is_the_whole_gap() -> None:
    """After a full reversal the lost motion between motor and output equals `backlash.total`, not
    twice, not half.
    """
    total = math.radians(0.5)
    rec = run(
        FREE_SHAFT | {"backlash.total": total},
        duration=1.0,
        record="motor_position,output_position@2 kHz",
        scenario={
            "load": {
                "shaft": {"terms": [term("sine", amplitude=2.0, frequency=2.0, phase="90 deg")]}
            }
        },
    )
    motor, output = values(rec, "motor_position", "output_position")
    lost = motor[500:] / 124 - output[500:]
    assert np.ptp(lost) == pytest.approx(total, rel=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_elastic_backlash_deflects_by_half_the_gap_plus_load_over_stiffness(sign: float) -> None:
    """Motor held by its friction, an output load: at rest theta_m/i - theta_u = sgn(T) (BLK +
    |T|/K).
    """
    total, stiffness, load = math.radians(0.4), 625.0, 3.0
    rec = run(
        {
            **FREE_SHAFT,
            "backlash.model": "elastic",
            "backlash.total": total,
            "backlash.stiffness": stiffness,
            "backlash.damping": 10.0,
            "load.inertia": 0.01,
            "friction.static": 10.0,
            "friction.dynamic": 10.0,
        },
        duration=1.0,
        record="motor_position,output_position@1 kHz",
        scenario={"load": {"output": {"terms": [constant(sign * load)]}}},
    )
    motor, output = values(rec, "motor_position", "output_position")
    assert motor[-1] == 0.0
    assert -output[-1] == pytest.approx(sign * (total / 2 + load / stiffness), rel=1e-6)


@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize(("name", "at"), [("torino-rotary", "2 deg"), ("nasa-ballscrew", "3 mm")])
def test_a_run_starts_where_the_output_is_stated_to_stand(name, at, fidelity):
    """The motor stands mid-gap with it; positions further apart than the gap are refused."""
    actuator = elevon.Actuator.load(name).with_values({"backlash.model": "operator"})
    scenario = {"duration": "5 ms", "initial": {"output_position": at}}
    record = "output_position,motor_position@400 Hz"
    run = elevon.simulate(actuator, scenario, fidelity=fidelity, record=record)
    wanted = parse_quantity(at, run["output_position"].unit)
    assert run["output_position"].values[0] == pytest.approx(wanted)
    turned = {"output_position": at, "motor_position": run["motor_position"].values[0]}
    same = elevon.simulate(
        actuator, {**scenario, "initial": turned}, fidelity=fidelity, record=record
    )
    assert np.array_equal(same["motor_position"].values, run["motor_position"].values)
    apart = {**turned, "motor_position": 0.0}
    with pytest.raises(elevon.InputError, match="more than half the backlash"):
        elevon.simulate(actuator, {**scenario, "initial": apart}, fidelity=fidelity)
