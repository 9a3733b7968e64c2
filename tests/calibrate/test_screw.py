"""Ballscrew: what was put in comes out of the stand's logs, the rest with a reason."""

from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator
from elevon.bench.procedure import Procedure
from elevon.calibrate.stages import calibrate_parts, motor_ratio
from elevon.calibrate.stages.context import Context, smooth
from elevon.calibrate.stages.loops import loops_by_current
from elevon.calibrate.stages.screw import relieved
from elevon.logs.log import Log
from tests.calibrate.screw_bench import drawn, make_logs, missed

FIRST = 201  # none of these was looked at while the balances were written
SINE = {"kind": "sine", "amplitude": "50 mm", "frequency": "0.3 Hz"}
TWO = Procedure.model_validate(
    {
        "name": "two",
        "text": "a sine against a spring and one without load",
        "stand": "load-actuator",
        "step": [
            {"kind": "trace", "name": "free", "duration": "7 s", "command": {"terms": [SINE]}},
            {"kind": "force", "stiffness": "90 N/mm"},
            {"kind": "trace", "name": "spring", "duration": "10 s", "command": {"terms": [SINE]}},
        ],
    }
)


@pytest.fixture(scope="module")
def one():
    """Truth, logs and calibration of one draw: switching model, two short logs."""
    values, model = drawn(5)
    logs = make_logs(model, [TWO], seed=5, fidelity="high")
    return values, logs, calibrate_parts(logs, Actuator.load("nasa-ballscrew"))


def test_what_the_logs_determine_is_recovered(one):
    values, _, result = one
    for path in ("motor.emf_constant", "motor.inertia", "screw.efficiency", "friction.dynamic",
                 "screw.efficiency_aiding", "screw.preload", "control.position_gain",
                 "control.speed_gain", "control.integral_time", "load.damping"):  # fmt: skip
        item, true = result[path], values[path]
        share = 0.05 if path.startswith("friction.") else 0.02
        assert abs(item.value - true) < max(share * true, 2.5 * item.std), path
    covered = [e.interval[0] <= values[e.path] <= e.interval[1]
               for e in result.estimates if e.path in values]  # fmt: skip
    assert np.mean(covered) > 0.7


def test_what_no_log_shows_is_listed_with_its_reason(one):
    _, _, result = one
    assert "temperature" in result.undetermined["thermal.housing_capacity"]
    assert "nut" in result.undetermined["screw.nut_capacity"]
    assert not set(result.undetermined) & {e.path for e in result.estimates}


def test_without_the_voltage_torques_are_ratios(one):
    values, logs, _ = one
    blind = [
        replace(log, channels={r: v for r, v in log.channels.items() if "voltage" not in r})
        for log in logs
    ]
    before = Actuator.load("nasa-ballscrew")
    result = calibrate_parts(blind, before)
    assert "motor.emf_constant" in result.undetermined
    assert "motor.emf_constant" in result["motor.inertia"].given
    scale = before.parameters.value("motor.emf_constant") / values["motor.emf_constant"]
    ratio = result["friction.dynamic"].value / values["friction.dynamic"]
    assert ratio == pytest.approx(scale, rel=0.3)


def test_without_set_points_the_current_gives_the_speed_gain():
    """A cascade written down: the gain comes out, its two roots change places, so they do not."""
    actuator = Actuator.load("nasa-ballscrew")
    value, ratio = actuator.parameters.value, motor_ratio(actuator)
    step, gain, k, rate = 2e-3, 1.7, 33.0, 28.0
    time = np.arange(8000) * step
    command = sum(1e-2 / n * np.sin(0.9 * n * time + n**2) for n in range(1, 9))
    error = 1e-2 * sum(np.cos(0.7 * n * time + n) for n in range(1, 30))
    fine = 0.25e-3
    total = np.cumsum(error) * step - 0.5 * (step - fine) * error
    torque = gain * (np.gradient(error, step) + (k + rate) * error + k * rate * total)
    roles = {
        "command": command,
        "motor_position": ratio * command - error,
        "motor_speed": np.gradient(ratio * command - error, step),
        "torque_current": torque / value("control.torque_constant"),
    }
    context = Context([Log("pid", time, roles)], actuator)
    loops_by_current(context)
    levels, reasons = context.levels, context.reasons
    assert levels["control.speed_gain"].value == pytest.approx(gain, rel=0.02)
    for path in ("control.position_gain", "control.integral_time"):
        assert path in levels or "change places" in reasons[path]


def test_the_relieved_half_is_the_law_of_hertz():
    u = np.linspace(0.0, 1.0, 50)
    bearing, free = (1.0 + u) ** 1.5, (1.0 - u) ** 1.5
    assert np.max(np.abs(relieved(437.5 * (bearing - free), 437.5) - free)) < 5e-5


def test_slopes_are_smoothed_as_the_values_are():
    """A trapezoid's corners, smoothed: the slope of the smoothed value is the smoothed slope."""
    time = np.arange(2000) * 2e-3
    ramp = np.abs((time / 0.8) % 2.0 - 1.0)
    log = Log("trapezoid", time, {"motor_speed": ramp})
    smoothed = smooth(log)
    slope = np.gradient(smoothed["motor_speed"], 2e-3)
    inner = slice(50, -50)
    assert np.max(np.abs(smoothed["acceleration"] - slope)[inner]) < 0.02 * np.ptp(slope)


def test_a_number_is_shown_by_its_share_or_by_a_small_deviation_that_holds():
    """Each of the three ways to miss is seen: too far, an empty deviation, a wide one."""
    stated = np.full(5, 0.06)
    errors = np.array([-0.068, 0.006, -0.072, 0.05, 0.063])
    assert missed("thermal.winding_mass", 0.2 * errors, 0.001 * stated) == ""
    assert missed("thermal.winding_mass", errors, stated) == ""
    assert missed("friction.dynamic", 0.7 * errors, 0.001 * stated) == ""
    assert "0.063" in missed("thermal.winding_mass", errors, 0.5 * stated)
    assert "0.120" in missed("thermal.winding_mass", errors, 2.0 * stated)


@pytest.mark.long
@pytest.mark.parametrize(("name", "draws"), [("nasa-ballscrew", 20), ("nasa-dema", 5)])
def test_truth_recovery_over_draws(name, draws):
    """Profiles by the switching model, 70 minutes of heating by the reduced-order one."""
    before = Actuator.load(name)
    errors, deviations, covered = {}, {}, []
    for seed in range(FIRST, FIRST + draws):
        values, truth = drawn(seed, name)
        logs = make_logs(truth, ["ballscrew-profiles"], seed=seed, fidelity="high")
        logs += make_logs(truth, ["ballscrew-heating"], seed=seed, fidelity="low")
        for item in calibrate_parts(logs, before).estimates:
            if item.path in values:
                true = values[item.path]
                errors.setdefault(item.path, []).append(item.value / true - 1.0)
                deviations.setdefault(item.path, []).append(item.std / abs(true))
                covered.append(item.interval[0] <= true <= item.interval[1])
    assert len(errors) > 18
    found = [missed(path, sizes, deviations[path]) for path, sizes in errors.items()]
    assert [text for text in found if text] == []
    # A few draws bound the coverage from below only.
    assert 0.80 <= np.mean(covered) <= (0.97 if draws >= 20 else 1.0)
