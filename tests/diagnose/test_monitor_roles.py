"""Watching an actuator that is read by roles: periods of a command, actions, causes."""

from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator, Scenario, simulate
from elevon.diagnose.engine.days import drawn
from elevon.diagnose.monitor import Monitor
from elevon.diagnose.monitor.by_roles import ActionCutter, period_of
from elevon.errors import InputError
from elevon.live.trace import LiveMotion, StreamWatch
from elevon.logs.log import Log

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
FEW = ["backlash@transmission", "gain_drift@control.position"]
OF_THE_GEAR = ["sag@supply", "proximity_off@sensor.proximity_25"]
ONSET = 6.0  # s
SIGNALS = {
    "ballscrew": "encoder_position,resolver_position,resolver_speed,current_q_meas",
    "landing_gear": "state,output_position,speed_meas,current_mean,proximity_25",
}


def log(actuator, command, day, *faults, seconds=12.0, name="log"):
    """A day's log at low fidelity."""
    unit = drawn(actuator, np.random.default_rng(day))
    data = {"duration": seconds, "command": command}
    scenario = Scenario.from_dict(data).with_faults(list(faults))
    record = f"command,{SIGNALS[actuator.wiring]}@400 Hz"
    return Log.of(simulate(unit, scenario, fidelity="low", record=record), name)


@pytest.fixture(scope="module")
def screw():
    unit = Actuator.load("nasa-ballscrew")
    sine = {"kind": "sine", "amplitude": "10 mm", "frequency": "0.8 Hz", "start": 0.3}
    command = {"mode": "position", "terms": [sine]}
    fault = f"backlash@transmission=0.4 mm:step(time={ONSET} s)"
    logs = {
        "base": log(unit, command, 1, name="base"),
        "healthy": log(unit, command, 2),
        "worn": log(unit, command, 3, fault),
    }
    return Monitor(unit, [logs["base"]], faults=FEW), logs


def test_a_fault_of_a_screw_is_told_with_its_cause_and_a_healthy_day_is_quiet(screw):
    monitor, logs = screw
    assert monitor.width == pytest.approx(1.25, rel=1e-3)
    quiet = monitor.fresh()
    assert not any(step.skipped for step in quiet.feed_log(logs["healthy"]))
    assert quiet.alarm is None
    watch = monitor.fresh()
    watch.feed_log(logs["worn"])
    alarm = watch.alarm
    assert ONSET < alarm.time <= ONSET + 2.0 * watch.width
    assert alarm.since == pytest.approx(ONSET, abs=watch.width)
    assert alarm.whole == 3  # windows behind the one with the onset
    assert alarm.causes[0].kind == "backlash"
    assert 2e-4 < alarm.causes[0].severity < 6e-4


def test_samples_by_role_say_what_the_log_says_also_over_a_restart(screw, tmp_path):
    monitor, logs = screw
    item, file = logs["worn"], tmp_path / "state"
    whole = monitor.fresh()
    whole.feed_log(item)
    samples = {"time": item.time, **{role: item[role] for role in monitor.roles}}
    fed, steps = monitor.fresh(), []
    for part in np.array_split(np.arange(len(item.time)), 9):
        steps += fed.feed({name: values[part] for name, values in samples.items()})
        fed.save(file)
        fed = monitor.fresh()
        fed.resume(file)
    steps += fed.finish()
    assert [replace(step, log=item.name) for step in steps] == whole.steps
    assert replace(fed.alarm, log="", since_log="") == replace(whole.alarm, log="", since_log="")


def test_what_is_not_the_baselines_is_left_out_or_refused(screw):
    monitor, logs = screw
    item = logs["healthy"]
    faster = item.with_channels(command=1.5 * item["command"])
    assert {step.skipped for step in monitor.fresh().feed_log(faster)} == {
        "not the baselines' motion"
    }
    paused = item["command"].copy()
    paused[2000:2250] = paused[2000]  # half a period
    steps = monitor.fresh().feed_log(item.with_channels(command=paused))
    assert "not the baselines' motion" in {step.skipped for step in steps}
    missing = monitor.fresh().feed_log(replace(item, time=1.5 * item.time, recording=None))
    assert all("not sampled at" in step.skipped for step in missing)
    with pytest.raises(InputError, match="motor_speed, which the baselines have"):
        monitor.fresh().feed_log(item.without("motor_speed"))
    with pytest.raises(InputError, match="no channel has the role 'command'"):
        Monitor(monitor.actuator, [item.without("command")])
    gappy = item["output_position"].copy()
    gappy[1000:1400] = np.nan
    steps = monitor.fresh().feed_log(item.with_channels(output_position=gappy))
    assert [step.samples.empty for step in steps].count(0) < len(steps)
    assert not any(step.alarm for step in steps)


