"""A live session gives the bits of a run in one call, and does what it is told in between."""

import numpy as np
import pytest

import elevon
from elevon.errors import ArgumentTypeError, InputError, RangeError, UnknownNameError

SIGNALS = ("output_position", "motor_speed", "current_q")
CASES = [
    (name, fidelity)
    for name in ("torino-rotary", "nasa-ballscrew", "pisa-landing-gear")
    for fidelity in ("high", "low")
]


def _signals(name):
    return SIGNALS[:2] if name == "pisa-landing-gear" else SIGNALS


def _stepped(session, names, steps, period="1 ms"):
    rows = [session.read(*names)]
    for _ in range(steps):
        session.advance(period)
        rows.append(session.read(*names))
    return {name: np.array([row[name] for row in rows]) for name in names}


@pytest.mark.parametrize(("name", "fidelity"), CASES)
def test_a_session_gives_the_bits_of_one_call(name, fidelity):
    actuator = elevon.Actuator.load(name)
    scenario = {**actuator.default_scenario, "duration": "60 ms"}
    names = _signals(name)
    once = elevon.simulate(
        actuator, scenario, fidelity=fidelity, record=f"{','.join(names)}@1 kHz", seed=3
    )
    stepped = _stepped(elevon.Session(actuator, scenario, fidelity=fidelity, seed=3), names, 60)
    for signal in names:
        assert np.array_equal(stepped[signal], once[signal].values), signal


def test_the_steps_do_not_matter():
    ends = []
    for count, step in ((30, "1 ms"), (1, "30 ms"), (3000, "10 us")):
        session = elevon.Session("torino-rotary", mode="speed")
        session.set(command="100 rpm")
        for _ in range(count):
            session.advance(step)
        ends.append(session.read(*SIGNALS))
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_set_commands_are_those_of_a_scenario(fidelity):
    """A command that steps at the session's instants is a held table of a scenario."""
    values = np.deg2rad([0.0, 2.0, -1.0, 3.0])
    table = {"kind": "table", "times": [0.0, 0.01, 0.02, 0.03], "hold": True}
    scenario = {"duration": "40 ms", "command": {"terms": [{**table, "values": list(values)}]}}
    once = elevon.simulate(
        "torino-rotary", scenario, fidelity=fidelity, record="output_position@100 Hz"
    )
    session = elevon.Session("torino-rotary", fidelity=fidelity)
    read = []
    for value in values:
        read.append(session["output_position"])
        session.set(command=value)
        session.advance("10 ms")
    assert np.array_equal([*read, session["output_position"]], once["output_position"].values)


def test_lanes_are_single_runs():
    actuator = elevon.Actuator.load("torino-rotary")
    runs = [
        elevon.Run(actuator.with_values({"friction.dynamic": f"{0.2 + 0.02 * k} N m"}), seed=k)
        for k in range(11)
    ]
    many = elevon.Session(runs)
    single = [
        elevon.Session(run.actuator, run.scenario, seed=run.seed) for run in (runs[0], runs[10])
    ]
    commands = np.deg2rad(np.arange(11.0))
    many.set(command=commands)
    for session, run in zip(single, (0, 10), strict=True):
        session.set(command=commands[run])
    for session in (many, *single):
        session.advance("20 ms")
        session.set(output="1 N m")
        session.advance("20 ms")
    assert many["output_position"].shape == (11,)
    for signal in SIGNALS:
        assert [many[signal][0], many[signal][10]] == [session[signal] for session in single]
    assert many.status == ["ok"] * 11


