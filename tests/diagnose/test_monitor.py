"""Watching a stream: the filter in closed form, thresholds, alarms, the command."""

import copy
import io
import json
import sys
from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator
from elevon.bench.procedure import Procedure
from elevon.bench.rig import setups
from elevon.bench.traces import recorded, traced
from elevon.diagnose.monitor import Monitor
from elevon.diagnose.monitor.by_positions import ROLES
from elevon.diagnose.monitor.filter import ChangeFilter, WindowSpread
from elevon.diagnose.monitor.threshold import simulated
from elevon.errors import FormatError, InputError
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


def samples_of(item):
    return {"time": item.time + item.start} | {r: item[r] for r in ROLES if item.has(r)}


def test_samples_fed_in_any_portions_say_what_the_log_says_to_the_bit(monitor, streams):
    item = streams["backlash"]
    whole = monitor.fresh()
    whole.feed_log(item)
    for portions in (7, 900):
        fed, steps = monitor.fresh(), []
        for part in np.array_split(np.arange(len(item.time)), portions):
            steps += fed.feed({n: values[part] for n, values in samples_of(item).items()})
        steps += fed.finish()
        assert [replace(s, log=item.name) for s in steps] == whole.steps
        assert replace(fed.alarm, log="", since_log="") == replace(
            whole.alarm, log="", since_log=""
        )
        assert fed.samples.missing == 0


def test_a_stream_goes_on_from_its_state_to_the_bit(monitor, streams, tmp_path):
    """Cut in the run-in, in a window and at a day's end; samples that come again are left out."""
    item, file = streams["backlash"], tmp_path / "state"
    samples = samples_of(item)
    whole = monitor.fresh()
    for _ in range(2):
        whole.feed(samples)
        whole.finish()
        whole.new_day()
    fed, steps, again = monitor.fresh(), [], 40
    for day in range(2):
        for first, last in ((0, 300), (300, 2000), (2000, 9000), (9000, len(item.time))):
            at = slice(max(first - again, 0), last)
            steps += fed.feed({name: values[at] for name, values in samples.items()})
            fed.save(file)
            fed = monitor.fresh()
            fed.resume(file)
        steps += fed.finish()
        fed.new_day()
        fed.save(file)
        fed = monitor.fresh()
        fed.resume(file)
        assert fed.day == day + 1
    left = [step.samples.doubled + step.samples.late for step in steps]
    assert sum(left) > 100
    clean = [replace(step, samples=w.samples) for step, w in zip(steps, whole.steps, strict=True)]
    assert clean == whole.steps
    assert fed.alarm == whole.alarm
    assert fed.windows == whole.windows


def test_a_state_of_another_monitor_or_none_is_refused(monitor, unit, streams, tmp_path):
    file = tmp_path / "state"
    monitor.fresh().save(file)
    other = copy.copy(monitor.fresh())
    other.false_alarm_time = 600.0
    other.__dict__.pop("_inputs", None)
    with pytest.raises(InputError, match="another time between false alarms"):
        other.resume(file)
    whole = file.read_bytes()
    for damaged in (b"", b"{}", whole[: len(whole) // 2], whole[:200] + b"\0" * 99 + whole[299:]):
        file.write_bytes(damaged)
        with pytest.raises(FormatError):
            monitor.fresh().resume(file)
    with pytest.raises(InputError, match="cannot be read"):
        monitor.fresh().resume(tmp_path / "none")


def test_samples_that_are_none_are_refused(monitor, streams):
    samples = {name: values[:10] for name, values in samples_of(streams["healthy"]).items()}
    for changed, words in (
        ({"motor_speed": None}, "motor_speed"),
        ({"time": None}, "'time' is missing"),
        ({"motor_sped": samples["motor_speed"]}, "did you mean 'motor_speed'"),
        ({"encoder_position": samples["time"]}, "so has another channel"),
        ({"motor_speed": [1.0]}, "10 time stamps, 1 values"),
        ({"motor_speed": ["fast"] * 10}, "no numbers"),
        ({"time": [*samples["time"][:9], np.nan]}, "must be finite"),
    ):
        given = {name: v for name, v in (samples | changed).items() if v is not None}
        with pytest.raises(InputError, match=words):
            monitor.fresh().feed(given)
    begun = monitor.fresh()
    begun.feed(samples)
    with pytest.raises(InputError, match="same channels throughout"):
        begun.feed({name: v for name, v in samples.items() if name != "torque_voltage"})


def test_what_cannot_be_watched_is_refused(unit, monitor, streams):
    with pytest.raises(InputError, match="needs a baseline"):
        Monitor(unit, [])
    with pytest.raises(InputError, match="the role 'command'"):
        Monitor(Actuator.load("nasa-ballscrew"), [streams["base"]])
    with pytest.raises(InputError, match="above zero"):
        Monitor(unit, [streams["base"]], false_alarm_time=0.0)
    with pytest.raises(InputError, match="longest day of 0 s"):
        Monitor(unit, [streams["base"]], longest=0.0)
    with pytest.raises(InputError, match="windows of 12 s"):
        Monitor(unit, [streams["base"]], window=12.0)


def test_another_motion_is_left_out(monitor, streams):
    item = streams["healthy"]
    faster = item.with_channels(output_position=1.5 * item.output)
    steps = monitor.fresh().feed_log(faster)
    assert {step.skipped for step in steps} == {"not the baselines' motion"}


def stream(run, monkeypatch, data, options):
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
    result = run("monitor", "-", *options)
    assert result.code == 0, result.err
    return [json.loads(line) for line in result.out.splitlines()]


def test_the_command(elevon_cli, tmp_path, monkeypatch):  # noqa: F811
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
    lines = stream(elevon_cli, monkeypatch, logs[1].read_bytes(), options)
    assert [item["event"] for item in lines] == ["window"] * 3 + ["end"]
    assert [{**step, "log": "stream"} for step in document["steps"]] == [
        {name: item[name] for name in document["steps"][0]} for item in lines[:-1]
    ]
    assert [("first_alarm" in line) for line in lines].count(True) == 1
    cut = logs[1].read_bytes()[:-9]
    state = ["--state", tmp_path / "state"]
    for k, part in enumerate((cut[:200_000], cut[200_000:])):
        lines = stream(elevon_cli, monkeypatch, part, [*options, *state])
        assert lines[-1]["ended"] == "in mid-line"
        assert lines[-1]["samples"]["unreadable"] == k  # the line that was cut
    assert lines[-1]["alarm"]["time"] == document["alarm"]["time"]
    answer = elevon_cli("monitor", logs[0], *options)
    assert "No alarm in" in answer.err + answer.out
    refused = elevon_cli("monitor", logs[1], *options, "--false-alarm-time", "0 s", "--json")
    assert refused.code == 2
    assert refused.out == ""
    for words, why in (
        (["-"], "the stream ends in mid-line, 3 bytes"),
        (["-", "--json"], "one object"),
        (["-", logs[0]], "alone"),
        ([logs[0], "--state", "s"], "give - as the log"),
    ):
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"a,b")))
        refused = elevon_cli("monitor", *words, *options)
        assert refused.code == 2
        assert why in refused.err
