"""Faults without a signal in the reduced-order model: each by its closed form, in made-up logs."""

import math
from dataclasses import replace

import numpy as np
import pytest

from elevon.actuator import Actuator
from elevon.diagnose.by_model import diagnose
from elevon.diagnose.engine.answer import Cause
from elevon.diagnose.positions.closed_form import DriveLog, drive_sign
from elevon.diagnose.signs import likely_signs, sign_of
from elevon.logs.log import Log
from tests.diagnose.virtual import bench_logs

RATIO, PAIRS = 124.0, 4.0
COUNT = 2.0 * math.pi / (5000 * 4 * 4)


@pytest.fixture(scope="module")
def unit():
    return Actuator.load("torino-rotary")


def log(*, error=None, lost=0.0, scale=1.0, leak=None, drag=0.0, stroke=220.0, **channels):
    """A servo's log of 20 s at 400 Hz: friction, counts and what is asked for, and one fault."""
    rng = np.random.default_rng(1)
    time = np.arange(8001) / 400.0
    turn = 0.1 * math.pi * time
    shaft, speed = 0.5 * stroke * (1.0 - np.cos(turn)), 0.05 * stroke * math.pi * np.sin(turn)
    output = (shaft - 0.4 * np.sign(speed)) / RATIO
    way = np.sign(speed)
    current = 1.2 * way + 0.004 * speed + drag * way * (1.0 + np.cos(0.381 * shaft + 0.7))
    current += 0.05 * rng.standard_normal(len(time))
    target = current + 0.1 * rng.standard_normal(len(time))
    if leak is not None:
        target = target + leak(PAIRS * shaft)
    seen = shaft + (error(shaft) if error is not None else 0.0)
    values = {
        "motor_position": seen,
        "output_position": np.floor(output * (1.0 - lost) / COUNT) * COUNT * scale,
        "motor_speed": speed, "speed_ref": speed, "torque_current": current, "current_ref": target,
    } | {role: np.full(len(time), value) for role, value in channels.items()}  # fmt: skip
    return Log("made", time, values)


def named(unit, made, *healthy):
    healthy = [DriveLog.of(item, unit) for item in healthy]
    sign = drive_sign(DriveLog.of(made, unit), healthy)
    return None if sign is None else sign.cause


def test_a_healthy_log_shows_none_of_them(unit):
    assert named(unit, log()) is None
    assert named(unit, log(), log()) is None


@pytest.mark.parametrize(
    ("error", "kind", "size"),
    [
        (lambda a: 0.05 * np.cos(a + 0.3), "channel_offset", 0.05),
        (lambda a: -np.sin(2.0 * a) * 0.1 / 1.9, "resolver_short", 0.1),
    ],
)
def test_an_error_of_the_resolver_by_its_order(unit, error, kind, size):
    cause = named(unit, log(error=error), log())
    assert (cause.kind, cause.place) == (kind, "sensor.resolver.sine")
    assert cause.severity == pytest.approx(size, rel=0.02)
    assert (kind, "sensor.resolver.cosine") in cause.ambiguous_with
    # What a resolver's class allows is none, nor what the healthy unit has.
    assert named(unit, log(error=lambda a: 0.1 * error(a))) is None
    assert named(unit, log(error=error), log(error=error)) is None


def test_lost_counts_are_whole_ones_another_scale_is_not(unit):
    cause = named(unit, log(lost=0.01), log())
    assert (cause.kind, cause.severity) == ("missing_counts", pytest.approx(0.01, abs=2e-4))
    assert named(unit, log(scale=0.99), log()) is None
    assert named(unit, log(lost=0.1)) is None  # another gear ratio


def test_a_contact_by_its_order(unit):
    pair = named(unit, log(leak=lambda e: 0.5 * np.cos(2.0 * e + 0.4)))
    ground = named(unit, log(leak=lambda e: 0.5 * np.cos(e + 0.4) + 0.2 * np.cos(2.0 * e)))
    assert (pair.kind, len(pair.ambiguous_with)) == ("phase_short", 2)
    assert ground.kind == "ground_short"
    assert math.isnan(ground.severity)
    assert named(unit, log(leak=lambda e: 0.05 * np.cos(2.0 * e))) is None


def test_a_cage_rubs_once_a_turn_of_its_own(unit):
    cause = named(unit, log(drag=0.05))
    assert (cause.kind, cause.place) == ("bearing", "bearing.cage")
    whole = 2.0 * 0.05 * unit.parameters.value("control.torque_constant")
    assert cause.interval[0] < whole < cause.interval[1]
    assert named(unit, log(drag=0.05, stroke=15.0)) is None  # less than a turn of it


