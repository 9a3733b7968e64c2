"""Clock offset and drift on the bench's own logs, against the truth that the bench keeps."""

import json
import math

import numpy as np
import pytest

from elevon import Actuator
from elevon.bench.procedure import Procedure, load_procedure
from elevon.bench.run import run_procedure
from elevon.documents import Document, validated
from elevon.errors import InputError
from elevon.logs.clocks import loadcell_join
from elevon.logs.clocks.clock_fit import RESONATOR_STD, RESONATOR_TOLERANCE
from elevon.logs.clocks.sync import align_clocks, find_trigger
from elevon.logs.importing import import_log

MODULE = loadcell_join.__name__


@pytest.fixture(scope="module")
def actuator():
    return Actuator.load("torino-rotary")


def procedure(name, *steps):
    data = {"name": name, "step": list(steps)}
    return validated(Procedure, data, Document("procedure", "", {}))


def trace(name, duration, *terms, mode="position"):
    command = {"mode": mode, "terms": list(terms)}
    return {"kind": "trace", "name": name, "duration": duration, "command": command}


def stall():
    steps = [{"kind": "step", "final": "1 N m", "time": f"{t} s"} for t in (2, 3, 4)]
    brake = {"kind": "brake", "terms": [{"kind": "constant", "value": "5.5 N m"}]}
    return procedure("stall", brake, trace("stall", "6 s", *steps, mode="torque"))


def weights():
    drops = [
        {"mass": f"{mass} kg", "at": f"{at} s", "until": f"{at + 0.5} s"}
        for mass, at in ((2, 1.0), (3, 2.5), (4, 4.0), (5, 5.5))
    ]
    return procedure(
        "weights",
        {"kind": "settings", "parameters": {"backlash.model": "elastic"}},
        {"kind": "weights", "drops": drops},
        trace("weights", "8 s", {"kind": "constant", "value": "10 deg"}),
    )


def sines():
    """The demonstration's loaded logs."""
    ramp = {"kind": "ramp", "initial": "0.2 N m", "slope": "0.09 N m/s", "end": "20 s"}
    slow = {"kind": "sine", "amplitude": "45 deg", "bias": "60 deg", "frequency": "0.05 Hz"}
    fast = {"kind": "sine", "amplitude": "12 deg", "bias": "20 deg", "frequency": "0.15 Hz"}
    return procedure(
        "sines",
        {"kind": "brake", "terms": [ramp]},
        trace("loaded", "20 s", slow),
        {"kind": "brake", "terms": [{"kind": "constant", "value": "0.8 N m"}]},
        trace("held", "20 s", fast),
    )


def logs(folder, actuator, plan, seed):
    """Run a procedure and return each log's name, report and truth."""
    run_procedure(plan, actuator, folder, seed=seed, truth=folder / "truth.json")
    return imported(folder)


def imported(folder):
    for entry in json.loads((folder / "truth.json").read_text())["logs"]:
        report = import_log(folder / f"{entry['name']}.csv").report
        json.dumps(report.to_dict(), allow_nan=False)
        yield entry["name"], report, entry["conditions"]


def scores(sync, true):
    """Errors over deviations, of offset and drift."""
    return (
        (sync["offset_s"] - true["trigger"]) / sync["offset_std_s"],
        (sync["drift"] - true["cell"]["clock_drift"]) / (sync["drift_std"] or math.inf),
    )


def test_a_stalled_shaft_gives_finite_deviations(tmp_path, actuator):
    """The current has one sign: it and its size are one signal, the speed and the backlash none."""
    ((_, report, true),) = logs(tmp_path, actuator, stall(), 1)
    sync = report.synchronisation
    assert sync["method"] == "trigger and correlation"
    assert 0.0 < sync["offset_std_s"] < 1e-3
    assert abs(scores(sync, true)[0]) < 2.0
    assert abs(scores(sync, true)[1]) < 3.0


def test_hung_weights_are_seen_in_what_they_wind_up(tmp_path, actuator):
    """Torque current and speed explain little of them, and that little is late: not a drift."""
    ((_, report, true),) = logs(tmp_path, actuator, weights(), 1)
    sync = report.synchronisation
    assert sync["explained"] > 0.9
    assert abs(scores(sync, true)[0]) < 2.0
    assert abs(scores(sync, true)[1]) < 3.0
    assert abs(sync["drift"] - true["cell"]["clock_drift"]) < 2e-3


