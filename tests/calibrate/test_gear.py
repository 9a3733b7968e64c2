"""Landing gear: what was put in comes out of its logs, and the rest is reported with a reason."""

from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator
from elevon.bench.procedure import load_procedure
from elevon.calibrate.stages import calibrate_parts
from elevon.calibrate.stages.rig import moves_of
from elevon.errors import InputError
from tests.calibrate.gear_bench import chosen, drawn, make_logs

RIG = ("ff-extension-2", "ff-retraction-2", "ff-extension-10", "ff-retraction-10",
       "ffm-extension-2", "ffm-retraction-2", "ffm-extension-10", "ffm-retraction-10",
       "brake-extension-2")  # fmt: skip
FIRST, DRAWS, HIGH = 201, 20, 10  # none of these was looked at while the balances were written
ROLES = {"torque_current", "motor_speed", "output_position", "load", "command"}


@pytest.fixture(scope="module")
def one():
    """Truth and calibration of one draw: half the rig's tests and one retraction."""
    values, model = drawn(3)
    procedures = [chosen("gear-friction", RIG), chosen("gear-cycles", ["retraction-normal"])]
    logs = make_logs(model, procedures, seed=3)
    return values, logs, calibrate_parts(logs, Actuator.load("pisa-landing-gear"))


def test_what_the_logs_determine_is_recovered(one):
    values, _, result = one
    errors = {e.path: abs(e.value / values[e.path] - 1.0) for e in result.estimates}
    for path in ("motor.emf_constant", "motor.inertia", "brake.torque", "screw.moving_mass",
                 "control.gain_retraction", "control.zero_retraction",):  # fmt: skip
        assert errors[path] < max(0.02, 2.5 * result[path].std / values[path]), path
    for kind in ("ff", "ffm"):
        for direction in ("extension", "retraction"):
            for k in (2, 4):
                assert errors[f"friction.{kind}_{direction}_{k}"] < 0.05
    covered = [e.interval[0] <= values[e.path] <= e.interval[1] for e in result.estimates]
    assert np.mean(covered) > 0.75


def test_the_model_that_corrects_is_the_one_the_logs_bear(one):
    """Logs of means lack the ripple of commutations: their runs are of the reduced-order model."""
    _, logs, result = one
    assert result.facts["fidelity"] == "low"
    assert result.facts["ripple_share"] < 0.2
    with pytest.raises(InputError, match="medium"):
        calibrate_parts(logs, Actuator.load("pisa-landing-gear"), fidelity="medium")


@pytest.mark.long
@pytest.mark.parametrize("seed", [FIRST, FIRST + 1])
def test_logs_that_switch_are_calibrated_by_the_switching_model(seed):
    """The bench's own default: intervals that hold, and a resistance within them."""
    values, truth = drawn(seed)
    logs = make_logs(truth, [load_procedure("gear-cycles")], seed=seed, fidelity="high")
    result = calibrate_parts(logs, Actuator.load("pisa-landing-gear"))
    assert result.facts["fidelity"] == "high"
    assert result.facts["ripple_share"] > 0.8
    covered = [
        e.interval[0] <= values[e.path] <= e.interval[1]
        for e in result.estimates
        if e.path in values
    ]
    assert len(covered) >= 17
    assert np.mean(covered) >= 0.8
    path = "motor.winding_resistance"
    assert abs(result[path].value / values[path] - 1.0) < 0.02


def test_what_no_log_shows_is_listed_with_its_reason(one):
    _, _, result = one
    assert "no log of a motion in extension" in result.undetermined["control.gain_extension"]
    assert "20 mm/s" in result.undetermined["friction.ff_extension_5"]
    assert not set(result.undetermined) & {e.path for e in result.estimates}
    old = Actuator.load("pisa-landing-gear").parameters
    assert result.actuator.parameters["lock.stiffness"] == old["lock.stiffness"]


