"""Diagnosis of any actuator by the roles of its logs."""

from dataclasses import replace

import numpy as np
import pytest

from elevon import Actuator, Recording, Scenario, simulate
from elevon.cli import main
from elevon.diagnose.by_model import diagnose
from elevon.diagnose.engine.candidates import candidates_of, chosen, not_candidates
from elevon.diagnose.engine.case import case_of
from elevon.diagnose.engine.days import drawn, factors_of
from elevon.diagnose.engine.likelihood import _around
from elevon.diagnose.engine.replay import _RECENT, _severities, spread_of
from elevon.diagnose.roles.log import _onset, role_log
from elevon.diagnose.roles.numbers import lines, numbers_of
from elevon.diagnose.roles.reading import load_alike, read_load
from elevon.errors import InputError, UnknownNameError
from elevon.logs.log import Log
from studies.fault_limits.standard import Day, day_logs, diagnosed, standard_tests

pytestmark = pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")


@pytest.fixture(scope="module")
def screw():
    return Actuator.load("nasa-ballscrew")


@pytest.fixture(scope="module")
def gear():
    return Actuator.load("pisa-landing-gear")


def log(actuator, *faults, day=None, start=0.3, name="log"):
    """A low-fidelity log: a sine, or an extension, that begins at `start`."""
    unit = actuator if day is None else drawn(actuator, np.random.default_rng(day))
    sine = {"kind": "sine", "amplitude": "20 mm", "frequency": "0.4 Hz", "start": start}
    command = {"mode": "position", "terms": [sine]}
    names, seconds = "encoder_position,resolver_position,resolver_speed,current_q_meas", 5
    if actuator.wiring == "landing_gear":
        command = {"mode": "gear", "steps": [{"time": start, "action": "extend"}]}
        names, seconds = "state,output_position,speed_meas,current_mean,proximity_25", 4
    scenario = Scenario.from_dict({"duration": seconds, "command": command, "fault": list(faults)})
    record = f"command,{names}@200 Hz"
    return Log.of(simulate(unit, scenario, fidelity="low", record=record), name)


def test_backlash_of_a_screw_is_named_and_a_healthy_day_is_healthy(screw):
    few = ["backlash@transmission", "gain_drift@control.position"]
    base = [log(screw, day=1, name="base")]
    healthy = diagnose([log(screw, day=2, start=0.41, name="h")], screw, baselines=base, faults=few)
    assert healthy.status == "healthy"
    fault = {"kind": "backlash", "place": "transmission", "severity": "0.4 mm"}
    worn = diagnose([log(screw, fault, day=3, name="w")], screw, baselines=base, faults=few)
    assert worn.status == "faulty"
    assert worn.best == ("backlash@transmission",)
    assert worn.faults[0].interval[0] < 4e-4 < worn.faults[0].interval[1]
    assert worn.unobservable == ()  # both are seen, others were not requested


def test_what_no_candidate_moves_is_seen_by_roles_too(screw, gear):
    """A motor's speed read 1.5 rad/s off moves no feature that a candidate moves."""
    few = ["backlash@transmission", "gain_drift@control.position"]
    base, item = log(screw, day=1, name="base"), log(screw, day=2, name="off")
    off = item.with_channels(motor_speed=item.speed + 1.5)
    answer = diagnose([replace(off, recording=None)], screw, baselines=[base], faults=few)
    assert (answer.status, answer.reason.feature) == ("unknown_fault", "speed_offset")
    # A motion one way tells no offset of a current from dry friction.
    names = role_log(log(gear), gear).plausible.names
    assert "current_noise" in names
    assert not {"current_mean", "creeping_current"} & set(names)


