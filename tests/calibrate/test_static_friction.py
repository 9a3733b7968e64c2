"""Static friction on benches outside the project: creeping on bristles, noisy and fast logs."""

import numpy as np
import pytest

from elevon import Actuator
from elevon.calibrate import calibrate, read_logs
from elevon.calibrate.balance import torque_balance
from elevon.calibrate.plant import static_estimate, torque_scale
from elevon.calibrate.static import static_friction
from tests.calibrate import foreign
from tests.calibrate.foreign import CHIRP, NOLOAD, draw, draw_creeping
from tests.calibrate.foreign_files import Style, write_campaign

BASE = Actuator.load("torino-rotary")


def estimate(paths, constant=None):
    """Return the static friction that logs show; the torque constant as given or as measured."""
    logs = read_logs(paths)
    used = [log.counting(log.time >= 1.0) for log in logs]
    plant = torque_balance(used)
    scale = torque_scale(BASE, plant)
    static = static_friction(used, plant, constant or scale.constant)
    return static_estimate(BASE, static, None, scale)[0]


def test_a_shaft_on_bristles_shows_its_static_friction(tmp_path):
    """It never stands still while its torque turns: there is no instant at which it breaks away."""
    bench, sensors = draw_creeping(302)
    trials = {"noload": NOLOAD, "chirp": CHIRP}
    paths, true = write_campaign(tmp_path, bench, sensors, trials=trials, seed=302)
    static = estimate(paths, bench.torque_constant)
    assert static.interval[0] <= true["friction.static"] <= static.interval[1]
    assert static.value == pytest.approx(true["friction.static"], rel=0.05)
    assert "bristles" in static.note


@pytest.mark.parametrize("missing", [(), ("current_ref",)])
def test_a_fast_log_full_of_noise_raises_no_friction(tmp_path, monkeypatch, missing):
    """Unfiltered, 1 kHz, 0.2 A of noise; the current's own noise must not choose the instants."""
    monkeypatch.setattr(foreign, "LOG", 1e-3)
    bench, sensors = draw(1, {}, {"cutoff": 5000.0, "current_noise": 0.2})
    trials = {"noload": NOLOAD}
    paths, true = write_campaign(tmp_path, bench, sensors, Style(missing=missing), trials, seed=1)
    static = estimate(paths, bench.torque_constant)
    assert static.interval[0] <= true["friction.static"] <= static.interval[1]


@pytest.mark.long
def test_twenty_five_creeping_benches(tmp_path):
    """LuGre, friction that grows with the load, elastic backlash: medians within 2 %, static
    friction in its interval on at least 80 %."""
    errors, hits = {}, []
    for seed in range(300, 325):
        bench, sensors = draw_creeping(seed)
        paths, true = write_campaign(tmp_path / str(seed), bench, sensors, seed=seed)
        result = calibrate(read_logs(paths), BASE, model_runs=False, hold_out=False)
        estimates = {item.path: item for item in result.estimates}
        for path in ("motor.emf_constant", "derived.inertia", "friction.dynamic",
                     "friction.viscous", "control.speed_gain", "control.integral_time",
                     "control.position_gain"):  # fmt: skip
            errors.setdefault(path, []).append(abs(estimates[path].value / true[path] - 1.0))
        if "friction.static" in estimates:
            low, high = estimates["friction.static"].interval
            hits.append(low <= true["friction.static"] <= high)
    assert {path: np.median(e) for path, e in errors.items() if np.median(e) > 0.02} == {}
    assert len(hits) >= 20
    assert np.mean(hits) >= 0.80
