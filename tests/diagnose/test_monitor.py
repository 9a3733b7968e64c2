"""Watching a stream: the filter in closed form, thresholds, alarms, the command."""

import json

import numpy as np
import pytest

from elevon import Actuator
from elevon.bench.procedure import Procedure
from elevon.bench.rig import setups
from elevon.bench.traces import recorded
from elevon.bench.virtual import traced
from elevon.diagnose.monitor import Monitor
from elevon.diagnose.monitor.filter import ChangeFilter, WindowSpread
from elevon.diagnose.monitor.threshold import simulated
from elevon.diagnose.monitor.windows import CHANNELS
from elevon.errors import InputError
from elevon.scenario.compile import signal_records
from elevon.simulate import Run, simulate_batch
from tests.cli.conftest import elevon_cli  # noqa: F401 - a fixture

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
SINE = {"kind": "sine", "amplitude": "7 deg", "bias": "10 deg", "frequency": "0.4 Hz"}
FEW = ["backlash@transmission", "friction@transmission"]
ONSET = 13.0  # s


def spread(size=3, memory=0.8):
    rng = np.random.default_rng(5)
    root = rng.standard_normal((size, size))
    return WindowSpread(0.3 * np.eye(size), root @ root.T, 0.5 * np.eye(size), memory)


def test_the_filter_is_the_likelihood_ratio_of_all_windows():
    """Against the density of all windows stacked, two days, one number missing."""
    s, rng, count = spread(), np.random.default_rng(6), 7
    days = np.array([0, 0, 0, 0, 1, 1, 1])
    at = np.arange(count)
    between = np.where(days[:, None] == days, s.memory ** np.abs(at[:, None] - at), 0.0)
    covariance = (
        np.kron(np.ones((count, count)), s.unit)
        + np.kron(between, s.day)
        + np.kron(np.eye(count), s.noise)
    )
    deviations, fault = rng.standard_normal((count, 3)), np.array([0.4, -1.0, 2.0])
    deviations[5, 1] = np.nan
    watch = ChangeFilter(s, np.eye(3), streams=1, last=10)
    for day, values in zip(days, deviations, strict=True):
        if day == 1 and watch.windows == 4:
            watch.new_day()
        watch.step(values[None, :])
    known = np.isfinite(deviations.ravel())
    inverse = np.linalg.inv(covariance[np.ix_(known, known)])
    for change in watch.changes:
        effect = np.kron(at >= change.window, fault)[known]
        expected = effect @ inverse @ deviations.ravel()[known] - 0.5 * effect @ inverse @ effect
        got = change.linear[0] @ fault - 0.5 * fault @ change.information @ fault
        assert got == pytest.approx(expected, rel=1e-9)
    assert [c.window for c in watch.changes if c.opening] == [0, 4]


def test_healthy_streams_alarm_as_often_as_set():
    """Streams that the thresholds were not drawn from; half of the alarms of either kind."""
    s, ways = spread(), np.vstack([np.eye(3), -np.eye(3)])
    kind = {"days": 1, "windows": 10, "width": 5.0, "noise_degrees": 20.0, "last": 5}
    levels = simulated(s, ways, time=500.0, **kind)
    rng, streams = np.random.default_rng(9), 2000
    watch = ChangeFilter(s, ways, streams=streams, last=5)
    slow = np.sqrt(10.0 / rng.chisquare(10.0, (streams, 1)))
    fast = np.sqrt(20.0 / rng.chisquare(20.0, (streams, 1)))
    day = np.linalg.cholesky(s.day)
    unit = slow * np.sqrt(0.3) * rng.standard_normal((streams, 3))
    drift = slow * (rng.standard_normal((streams, 3)) @ day.T)
    alarms = np.zeros((2, streams), dtype=bool)
    for _ in range(10):
        watch.step(unit + drift + fast * np.sqrt(0.5) * rng.standard_normal((streams, 3)))
        fresh = slow * (rng.standard_normal((streams, 3)) @ day.T)
        drift = s.memory * drift + np.sqrt(1.0 - s.memory**2) * fresh
        pairs = zip(watch.ratios(), (levels.opening, levels.within), strict=True)
        alarms |= np.array([ratio > level for ratio, level in pairs])
    chance = 1.0 - np.exp(-0.5 * 10 * 5.0 / 500.0)
    error = 4.0 * np.sqrt(2.0 * chance / streams)  # of the count here and of that of the threshold
    assert alarms.mean(axis=1) == pytest.approx([chance, chance], abs=error)


@pytest.fixture(scope="module")
def unit():
    return Actuator.load("torino-rotary").with_values({"drive.kind": "pwm"})