def test_free_takes_some_and_refuses_what_is_not_there(one):
    _, logs, _ = one
    model = Actuator.load("pisa-landing-gear")
    result = calibrate_parts(logs, model, free=["brake.torque"], fidelity=None)
    assert [e.path for e in result.estimates] == ["brake.torque"]
    with pytest.raises(InputError, match="nothing broke"):
        calibrate_parts(logs, model, free=["lock.strength"], fidelity=None)


def test_runs_of_the_motions_take_off_what_the_balances_misread(one):
    values, logs, result = one
    plain = calibrate_parts(logs, Actuator.load("pisa-landing-gear"), fidelity=None)
    assert plain.facts["motions_run_again"] == 0 < result.facts["motions_run_again"]
    for path in ("motor.winding_resistance", "motor.winding_inductance"):
        before, after = (abs(r[path].value / values[path] - 1.0) for r in (plain, result))
        assert after < max(before, 0.005), path


def few(logs, truth):
    """Retractions with position, speed, current, load and command only, and the set they need."""
    given = [
        p for p in truth if p.startswith(("control.acc", "control.speed", "motor.w", "motor.e"))
    ]
    model = Actuator.load("pisa-landing-gear").with_values({p: truth[p] for p in given})
    bare = [
        replace(log, channels={role: v for role, v in log.channels.items() if role in ROLES})
        for log in logs
        if "retraction" in log.name and moves_of(log)
    ]
    return bare, model


def test_position_speed_and_current_give_the_integral_gain(one):
    values, logs, _ = one
    bare, model = few(logs, values)
    result = calibrate_parts(bare, model, fidelity=None)
    gain, zero = "control.gain_retraction", "control.zero_retraction"
    product = result[gain].value * model.parameters.value(zero) / (values[gain] * values[zero])
    assert abs(product - 1.0) < max(0.02, 2.5 * result[gain].std / result[gain].value)
    assert zero in result[gain].given
    assert "product" in result.undetermined[zero]


@pytest.mark.long
def test_few_channels_over_draws():
    """The product of gain and zero, and the inertia, from position, speed, current and load."""
    products, inertias, covered = [], [], []
    for seed in range(FIRST, FIRST + 10):
        values, truth = drawn(seed)
        logs = make_logs(truth, [load_procedure("gear-cycles")], seed=seed)
        bare, model = few(logs, values)
        result = calibrate_parts(bare, model)
        item = result["control.gain_retraction"]
        zero = "control.zero_retraction"
        scale = model.parameters.value(zero) / values[zero]
        products.append(scale * item.value / values[item.path] - 1.0)
        covered.append(abs(products[-1]) < 1.645 * item.std / item.value)
        inertias.append(result["motor.inertia"].value / values["motor.inertia"] - 1.0)
    assert np.median(np.abs(products)) < 0.02
    assert np.median(np.abs(inertias)) < 0.02
    assert np.mean(covered) >= 0.8


@pytest.mark.long
@pytest.mark.parametrize(("fidelity", "draws"), [("low", DRAWS), ("high", HIGH)])
def test_truth_recovery_over_draws(fidelity, draws):
    """Motions at either fidelity, as the runs that correct; the rig at low (no current flows)."""
    model = Actuator.load("pisa-landing-gear")
    errors, covered = {}, []
    for seed in range(FIRST, FIRST + draws):
        values, truth = drawn(seed)
        logs = make_logs(truth, [load_procedure("gear-friction")], seed=seed)
        logs += make_logs(truth, [load_procedure("gear-cycles")], seed=seed, fidelity=fidelity)
        for item in calibrate_parts(logs, model, fidelity=fidelity).estimates:
            if item.path in values:
                true = values[item.path]
                errors.setdefault(item.path, []).append(abs(item.value / true - 1.0))
                covered.append(item.interval[0] <= true <= item.interval[1])
    often = {path: sizes for path, sizes in errors.items() if len(sizes) > draws / 2}
    assert len(often) > 40
    for path, sizes in often.items():
        assert np.median(sizes) < (0.05 if path.startswith("friction.") else 0.02), path
    assert 0.80 <= np.mean(covered) <= 0.97