def test_a_gear_is_watched_action_by_action():
    unit = Actuator.load("pisa-landing-gear")

    def day(number, *faults):
        steps = [{"time": 0.2 + 0.1 * number, "action": "extend"}]
        return log(unit, {"mode": "gear", "steps": steps}, number, *faults, seconds=4.5)

    watch = Monitor(unit, [day(k) for k in range(3)], faults=OF_THE_GEAR, days=2)
    steps = watch.feed_log(day(4))
    assert len(steps) == 1
    assert watch.alarm is None
    watch.feed_log(day(5, "proximity_off@sensor.proximity_25=1"))
    assert watch.alarm.causes[0].kind == "proximity_off"
    assert watch.alarm.opening
    other = log(unit, {"mode": "gear", "steps": [{"time": 0.2, "action": "retract"}]}, 6, seconds=9)
    assert watch.fresh().feed_log(other)[0].skipped.startswith("at rest")
    with pytest.raises(InputError, match="begins with another action"):
        Monitor(unit, [day(0), other], faults=OF_THE_GEAR)


@pytest.mark.long
def test_the_live_strip_watches_a_screw(screw):
    """With all candidates, as the strip has them."""
    monitor, logs = screw
    strip = StreamWatch(monitor.actuator)
    strip.learn(logs["base"], LiveMotion(0.0, 0.0, 1.25))
    watch = strip.take(logs["worn"], LiveMotion(40.0, 0.0, 1.25), healthy=False)
    assert watch.alarm
    assert watch.since == pytest.approx(40.0 + ONSET, abs=1.3)


@pytest.mark.parametrize("portion", [1, 7, 5000])
def test_each_repetition_of_an_action_is_a_window(portion):
    """Actions at uneven times, another one between them; the day begins with the action on."""
    time = np.arange(0.0, 50.0, 0.01)
    level = np.select(
        [time < 2.0, time < 8.0, time < 12.0, time < 30.0, time < 35.5], [1, 0, 1, 2, 0], 1
    )
    cutter = ActionCutter(5.0, 0.0, 1.0, 0, [0])
    out = []
    for part in np.array_split(np.arange(len(time)), max(len(time) // portion, 1)):
        out += cutter.take(time[part], level[part, None].astype(float))
    out += cutter.finish()
    starts = [w.start for w in out if w.why == "window"]
    assert starts == pytest.approx([8.0, 35.5], abs=0.011)
    assert all(w.counts.taken == 500 for w in out if w.why == "window")


def test_the_period_of_a_command_is_found_or_it_is_refused():
    time = np.arange(0.0, 10.0, 0.002)
    for period in (0.7311, 2.345):
        phase = 2.0 * np.pi * time / period
        for wave in (
            np.sin(phase),
            np.sign(np.sin(phase)),
            np.sin(phase) + 0.5 * np.sin(2 * phase),
        ):
            assert period_of(time, wave, "log") == pytest.approx(period, rel=2e-3)
    for wave in (time, np.sin(2.0 * np.pi * time / 7.0), np.sin(time**2)):
        with pytest.raises(InputError, match="does not repeat within"):
            period_of(time, wave, "log")


@pytest.mark.long
def test_an_actuator_of_ones_own_is_watched():
    """Of the ballscrew's wiring; its second period is the first that is like the others."""
    unit = Actuator.load("examples/linear-drive/drive.toml")
    sine = {"kind": "sine", "amplitude": "10 mm", "frequency": "0.5 Hz", "start": 0.3}
    command = {"mode": "position", "terms": [sine]}
    watch = Monitor(unit, [log(unit, command, 1)], faults=[*FEW, "friction@transmission"])
    quiet = watch.fresh()
    quiet.feed_log(log(unit, command, 2))
    assert quiet.alarm is None
    for fault in ("backlash@transmission=0.5 mm", "friction@transmission=1.0"):
        seen = watch.fresh()
        seen.feed_log(log(unit, command, 3, f"{fault}:step(time={ONSET} s)"))
        assert seen.alarm.since == pytest.approx(ONSET, abs=watch.width)
        assert seen.alarm.causes[0].kind == fault.split("@")[0]