def test_a_drift_that_one_event_cannot_tell_is_not_applied(tmp_path, actuator, monkeypatch):
    brake = {"kind": "brake", "terms": [{"kind": "constant", "value": "5.5 N m"}]}
    step = {"kind": "step", "final": "2 N m", "time": "2 s"}
    plan = procedure("once", brake, trace("once", "5 s", step, mode="torque"))
    for trigger in (True, False):
        if not trigger:
            monkeypatch.setattr(f"{MODULE}.find_trigger", lambda *_: None)
        ((_, report, true),) = logs(tmp_path / str(trigger), actuator, plan, 3)
        sync = report.synchronisation
        assert sync["drift"] == 0.0
        assert sync["drift_std"] == pytest.approx(RESONATOR_STD)
        assert report.has("drift-unknown")
        assert abs(scores(sync, true)[0]) < 2.0
        # Without a trigger the unknown drift acts from the event back to the clock's zero.
        lever = 2.0 * RESONATOR_STD if not trigger else 0.0
        assert sync["offset_std_s"] > lever


SEEDS = 8


@pytest.fixture(scope="module")
def many(tmp_path_factory, actuator):
    """Folders of the loaded, stalled and hung-weights logs of several seeds."""
    root = tmp_path_factory.mktemp("many")
    plans = (sines(), load_procedure("stall"), load_procedure("compliance"))
    folders = [
        (plan, seed, root / plan.name / str(seed)) for plan in plans for seed in range(SEEDS)
    ]
    for plan, seed, folder in folders:
        run_procedure(plan, actuator, folder, seed=seed, truth=folder / "truth.json")
    return [folder for _, _, folder in folders]


@pytest.mark.long
@pytest.mark.parametrize("trigger", [True, False])
def test_deviations_cover_the_truth_over_many_seeds(many, monkeypatch, trigger):
    """Each within 3.5 of its own deviations, 90 % of all within 1.645."""
    if not trigger:
        monkeypatch.setattr(f"{MODULE}.find_trigger", lambda *_: None)
    found, hung = [], []
    for folder in many:
        for name, report, true in imported(folder):
            sync = report.synchronisation
            if sync["method"] == "none":  # a motion that repeats, without a trigger
                assert not trigger
                assert report.has("not-synchronised")
                continue
            found.append(scores(sync, true))
            if name == "compliance":
                hung.append(sync["drift"] - true["cell"]["clock_drift"])
    # Without a trigger the sine of 0.15 Hz repeats; some stairs of weights repeat by a step.
    assert len(found) >= (4 * SEEDS if trigger else 2 * SEEDS)
    assert len(hung) == SEEDS or not trigger
    assert hung
    assert np.max(np.abs(found)) < 3.5
    assert np.mean(np.abs(found) < 1.645, axis=0).min() > 0.85
    assert np.sqrt(np.mean(np.square(hung))) < 5e-4


def square(t):
    """A torque that turns with a motion that never repeats."""
    return np.sign(np.sin(2.0 * math.pi * (0.2 * t + 0.012 * t**2)))


def sampled(*, late=0.0, drift=0.0, offset=1.5, noise=0.02, rival=0.0, seed=0):
    rng = np.random.default_rng(seed)
    drive = np.arange(0.0, 20.0, 1 / 400)
    cell_time = np.arange(0.0, 18.0, 1 / 80)
    signal = square(drive) + noise * rng.standard_normal(len(drive))
    true = offset + (1.0 + drift) * cell_time - late
    value = 40.0 * square(true) + rival * np.cumsum(rng.standard_normal(len(cell_time)))
    value += 40.0 * noise * rng.standard_normal(len(cell_time))
    return drive, signal, cell_time, value, find_trigger(drive, drive >= offset)


@pytest.mark.parametrize("late", [0.0, 0.02, 0.035])
def test_a_late_converter_is_no_drift(late):
    errors = []
    for seed in range(6):
        drive, signal, cell_time, value, edge = sampled(late=late, drift=-8e-4, seed=seed)
        fit = align_clocks(drive, signal, cell_time, value, edge=edge)
        assert abs(fit.offset - 1.5) < 3.0 * fit.offset_std
        assert fit.residual == pytest.approx(-late, abs=3.0 * fit.residual_std)
        assert fit.residual_std < 0.01
        errors.append((fit.drift + 8e-4) / fit.drift_std)
    assert np.max(np.abs(errors)) < 3.0


