"""The command rebuilt from a log, against a truth that the reconstruction does not see."""

import math

import numpy as np
import pytest

from elevon.errors import InputError, UnknownNameError
from elevon.estimate.covariance import robust_covariance
from elevon.logs.command.fit import FREE, best_waveform, fit_waveform
from elevon.logs.command.reconstruct import CommandTrace, reconstruct
from elevon.logs.formats.drive import write_drive_csv
from elevon.logs.importing import import_log
from elevon.waveforms import evaluate, wave_records
from tests.logs.conftest import GAIN, servo_log

DEG = math.pi / 180


def reconstruct_from(recording):
    """Return the command of an imported log."""
    speed, output = recording["speed_ref"], recording["encoder_position"]
    return reconstruct(speed.time, speed.values, output.values)


def coloured(rng, n, rho, std):
    from scipy.signal import lfilter

    white = rng.normal(0.0, std * math.sqrt(1 - rho**2), n + 2000)
    return lfilter([1.0], [1.0, -rho], white)[2000:]


def trace_of(kind, values, *, noise=0.01 * DEG, rho=0.9, seed=1, seconds=20.0):
    t = np.arange(0.0, seconds, 1 / 400)
    y = evaluate(kind, values, t) + coloured(np.random.default_rng(seed), len(t), rho, noise)
    return CommandTrace(t, y, np.ones(len(t), dtype=bool))


@pytest.mark.parametrize("seed", range(4))
def test_a_sine_is_recovered_from_a_noisy_log_of_20_s(tmp_path, seed):
    """Issue's figures: phase within 0.05 deg, frequency within 1e-5 Hz."""
    truth = servo_log(seed=seed, zero=0.001 * seed, phase=0.3 + seed)
    log = import_log(write_drive_csv(tmp_path / "log.csv", truth.signals))
    fit = fit_waveform(reconstruct_from(log.recording))
    assert fit.converged
    wrong = math.remainder(fit.values["phase"] - truth.phase, 2 * math.pi)
    assert abs(wrong) < 0.05 * DEG
    assert abs(fit.values["frequency"] - truth.frequency) < 1e-5
    assert fit.values["amplitude"] == pytest.approx(truth.amplitude, rel=1e-3)
    assert fit.values["bias"] == pytest.approx(truth.bias, abs=0.01 * DEG)
    assert abs(wrong) < 3 * fit.std["phase"]
    assert fit.std["phase"] < 0.1 * DEG
    assert abs(fit.values["frequency"] - truth.frequency) < 6 * fit.std["frequency"] + 1e-7


@pytest.mark.parametrize("fidelity", ["low", "high"])
def test_a_sine_is_recovered_from_a_simulated_log(tmp_path, fidelity):
    pytest.importorskip("elevon._core")
    import elevon

    sine = {
        "kind": "sine", "amplitude": "7 deg", "bias": "10 deg", "frequency": "0.2 Hz",
        "phase": "20 deg",
    }  # fmt: skip
    scenario = elevon.Scenario.from_dict(
        {"duration": "20 s", "command": {"mode": "position", "terms": [sine]}}
    )
    record = "encoder_position,resolver_position,resolver_speed,speed_ref,current_q_meas@400 Hz"
    actuator = elevon.Actuator.load("torino-rotary")
    run = elevon.simulate(actuator, scenario, fidelity=fidelity, record=record, seed=3)
    signals = {"time": run.clock().time, **{c.name: c.values for c in run.channels}}
    log = import_log(write_drive_csv(tmp_path / "log.csv", signals))
    fit = fit_waveform(reconstruct_from(log.recording))
    assert abs(fit.values["phase"] - 20 * DEG) < 0.05 * DEG
    assert abs(fit.values["frequency"] - 0.2) < 1e-5
    assert fit.values["amplitude"] == pytest.approx(7 * DEG, rel=1e-3)
    assert fit.values["bias"] == pytest.approx(10 * DEG, abs=0.01 * DEG)
    assert fit.outliers <= 2  # the first row, taken before the first set point


def test_a_command_that_starts_late_is_found(tmp_path):
    t = np.arange(0.0, 20.0, 1 / 400)
    values = {"amplitude": 7 * DEG, "frequency": 0.2, "phase": 0.4, "bias": 10 * DEG}
    y = np.where(t < 6.3, 2 * DEG, evaluate("sine", values, t))
    y = y + np.random.default_rng(5).normal(0, 0.01 * DEG, len(t))
    fit = fit_waveform(CommandTrace(t, y, np.ones(len(t), dtype=bool)))
    assert fit.window[0] == pytest.approx(6.3, abs=0.02)
    assert fit.values["phase"] == pytest.approx(0.4, abs=0.05 * DEG + 4 * fit.std["phase"])
    assert fit.values["frequency"] == pytest.approx(0.2, abs=5 * fit.std["frequency"])