def test_a_state_is_saved_and_restored():
    session = elevon.Session("nasa-ballscrew", mode="torque", tunable=["friction.dynamic"])
    session.set(command=0.2)
    session.advance("10 ms")
    state = session.save()
    first = _stepped(session, SIGNALS, 10)
    session.set_parameter("friction.dynamic", 0.0)
    session.restore(state)
    assert session.time == pytest.approx(0.01)
    again = _stepped(session, SIGNALS, 10)
    other = elevon.Session("nasa-ballscrew", mode="torque", tunable=["friction.dynamic"])
    other.restore(state)
    for signal in SIGNALS:
        assert np.array_equal(first[signal], again[signal])
    assert np.array_equal(_stepped(other, SIGNALS, 10)["motor_speed"], first["motor_speed"])
    for other in (
        elevon.Session("torino-rotary", mode="torque"),
        elevon.Session("nasa-ballscrew", mode="torque", fidelity="low"),
        elevon.Session("nasa-ballscrew", mode="speed"),
    ):
        with pytest.raises(InputError, match="another kind"):
            other.restore(state)
    with pytest.raises(ArgumentTypeError):
        session.restore("yesterday")


def test_a_parameter_changes_while_it_runs():
    """The same torque turns a free shaft of ten times the inertia a tenth as fast."""
    free = {"friction.static": 0.0, "friction.dynamic": 0.0, "friction.viscous": 0.0}
    standing = {
        "gear.inertia": 0.0,
        "load.inertia": 0.0,
        "backlash.total": 0.0,
        "drive.kind": "pwm",
    }
    actuator = elevon.Actuator.load("torino-rotary").with_values({**free, **standing})
    inertia = actuator.parameters["motor.inertia"].value
    session = elevon.Session(actuator, mode="torque", fidelity="low")
    rises = []
    for factor in (1.0, 10.0):
        session.set_parameter("motor.inertia", factor * inertia)
        session.set(command=0.1)
        session.advance("5 ms")  # the current settles
        torque, before = session["motor_torque"], session["motor_speed"]
        session.advance("10 ms")
        rises.append((session["motor_speed"] - before) / torque)
        assert rises[-1] == pytest.approx(0.01 / (factor * inertia), rel=0.02)
    assert session.actuators[0].parameters["motor.inertia"].value == pytest.approx(10 * inertia)


@pytest.mark.parametrize("fidelity", ["high", "low"])
@pytest.mark.parametrize("name", ["torino-rotary", "nasa-ballscrew", "pisa-landing-gear"])
def test_the_supplys_parameter_acts_where_nothing_drives_the_supply(name, fidelity):
    """As `set(supply=...)` to the bit, the state's copy too; refused where it would not act."""
    gear = name == "pisa-landing-gear"
    steps = {"command": {"mode": "gear", "steps": [{"time": 0.0, "action": "extend"}]}}
    kind = {"scenario": {"duration": 1.0, **steps}} if gear else {"mode": "speed"}
    share = 0.75 if gear else 0.1
    start = float(elevon.Actuator.load(name).parameters.value("inverter.supply_voltage"))
    by_port, by_path = (elevon.Session(name, fidelity=fidelity, **kind) for _ in range(2))
    for session in (by_port, by_path):
        if not gear:
            session.set(command=100.0)
        session.advance(0.02)
    assert by_path["supply_voltage"] == pytest.approx(start, rel=0.02)
    by_path.set_parameter("inverter.supply_voltage", share * start)
    by_port.set(supply=share * start)
    saved = by_path.save()
    ends = []
    for session in (by_port, by_path):
        session.advance(0.2)
        ends.append([session[n] for n in ("supply_voltage", "motor_speed", "motor_torque")])
    assert ends[0] == ends[1]
    assert ends[1][0] == pytest.approx(share * start, rel=0.2 if gear else 1e-12)
    by_path.restore(saved)
    by_path.advance(0.2)
    assert by_path["motor_speed"] == ends[1][1]
    with pytest.raises(InputError, match=r"inverter.supply_voltage has no effect: supply is given"):
        by_port.set_parameter("inverter.supply_voltage", start)