def test_nothing_flows_although_all_is_asked_for(unit):
    dead = {"current_ref": 22.5, "torque_current": 0.0}
    either = named(unit, log(**dead))
    assert either.kind == "connector_open"
    assert ("open_phase", "motor.phase_a") in either.ambiguous_with
    assert named(unit, log(current_ref=22.5, torque_current=22.0)) is None  # it turns


@pytest.mark.parametrize(("way", "kind"), [(1.0, "open_phase"), (0.0, "open_switch")])
def test_which_circuit_is_open_by_where_the_current_did_flow(unit, way, kind):
    """A line in the plane of the windings, or a half of it; of an open connector all of it."""
    made = log(current_ref=22.5)
    turn = PAIRS * made["motor_position"]
    flows = np.arange(len(turn)) < 3000
    plane = np.cos(turn) * 1j if way else 1j * np.abs(np.cos(turn)) + np.sin(turn)
    vector = np.where(flows, plane, 0.0) * np.exp(-1j * turn)
    cut = made.with_channels(direct_current=vector.real, torque_current=vector.imag * flows * 0.4)
    if way:
        cut = made.with_channels(direct_current=vector.real, torque_current=vector.imag)
    target = np.where(flows, 1.0, 22.5)
    cause = named(unit, cut.with_channels(current_ref=target))
    assert cause.kind == kind


def test_a_standing_shaft_is_a_jam_or_a_resolver_without_a_signal(unit):
    standing = {
        "motor_position": 1.0,
        "motor_speed": 0.0,
        "current_ref": 22.5,
        "torque_current": 22.4,
    }
    jam = named(unit, log(output_position=0.0, **standing))
    assert jam.kind == "jam"
    assert ("resolver_open", "sensor.resolver.sine") in jam.ambiguous_with
    moved = log(**standing)
    assert named(unit, moved).kind == "resolver_open"


def test_the_answer_names_it_and_what_looks_alike(unit):
    answer = diagnose([log(lost=0.01)], unit, baselines=[log()])
    assert (answer.status, answer.best) == ("faulty", ("missing_counts@sensor.encoder",))
    assert [place.key for place in answer.faults[0].ambiguous_with] == ["gain@sensor.resolver"]
    assert "closed form" in answer.findings[0]


@pytest.mark.filterwarnings("ignore::elevon.errors.ElevonWarning")
def test_a_fault_of_another_kind_is_named_beside_a_sign(unit):
    """Friction doubled and an offset of a resolver's channel at once: both, in one answer."""
    few = [(1, []), (2, ["friction@transmission=1.0"])]
    base, rubbing = bench_logs(unit, few)
    angle = rubbing["motor_position"]
    both = rubbing.with_channels(motor_position=angle + 0.02 * np.cos(angle + 0.3))
    both = replace(both, recording=None)
    answer = diagnose([both], unit, baselines=[base])
    assert answer.status == "faulty"
    assert answer.best == ("channel_offset@sensor.resolver.sine", "friction@transmission")
    sizes = {f"{c.kind}@{c.place}": c.interval for c in answer.faults}
    assert sizes["channel_offset@sensor.resolver.sine"][0] < 0.02
    assert sizes["channel_offset@sensor.resolver.sine"][1] > 0.02
    assert sizes["friction@transmission"][0] < 1.0 < sizes["friction@transmission"][1]
    assert 0.5 < answer.p_best < answer.p_fault
    # An error of the gear once a motor turn looks the same: it keeps its share.
    assert answer.p_other > 0.1
    assert any("these logs do not tell" in text for text in answer.findings)


def test_the_probability_of_a_sign_is_that_of_its_size():
    cause = Cause("dead", "stand.load_cell", "1", 0.0, 1.0, (1.0, 1.0))
    seen = [sign_of(cause, x, 1.0, moves=("a",), text="") for x in (0.5, 1.0, 1.3, 3.0)]
    probabilities = [sign.present for sign in seen]
    assert probabilities == sorted(probabilities)
    assert probabilities[0] < 0.05 < 0.5 < probabilities[1] < 0.9 < 0.999 < probabilities[3]
    # As much noise in the log as the limit: the same size says little.
    assert sign_of(cause, 1.3, 1.0, moves=("a",), text="", error=1.0).present < 0.05
    assert likely_signs(seen) == seen[1:]