def test_of_a_unit_that_nobody_ever_saw_healthy_nothing_is_decided(screw, tmp_path):
    """A file that no logs were calibrated to may be another unit's; a calibrated one is not."""
    path = tmp_path / "unit.toml"
    value = screw.parameters.value("motor.inertia")
    path.write_text(
        f'name = "unit"\nbase = "nasa-ballscrew"\n[motor.inertia]\nvalue = {value!r}\n'
        'unit = "kg m2"\nsource = "logs"\nconfidence = "calibrated"\n'
    )
    item = log(screw, day=2)
    hum = item.with_channels(torque_current=item.current + 20.0 * np.sin(400.0 * item.time))
    few = ["backlash@transmission"]
    odd = [replace(hum, recording=None)]
    answers = [diagnose(odd, unit, faults=few) for unit in (screw, Actuator.load(path))]
    assert [a.status for a in answers] == ["undecided", "unknown_fault"]
    assert any("give a baseline, or calibrate" in text for text in answers[0].findings)
    assert (answers[0].alarm, answers[0].best, answers[0].hypotheses) == (False, (), ())
    # Neither healthy nor faulty, whatever the log shows; what it measures stands beside the file's.
    worn = log(screw, {"kind": "backlash", "place": "transmission", "severity": "0.4 mm"}, day=3)
    for each in (item, worn):
        answer = diagnose([each], screw, faults=few)
        assert (answer.status, answer.best, answer.faults) == ("undecided", (), ())
        assert (answer.alarm, answer.would_be_seen, answer.alternatives) == (False, {}, ())
    assert answer.headline.startswith("UNDECIDED: this unit was never seen healthy; furthest from ")
    apart = max(answer.features, key=lambda m: abs(m.score))
    assert f"{apart.name.replace('_', ' ')} " in answer.headline
    assert diagnose([worn], Actuator.load(path), faults=few).best == ("backlash@transmission",)
    assert diagnose([worn], screw, faults=few, unit_known=True).best == ("backlash@transmission",)


def test_a_healthy_answer_says_what_would_have_been_seen(screw):
    """Backlash as large as is said raises an alarm in nine of ten days; a tenth of it does not."""
    few = ["backlash@transmission"]
    base = [log(screw, day=1, name="base")]
    answer = diagnose([log(screw, day=2, name="h")], screw, baselines=base, faults=few)
    assert answer.status == "healthy"
    assert set(answer.would_be_seen) == {"backlash@transmission"}
    least = answer.would_be_seen["backlash@transmission"]
    assert "; would be seen: backlash from " in answer.headline

    def alarms(severity):
        fault = {"kind": "backlash", "place": "transmission", "severity": severity}
        logs = [log(screw, fault, day=10 + k, name="w") for k in range(10)]
        return sum(diagnose([x], screw, baselines=base, faults=few).alarm for x in logs)

    assert alarms(least) >= 7  # of ten, nine expected; fewer than seven: 1.3 %
    assert alarms(0.1 * least) <= 3  # at 5 %: more than three: 0.1 %


def test_two_faults_of_a_screw_are_named_together(screw):
    few = ["backlash@transmission", "gain_drift@control.position", "short@motor.phase_a"]
    base = [log(screw, day=1, name="base")]
    backlash = {"kind": "backlash", "place": "transmission", "severity": "0.4 mm"}
    gain = {"kind": "gain_drift", "place": "control.position", "severity": -0.5}
    answer = diagnose(
        [log(screw, backlash, gain, day=3, name="w")], screw, baselines=base, faults=few
    )
    assert set(answer.best) == {"backlash@transmission", "gain_drift@control.position"}
    low, high = next(c.interval for c in answer.faults if c.kind == "backlash")
    assert low < 4e-4 < high
    assert all(c.probability > 0.75 for c in answer.faults)  # wind-up looks like backlash


