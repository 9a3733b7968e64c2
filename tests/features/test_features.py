"""Features while simulating equal those of the recording, and known motions give known features."""

import numpy as np
import pytest
from scipy.signal import welch

from elevon import InputError
from elevon.actuator import Actuator
from elevon.features import ROLES, feature_records, recording_features
from elevon.recording import Recording
from elevon.scenario import Scenario
from elevon.simulate import Run, simulate, simulate_batch

RATE = 2000.0


def _runs(name, amplitude, faults=(), frequency="4 Hz", duration="0.3 s"):
    actuator = Actuator.load(name)
    term = {"kind": "sine", "amplitude": amplitude, "frequency": frequency}
    data = {"duration": duration, "command": {"terms": [term]}}
    return [
        Run(actuator, Scenario.from_dict({**data, "fault": list(part)}, "test"), number=number)
        for number, part in enumerate(([], *([fault] for fault in faults)))
    ]


@pytest.mark.parametrize(
    ("name", "fidelity", "amplitude", "faults"),
    [
        (
            "torino-rotary",
            "high",
            "4 deg",
            ["short@motor.phase_a=0.2", "backlash@transmission=1 deg"],
        ),
        ("torino-rotary", "low", "4 deg", ["backlash@transmission=1 deg"]),
        ("nasa-ballscrew", "high", "0.5 mm", []),
    ],
)
def test_features_while_simulating_equal_those_of_the_recording_to_the_bit(
    name, fidelity, amplitude, faults
):
    runs = _runs(name, amplitude, faults)
    pole_pairs = runs[0].actuator.parameters.value("motor.pole_pairs")
    summed = simulate_batch(runs, fidelity=fidelity, record=(), features=f"all@{RATE} Hz")
    kept = simulate_batch(runs, fidelity=fidelity, record=f"all@{RATE} Hz")
    for streamed, recording in zip(summed, kept, strict=True):
        assert not streamed.names
        again = recording_features(recording, pole_pairs=pole_pairs)
        values = [float("nan") if v is None else v for v in streamed.meta["features"].values()]
        assert list(again.values) == list(streamed.meta["features"])
        assert np.array_equal(values, list(again.values.values()), equal_nan=True)
        assert again.units == streamed.meta["feature_units"]
        assert np.isfinite(values).mean() > 0.6


def test_lanes_threads_and_company_change_no_bit():
    runs = _runs(
        "torino-rotary", "4 deg", ["short@motor.phase_a=0.2", "backlash@transmission=1 deg"]
    )
    alone = [simulate_batch([run], record=(), features="all@400 Hz")[0] for run in runs]
    together = simulate_batch(runs, record="motor_speed@1 kHz", features="all@400 Hz")
    for one, other in zip(alone, together, strict=True):
        assert one.meta["features"] == other.meta["features"]


def test_a_fault_moves_its_feature():
    faults = ["short@motor.phase_a=0.2", "backlash@transmission=0.5 deg"]
    runs = _runs("torino-rotary", "7 deg", faults, "1 Hz", "1 s")
    healthy, short, backlash = [
        r.meta["features"] for r in simulate_batch(runs, record=(), features="all@2 kHz")
    ]
    extra = backlash["lost_motion"] - healthy["lost_motion"]
    assert extra == pytest.approx(np.deg2rad(0.5), rel=0.02)
    assert short["switching_rate"] > 1.15 * healthy["switching_rate"]


def _log(**columns):
    time = np.arange(len(next(iter(columns.values())))) / 1000.0
    units = {
        "motor_position": "rad",
        "motor_speed": "rad/s",
        "iq": "A",
        "encoder_position": "rad",
    }
    return Recording.build(time, columns, {name: units[name] for name in columns}, rate=1000.0)


