"""What was put into a bench comes out of its logs, and the intervals say how well."""

import math

import numpy as np
import pytest

from elevon import Actuator, Scenario
from elevon.calibrate import calibrate, read_logs
from elevon.calibrate.calibration import HeldOut
from elevon.errors import InputError
from elevon.simulate import simulate
from tests.calibrate.bench import CASES, COUNT, make_truth, write_logs

OFFSETS = ("sensor.current_offset", "sensor.speed_offset", "sensor.encoder.offset")


def test_every_parameter_is_recovered(result, truth):
    """Within 2 %, or as near as its own deviation says, which must itself be below 2 %."""
    for path, true in truth.values.items():
        item = result[path]
        assert abs(item.value - true) < max(0.02 * abs(true), 2.5 * item.std), path
        assert item.interval[0] < item.value < item.interval[1]
        assert item.std < 0.02 * abs(true), path


def test_backlash_is_found_within_a_count_and_2_percent(result, truth):
    true = truth.values["backlash.total"]
    assert abs(result["backlash.total"].value - true) < COUNT + 0.02 * true


def test_registers_stay_apart(result):
    registers = {item.path: item.register for item in result.estimates}
    assert registers["friction.dynamic"] == "plant"
    assert registers["control.speed_gain"] == "controller"
    assert all(registers[path] == "sensor" for path in OFFSETS)


def test_where_each_log_began_in_the_backlash_is_told_apart_from_the_sensors(result, truth):
    for name, recording in truth.recordings.items():
        motor, output = (
            float(recording[s].values[0]) for s in ("motor_position", "output_position")
        )
        item = result[f"initial.lead[{name}.csv]"]
        assert item.register == "initial"
        assert not item.in_set
        true = motor / truth.actuator.parameters.value("gear.ratio") - output
        assert item.interval[0] <= true <= item.interval[1]


def test_the_load_cell_separates_torque_constant_and_inertia(result):
    assert result.facts["torque_constant"]["from_load_cell"]
    assert result["motor.emf_constant"].given == ()
    assert result["motor.inertia"].given == ()


def test_without_a_load_cell_only_ratios_are_told(truth, tmp_path, before):
    logs = read_logs(write_logs(truth, tmp_path, cell=False))
    result = calibrate(logs, before, model_runs=False, hold_out=False)
    assert not result.facts["torque_constant"]["from_load_cell"]
    assert "motor.emf_constant" not in {item.path for item in result.estimates}
    ratio = truth.values["derived.inertia"] / truth.values["derived.torque_constant"]
    assert result["derived.inertia_per_torque"].value == pytest.approx(ratio, rel=0.02)
    assert result["motor.inertia"].given == ("motor.emf_constant",)
    assert any("ratio" in text for text in result.findings)
    scale = 1.5 * before.parameters.value("motor.emf_constant")
    dry = truth.values["friction.dynamic"] / truth.values["derived.torque_constant"]
    assert result["friction.dynamic"].value == pytest.approx(dry * scale, rel=0.02)
    with pytest.raises(InputError, match="without a load cell"):
        calibrate(logs, before, free=["motor.emf_constant"], model_runs=False)


def test_unchanged_values_and_old_ones_are_kept(result, before):
    assert result["friction.viscous"].old == before.parameters.value("friction.viscous")
    kept = "motor.winding_resistance"
    assert result.actuator.parameters[kept] == before.parameters[kept]
    fitted = result.actuator.parameters.value
    assert fitted("control.torque_constant") == pytest.approx(1.5 * fitted("motor.emf_constant"))
    assert fitted("friction.static") >= fitted("friction.dynamic")


def test_held_out_logs_are_predicted_as_well_as_fitted_ones(result):
    assert {row["log"] for row in result.facts["held_out"]} == {
        "noload.csv",
        "loaded.csv",
        "chirp.csv",
    }
    for row in map(HeldOut.from_dict, result.facts["held_out"]):
        assert row.current < 1.25 * row.current_all + 0.005
        assert row.speed < 1.25 * row.speed_all + 0.02


def test_a_single_log_holds_its_end_back(logs, before):
    result = calibrate(logs[:1], before, model_runs=False)
    assert [row["span"] for row in result.facts["held_out"]] == ["last quarter"]


def test_free_keeps_the_others(logs, before):
    result = calibrate(
        logs, before, free=["friction.dynamic", "backlash.total"], model_runs=False, hold_out=False
    )
    assert {i.path for i in result.estimates if i.in_set} == {"friction.dynamic", "backlash.total"}
    assert result.actuator.parameters["motor.inertia"] == before.parameters["motor.inertia"]


@pytest.mark.parametrize("where", ["encoder", "command"])
def test_an_amplitude_factor_is_found_and_named(truth, tmp_path, before, where):
    gain, noted = (1.015, 1.0) if where == "encoder" else (1.0, 1 / 1.03)
    paths = write_logs(truth, tmp_path, encoder_gain=gain, noted=noted, names=["noload"])
    result = calibrate(read_logs(paths), before, model_runs=False, hold_out=False)
    says = [text for text in result.findings if "amplitude factor" in text]
    if where == "encoder":
        assert result["sensor.encoder.gain"].value == pytest.approx(1.015, abs=1e-4)
        assert any("encoder gain" in text for text in says)
    else:
        assert result.facts["commands"][0]["amplitude_factor"] == pytest.approx(1.03, abs=1e-3)
        assert any("command is scaled" in text for text in says)


def test_another_speed_limit_is_seen(truth, tmp_path, before):
    narrow = before.with_values({"control.speed_limit": 30.0})
    logs = read_logs(write_logs(truth, tmp_path, names=["noload"]))
    found = calibrate(logs, narrow, model_runs=False, hold_out=False)
    assert found["control.speed_limit"].value == pytest.approx(500 * math.pi / 30, rel=1e-3)


