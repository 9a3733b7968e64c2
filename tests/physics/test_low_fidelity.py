"""The reduced-order model in the limits where it must equal closed forms or the switching model."""

from __future__ import annotations

import math

import numpy as np
import pytest

from tests.physics.rig import FREE_SHAFT, INERTIA, MOTOR, PWM, K, constant, run, term, values

LOW = MOTOR | PWM
RUBBING = FREE_SHAFT | {"friction.static": 0.12, "friction.dynamic": 0.06}


def test_low_model_sticks_exactly() -> None:
    """0.99 FSJ for 10 s: zero motion; 1.01 FSJ: moving."""
    for factor, moves in ((0.99, False), (1.01, True)):
        rec = run(
            RUBBING,
            duration=10.0 if not moves else 0.1,
            record="motor_position@100 Hz",
            fidelity="low",
            scenario={"load": {"shaft": {"terms": [constant(factor * 0.12)]}}},
        )
        assert bool(np.any(rec["motor_position"].values != 0.0)) is moves


def test_low_model_coasts_to_rest_when_the_dry_friction_says() -> None:
    """w = w0 - F t / J, to within one step of 1e-4 s."""
    rec = run(
        RUBBING,
        duration=2.0,
        record="motor_speed@1 kHz",
        fidelity="low",
        scenario={"initial": {"motor_speed": 20.0}},
    )
    stop = INERTIA * 20.0 / 0.06
    time, speed = rec["motor_speed"].time, rec["motor_speed"].values
    early = time < stop - 1e-2
    assert speed[early] == pytest.approx(
        20.0 - 0.06 / INERTIA * time[early], abs=2e-4 * 0.06 / INERTIA + 1e-9
    )
    assert np.all(speed[time > stop + 1e-2] == 0.0)


def test_low_steady_torque_balances_the_load() -> None:
    """1.5 k i_q = load at constant speed."""
    rec = run(
        FREE_SHAFT | PWM,
        duration=4.0,
        mode="speed",
        command=[constant(30.0)],
        record="current_q,motor_torque@1 kHz",
        fidelity="low",
        scenario={"load": {"shaft": {"terms": [constant(2.0)]}}},
    )
    current, torque = (x[-100:].mean() for x in values(rec, "current_q", "motor_torque"))
    assert torque == pytest.approx(2.0, rel=1e-3)
    assert current == pytest.approx(2.0 / (1.5 * K), rel=1e-3)


@pytest.mark.parametrize("load", [0.0, 1.0])
def test_low_follows_high_under_the_pwm_drive(load: float) -> None:
    """One cycle of the campaign's sine, faster: position within 0.5 % of its amplitude RMS."""
    command = [term("sine", amplitude="7 deg", frequency="1 Hz")]
    scenario = {"load": {"brake": {"terms": [constant(load)]}}}
    runs = [
        run(
            LOW,
            duration=2.0,
            command=command,
            record="output_position@400 Hz",
            fidelity=fidelity,
            scenario=scenario,
        )
        for fidelity in ("high", "low")
    ]
    high, low = (rec["output_position"].values[400:] for rec in runs)
    assert np.sqrt(np.mean((high - low) ** 2)) < 0.005 * math.radians(7.0)


def test_low_short_raises_the_mean_current_as_high_does() -> None:
    """The same load with fewer turns takes more quadrature current in both models, within half to
    double.
    """

    def change(fidelity: str) -> float:
        means = []
        for faults in ([], [{"kind": "short", "place": "motor.phase_a", "severity": 0.2}]):
            rec = run(
                FREE_SHAFT | PWM,
                duration=1.5,
                mode="speed",
                command=[constant(40.0)],
                record="current_q@2 kHz",
                fidelity=fidelity,
                scenario={"load": {"shaft": {"terms": [constant(2.0)]}}, "fault": faults},
            )
            means.append(np.mean(rec["current_q"].values[rec["current_q"].time > 0.5]))
        return float(means[1] - means[0])

    high, low = change("high"), change("low")
    assert high > 0
    assert 0.5 * high < low < 2.0 * high


@pytest.mark.parametrize("speed", [10.0, 50.0])
def test_mean_error_of_the_relays_falls_with_the_voltage_needed(speed: float) -> None:
    """Far below the link's voltage a current coasts to its band's edge; nearer to it, less."""
    options = {"duration": 0.4, "mode": "speed", "command": [constant(f"{speed} rad/s")],
               "record": "current_ref,current_q@10 kHz",
               "scenario": {"initial": {"motor_speed": speed}}}  # fmt: skip
    errors = []
    for fidelity in ("high", "low"):
        record = options["record"] if fidelity == "high" else "current_ref,current_q@2 kHz"
        rec = run({}, **(options | {"record": record}), fidelity=fidelity)
        error = rec["current_ref"].values - rec["current_q"].values
        errors.append(float(np.mean(error[len(error) // 2 :])))
    assert errors[1] == pytest.approx(errors[0], abs=0.025)


def test_a_run_that_begins_at_its_set_point_has_no_jump() -> None:
    """The derivative's filter knows nothing before the first step: no kick, nothing cut off."""
    speeds = [
        run({}, duration=0.03, mode="speed", command=[constant("40 rad/s")],
            record="motor_speed@2 kHz", scenario={"initial": {"motor_speed": 40.0}},
            fidelity=fidelity)["motor_speed"].values
        for fidelity in ("high", "low")
    ]  # fmt: skip
    assert np.abs(speeds[1] - speeds[0]).max() < 0.3