@pytest.mark.parametrize("fidelity", ["high", "low"])
def test_the_supplys_parameter_acts_in_each_run_of_a_batch(fidelity):
    """Lanes with supplies of their own, as each alone, to the bit."""
    scenario = {"duration": 1.0, "command": {"mode": "speed", "terms": [
        {"kind": "constant", "value": 300.0}]}}  # fmt: skip
    runs = [elevon.Run("torino-rotary", scenario, k) for k in range(3)]
    volts = [20.0, 60.0, 380.0]
    batch = elevon.Session(runs, fidelity=fidelity)
    batch.set_parameter("inverter.supply_voltage", volts)
    batch.advance(0.1)
    speeds = []
    for run, volt in zip(runs, volts, strict=True):
        alone = elevon.Session([run], fidelity=fidelity)
        alone.set_parameter("inverter.supply_voltage", volt)
        alone.advance(0.1)
        speeds.append(alone["motor_speed"][0])
    assert list(batch["motor_speed"]) == speeds
    assert speeds[0] < speeds[1] < speeds[2]


def test_a_fault_that_is_announced_acts_as_in_a_scenario():
    name = "short@motor.phase_a"
    scenario = {
        "duration": "40 ms",
        "command": {"mode": "speed", "terms": [{"kind": "constant", "value": "200 rpm"}]},
    }
    once = elevon.simulate(
        "torino-rotary",
        {**scenario, "fault": [f"{name}=0.2:step(time=20 ms)"]},
        record="current_q,motor_speed@50 Hz",
    )
    session = elevon.Session("torino-rotary", mode="speed", faults=[name])
    session.set(command="200 rpm")
    session.advance("20 ms")
    session.set_fault(name, 0.2)
    session.advance("20 ms")
    for signal in ("current_q", "motor_speed"):
        assert session[signal] == once[signal].values[-1]
    healthy = elevon.Session("torino-rotary", mode="speed")
    healthy.set(command="200 rpm")
    healthy.advance("40 ms")
    assert healthy["current_q"] != session["current_q"]


def test_what_the_equations_in_use_leave_out_is_refused_with_the_remedy():
    actuator = elevon.Actuator.load("torino-rotary")
    session = elevon.Session(actuator)
    with pytest.raises(InputError, match=r"faults=\['eccentricity_static@motor'\]"):
        session.set_fault("eccentricity_static@motor", 0.1)
    with pytest.raises(InputError, match=r"tunable=\['motor.cogging_torque'\]"):
        session.set_parameter("motor.cogging_torque", 0.01)
    with pytest.raises(InputError, match=r"signals=\["):
        for name in session.names:
            session.read(name)
    whole = elevon.Session(actuator, signals=session.names)
    values = whole.read(*whole.names)
    assert all(np.isfinite(list(values.values())))


def test_own_controller_on_one_and_on_many():
    """A proportional controller of speed by torque: an exponential with the time J / K."""
    free = {"friction.static": 0.0, "friction.dynamic": 0.0, "friction.viscous": 0.0}
    standing = {
        "gear.inertia": 0.0,
        "load.inertia": 0.0,
        "backlash.total": 0.0,
        "drive.kind": "pwm",
    }
    actuator = elevon.Actuator.load("torino-rotary").with_values({**free, **standing})
    wanted, rise = 20.0, 0.02
    gain = actuator.parameters["motor.inertia"].value / rise

    def controller(session):
        return gain * (wanted - session["motor_speed"])

    run = elevon.Run(actuator, {"duration": 1, "command": {"mode": "torque"}})
    one = elevon.Session(actuator, mode="torque", fidelity="low")
    for session in (one, elevon.Session([run] * 3, fidelity="low")):
        recordings = session.run("60 ms", controller, period="0.5 ms", record=["motor_speed"])
        assert len(recordings) == len(session)
        for recording in recordings:
            speed = recording["motor_speed"]
            assert (recording.status, speed.unit) == ("ok", "rad/s")
            # The current follows within some ticks: that much time the answer may be late.
            early, late = (wanted * (1.0 - np.exp(-(speed.time - lag) / rise)) for lag in (0, 2e-3))
            assert np.all(speed.values <= early + 1e-2 * wanted)
            assert np.all(speed.values >= late - 1e-2 * wanted)