PAIRS = [
    ("nasa-ballscrew", "sine-opposing", [
        ("short@motor.phase_a=0.25", "gain_drift@control.position=-0.4"),
        ("backlash@transmission=0.0004", "gain@sensor.current_a=0.2"),
        ("demagnetisation@motor=0.2", "lubrication_loss@screw=0.9"),
        ("gain@sensor.encoder=0.01", "eccentricity_static@motor=0.2"),
    ]),
    ("pisa-landing-gear", "retraction-nominal", [
        ("demagnetisation@motor=0.3", "offset@sensor.hall_a=0.15"),
        ("efficiency_loss@screw=0.3", "bearing_wear@motor.bearing=0.3"),
        ("sag@supply=0.2", "short@motor.phase_a=0.3"),
        ("demagnetisation@motor=0.25", "proximity_on@sensor.proximity_0=1"),
    ]),
]  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize(("name", "title", "pairs"), PAIRS, ids=[name for name, *_ in PAIRS])
def test_pairs_of_faults_are_named_with_the_whole_catalogue(name, title, pairs):
    actuator = Actuator.load(name)
    test = next(t for t in standard_tests(actuator) if t.name == title)
    days = [Day((), 71), *(Day(pair, 72 + k) for k, pair in enumerate(pairs))]
    base, *logs = day_logs(actuator, test, days)
    for pair, item in zip(pairs, logs, strict=True):
        answer = diagnosed(actuator, item, [base])
        names = [{(c.kind, c.place), *c.ambiguous_with} for c in answer.faults]
        for text in pair:
            wanted = tuple(text.split("=")[0].split("@"))
            assert any(wanted in causes for causes in names), (pair, answer.best)


def test_a_gear_is_diagnosed_whenever_its_action_came(gear):
    few = ["sag@supply", "proximity_off@sensor.proximity_25", "release_cable_failed@release"]
    base = [log(gear, day=1, name="base")]
    late = diagnose(
        [log(gear, day=2, start=0.7, name="h")], gear, baselines=base, faults=few, false_alarm=1e-3
    )
    assert late.status == "healthy"
    early = diagnose([log(gear, day=1, start=0.7, name="h")], gear, baselines=base, faults=few)
    deviation = {m.name: m.deviation for m in early.features}
    read = [role_log(item, gear) for item in (base[0], log(gear, day=1, start=0.7))]
    first, again = (r.within(min(x.seconds for x in read)).features for r in read)
    assert first.names == again.names
    size = np.array([deviation.get(name, np.inf) for name in first.names])
    apart = np.abs(first.values - again.values) / size
    assert max(apart) < 0.5  # its own day, begun later
    blind = {(item["kind"], item["place"]): item["reason"] for item in late.unobservable}
    assert "moves nothing" in blind["release_cable_failed", "release"]
    dead = {"kind": "proximity_off", "place": "sensor.proximity_25", "severity": 1}
    answer = diagnose([log(gear, dead, day=3, name="f")], gear, baselines=base, faults=few)
    assert (answer.status, answer.best) == ("faulty", ("proximity_off@sensor.proximity_25",))


def test_a_baseline_that_the_model_does_not_show_is_a_gate(screw):
    """Beside a sound one it is left out; alone, nothing is diagnosed."""
    worn = {"kind": "friction", "place": "transmission", "severity": 5.0}
    wrong, right = log(screw, worn, day=4, name="wrong"), log(screw, day=4, name="right")
    few = ["backlash@transmission", "gain_drift@control.position"]
    item = log(screw, day=2, name="h")
    cases = (([wrong], "model_does_not_fit"), ([right], "healthy"), ([wrong, right], "healthy"))
    for baselines, status in cases:
        result = diagnose([item], screw, baselines=baselines, faults=few)
        about = [text for text in result.findings if text.startswith("baseline wrong")]
        assert len(about) == (wrong in baselines)
        assert result.status == status
        assert (result.reason is not None) == (status == "model_does_not_fit")


def test_a_log_is_read_from_its_first_command(screw, gear):
    first, late = (role_log(log(screw, start=s), screw) for s in (0.3, 0.412))
    assert first.same(late)
    short = min(first.seconds, late.seconds)
    first, late = first.within(short), late.within(short)
    np.testing.assert_allclose(first.log.time, late.log.time, atol=1e-12)
    commands = [item.log["command"] for item in (first, late)]
    np.testing.assert_allclose(*commands, atol=8e-5)  # the kink at the start
    extend = role_log(log(gear), gear)
    assert extend.command[0][-1] == pytest.approx(0.0, abs=1e-9)
    assert extend.log.time[0] == pytest.approx(-0.1)