def test_bands_are_welch_spectra():
    noise = np.random.default_rng(3).normal(2.0, 1.0, 5000)
    values = recording_features(_log(iq=noise), "bands", roles={"torque_current": "iq"}).values
    frequency, density = welch(noise, 1000.0, "hann", nperseg=256, detrend="constant")
    for low, high in [(5, 20), (20, 50), (50, 100), (100, 200), (200, 500)]:
        inside = (frequency >= low) & (frequency < high)
        expected = np.sqrt(density[inside].sum() * (frequency[1] - frequency[0]))
        assert values[f"torque_current_band_{low}_{high}"] == pytest.approx(expected, rel=1e-12)


def test_level_features_equal_their_definitions():
    x = np.random.default_rng(5).normal(1.0, 2.0, 3000)
    values = recording_features(_log(iq=x), "level", roles={"torque_current": "iq"}).values
    centred = x - x.mean()
    squares = (x[: len(x) // 13 * 13] ** 2).reshape(-1, 13).sum(axis=1)  # 12.5 rows a hop
    windows = np.sqrt(np.convolve(squares, np.ones(8), "valid") / 104)
    expected = {
        "mean": x.mean(),
        "rms": np.sqrt(np.mean(x**2)),
        "peak": np.abs(x).max(),
        "kurtosis": np.mean(centred**4) / np.mean(centred**2) ** 2,
        "moving_rms_max": windows.max(),
        "moving_rms_min": windows.min(),
    }
    for name, value in expected.items():
        assert values[f"torque_current_{name}"] == pytest.approx(value, rel=1e-12)


def test_every_role_and_feature_has_its_record():
    from elevon import _core

    assert [item["name"] for item in _core.feature_roles()] == list(ROLES)
    assert all(set(record.roles) <= set(ROLES) for record in feature_records().values())
    assert all(len(record.text) > 10 for record in feature_records().values())


@pytest.mark.parametrize(
    ("features", "message"),
    [
        ("torque_curent_rms@400 Hz", "torque_current_rms"),
        ("all", "FEATURES@RATE"),
        ("vibration_rms@400 Hz", "vibration: no signal"),
        ("torque_current_band_200_500@400 Hz", "at least 1000 Hz"),
        (["level@400 Hz", "torque_current_rms@1 kHz"], "asked for by"),
        ("all@333 Hz", "nearest"),
    ],
)
def test_what_cannot_be_is_refused(features, message):
    run = _runs("torino-rotary", "4 deg")[0]
    with pytest.raises(InputError, match=message):
        simulate(run.actuator, run.scenario, features=features)


def test_a_log_with_gaps_or_missing_samples_is_refused():
    with pytest.raises(InputError, match="sample 7"):
        recording_features(
            _log(iq=np.where(np.arange(500) == 7, np.nan, 1.0)),
            "level",
            roles={"torque_current": "iq"},
        )
    time = np.concatenate([np.arange(500), np.arange(600, 900)]) / 1000.0
    log = Recording.build(time, {"motor_speed": time}, {"motor_speed": "rad/s"}, rate=1000.0)
    with pytest.raises(InputError, match="missing"):
        recording_features(log)


def test_the_command_line_lists_them_and_computes_them(elevon_cli, tmp_path):
    listed = elevon_cli("list", "features", "--json").json["features"]
    assert [row["name"] for row in listed] == list(feature_records())
    expected = elevon_cli("list", "features", "nasa-ballscrew", "--json").json["features"]
    assert next(row["unit"] for row in expected if row["name"] == "lost_motion") == "m"
    run = _runs("torino-rotary", "4 deg")[0]
    recording = simulate(run.actuator, run.scenario, record="drive_log@1 kHz", features="all@1 kHz")
    recording.save(tmp_path / "log.parquet")
    found = elevon_cli("features", tmp_path / "log.parquet", "--pole-pairs", 4, "--json").json
    assert found["signals"]["motor_speed"] == "motor_speed"
    rms = next(row["value"] for row in found["features"] if row["name"] == "torque_current_rms")
    assert rms == recording.meta["features"]["torque_current_rms"]
    wrong = elevon_cli("features", tmp_path / "log.parquet", "--features", "lostmotion")
    assert wrong.code == 2
    assert "lost_motion" in wrong.err
