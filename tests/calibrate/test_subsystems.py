"""Subsystem by subsystem, on an axis that is written here and nowhere else."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest

from elevon.actuator import Actuator
from elevon.calibrate.door import calibrate, validate
from elevon.calibrate.subsystems.controller import identify_controller
from elevon.calibrate.subsystems.flow import calibrate_machine, identify
from elevon.calibrate.subsystems.signals import MOST, STRETCHES, excerpts
from elevon.calibrate.validation import phases_of
from elevon.cli.runner import run as elevon
from elevon.errors import InputError
from elevon.logs.log import Log
from elevon.parameters.records import record_of
from tests.calibrate import linear
from tests.calibrate.linear_set import datasheet, loop, truth

MASS, VISCOUS, DRY, OFFSET, FORCE = 90.0, 200.0, 20.0, -3.0, 35.0
PERIOD, STEPS = 1e-3, 10
POSITION_GAIN, SPEED_GAIN = 160.0, 240.0


def axis():
    """A linear axis in the wiring of a screw: one radian of the motor moves it one metre."""
    nothing = dict.fromkeys(
        ("screw.preload", "screw.inertia", "load.mass", "load.damping", "load.friction",
         "backlash.total"), 0.0,
    )  # fmt: skip
    return Actuator.load("nasa-ballscrew").with_values({
        **nothing, "screw.lead": 1.0, "screw.efficiency": 1.0, "screw.efficiency_aiding": 1.0,
        "motor.inertia": 60.0, "friction.static": 15.0, "friction.dynamic": 15.0,
        "friction.viscous": 150.0, "backlash.model": "operator", "thermal.model": "off",
        "control.current_limit": 1e4, "motor.torque_limit": 1e6, "stop.upper": 1e3,
        "stop.lower": -1e3,
    })  # fmt: skip


def commanded(duration):
    time = PERIOD * np.arange(int(duration / PERIOD))
    return time, 0.05 * np.sin(2.0 * math.pi * 0.5 * time) + 0.02 * np.sin(2 * math.pi * 1.3 * time)


def p_p(error, speed):
    return SPEED_GAIN * (POSITION_GAIN * error - speed)


def table(error, speed):
    """A law of steps, which no gain describes."""
    del speed
    return 40.0 * np.sign(error) * (0.1 + (abs(error) > 2e-3) + (abs(error) > 6e-3))


def moved(law, duration=12.0, noise=0.0, seed=0, mass=MASS, dry=DRY):
    """Return the log of the axis under a law of position error and speed, force held a sample."""
    time, command = commanded(duration)
    rng = np.random.default_rng(seed)
    place = rate = 0.0
    seen, efforts = np.empty(len(time)), np.empty(len(time))
    before = earlier = 0.0
    step = PERIOD / STEPS
    for k, wanted in enumerate(command):
        measured = place + noise * rng.standard_normal()
        speed = (measured - earlier) / (2.0 * PERIOD)
        effort = float(law(wanted - measured, speed))
        seen[k], efforts[k], earlier, before = measured, effort, before, measured
        push = FORCE * effort - OFFSET
        for _ in range(STEPS):
            if rate == 0.0 and abs(push) <= dry:
                continue
            way = math.copysign(1.0, rate if rate else push)
            after = rate + step * (push - VISCOUS * rate - dry * way) / mass
            after = 0.0 if after * way < 0.0 else after
            place += 0.5 * step * (rate + after)
            rate = after
    return Log(
        "axis.csv", time, {"command": command, "output_position": seen, "torque_voltage": efforts},
        {"command": "m", "output_position": "m", "torque_voltage": "V"},
    )  # fmt: skip


@pytest.fixture(scope="module")
def known():
    return moved(p_p)


def test_mass_friction_and_law_are_found(known):
    found = calibrate(known, axis(), torque_constant=f"{FORCE} N/V")
    parts = found.facts["subsystems"]
    numbers = parts["mechanics"]["parameters"]
    for name, true in (("mass", MASS), ("viscous", VISCOUS), ("coulomb", DRY), ("offset", OFFSET)):
        item = numbers[name]
        assert item["low"] <= true <= item["high"], (name, item)
        assert item["value"] == pytest.approx(true, rel=0.03, abs=0.1)
    law = parts["controller"]
    assert (law["status"], law["structure"]) == ("identified", "P-P")
    assert law["speed"] == "difference of the mean of two samples"
    assert law["parameters"]["position_gain"]["value"] == pytest.approx(POSITION_GAIN, rel=1e-3)
    assert law["parameters"]["speed_gain"]["value"] == pytest.approx(SPEED_GAIN, rel=1e-3)
    assert parts["electrics"]["status"] == "not_identified"
    assert found.actuator.parameters.value("motor.inertia") == pytest.approx(MASS, rel=0.03)


def test_the_loop_is_closed_by_the_law_that_was_found(known):
    found = calibrate(known, axis(), torque_constant=f"{FORCE} N/V")
    held_out = moved(p_p, duration=6.0)
    rows = {row.signal: row for row in validate(held_out, found.actuator).errors}
    assert rows["closed_loop_position"].rms < 2e-6
    assert rows["closed_loop_effort"].of_rms < 5.0
    assert rows["open_loop_speed"].of_rms < 2.0


def test_a_sensor_with_noise_biases_nothing():
    """Its noise comes back in the effort: least squares alone is off, the instrument is not."""
    log = moved(p_p, noise=2e-6, seed=3)
    numbers = identify([log], axis(), scale=f"{FORCE} N/V").subsystems["mechanics"].parameters
    for name, true in (("mass", MASS), ("viscous", VISCOUS), ("coulomb", DRY)):
        assert numbers[name].interval[0] <= true <= numbers[name].interval[1], name


def test_an_unknown_controller_leaves_the_mechanics(tmp_path, capsys):
    log = moved(table, duration=20.0)
    path = tmp_path / "axis.csv"
    rows = np.column_stack(
        [log.time, log["command"], log["output_position"], log["torque_voltage"]]
    )
    np.savetxt(path, rows, delimiter=",", header="t,r,x,u", comments="")
    columns = (("t", "time", "s"), ("r", "command", "m"), ("x", "output_position", "m"),
               ("u", "torque_voltage", "V"))  # fmt: skip
    entries = [
        f'[[column]]\nname = "{name}"\nrole = "{role}"\nunit = "{unit}"\n'
        + (f'signal = "{role}"\n' if role != "time" else "")
        for name, role, unit in columns
    ]
    (tmp_path / "map.toml").write_text('current = "peak"\n' + "".join(entries))
    unit = tmp_path / "axis.toml"
    axis_file(unit)
    code = elevon([
        "calibrate", str(path), "--map", str(tmp_path / "map.toml"), "--actuator", str(unit),
        "--set", f"motor.torque_constant={FORCE} N/V", "--json",
    ])  # fmt: skip
    printed = capsys.readouterr()
    assert code == 0, printed.err
    answer = json.loads(printed.out)
    parts = answer["subsystems"]
    assert parts["controller"]["status"] == "not_identified"
    mass = parts["mechanics"]["parameters"]["mass"]
    assert mass["low"] <= MASS <= mass["high"]


def axis_file(path):
    """Write the axis as a user would: the base and what differs."""
    model, base = axis(), Actuator.load("nasa-ballscrew")
    lines = ['name = "axis"', 'base = "nasa-ballscrew"']
    for name, entry in model.parameters.items():
        if entry.value == base.parameters[name].value:
            continue
        record = record_of(model.wiring, name)
        choice = record.choices is not None
        value = entry.value if choice else model.parameters.value(name)
        lines += [f"[{name}]", f"value = {json.dumps(value)}"]
        lines += [] if choice or record.unit == "1" else [f'unit = "{record.unit}"']
        lines += ['source = "ASSUMED: of the test"', 'confidence = "assumed"']
    path.write_text("\n".join(lines) + "\n")


def test_without_a_scale_numbers_are_in_the_efforts_unit(known):
    found = calibrate(known, axis())
    part = found.facts["subsystems"]["mechanics"]
    assert part["status"] == "partial"
    assert part["parameters"]["mass"]["unit"] == "V s2/m"
    assert part["parameters"]["mass"]["value"] == pytest.approx(MASS / FORCE, rel=0.03)
    ratio = part["parameters"]["viscous_per_mass"]
    assert ratio["low"] <= VISCOUS / MASS <= ratio["high"]
    assert found.actuator.parameters.value("motor.inertia") == 60.0


@pytest.mark.parametrize(
    ("scale", "text"),
    [("35 N/A", "in V, not in A"), ("-3 N/V", "must be above 0"), ("3 rpm", "torque_constant")],
)
def test_a_scale_that_cannot_be_is_refused(known, scale, text):
    with pytest.raises(InputError, match=text):
        calibrate(known, axis(), torque_constant=scale)


def test_two_machines_in_two_logs_disagree(known):
    """Of one axis with another mass the interval of both is as wide as what is between them."""
    other = moved(p_p, mass=1.3 * MASS)
    alone = identify([known], axis(), scale=f"{FORCE} N/V").subsystems["mechanics"]
    both = identify(
        [known, Log("other.csv", other.time, other.channels, other.units)], axis(),
        scale=f"{FORCE} N/V",
    ).subsystems["mechanics"]  # fmt: skip
    width = [np.ptp(part.parameters["mass"].interval) for part in (alone, both)]
    assert width[1] > 3.0 * width[0]


def test_a_delay_of_the_drive_is_found():
    waiting = [0.0, 0.0]

    def late(error, speed):
        waiting.append(0.3 * p_p(error, speed))
        return waiting.pop(0)

    context = identify([moved(late)], axis(), scale=f"{FORCE} N/V")
    found, _ = identify_controller(context.drives)
    assert found.delay == 2
    assert found.exact


def test_logs_without_a_set_point_give_inertia_and_friction():
    """A motor whose torque is commanded: no position, no speed was asked for."""
    time = PERIOD * np.arange(12_000)
    rng = np.random.default_rng(1)
    push = np.repeat(rng.uniform(-1.0, 1.0, 120), 100)
    inertia, viscous, dry = 2e-3, 1e-3, 0.05
    rate = place = 0.0
    places = np.empty(len(time))
    for k, torque in enumerate(push):
        places[k] = place + 1e-4 * rng.standard_normal()
        for _ in range(STEPS):
            way = math.copysign(1.0, rate if rate else torque)
            stuck = rate == 0.0 and abs(torque) <= dry
            force = 0.0 if stuck else torque - viscous * rate - dry * way
            rate += PERIOD / STEPS * force / inertia
            place += PERIOD / STEPS * rate
    log = Log(
        "torque.csv", time, {"motor_position": places, "torque_ref": push},
        {"motor_position": "rad", "torque_ref": "N m"},
    )  # fmt: skip
    motor = Actuator.load("torino-rotary").with_values({"gear.inertia": 0.0, "load.inertia": 0.0})
    numbers = calibrate(log, motor).facts["subsystems"]["mechanics"]["parameters"]
    assert numbers["inertia"]["value"] == pytest.approx(inertia, rel=0.005)
    for name, true in (("viscous", viscous), ("coulomb", dry)):
        assert numbers[name]["low"] <= true <= numbers[name]["high"], (name, numbers[name])


def mass_of(seed):
    """Return the interval of the mass over the truth, of a drive written in C, and its loss."""
    bench, rng = linear.draw(seed), np.random.default_rng(seed)
    logs = [
        loop("square", linear.log(bench, linear.square, 13.0, seed=seed)),
        loop("sweep", linear.log(bench, linear.sweep, 21.0, seed=seed + 1)),
    ]
    given = {"motor.inertia": 2e-5, "friction.dynamic": 0.03}
    far = {path: value * rng.uniform(0.7, 1.3) for path, value in given.items()}
    found = identify(logs, datasheet(bench).with_values(far))
    true = truth(bench)["whole inertia"] * bench.per_metre**2
    interval = found.subsystems["mechanics"].parameters["mass"].interval
    return np.array(interval) / true, found, bench


def test_the_mass_holds_on_drives_whose_friction_grows_with_the_torque():
    """At 100 Hz, with late channels, counts and noise; 0.85 of the intervals are to hold."""
    intervals = np.array([mass_of(seed)[0] for seed in range(3000, 3012)])
    assert np.mean((intervals[:, 0] <= 1.0) & (intervals[:, 1] >= 1.0)) >= 0.85
    assert np.median(np.ptp(intervals, axis=1)) < 0.8


def test_a_loss_that_grows_with_the_effort_is_found_where_the_motion_brakes():
    _, found, bench = mass_of(1002)
    share = found.subsystems["mechanics"].parameters["load_loss"]
    assert share.interval[0] <= bench.per_load <= share.interval[1]
    fitted = calibrate_machine(found).actuator.parameters
    assert fitted["friction.law"].value == "load_dependent"
    assert fitted.value("friction.load_motor") == pytest.approx(share.value)


def test_without_braking_a_loss_is_possible_and_said():
    _, found, _ = mass_of(1015)
    assert "load_loss" not in found.subsystems["mechanics"].parameters
    assert any("a loss that grows with the effort is not seen" in text for text in
               found.inverse.findings)  # fmt: skip


def test_a_long_log_is_read_in_stretches_spread_over_it(known):
    drive = identify([known], axis(), scale=f"{FORCE} N/V").drives[0]
    assert excerpts(drive) == [drive]
    times = 12
    long = replace(
        drive, time=PERIOD * np.arange(times * len(drive.time)),
        **{name: np.tile(getattr(drive, name), times)
           for name in ("good", "effort", "position", "command")},
    )  # fmt: skip
    parts = excerpts(long)
    assert sum(len(part.time) for part in parts) == MOST < len(long.time)
    assert len(parts) == STRETCHES
    assert all(part.time[0] == 0.0 for part in parts)
    assert np.array_equal(parts[-1].effort, long.effort[-len(parts[-1].time) :])


def test_errors_of_start_steady_motion_reversal_and_contact_stand_apart(known):
    found = calibrate(known, axis(), torque_constant=f"{FORCE} N/V")
    phases = found.validation.phases
    assert {"start", "steady", "reversal"} >= phases.keys() >= {"reversal"}
    rows = {row.signal: row for row in phases["reversal"]}
    assert rows["open_loop_speed"].rms > 0.0
    whole = {row.signal: row for row in found.validation.errors}
    assert rows["open_loop_speed"].largest <= whole["open_loop_speed"].largest


def test_phases_of_a_stroke_there_and_back():
    time = 1e-3 * np.arange(4000)
    steps = np.select([time < 0.5, time < 1.5, time < 2.5], [0.0, 1.0, -1.0], 0.0)
    speed = np.convolve(steps, np.ones(20) / 20.0, mode="same")
    parts = phases_of(time, speed, np.where(time > 2.0, 5.0, 0.0))
    inside = {name: (time[used].min(), time[used].max()) for name, used in parts.items()}
    assert inside["start"] == pytest.approx((0.39, 0.59), abs=0.02)
    assert inside["reversal"] == pytest.approx((1.4, 1.6), abs=0.02)
    assert inside["contact"][0] == pytest.approx(2.0, abs=2e-3)
    assert not any(parts["steady"] & (parts["start"] | parts["reversal"]))