def test_a_ramp_is_seen_to_begin_between_two_samples(screw):
    """Whatever of its first samples is too near its start to count."""
    time = np.arange(2000) / 500.0
    for start in (0.3001, 0.3009, 0.3017):
        ramp = 0.05 * np.clip(time - start, 0.0, 1.0)
        assert _onset(time, ramp, sequence=False, name="x") == pytest.approx(start, abs=1e-9)


def test_a_load_is_read_over_the_stroke_and_its_noise_is_none(gear):
    rng = np.random.default_rng(3)
    time = np.arange(4000) / 500.0
    position = 0.264 * time / time[-1]
    knots = np.array([-2000.0, -1900, -1700, -1600, -1500, -1400, -1300, -1100, -800])
    load = np.interp(position, np.linspace(0.0, 0.264, 9), knots) + rng.normal(0.0, 5.0, len(time))
    residual, over = read_load(gear, time, {"load": load, "output_position": position})
    assert over is not None
    np.testing.assert_allclose(over.forces, knots, atol=3.0)
    assert np.abs(residual[1]).max() < 20.0
    settings = over.settings(gear)
    causes = gear.parameters.value("load.force_3") * gear.parameters.value("load.factor")
    assert settings["load.force_3"] == pytest.approx(causes - over.forces[3])
    half = {"load": load[:2000], "output_position": position[:2000]}  # a gear that stops midway
    assert load_alike((residual, over), read_load(gear, time[:2000], half), time[::20])
    heavy = {"load": 1.3 * load, "output_position": position}
    assert not load_alike((residual, over), read_load(gear, time, heavy), time[::20])
    noise = rng.normal(0.0, 5.0, len(time))
    assert read_load(gear, time, {"load": noise, "output_position": position}) == (None, None)


def test_numbers_of_a_closed_form():
    """Voltage R i + k w, current by dry friction and inertia, position by its gain."""
    time = np.arange(0.0, 10.0, 0.01)
    speed = 20.0 * np.sin(2.0 * time)
    current = 3.0 * np.sign(speed) + 0.05 * np.gradient(speed, time)
    channels = {
        "torque_voltage": 0.9 * current + 1.1 * speed,
        "torque_current": current,
        "motor_speed": speed,
        "speed_ref": speed,
        "output_position": -speed / 500.0,
        "state": np.where(time < 4.0, 0.0, 2.0),
    }
    units = {"torque_voltage": "V", "torque_current": "A", "motor_speed": "rad/s", "state": "1"}
    units |= {"speed_ref": "rad/s", "output_position": "m", "command": "m"}
    values = numbers_of(channels, np.zeros(len(time)), time, units, 4.0).values
    assert values["torque_voltage: by speed"] == pytest.approx(1.1)
    assert values["torque_voltage: by current"] == pytest.approx(0.9)
    assert values["torque_current: by dry"] == pytest.approx(3.0, rel=1e-3)
    assert values["torque_current: by acceleration"] == pytest.approx(0.05, rel=1e-3)
    assert values["position error: by set point"] == pytest.approx(1.0 / 500.0, rel=1e-6)
    assert (values["state: changes"], values["state: last change"]) == (1.0, pytest.approx(4.0))
    assert "torque_current: by speed" not in values or values[
        "torque_current: by speed"
    ] == pytest.approx(0.0, abs=2e-3)


