"""The health strip's diagnosis and monitor: what they get, what they say."""

import pickle

import pytest

from elevon import Actuator
from elevon.live.bench import LiveBench
from elevon.live.health import Examiner, Health, Request
from elevon.live.trace import LiveMotion, Watch, window_of, write_stretch
from elevon.live.unit import LiveUnit
from tests.live.serving import SINE

FAULT = "backlash@transmission"


class Taken:
    """What nobody may look at."""

    def __getattribute__(self, name):
        raise AssertionError(f"the truth was looked at: {name}")


def _bench(name="torino-rotary", command=SINE):
    bench = LiveBench(LiveUnit(Actuator.load(name), fidelity="low", seed=1))
    bench.act({"command": command})
    return bench


def _run(bench, until):
    while bench.unit.time < until - 1e-6:
        bench.loop.sample()


def _request(bench, folder):
    """What the process beside is given: a request, and the files it names."""
    part = bench.stretch()
    path = folder / "live.csv"
    write_stretch(path, part, bench.unit.actuator, "low", force=True)
    return part, Request(str(path), part.motion)


def _truth_taken(bench):
    """Take away the list of faults, the model that runs, the journal: all that knows of them."""
    unit = bench.unit
    unit.faults = unit._session = bench.journal = bench.script = Taken()


def test_what_is_diagnosed_is_written_without_the_list_of_faults(tmp_path):
    bench = _bench()
    bench.act({"fault": {FAULT: "0.5 deg"}})
    _run(bench, 11.1)
    _request(bench, tmp_path)
    files = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    _truth_taken(bench)
    with pytest.raises(AssertionError, match="looked at"):
        bench.state()  # the page's truth is really gone
    _, request = _request(bench, tmp_path)
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == files
    assert b"backlash" not in pickle.dumps(request)
    assert all(b"backlash" not in content for content in files.values())
    assert bench.unit.actuator.hash == Actuator.load("torino-rotary").hash


@pytest.mark.long
def test_backlash_is_found_without_the_list_of_faults(tmp_path):
    bench = _bench()
    examiner = Examiner(bench.unit.actuator, (), None)
    _run(bench, 11.1)
    part, request = _request(bench, tmp_path)
    bench.watch.take(examiner.examine(request), part)
    assert bench.watch.health.status == "healthy"
    examiner.learn()  # the monitor learns
    _run(bench, 16.0)
    bench.act({"fault": {FAULT: "0.3 deg"}})
    for until in (19.0, 27.0):
        _run(bench, until)
        part, request = _request(bench, tmp_path)
        bench.watch.take(examiner.examine(request), part)
    bench.unit.faults = Taken()
    part, request = _request(bench, tmp_path)
    health = examiner.examine(request)
    assert health.status == "faulty"
    assert health.faults[0].kind == "backlash"
    assert health.watch.alarm
    assert abs(health.watch.since - 16.0) <= 2.0  # a window's width


def test_a_landing_gear_is_looked_at_when_its_motion_has_ended():
    bench = _bench(
        "pisa-landing-gear", {"mode": "gear", "steps": [{"time": 0, "action": "extend"}]}
    )
    _run(bench, 0.5)
    assert "waiting" in bench.stretch()
    _run(bench, 9.5)
    assert bench.stretch().time[-1] == pytest.approx(bench.unit.time)


@pytest.mark.parametrize(
    ("terms", "width"),
    [
        ([{"kind": "sine", "amplitude": 1, "frequency": "0.5 Hz"}], 2.0),
        ([{"kind": "sine", "amplitude": 1, "frequency": "3 Hz"}], 1.0),
        ([{"kind": "triangle", "amplitude": 1, "frequency": 0.7}], 1 / 0.7),
        ([{"kind": "constant", "value": 1}], None),
        ([{"kind": "chirp", "amplitude": 1, "end_frequency": 2, "sweep_time": 3}], None),
        (
            [
                {"kind": "sine", "amplitude": 1, "frequency": 1},
                {"kind": "sine", "amplitude": 1, "frequency": 1.1},
            ],
            None,
        ),
    ],
)
def test_a_window_is_whole_periods_of_a_command_that_has_one(terms, width):
    assert window_of({"terms": terms}) == (None if width is None else pytest.approx(width))


def test_the_onset_is_the_monitors_where_it_has_one():
    bench = _bench()
    _run(bench, 11.1)
    part = bench.stretch()
    assert part.motion == LiveMotion(part.time[0], bench.unit.given_at, 2.0)
    bench.watch.take(Health(status="faulty"), part)
    assert (bench.watch.health.since, bench.watch.health.onset) == (part.time[-1], False)
    alarm = Watch(statistic=2.0, windows=5, alarm=True, since=7.0)
    bench.watch.take(Health(status="faulty", watch=alarm), part)
    assert (bench.watch.health.since, bench.watch.health.onset) == (7.0, True)