@pytest.fixture(scope="module")
def streams(unit):
    """Logs of 25 s: two healthy days, and faults that begin in the middle."""
    step = {"kind": "trace", "name": "stream", "duration": "25 s", "command": {"terms": [SINE]}}
    procedure = Procedure.model_validate({"name": "stream", "step": [step]})
    faults = {
        "base": [],
        "healthy": [],
        "backlash": [f"backlash@transmission=0.1 deg:step(time={ONSET} s)"],
        "friction": [f"friction@transmission=0.5:step(time={ONSET} s)"],
    }
    noise = {"motor_speed": 0.05, "current_q_meas": 0.02, "voltage_q_ref": 0.5}
    ready = [
        setups(procedure, unit, faults=given, seed=seed)[0]
        for seed, given in enumerate(faults.values())
    ]
    record = recorded(list(signal_records("rotary", "low")))
    deviations = simulate_batch(
        [Run(s.actuator, s.scenario) for s in ready], fidelity="low", record=record
    )
    logs = [traced(s, r, noise=noise) for s, r in zip(ready, deviations, strict=True)]
    return dict(zip(faults, logs, strict=True))


@pytest.fixture(scope="module")
def monitor(unit, streams):
    return Monitor(unit, [streams["base"]], faults=FEW, longest=25.0)


def test_a_fault_that_begins_is_told_soon_and_a_healthy_day_is_quiet(monitor, streams):
    quiet = monitor.fresh()
    quiet.feed_log(streams["healthy"])
    assert quiet.alarm is None
    for kind, severity in (("backlash", np.radians(0.1)), ("friction", 0.5)):
        watch = monitor.fresh()
        watch.feed_log(streams[kind])
        alarm = watch.alarm
        assert ONSET < alarm.time <= ONSET + 2.0 * watch.width
        assert alarm.since == pytest.approx(ONSET, abs=watch.width)
        assert not alarm.opening
        assert alarm.statistic > 1.0
        assert alarm.ratio == pytest.approx(alarm.statistic * alarm.threshold)
        assert alarm.causes[0].kind == kind
        # The window in which it began holds a part of it, so the size may be below at first.
        assert 0.2 * severity < alarm.causes[0].severity < 1.2 * severity


def test_samples_fed_in_any_portions_say_what_the_log_says(monitor, streams):
    item = streams["backlash"]
    whole = monitor.fresh()
    whole.feed_log(item)
    fed = monitor.fresh()
    samples = {"time": item.time, "voltage_q_ref": item["torque_voltage"]}
    samples |= {name: item[role] for name, role in CHANNELS.items()}
    for part in np.array_split(np.arange(len(item.time)), 7):
        fed.feed({name: values[part] for name, values in samples.items()})
    count = len(fed.steps)
    assert count >= len(whole.steps) - 1
    assert [s.statistic for s in fed.steps] == pytest.approx(
        [s.statistic for s in whole.steps[:count]], rel=1e-6
    )
    with pytest.raises(InputError, match="current_q_meas"):
        fed.feed({"time": item.time})


def test_what_cannot_be_watched_is_refused(unit, monitor, streams):
    with pytest.raises(InputError, match="needs a baseline"):
        Monitor(unit, [])
    with pytest.raises(InputError, match="rotary"):
        Monitor(Actuator.load("nasa-ballscrew"), [streams["base"]])
    with pytest.raises(InputError, match="above zero"):
        Monitor(unit, [streams["base"]], false_alarm_time=0.0)
    with pytest.raises(InputError, match="windows of 12 s"):
        Monitor(unit, [streams["base"]], window=12.0)


def test_windows_begin_a_second_after_the_motion_has(streams):
    from elevon.diagnose.monitor.windows import run_in, top_speed

    item = streams["healthy"]
    top = top_speed(item)
    rests = item.with_channels(motor_speed=np.where(item.time < 2.0, 0.0, top))
    assert run_in(rests, top) == pytest.approx(3.0, abs=item.period)
    standing = item.with_channels(motor_speed=0.0 * item.speed)
    assert run_in(standing, top) is None


def test_another_motion_is_left_out(monitor, streams):
    item = streams["healthy"]
    faster = item.with_channels(output_position=1.5 * item.output)
    steps = monitor.fresh().feed_log(faster)
    assert {step.skipped for step in steps} == {"not the baselines' motion"}


def test_the_command(elevon_cli, tmp_path):  # noqa: F811
    logs = []
    for seed, fault in ((1, []), (2, ["--fault", "backlash@transmission=0.1 deg:step(time=11 s)"])):
        out = tmp_path / str(seed)
        made = elevon_cli("bench", "run", "backlash", "--actuator", "torino-rotary", "--fidelity",
                          "low", "--seed", seed, "--out", out, *fault)  # fmt: skip
        assert made.code == 0
        logs.append(out / "backlash.csv")
    options = ["--actuator", "torino-rotary", "--baseline", logs[0], "--fault", FEW[0]]
    result = elevon_cli("monitor", logs[1], *options, "--json")
    assert result.code == 0
    document = json.loads(result.out)
    assert document["status"] == "alarm"
    assert document["window"] == pytest.approx(5.0)
    assert document["alarm"]["time"] > 11.0
    assert document["alarm"]["causes"][0]["kind"] == "backlash"
    assert len(document["steps"]) == 3  # the first second of motion is none
    assert document["steps"][0]["start"] >= 1.0
    answer = elevon_cli("monitor", logs[0], *options)
    assert "No alarm in" in answer.err + answer.out
    refused = elevon_cli("monitor", logs[1], *options, "--false-alarm-time", "0 s", "--json")
    assert refused.code == 2
    assert refused.out == ""