def test_a_number_states_the_deviation_that_noise_and_a_slope_s_misfit_give_it():
    """Sixty logs of one motion, another noise in each; and a current that hardly moves."""
    rng, time = np.random.default_rng(3), np.arange(0.0, 8.0, 0.01)
    speed = 20.0 + 10.0 * np.sin(2.0 * time)
    units = {"torque_voltage": "V", "torque_current": "A", "motor_speed": "rad/s"}

    def read(current, bend=0.0, noise=0.0):
        voltage = 0.9 * current + 1.1 * speed + bend * speed**2 * np.sin(0.7 * time)
        channels = {"torque_voltage": voltage, "torque_current": current, "motor_speed": speed}
        seen = {r: x + noise * rng.standard_normal(len(x)) for r, x in channels.items()}
        units["command"] = "1"
        return numbers_of(seen, np.zeros(len(time)), time, units, None, noisy=True)

    lively = 3.0 * np.cos(5.0 * time)
    logs = [read(lively, noise=0.1) for _ in range(60)]
    for name in ("torque_current: last", "torque_current: mean of part 6", "motor_speed: rms",
                 "torque_voltage: by current"):  # fmt: skip
        stated = np.median([x.noise[name] for x in logs])
        scatter = np.std([x.values[name] for x in logs], ddof=1)
        assert stated == pytest.approx(scatter, rel=0.3), name
    name = "torque_voltage: by current"
    lazy = read(0.01 * lively, bend=0.002)
    assert abs(lazy.values[name] - 0.9) < 3.0 * lazy.noise[name]
    assert read(lively, bend=0.002).noise[name] < 0.05 * lazy.noise[name]


def test_spread_keeps_what_is_linear_and_gives_each_number_its_rest():
    rng = np.random.default_rng(0)
    steps = np.linalg.qr(rng.standard_normal((400, 3)))[0] * 20.0  # unit covariance
    draws = steps @ np.array([[1.0, 2.0, 0.0], [0.0, 0.0, 3.0], [0.0, 0.0, 0.5]])
    steps = steps[:, :2]
    want = [[1.0, 2.0, 0.0], [2.0, 4.0, 0.0], [0.0, 0.0, 9.25]]
    np.testing.assert_allclose(spread_of(draws, steps), want, atol=0.05)


def test_what_cannot_be_diagnosed_is_refused(screw):
    good = log(screw)
    with pytest.raises(InputError, match="role 'command'"):
        role_log(replace(good, channels={"output_position": good.output}), screw)
    with pytest.raises(UnknownNameError):
        diagnose([good], screw, faults=["backlash@moon"])
    with pytest.raises(InputError, match="at least one"):
        diagnose([], screw)
    idle = Scenario.from_dict({"duration": 2, "command": {"mode": "position"}})
    with pytest.raises(InputError, match="nothing is commanded"):
        run = simulate(screw, idle, fidelity="low", record="command,encoder_position@200 Hz")
        role_log(Log.of(run, "x"), screw)


@pytest.mark.parametrize("name", ["nasa-ballscrew", "pisa-landing-gear", "torino-rotary"])
def test_every_fault_is_a_candidate_or_not_modelled_with_a_reason(name):
    from elevon.faults import catalogue

    actuator = Actuator.load(name)
    answer = {(c.kind, p) for c in candidates_of(actuator) for p in (c.place, *c.same)}
    answer |= {name for c in candidates_of(actuator) for name in c.ambiguous}
    answer |= {(item["kind"], item["place"]) for item in not_candidates(actuator)}
    assert answer == {(r.kind, p) for r in catalogue(actuator.wiring) for p in r.places}
    assert all(item["reason"] for item in not_candidates(actuator))
    assert len(factors_of(actuator)) >= 4


def test_the_command_line(screw, tmp_path, capsys):
    path = tmp_path / "log.csv"
    log(screw, day=5).recording.save(path)
    code = main(["diagnose", str(path), "--actuator", "nasa-ballscrew", "--fault",
                 "backlash@transmission", "--json",
                 "--report", str(tmp_path / "page.html")])  # fmt: skip
    assert code == 0
    page = (tmp_path / "page.html").read_text()
    assert "Signals against the healthy model" in page
    assert "backlash@transmission" in page.partition("What these logs can tell")[2]
    assert '"status": "undecided"' in capsys.readouterr().out
    options = ["--actuator", "nasa-ballscrew", "--method", "surrogate"]
    assert main(["diagnose", str(path), *options]) == 2
    assert "--method; give --model MODEL" in capsys.readouterr().err