def test_the_kind_of_drive_is_found(logs):
    result = calibrate(logs[:1], Actuator.load("torino-rotary"), hold_out=False)
    assert result.actuator.parameters["drive.kind"].value == "pwm"
    assert any("drive.kind" in text for text in result.findings)
    assert not result.parameters.keys() & result.undetermined.keys()
    assert all(result.undetermined.values())
    assert result.facts["identifiability"]["dropped"].keys() <= (
        result.parameters.keys() | result.undetermined.keys()
    )
    assert np.all(np.diff(result.facts["identifiability"]["singular_values"]) <= 0.0)


@pytest.mark.long
def test_twenty_benches_and_their_intervals():
    """Median error within 2 %, 90 % intervals covering 80 to 97 % pooled; 20 draws, 20 seeds."""
    import tempfile
    from pathlib import Path

    errors, hits = {}, []
    for seed in range(20):
        rng = np.random.default_rng(1000 + seed)
        truth = make_truth(_draw(rng), seed=seed, **_sensors(rng))
        with tempfile.TemporaryDirectory() as folder:
            data = read_logs(write_logs(truth, Path(folder), seed=seed))
        result = calibrate(data, Actuator.load("torino-rotary"), model_runs=False, hold_out=False)
        for path, true in truth.values.items():
            item = result[path]
            errors.setdefault(path, []).append(abs(item.value / true - 1))
            if not path.startswith("derived."):
                hits.append(item.interval[0] <= true <= item.interval[1])
    assert {path: np.median(e) for path, e in errors.items() if np.median(e) > 0.02} == {}
    assert 0.80 <= np.mean(hits) <= 0.97, np.mean(hits)


def _draw(rng):
    def u(low, high):
        return float(rng.uniform(low, high))

    k, dry = u(0.75, 1.05), u(0.15, 0.5)
    return {
        "motor.inertia": u(5e-4, 1.5e-3),
        "friction.dynamic": dry,
        "friction.static": dry * u(1.0, 1.4),
        "friction.viscous": u(2e-3, 8e-3),
        "backlash.total": f"{u(0.3, 1.5)} deg",
        "motor.emf_constant": k,
        "control.torque_constant": 1.5 * k,
        "pwm.emf_constant": k,
        "control.speed_gain": u(0.12, 0.25),
        "control.integral_time": u(0.15, 0.5),
        "control.derivative_time": u(0.004, 0.008),
    }


def _sensors(rng):
    return {
        "encoder": float(rng.uniform(-0.05, 0.05)),
        "motor": float(rng.uniform(-10, 10)),
        "current": float(rng.uniform(-0.08, 0.08)),
        "speed": float(rng.uniform(-0.2, 0.2)),
    }


@pytest.mark.long
def test_three_logs_take_less_than_a_minute(logs):
    fractions = []
    result = calibrate(
        logs, Actuator.load("torino-rotary"), progress=lambda f: fractions.append(f) or True
    )
    assert result.wall_s < 60.0
    assert fractions == sorted(fractions)
    assert fractions[-1] == 1.0
    assert len(fractions) > 10


@pytest.mark.long
def test_a_two_mass_bench_fitted_with_the_low_model(tmp_path, before):
    """Elastic backlash and PWM drive against the reduced-order model: absorbers are named.

    Nothing rubs on the output side of the two-mass model, so the output mass flies through the gap,
    which no backlash operator does: within the gap the reduced-order model cannot know where it is.
    """
    from elevon.calibrate import validate

    truth = make_truth(
        {"backlash.model": "elastic", "solver.method": "semi_implicit", "solver.step": 2.5e-6}
    )
    logs = read_logs(write_logs(truth, tmp_path))
    result = calibrate(logs, before, hold_out=False)
    assert any("moves within it on its own" in text for text in result.findings)
    assert "sensor.encoder.gain" not in {item.path for item in result.estimates}
    for path in ("friction.dynamic", "motor.emf_constant", "control.speed_gain", "backlash.total"):
        assert result[path].value == pytest.approx(truth.values[path], rel=0.05), path
    low, high = result["backlash.total"].interval
    assert low < truth.values["backlash.total"] < high
    checked = validate(logs, result.actuator)
    assert {error.signal for error in checked.errors} == {
        "encoder_position", "motor_speed", "current_q_meas",
    }  # fmt: skip
    for error in checked.errors:
        if error.signal == "encoder_position" and error.log != "chirp.csv":
            assert error.rms < 0.5 * truth.values["backlash.total"]
    absorbed = {row["path"] for row in result.facts["simulation_fit"]["absorbed"]}
    assert absorbed
    assert all(any(path in text for text in result.findings) for path in absorbed)


@pytest.mark.parametrize("case", ["noload", "chirp"])
def test_the_low_models_own_log_shows_filter_and_controller(tmp_path, case):
    """Current and motion are of one instant; the derivative sees the motion that relays make."""
    command, _ = CASES[case]
    document = {"duration": "10 s", "command": {"mode": "position", "terms": [command]}}
    base = Actuator.load("torino-rotary")
    record = "drive_log,motor_position,encoder_position@400 Hz"
    log = simulate(base, Scenario.from_dict(document), fidelity="low", record=record, seed=1)
    path = log.save(tmp_path / "own.parquet")
    result = calibrate(read_logs([path]), base, model_runs=False, hold_out=False)
    for name in ("sensor.filter_cutoff", "control.speed_gain"):
        true = base.parameters.value(name)
        assert result[name].value == pytest.approx(true, rel=0.02), name