def test_without_a_trigger_the_offset_holds_the_delay_it_cannot_tell():
    drive, signal, cell_time, value, _ = sampled(late=0.03)
    fit = align_clocks(drive, signal, cell_time, value)
    assert abs(fit.offset - 1.5) < 2.0 * fit.offset_std
    assert abs(fit.offset - 1.5) > 0.02


def test_dependent_and_silent_signals_change_nothing():
    drive, signal, cell_time, value, edge = sampled(seed=2)
    alone = align_clocks(drive, signal, cell_time, value, edge=edge)
    more = np.column_stack([signal, 2.0 * signal - 1.0, np.full_like(drive, 0.3)])
    fit = align_clocks(drive, more, cell_time, value, edge=edge)
    for name in ("offset", "offset_std", "drift", "drift_std", "residual_std"):
        assert getattr(fit, name) == pytest.approx(getattr(alone, name), rel=1e-3, abs=1e-7)


def test_two_sets_that_disagree_are_refused_without_a_trigger():
    """Each explains the load cell, at offsets of its own: which one it follows is not known."""
    drive, signal, cell_time, value, edge = sampled(seed=4)
    late = np.interp(drive - 0.3, drive, signal)
    with pytest.raises(InputError, match="two sets of signals disagree"):
        align_clocks(drive, signal, cell_time, value, alternatives=[late])
    fit = align_clocks(drive, signal, cell_time, value, edge=edge, alternatives=[late])
    assert fit == align_clocks(drive, signal, cell_time, value, edge=edge)


def test_a_set_of_missing_values_is_passed_over():
    drive, signal, cell_time, value, edge = sampled(seed=1)
    lost = np.full_like(drive, math.nan)
    fit = align_clocks(drive, signal, cell_time, value, edge=edge, alternatives=[lost])
    assert fit == align_clocks(drive, signal, cell_time, value, edge=edge)
    with pytest.raises(InputError, match="0 and 1440 samples"):
        align_clocks(drive, lost, cell_time, value, edge=edge, alternatives=[lost])


def test_a_clock_that_stands_still_is_refused():
    drive, signal, cell_time, value, edge = sampled()
    cell_time[100] = cell_time[99]
    with pytest.raises(InputError, match=r"load cell's time does not increase at 1\.2375 s"):
        align_clocks(drive, signal, cell_time, value, edge=edge)


def test_signals_that_explain_less_than_half_leave_the_trigger_alone():
    drive, signal, cell_time, value, edge = sampled(rival=12.0, seed=5)
    fit = align_clocks(drive, signal, cell_time, value, edge=edge)
    assert fit.method == "trigger"
    assert fit.drift == 0.0
    with pytest.raises(InputError, match="50 % needed"):
        align_clocks(drive, signal, cell_time, value)


def test_a_clock_beyond_any_resonator_is_still_followed_when_it_is_seen():
    drive, signal, cell_time, value, edge = sampled(drift=0.012)
    fit = align_clocks(drive, signal, cell_time, value, edge=edge)
    assert fit.drift == pytest.approx(0.012, abs=3.0 * fit.drift_std)
    assert fit.drift - 2.0 * fit.drift_std > RESONATOR_TOLERANCE


def test_the_set_of_signals_that_explains_more_is_taken():
    drive, signal, cell_time, value, edge = sampled(seed=1)
    other = np.random.default_rng(9).standard_normal(len(drive))
    one = align_clocks(drive, other, cell_time, value, edge=edge, alternatives=[signal])
    assert one == align_clocks(drive, signal, cell_time, value, edge=edge)


def test_half_a_period_before_the_trace_is_set_aside():
    """A cosine and its half period: the load cell began within the trace, and that is reported."""
    drive = np.arange(0.0, 20.0, 1 / 400)
    cell_time = np.arange(0.0, 19.0, 1 / 80)
    noise = 0.02 * np.random.default_rng(3).standard_normal(len(cell_time))
    wave = np.cos(2.0 * math.pi * 0.05 * drive)
    value = np.cos(2.0 * math.pi * 0.05 * (cell_time + 0.7)) + noise
    fit = align_clocks(drive, wave, cell_time, value)
    assert abs(fit.offset - 0.7) < 3.0 * fit.offset_std
    assert fit.set_aside == pytest.approx(-9.3, abs=0.1)