def loaded_log(actuator, compliance, *faults, seconds=3.0, day=1, force=1500.0, name="s"):
    """A sine against 1500 N; the output deflects by `compliance` times load over stiffness."""
    unit = drawn(actuator, np.random.default_rng(day))
    grid = np.arange(0.0, 4.0, 0.01)
    force = force * np.clip(5.0 * np.cos(2.0 * np.pi * 0.7 * grid), -1.0, 1.0)
    sine = {"kind": "sine", "amplitude": "12 mm", "frequency": "0.7 Hz"}
    table = {"kind": "table", "times": grid.tolist(), "values": force.tolist()}
    scenario = Scenario.from_dict({
        "duration": seconds,
        "command": {"mode": "position", "terms": [sine]},
        "load": {"output": {"terms": [table]}},
        "fault": list(faults),
    })  # fmt: skip
    names = "encoder_position,resolver_position,resolver_speed,speed_ref,current_q_meas"
    made = simulate(unit, scenario, fidelity="low", record=f"command,{names}@200 Hz")
    time = made.clock().time
    load = np.interp(time, grid, force)
    columns, units, roles = {}, {}, {}
    for role in made.roles:
        channel = made.role(role)
        back = compliance * load / actuator.parameters.value("backlash.stiffness")
        columns[role] = channel.values - (back if role == "output_position" else 0.0)
        units[role], roles[role] = channel.unit, role
    columns["load"], units["load"], roles["load"] = load, "N", "load"
    return Log.of(Recording.build(time, columns, units, meta={"roles": roles}), name)


def test_a_screw_that_gives_under_its_load_is_healthy_and_its_backlash_is_seen(screw):
    few = ["backlash@transmission", "gain_drift@control.position"]
    base = [loaded_log(screw, 1.0, name="base")]
    healthy = diagnose([loaded_log(screw, 1.0, day=2, name="h")], screw, baselines=base, faults=few)
    assert (healthy.status, healthy.findings) == ("healthy", ())  # its baseline is not left out
    backlash = {"kind": "backlash", "place": "transmission", "severity": "60 um"}
    worn = diagnose(
        [loaded_log(screw, 1.0, backlash, day=3, name="w")], screw, baselines=base, faults=few
    )
    assert worn.best == ("backlash@transmission",)
    assert worn.faults[0].interval[0] < 6e-5 < worn.faults[0].interval[1]
    stiff = [loaded_log(screw, 0.0, name="s")]  # its stiffness is uncertain by its own size
    assert diagnose(stiff, screw, baselines=stiff, faults=few).findings == ()
    soft = [loaded_log(screw, 8.0, name="s")]
    driven = [loaded_log(screw, -1.0, force=-1500.0, name="d")]
    answer = diagnose(driven, screw, baselines=driven, faults=few)
    assert any("drives the output" in finding for finding in answer.findings)
    assert diagnose(soft, screw, baselines=soft, faults=few).status == "model_does_not_fit"


def test_a_baseline_may_go_on_for_longer_than_the_log(screw):
    short, long = (role_log(loaded_log(screw, 1.0, seconds=s), screw) for s in (1.5, 3.0))
    assert short.same(long)
    assert not long.same(short)


def test_a_baseline_of_the_same_command_counts_as_it_stands(screw):
    """Two replays of one command differ by where the motor starts: that is no news of the unit."""
    base, item = (log(screw, day=d, start=s) for d, s in ((1, 0.3), (2, 0.4127)))
    read = [role_log(x, screw) for x in (item, base)]
    case = case_of(read[0], chosen(["backlash@transmission"], screw), read[1:])
    first, same = read[0].matched(read[1:])
    assert first.repeats(same[0])
    np.testing.assert_array_equal(case.unit.mean, same[0].features.only(case.unit.names).values)