def test_saturation_is_left_out():
    truth = servo_log(seconds=12, amplitude=45 * DEG, bias=60 * DEG, frequency=0.1)
    s = truth.signals
    trace = reconstruct(s["time"], s["speed_ref"], s["encoder_position"])
    assert 0.1 < trace.coverage < 0.95
    true = truth.bias + truth.amplitude * np.sin(2 * math.pi * 0.1 * s["time"] + truth.phase)
    off = np.abs(trace.position - true)
    assert np.percentile(off[trace.valid], 99) < 0.05 * DEG
    assert off[~trace.valid].max() > 1 * DEG
    assert np.all(np.abs(s["speed_ref"][trace.valid]) < 500 * math.pi / 30)


def test_the_gain_turns_speed_into_position():
    trace = reconstruct([0.0, 1.0], [GAIN * 1e-3, 0.0], [0.5, 0.5])
    np.testing.assert_allclose(trace.position, [0.501, 0.5])


CASES = {
    "sine": {"amplitude": 7 * DEG, "frequency": 0.2, "phase": 0.7, "bias": 10 * DEG},
    "triangle": {"amplitude": 7 * DEG, "frequency": 0.23, "phase": -2.0, "bias": 10 * DEG},
    "trapezoid": {
        "low": DEG, "high": 9 * DEG, "rise": 1.0, "hold_high": 2.0, "fall": 1.5, "hold_low": 1.0,
        "start": 0.7,
    },
    "chirp": {
        "amplitude": 3 * DEG, "start_frequency": 0.1, "end_frequency": 5.0, "sweep_time": 20.0,
        "phase": 0.3, "bias": 2 * DEG,
    },
    "ramp": {"initial": 2 * DEG, "slope": 3 * DEG, "start": 4.0, "end": 12.0},
    "step": {"initial": DEG, "final": 6 * DEG, "time": 5.001},
}  # fmt: skip


@pytest.mark.parametrize("kind", CASES)
def test_every_waveform_is_fitted_within_its_own_uncertainty(kind):
    fixed = {"sweep_time": 20.0, "start": 0.0} if kind == "chirp" else None
    fit = fit_waveform(trace_of(kind, CASES[kind]), kind, fixed=fixed)
    assert fit.rms == pytest.approx(0.01 * DEG, rel=0.15)
    for name, std in fit.std.items():
        assert 0 < std < math.inf
        assert abs(fit.values[name] - CASES[kind][name]) < 5 * std, name


@pytest.mark.long
@pytest.mark.parametrize("kind", CASES)
def test_the_kind_of_waveform_is_recognised(kind):
    assert best_waveform(trace_of(kind, CASES[kind])).kind == kind


def test_known_parameters_stay():
    fit = fit_waveform(trace_of("sine", CASES["sine"]), fixed={"amplitude": 7.1 * DEG})
    assert fit.values["amplitude"] == 7.1 * DEG
    assert "amplitude" not in fit.std


@pytest.mark.parametrize("rho", [0.0, 0.9, 0.97])
def test_intervals_cover_under_coloured_residuals(rho):
    """The 90 % interval of every parameter of a sine, over 200 logs, linearised at the truth."""
    rng = np.random.default_rng(11)
    t = np.arange(0.0, 20.0, 1 / 100)
    a = 2 * math.pi * 0.2 * t
    jacobian = np.column_stack((np.sin(a), np.cos(a), t * np.cos(a), np.ones_like(t)))
    solver = np.linalg.pinv(jacobian)
    hits = white = 0
    for _ in range(200):
        noise = coloured(rng, len(t), rho, 1.0)
        wrong = solver @ noise
        residual = noise - jacobian @ wrong
        std = np.sqrt(np.diag(robust_covariance(jacobian, residual)))
        hits += int(np.sum(np.abs(wrong) < 1.645 * std))
        textbook = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)) * residual.var())
        white += int(np.sum(np.abs(wrong) < 1.645 * textbook))
    assert 0.84 <= hits / 800 <= 0.95
    if rho > 0.5:
        assert white / 800 < 0.6  # what the textbook covariance would have claimed


def test_refusals():
    short = CommandTrace(np.arange(10.0), np.zeros(10), np.ones(10, dtype=bool))
    with pytest.raises(InputError, match="20 are needed"):
        fit_waveform(short)
    with pytest.raises(UnknownNameError, match="sine"):
        fit_waveform(short, "sin")
    with pytest.raises(UnknownNameError, match="amplitude"):
        fit_waveform(short, fixed={"amplitud": 1.0})
    with pytest.raises(InputError, match="shapes"):
        reconstruct([0.0], [0.0, 1.0], [0.0])
    with pytest.raises(InputError, match="above 0"):
        reconstruct([0.0], [0.0], [0.0], gain=0.0)


def test_every_fitted_waveform_is_the_cores():
    for kind, names in FREE.items():
        assert set(names) <= set(wave_records()[kind].names)