@pytest.mark.parametrize(
    ("act", "error", "messages"),
    [
        (lambda s: s.set(comand=1.0), UnknownNameError, "command"),
        (lambda s: s.set(command="1 kg"), InputError, "kg"),
        (lambda s: s.set(command="7"), InputError, "'7 deg'"),
        (lambda s: s.set(command=float("nan")), InputError, "nan"),
        (lambda s: s.set(command=[1.0, 2.0]), InputError, "one, or one a run"),
        (lambda s: s.set(command={"kind": "sinus"}), InputError, "sine"),
        (lambda s: s.advance(0.0), InputError, "whole number"),
        (lambda s: s.advance("1.5 us"), InputError, "nearest: 1e-06 s, 2e-06 s"),
        (lambda s: s.advance(-1.0), InputError, "whole number"),
        (lambda s: s.read("motor_sped"), UnknownNameError, "motor_speed"),
        (lambda s: s.set_parameter("motor.inertai", 1.0), UnknownNameError, "motor.inertia"),
        (lambda s: s.set_parameter("motor.inertia", -1.0), RangeError, "motor.inertia"),
        (lambda s: s.set_fault("shor@motor.phase_a", 0.1), UnknownNameError, "short"),
        (lambda s: s.set_fault("short@motor.phase_a", 2.0), RangeError, "short"),
    ],
)
def test_wrong_input_is_named_and_changes_nothing(act, error, messages):
    session = elevon.Session("torino-rotary", tunable=["motor.inertia"])
    session.advance("1 ms")
    before = session.save().core.read([0, 1, 2]).tolist()
    with pytest.raises(error, match=messages):
        act(session)
    assert session.save().core.read([0, 1, 2]).tolist() == before
    assert session.time == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("arguments", "options", "messages"),
    [
        (([],), {}, "an empty list"),
        ((["torino-rotary"],), {}, "a str is no run"),
        (("torino-rotary", {"duration": 1}), {"mode": "speed"}, "command.mode"),
        (("torino-rotary",), {"tunable": ["motor.inerta"]}, "motor.inertia"),
        (("torino-rotary",), {"faults": ["short@motor"]}, "motor.phase_a"),
        (("torino-rotary",), {"mode": "sped"}, "speed"),
    ],
)
def test_a_wrong_session_is_refused(arguments, options, messages):
    with pytest.raises(InputError, match=messages):
        elevon.Session(*arguments, **options)


def test_each_lane_has_a_status_of_its_own():
    """One drive trips, coasts and says so; its neighbour goes on."""
    actuator = elevon.Actuator.load("torino-rotary")
    weak = actuator.with_values({"inverter.trip_current": "0.5 A"})
    scenario = {"duration": 1, "command": {"mode": "torque"}}
    session = elevon.Session([elevon.Run(actuator, scenario), elevon.Run(weak, scenario)])
    session.set(command=1.0)
    session.advance("50 ms")
    assert session.status == ["ok", "tripped"]
    assert session.messages[0] == ""
    assert "trip" in session.messages[1]
    torque = session["motor_torque"]
    assert torque[0] > 0.5 > torque[1]


def test_a_change_that_one_lane_refuses_changes_none():
    actuator = elevon.Actuator.load("torino-rotary")
    standing = actuator.with_values({"motor.cogging_torque": "0.01 N m"})
    runs = [elevon.Run(standing), elevon.Run(actuator)]
    session = elevon.Session(runs, fidelity="low")
    session.advance("1 ms")
    before = session.read(*SIGNALS), session.actuators

    def unchanged():
        read = session.read(*SIGNALS)
        assert all(np.array_equal(read[name], before[0][name]) for name in SIGNALS)
        assert session.actuators == before[1]
        assert session.save().faults == ({}, {})

    with pytest.raises(InputError, match="announce"):  # the second lane has no cogging
        session.set_parameter("motor.cogging_torque", np.array([0.02, 0.03]))
    unchanged()
    with pytest.raises(RangeError):
        session.set_parameter("motor.inertia", np.array([1e-3, -1.0]))
    unchanged()
    with pytest.raises(RangeError):
        session.set_fault("short@motor.phase_a", np.array([0.1, 2.0]))
    unchanged()
    command = session["command"]
    with pytest.raises(UnknownNameError):
        session.set(command=0.5, comand=0.5)
    assert np.array_equal(session["command"], command)
    unchanged()