def test_what_is_counted_is_run_at_each_count(screw):
    """Two blocked channels are not the most that one can be."""
    channel = chosen(["return_jam@screw.return_channel"], screw)[0]
    np.testing.assert_array_equal(_severities(channel, 4, 3), np.arange(channel.high + 1.0))
    assert channel.high >= 2.0
    fine = _around(1.4, 0.3, channel, 121)
    np.testing.assert_array_equal(fine, [1.0, 2.0, 3.0, 4.0])  # no fraction is a hypothesis


@pytest.mark.long
def test_two_jammed_channels_are_two_and_no_fraction(screw):
    test = next(t for t in standard_tests(screw) if t.name == "sine-opposing")
    jam = "return_jam@screw.return_channel=2"
    for fidelity in ("low", "high"):
        base, item = day_logs(screw, test, [Day((), 91), Day((jam,), 92)], fidelity)
        answer = diagnosed(screw, item, [base])
        assert answer.best == ("return_jam@screw.return_channel",)
        assert answer.faults[0].severity == 2.0
        jams = [f for h in answer.hypotheses for f in h.faults if f.kind == "return_jam"]
        assert all(f.severity == round(f.severity) for f in jams)


def test_an_answer_by_roles_does_not_depend_on_earlier_ones(screw):
    """A log of a command that is like this one's, not the same, lends it no runs."""
    few = ["backlash@transmission"]
    item, other = log(screw, day=2, start=0.3), log(screw, day=3, start=0.3)
    like = replace(other, channels={**other.channels, "command": 1.02 * other["command"]})
    _RECENT.clear()
    alone = diagnose([item], screw, faults=few)
    _RECENT.clear()
    diagnose([like], screw, faults=few)
    assert diagnose([item], screw, faults=few) == alone


def test_one_sample_of_jitter_at_square_edges_is_the_same_test(screw):
    """An edge that falls on one sample in a log falls on the next one in another."""
    item = role_log(log(screw), screw)
    time = np.arange(0.0, 8.0, 0.01)

    def square(late):
        edges = np.arange(0.0, 8.0, 0.5) + 0.01 * np.resize(late, 16)
        level = np.where(np.searchsorted(edges, time + 1e-9, side="right") % 2 == 1, 1e-3, 0.0)
        return replace(
            item, rate=100.0, seconds=8.0, command=lines(time, level, 2e-7), load=None, stroke=None,
            note="",
        )  # fmt: skip

    base, jittered, other = square([0]), square([0, 1, 1, 0, 1]), square([0, 12, 0, 12])
    assert base.same(jittered)
    assert jittered.same(base)
    assert not base.same(other)


def test_a_servo_with_one_position_is_read_by_its_roles():
    """Without the motor's own position there is no lost motion to regress, but a command to run."""
    unit = Actuator.load("torino-rotary")
    sine = {"kind": "sine", "amplitude": "8 deg", "frequency": "0.5 Hz"}
    scenario = Scenario.from_dict({"duration": 6, "command": {"terms": [sine]}})
    record = "command,encoder_position,current_q_meas@400 Hz"
    logs = [
        Log.of(simulate(drawn(unit, np.random.default_rng(k)), scenario, fidelity="low",
                        record=record, faults=faults), f"{k}")
        for k, faults in ((1, []), (2, ["friction@transmission=1"]))
    ]  # fmt: skip
    few = ["friction@transmission", "backlash@transmission"]
    worn = diagnose(logs[1:], unit, baselines=logs[:1], faults=few)
    assert worn.best == ("friction@transmission",)
    assert worn.faults[0].interval[0] < 1.0 < worn.faults[0].interval[1]
    with pytest.raises(InputError, match="diagnosis of a servo needs motor_position"):
        diagnose([logs[1].without("command")], unit)
